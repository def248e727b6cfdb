"""`gcs log info`: what is in a file, for a person and as JSON."""

import io

import orjson
import pytest
from flights import SHORT, fly_and_record, messages, recorded, told
from mcap.writer import CompressionType, Writer
from rich.console import Console

from gcs.events import LAND
from gcs.recording.info import show
from gcs.recording.tlog import packed


@pytest.fixture(scope="module")
def flight():
    return recorded("demo", *SHORT)


def foreign(path, **options):
    """Another program's file: in chunks without CRCs, or in none."""
    with path.open("wb") as stream:
        writer = Writer(stream, enable_crcs=False, compression=CompressionType.ZSTD, **options)
        writer.start(library="another")
        channel = writer.register_channel("/camera", "cdr", writer.register_schema("sensor/Image", "ros2msg", b"x"))
        for time_ns in range(0, 10_000_000_000, 100_000_000):
            writer.add_message(channel, time_ns, b"pixels", time_ns)
        writer.finish()
    return path


def as_json(gcs, path):
    code, out, err = gcs("log", "info", path, "--json")
    assert (code, err) == (0, "")
    return orjson.loads(out)


def test_a_flight_is_told_from_title_to_topics(gcs, flight):
    found = as_json(gcs, flight.folder)
    assert found["whole"]
    assert found["title"] == flight.scenario.title
    assert (found["vehicles"], found["controller"], found["seed"]) == (6, flight.summary.controller, 1)
    assert (found["passed"], found["problem"]) == (flight.summary.passed, flight.summary.problem)
    assert found["duration_s"] == pytest.approx(flight.summary.simulated_s, abs=0.2)
    assert found["versions"]["trustr"]
    assert found["bytes"] == flight.path.stat().st_size


def test_a_mission_that_the_operator_broke_off_has_no_score_and_did_not_fail(gcs):
    said = iter([(LAND,) if tick == 100 else () for tick in range(10_000)])
    landed = fly_and_record("demo", *SHORT, events=lambda: next(said))
    code, out, _ = gcs("log", "info", landed.path)
    assert code == 0
    assert "no score: it ended before its read-out" in " ".join(out.split())


def test_topics_are_counted_to_the_message_and_the_byte(gcs, flight):
    found = as_json(gcs, flight.path)
    every = messages(flight.path)
    assert found["messages"] == sum(topic["messages"] for topic in found["topics"]) == len(every)
    for topic in found["topics"]:
        lengths = [len(data) for name, _, data in every if name == topic["topic"]]
        assert (topic["messages"], topic["bytes"]) == (len(lengths), sum(lengths))
        assert topic["rate_hz"] == pytest.approx(len(lengths) / found["duration_s"])


def test_bytes_for_a_vehicles_minute_are_those_of_the_file(gcs, flight):
    found = as_json(gcs, flight.path)
    assert found["bytes_per_vehicle_minute"] == pytest.approx(found["bytes"] / 6 / (found["duration_s"] / 60))


def test_for_a_person_topics_of_all_vehicles_share_a_row(gcs, flight):
    code, out, _ = gcs("log", "info", flight.folder)
    assert code == 0
    rows = {line.split()[0]: line.split() for line in out.splitlines() if line.strip().startswith("/")}
    ticks = len(told(flight, "/tick"))
    assert rows["/tick"][1:3] == ["trustr.Tick", str(ticks)]
    assert int(rows["/mavlink/1…6_1/raw"][2]) == sum(
        topic.endswith("_1/raw") and not topic.startswith("/mavlink/255") for topic, _, _ in messages(flight.path)
    )
    outcome = "passed" if flight.summary.passed else "failed"
    for words in ("whole", "controller", outcome, "seed", flight.scenario.title, "a vehicle's minute"):
        assert words in out


def test_of_a_torn_recording_is_told_what_is_left_and_what_to_do(gcs, flight, tmp_path):
    data = flight.path.read_bytes()
    (tmp_path / "run.mcap").write_bytes(data[: len(data) * 2 // 3])
    (tmp_path / "run.tlog").write_bytes(b"")
    found = as_json(gcs, tmp_path)
    assert not found["whole"]
    assert 0 < found["messages"] < len(messages(flight.path))
    assert found["problem"] == "the recording ends before the flight did"
    assert found["journal"] == str(tmp_path / "run.tlog")
    _, out, _ = gcs("log", "info", tmp_path)
    assert "torn: it ends without its summary" in out
    assert f"gcs log recover {tmp_path / 'run.mcap'} rebuilds it" in " ".join(out.split())


def test_further_parts_are_named(gcs, flight, tmp_path):
    for name in ("run.mcap", "run.part2.mcap"):
        (tmp_path / name).write_bytes(flight.path.read_bytes())
    assert as_json(gcs, tmp_path)["parts"] == [str(tmp_path / "run.part2.mcap")]


def test_of_a_tlog_vehicles_and_messages_are_told(gcs, flight, tmp_path):
    log = tmp_path / "run.tlog"
    frames = [(time_ns, data) for topic, time_ns, data in messages(flight.path) if topic.endswith("/raw")]
    log.write_bytes(b"".join(packed(*frame) for frame in frames))
    found = as_json(gcs, log)
    assert (found["whole"], found["vehicles"], found["messages"]) == (True, 6, len(frames))
    counted = {(topic["topic"], topic["of"]): topic["messages"] for topic in found["topics"]}
    sent = sum(
        topic == "/mavlink/255_190/raw" and data[7:10] == b"\x54\0\0" for topic, _, data in messages(flight.path)
    )
    assert counted["/mavlink/255_190/raw", "SET_POSITION_TARGET_LOCAL_NED"] == sent > 0
    assert "HEARTBEAT" in gcs("log", "info", log)[1]


def test_of_a_damaged_tlog_the_bytes_that_are_no_frames_are_told(gcs, flight, tmp_path):
    log = tmp_path / "run.tlog"
    frames = [packed(time_ns, data) for topic, time_ns, data in messages(flight.path) if topic.endswith("/raw")]
    log.write_bytes(b"".join([*frames[:50], b"\0" * 33, *frames[50:]]))
    found = as_json(gcs, log)
    assert (found["whole"], found["damage"]) == (False, [{"at_byte": 0, "bytes": 33}])


@pytest.mark.parametrize("chunked", [True, False])
def test_of_another_programs_file_topics_are_told(gcs, tmp_path, chunked):
    found = as_json(gcs, foreign(tmp_path / "camera.mcap", use_chunking=chunked))
    assert (found["whole"], found["title"], found["problem"]) == (True, None, None)
    (topic,) = found["topics"]
    assert (topic["topic"], topic["of"], topic["messages"]) == ("/camera", "sensor/Image", 100)
    assert topic["rate_hz"] == pytest.approx(100 / 9.9)
    assert found["bytes_per_vehicle_minute"] is None


def test_another_programs_records_that_are_called_like_ours_are_not_taken_for_ours(gcs, tmp_path):
    with (tmp_path / "bag.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start(library="another")
        writer.add_metadata("summary", {"words": "fine"})
        writer.add_metadata("trustr", {"seed": "a grain", "started": "once", "dropped_messages": "some"})
        writer.add_metadata("recovered", {"by": "another"})
        writer.add_attachment(0, 0, "scenario.json", "application/json", b'{"about": "a theatre"}')
        writer.add_message(writer.register_channel("mav", "mavlink", 0), 5, b"no frame", 5)
        writer.finish()
    found = as_json(gcs, tmp_path / "bag.mcap")
    assert (found["seed"], found["started"], found["recovered"], found["vehicles"]) == (None, None, None, 0)
    assert gcs("log", "info", tmp_path / "bag.mcap")[0] == 0
    whole = (tmp_path / "bag.mcap").read_bytes()
    (tmp_path / "torn.mcap").write_bytes(whole[:-50])
    for name in ("bag.mcap", "torn.mcap"):
        assert gcs("log", "recover", tmp_path / name)[0] == 0


@pytest.mark.parametrize("width", [40, 60, 80])
def test_no_topic_is_broken_where_the_terminal_is_narrow(flight, width):
    page = io.StringIO()
    assert show(flight.path, as_json=False, console=Console(file=page, width=width)) == 0
    lines = page.getvalue().splitlines()
    assert max(map(len, lines)) <= width
    if width >= 60:
        assert {topic for topic, _, _ in messages(flight.path) if not topic.startswith(("/mavlink", "/uav"))} <= {
            line.split()[0] for line in lines if line.strip().startswith("/")
        }


@pytest.mark.parametrize("name", ["run.mcap", "run.tlog"])
def test_a_file_with_nothing_in_it_is_refused_in_a_sentence(gcs, tmp_path, name):
    (tmp_path / name).write_bytes(b"hello\n" * 100)
    code, out, err = gcs("log", "info", tmp_path / name)
    assert (code, out, err.count("\n")) == (2, "", 1)
    code, _, err = gcs("log", "info", tmp_path / "absent.mcap")
    assert (code, "No such file" in err) == (2, True)
