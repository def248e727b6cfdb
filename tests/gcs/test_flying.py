"""`gcs fly` with all that a real link may ask for: a key, a vehicle degraded on the way, and the operator's word."""

import os
import signal
import socket
import subprocess
from contextlib import closing

import orjson
import pytest
from flights import FDM, GCS, SHORT, fly_and_record, messages, start
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs.events import LAND
from gcs.recording.reader import read, ticks
from gcs.recording.tlog import entries
from gcs.replay.verify import decide_again
from wire.frames import Framer, decode

HOST = "127.0.0.1"


def free_port():
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as probe:
        probe.bind((HOST, 0))
        return probe.getsockname()[1]


def test_the_word_land_is_the_first_thing_to_leave_at_its_tick():
    said = iter([(LAND,) if tick == 150 else () for tick in range(10_000)])
    flight = fly_and_record("demo", *SHORT, events=lambda: next(said))
    page = list(ticks(flight.path))[150]
    assert page.events == (LAND,)
    sent = [decode(*Framer().frames(0, frame)) for frame in page.sent]
    first = sent[:6]
    assert [one.target_system for one in first] == [1, 2, 3, 4, 5, 6]
    assert {one.command for one in first} == {dialect.MAV_CMD_NAV_LAND}
    assert not any(one.get_type() == "SET_POSITION_TARGET_LOCAL_NED" for one in sent)


@pytest.fixture(scope="module")
def degraded(tmp_path_factory):
    """The emergency with sound vehicles, the fifth of which is degraded on the way, all of it signed."""
    folder, port = tmp_path_factory.mktemp("degraded"), free_port()
    keys = [folder / name for name in ("vehicles-key", "ground-key")]
    for key in keys:
        key.write_text("correct horse battery staple\n")
    to = ("--to", f"udpout:{HOST}:{port}", "--speed", "2", "--no-fault", "--signing-key", keys[0])
    server = start(FDM, "serve", "emergency", *to)
    words = ("--link", f"udpin:{HOST}:{port}", "--speed", "2", "--arm", "--yes", "--json", "--out", folder / "run")
    process = start(
        GCS, "fly", "emergency", *words, "--degrade", "5", "--signing-key", keys[1], stdin=subprocess.DEVNULL
    )
    out, err = process.communicate(timeout=120)
    server.send_signal(signal.SIGINT)
    _, complaints = server.communicate(timeout=20)
    assert "Traceback" not in err + complaints
    assert process.returncode == 0, err
    return folder, orjson.loads(out)


@pytest.mark.wall_clock
def test_a_vehicle_degraded_on_the_way_is_the_papers_failed_robot(degraded):
    _, summary = degraded
    assert summary["passed"], summary
    assert summary["faults"] == ["robot 5 at 40% speed"]
    assert summary["detected"] == {"5": 0.0}


@pytest.mark.wall_clock
def test_the_summary_says_how_each_vehicle_was_heard_and_that_nothing_was_refused(degraded):
    _, summary = degraded
    assert (summary["rejected_frames"], summary["rejections"]) == (0, {})
    assert summary["loss"].keys() == set("123456")
    assert all(0.0 <= loss < 0.05 for loss in summary["loss"].values())


@pytest.mark.wall_clock
def test_the_recording_has_what_the_controller_sent_and_can_be_decided_again(degraded):
    folder, _ = degraded
    assert decide_again(folder / "run" / "run.mcap").difference is None


@pytest.mark.wall_clock
def test_the_journal_has_the_same_frames_as_the_recording_in_the_same_order(degraded):
    """Both have what the controller sent: it is bent behind them, as it would be on board."""
    path = degraded[0] / "run" / "run.mcap"
    recorded = [data for topic, _, data in messages(path) if topic.endswith("/raw")]
    noted = [entry.raw for entry in entries(path.with_suffix(".tlog"))]
    assert noted[: len(recorded)] == recorded
    assert len(noted) - len(recorded) < 20  # that came when the last turn of the loop was over


@pytest.mark.wall_clock
def test_the_recording_tells_once_a_second_how_each_vehicle_was_heard(degraded):
    folder, summary = degraded
    links = [orjson.loads(data) for topic, _, data in messages(folder / "run" / "run.mcap") if topic == "/link"]
    assert len(links) == pytest.approx(summary["simulated_s"], abs=3)
    assert all(min(link["received"]) > 0 for link in links[2:])


@pytest.mark.wall_clock
def test_the_degraded_vehicle_falls_behind_though_it_was_sent_what_all_were(degraded):
    folder, _ = degraded
    track = read(folder / "run" / "run.mcap").track
    gone = [abs(track.position[-1, row, :2] - track.position[0, row, :2]).max() for row in range(6)]
    assert gone[4] < 0.6 * max(gone)


@pytest.mark.wall_clock
def test_a_signed_flight_leaves_a_memory_beside_the_key_and_no_key_in_the_recording(degraded):
    folder, _ = degraded
    assert {path.name for path in folder.iterdir()} >= {"ground-key", "ground-key.flies"}
    data = (folder / "run" / "run.mcap").read_bytes()
    assert b"correct horse" not in data


def test_whoever_reads_the_progress_may_hang_up_and_the_flight_goes_on(tmp_path):
    short = [word for override in SHORT for word in ("--set", override)]
    reading, writing = os.pipe()
    process = subprocess.Popen(
        [GCS, "run", "demo", *short, "--json", "--out", tmp_path], stdout=subprocess.PIPE, stderr=writing
    )
    os.close(writing)
    os.close(reading)
    out, _ = process.communicate(timeout=60)
    summary = orjson.loads(out)
    assert process.returncode == 0
    assert summary["problem"] is None
    assert summary["heading_error_deg"] is not None
    assert decide_again(tmp_path / "run.mcap").difference is None
