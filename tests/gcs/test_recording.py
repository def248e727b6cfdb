"""What a recording holds, that it is MCAP as anybody reads it, and that nothing which happens leaves it torn."""

from collections import Counter
from dataclasses import fields
from io import BytesIO
from itertools import pairwise

import numpy as np
import orjson
import pytest
from flights import failing, fly_and_record, messages, recorded, told
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader, SeekingReader
from mcap.records import Chunk, Footer
from mcap.stream_reader import StreamReader

from gcs.events import Rating
from gcs.link_quality import LinkQuality
from gcs.recording import topics
from gcs.recording.decoded import decoded as read_message
from gcs.recording.reader import UnreadableRecording, read
from gcs.recording.writer import PROMPTLY_NS
from gcs.scoring import score
from gcs.session import Recording
from gcs.summary import Reception
from scenarios import Scenario
from wire.frames import Framer

SYSTEMS = range(1, 7)
OURS = {
    "/tick", "/mission", "/trust", "/weights", "/roles", "/setpoint", "/swarm/state", "/truth/pose", "/truth/fault",
}  # fmt: skip
VIEWERS = {"/tf", "/swarm/scene", "/log"} | {f"/uav/{system}/fix" for system in SYSTEMS}
RAW = {f"/mavlink/{system}_{component}/raw" for system in SYSTEMS for component in (1, 200)}
GROUND = "/mavlink/255_190/raw"


@pytest.fixture(scope="module")
def flight():
    return recorded("emergency")


@pytest.fixture(scope="module")
def held(flight):
    """(topic, log time, payload), in the order of the file."""
    return messages(flight.path)


def contents(held, topic):
    return [orjson.loads(data) for name, _, data in held if name == topic]


def test_its_topics_are_those_of_the_contract(held):
    expected = OURS | VIEWERS | RAW | {GROUND} | {f"/uav/{system}/state" for system in SYSTEMS}
    assert {topic for topic, _, _ in held} == expected


def test_every_frame_that_came_is_in_it_under_its_sender_and_its_time(flight, held):
    came = [(f"/mavlink/{f.system}_{f.component}/raw", f.time_ns, f.raw) for f in flight.link.received]
    assert [message for message in held if message[0] in RAW] == came
    assert len(came) > 5000


def test_every_frame_that_went_is_in_it(flight, held):
    went = [data for topic, _, data in held if topic == GROUND]
    assert went == [frame for _, frame in flight.link.sent]
    (beats, setpoints) = (Counter(frame[7] for frame in went)[message] for message in (0, 84))
    assert beats == 6 * -(-len(contents(held, "/tick")) // 5)
    assert setpoints > 1900


def test_a_set_point_names_its_vehicle(flight, held):
    framer = Framer()
    targets = [framer.frames(0, data)[0].payload[-3] for topic, _, data in held if topic == GROUND and data[7] == 84]
    assert targets == [system for system, frame in flight.link.sent if frame[7] == 84]


def test_the_raw_frames_between_two_ticks_are_what_the_second_consumed(held):
    since = 0
    for topic, _, data in held:
        if topic in RAW:
            since += 1
        elif topic == "/tick":
            assert orjson.loads(data)["frames"] == since
            since = 0


def test_ticks_are_numbered_without_a_gap_and_their_times_are_periods_apart(held):
    times = [time_ns for topic, time_ns, _ in held if topic == "/tick"]
    ticks = contents(held, "/tick")
    assert [tick["number"] for tick in ticks] == list(range(len(ticks)))
    assert {later - earlier for earlier, later in pairwise(times)} == {100_000_000}
    assert {tick["lateness_ns"] for tick in ticks} == {0}
    assert list(dict.fromkeys(tick["phase"] for tick in ticks)) == [
        "joining", "taking off", "taking control", "running up", "mission", "landing", "done",
    ]  # fmt: skip


def test_a_fault_is_told_when_it_begins(held):
    (fault,) = contents(held, "/truth/fault")
    assert (fault["vehicle"], fault["active"], fault["mission_s"]) == (5, True, 0.0)
    assert fault["definition"]["max_speed_fraction"] == 0.4


def test_weights_are_rows_that_sum_to_one_and_hardly_heed_the_distrusted(held):
    for content in contents(held, "/weights"):
        weights = np.array(content["weights"])
        assert (weights >= 0).all()
        assert weights.sum(axis=1) == pytest.approx(1.0, abs=1e-12)
    assert contents(held, "/trust")[0]["trust"] == [1, 1, 1, 1, 0, 1]


def test_a_number_that_is_none_is_null(held):
    (first, last) = (contents(held, "/swarm/state")[place] for place in (0, -1))
    assert first["position_m"] == [[None] * 3] * 6
    assert first["age_s"] == [None] * 6
    assert np.isfinite(last["position_m"]).all()
    assert not any(b"NaN" in data for topic, _, data in held if topic in OURS)


def test_every_message_of_ours_is_what_its_schema_says(flight):
    checked = set()
    with flight.path.open("rb") as stream:
        for schema, channel, message in SeekingReader(stream).iter_messages():
            if channel.message_encoding == "json":
                assert schema.encoding == "jsonschema"
                check(orjson.loads(message.data), orjson.loads(schema.data))
                checked.add(channel.topic.split("/")[1])
            elif channel.message_encoding == "mavlink":
                assert schema is None
    assert checked == {"tick", "mission", "trust", "weights", "roles", "setpoint", "swarm", "uav", "truth"}


SUPERVISED = (Rating("op1", 5, 1, 12.0), Rating("op2", None, 4, 20.0))
INTERMITTENT = 'fault=[{vehicle=5, kind="frozen_telemetry", onset_s=3, period_s=8, on_fraction=0.4, end_s=24}]'


@pytest.fixture(scope="module")
def supervised():
    """A leader fails, passes its role on and is left behind, while people rate."""
    hold = 'trust.beyond_repair="hold"'
    return recorded("emergency", 'trust.source="fused"', "fault.0.vehicle=1", hold, ratings=SUPERVISED)


@pytest.mark.parametrize("topic", ["/evidence", "/ratings", "/roles"])
def test_what_trust_was_drawn_from_is_what_its_schema_says(supervised, topic):
    checked = 0
    with supervised.path.open("rb") as stream:
        for schema, _, message in SeekingReader(stream).iter_messages(topics=topic):
            check(orjson.loads(message.data), orjson.loads(schema.data))
            checked += 1
    assert checked == {"/evidence": len(told(supervised, "/mission")), "/ratings": 2, "/roles": 3}[topic]


def test_evidence_has_a_number_for_every_vehicle_once_there_is_any(supervised):
    for content in told(supervised, "/evidence"):
        for key in ("log_odds", "spoken", "response_m_s", "inconsistency_m", "disagreement_m_s"):
            assert len(content[key]) == 6
            assert np.isfinite(content[key]).all()


def test_there_is_no_evidence_where_nothing_is_drawn_from_it(flight):
    assert told(flight, "/evidence") == told(flight, "/ratings") == []


def test_a_rating_of_the_swarm_is_recorded_under_its_name(supervised):
    first, second = told(supervised, "/ratings")
    assert (first["vehicle"], first["rater"], first["time_s"]) == (5, "op1", pytest.approx(12.0))
    assert (second["vehicle"], second["rater"], second["time_s"]) == ("swarm", "op2", pytest.approx(20.0))


def test_roles_are_told_at_the_start_and_whenever_they_change(supervised):
    told_roles = [(content["leaders"], content["left_behind"]) for content in told(supervised, "/roles")]
    assert told_roles == [([1, 3], []), ([2, 3], []), ([2, 3], [1])]


def test_a_track_read_back_knows_who_led_and_who_was_left_behind(supervised):
    parts = supervised.read().track.parts
    assert [(list(part.leaders), list(part.left_behind)) for part in parts] == [
        ([1, 3], []), ([2, 3], []), ([2, 3], [1]),
    ]  # fmt: skip
    assert [part.time_s for part in parts] == [content["mission_s"] for content in told(supervised, "/roles")]


def test_a_fault_that_comes_and_goes_is_told_each_time():
    faults = told(recorded("emergency", 'trust.source="auto"', INTERMITTENT), "/truth/fault")
    assert [fault["active"] for fault in faults] == [True, False] * 3
    assert [fault["mission_s"] for fault in faults] == pytest.approx([3.0, 6.2, 11.0, 14.2, 19.0, 22.2])
    assert {fault["vehicle"] for fault in faults} == {5}
    assert faults[0]["definition"]["period_s"] == 8.0


@pytest.fixture(scope="module")
def decoded():
    """A flight of a few seconds with its messages as JSON."""
    return fly_and_record("demo", "time.timeout_s=3", recording=Recording(decodes=True))


def test_every_frame_is_there_as_json_too_if_that_is_asked_for(decoded):
    framer, held = Framer(), messages(decoded.path)
    frames = [framer.frames(time_ns, data)[0] for topic, time_ns, data in held if topic.endswith("/raw")]
    expected = [(f"/mavlink/{f.system}_{f.component}/{name}", f.time_ns, data)
                for f in frames for name, data in filter(None, [read_message(f)])]  # fmt: skip
    found = [message for message in held if message[0].startswith("/mavlink/") and not message[0].endswith("/raw")]
    assert sorted(found) == sorted(expected)
    assert len(found) == len(frames) > 500


def test_every_decoded_message_is_what_its_schema_says(decoded):
    checked = set()
    with decoded.path.open("rb") as stream:
        for schema, channel, message in SeekingReader(stream).iter_messages():
            if channel.topic.startswith("/mavlink/") and channel.message_encoding == "json":
                assert schema.name == f"mavlink.{channel.topic.rsplit('/')[-1]}"
                check(orjson.loads(message.data), orjson.loads(schema.data))
                checked.add(schema.name)
    assert checked >= {"mavlink.HEARTBEAT", "mavlink.LOCAL_POSITION_NED", "mavlink.COMMAND_LONG", "mavlink.SIM_STATE"}


class Heard:
    """How vehicles are heard by a link that knows: one loses frames, one is not heard at all."""

    def __init__(self):
        self._calls = 0

    def __call__(self):
        self._calls += 1
        quality = {1: LinkQuality(received=100 * self._calls), 2: LinkQuality(90, 10, 3, 1)}
        return Reception.of({"bad checksum": 2, "a stranger": 0}, quality)


def test_how_vehicles_are_heard_is_told_once_a_second_where_the_link_knows():
    short = ("time.timeout_s=3", "swarm.rows=1", "swarm.columns=3", "swarm.leaders=[1]")
    flight = fly_and_record("demo", *short, reception=Heard())
    content = told(flight, "/link")
    assert [link["tick"] for link in content] == list(range(0, len(told(flight, "/tick")), 10))
    assert [link["received"] for link in content] == [[100 * (turn + 1), 90, 0] for turn in range(len(content))]
    assert {key: content[0][key] for key in ("lost", "reordered", "duplicated", "rejected")} == {
        "lost": [0, 10, 0], "reordered": [0, 3, 0], "duplicated": [0, 1, 0], "rejected": {"bad checksum": 2},
    }  # fmt: skip
    assert flight.summary.loss == {"1": 0.0, "2": 0.1}
    with flight.path.open("rb") as stream:
        for schema, _, message in SeekingReader(stream).iter_messages(topics=["/link"]):
            check(orjson.loads(message.data), orjson.loads(schema.data))


KINDS = {
    "integer": lambda v: isinstance(v, int) and not isinstance(v, bool),
    "number": lambda v: isinstance(v, (int, float)) and not isinstance(v, bool),
    "null": lambda v: v is None,
    "string": lambda v: isinstance(v, str),
    "boolean": lambda v: isinstance(v, bool),
    "array": lambda v: isinstance(v, list),
    "object": lambda v: isinstance(v, dict),
}


def check(value, schema):
    """The part of JSON Schema that we write, and no key that it does not name."""
    kinds = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    assert any(KINDS[kind](value) for kind in kinds), (value, schema)
    if "properties" in schema:
        assert value.keys() == schema["properties"].keys() == set(schema["required"])
        for key, below in schema["properties"].items():
            check(value[key], below)
    for item in value if isinstance(value, list) else ():
        check(item, schema["items"])


@pytest.mark.parametrize(
    "topic", [kind for name, kind in vars(topics).items() if name.endswith("Topic")], ids=lambda kind: kind.__name__
)
def test_a_schema_has_a_type_for_every_field_and_a_sentence_for_the_whole(topic):
    schema = topics.schema(topic)
    assert schema["properties"].keys() == {field.name for field in fields(topic)}
    assert schema["description"].startswith("/")
    assert not [key for key, below in schema["properties"].items() if "type" not in below]


def test_the_scenario_in_it_is_the_scenario_flown(flight):
    assert flight.read().scenario == flight.scenario
    with flight.path.open("rb") as stream:
        (attachment,) = NonSeekingReader(stream).iter_attachments()
    assert (attachment.name, attachment.media_type) == ("scenario.json", "application/json")
    assert Scenario.model_validate_json(attachment.data) == flight.scenario


def test_versions_seed_and_summary_are_metadata(flight):
    with flight.path.open("rb") as stream:
        metadata = {record.name: record.metadata for record in SeekingReader(stream).iter_metadata()}
    assert metadata["trustr"]["seed"] == "1"
    assert metadata["trustr"].keys() >= {"started", "python", "trustr", "jsbsim", "pymavlink", "numpy", "mcap"}
    assert orjson.loads(metadata["summary"]["json"]) == orjson.loads((flight.folder / "summary.json").read_bytes())


def test_the_summary_of_the_file_counts_all_that_is_in_it(flight, held):
    with flight.path.open("rb") as stream:
        summary = SeekingReader(stream, validate_crcs=True).get_summary()
    assert summary.statistics.message_count == len(held)
    counted = {summary.channels[number].topic: n for number, n in summary.statistics.channel_message_counts.items()}
    assert counted == Counter(topic for topic, _, _ in held)


def test_a_mission_read_back_is_scored_as_the_flight_was(flight):
    again = score(flight.read().track, flight.scenario)
    assert again.heading_error_deg == pytest.approx(flight.summary.heading_error_deg, abs=1e-9)
    assert again.distance_to_target_m == pytest.approx(flight.summary.distance_to_target_m, abs=1e-9)
    assert again.min_separation_m == pytest.approx(flight.summary.min_separation_m, abs=1e-9)
    assert again.passed is flight.summary.passed is True


def records(data):
    return list(StreamReader(BytesIO(data), emit_chunks=True).records)


def longest_wait_ns(path):
    """How long a message may have waited to be written: the longest chunk, and the longest time between two."""
    chunks = [record for record in records(path.read_bytes()) if isinstance(record, Chunk)]
    lasted = [chunk.message_end_time - chunk.message_start_time for chunk in chunks]
    apart = [later.message_end_time - earlier.message_end_time for earlier, later in pairwise(chunks)]
    return max(lasted + apart)


def test_no_chunk_holds_back_more_than_a_second_of_a_flight_that_can_be_flown_again(flight):
    assert longest_wait_ns(flight.path) == 1_000_000_000


def test_no_chunk_holds_back_more_than_a_tenth_of_a_second_of_a_flight_that_cannot(tmp_path):
    fly_and_record("demo", "time.timeout_s=5", out=tmp_path, recording=Recording(flush_ns=PROMPTLY_NS))
    assert longest_wait_ns(tmp_path / "run.mcap") == 100_000_000


class Peek:
    """A record that keeps what another process would find on the disk at one tick."""

    def __init__(self, path, tick):
        self._path, self._tick = path, tick
        self.on_disk = None

    def tick(self, tick):
        if tick.number == self._tick:
            self.on_disk = self._path.read_bytes()


def test_a_process_killed_at_any_time_leaves_all_but_the_last_tick_on_the_disk(tmp_path):
    peek = Peek(tmp_path / "run.mcap", 40)
    prompt = Recording(flush_ns=PROMPTLY_NS)
    fly_and_record("demo", "time.timeout_s=5", out=tmp_path, watching=lambda _flight: (peek,), recording=prompt)
    found = NonSeekingReader(BytesIO(peek.on_disk)).iter_messages(log_time_order=False)
    numbers = []
    with pytest.raises(EndOfFile):
        numbers.extend(orjson.loads(m.data)["number"] for _, channel, m in found if channel.topic == "/tick")
    assert numbers == list(range(len(numbers)))
    assert numbers[-1] >= 39


@pytest.mark.parametrize("error", [RuntimeError("a defect"), KeyboardInterrupt(), OSError("disk")], ids=repr)
def test_whatever_ends_a_flight_its_recording_is_whole(error, tmp_path):
    path = tmp_path / "run.mcap"
    with pytest.raises(type(error)):
        fly_and_record("demo", out=tmp_path, events=failing(31, error))
    assert isinstance(records(path.read_bytes())[-1], Footer)
    assert read(path).track is None
    assert [content["number"] for content in contents(messages(path), "/tick")] == list(range(31))


def torn(data):
    return [data[:size] for size in (0, 1, 8, 9, 100, 1000, len(data) // 2, len(data) - 9, len(data) - 1)]


def flipped(data):
    rng = np.random.default_rng(2)
    for place in rng.integers(len(data), size=120):
        wrong = bytearray(data)
        wrong[place] ^= 1 << int(rng.integers(8))
        yield bytes(wrong)


@pytest.fixture(scope="module")
def small():
    """A recording of a few seconds: taken off, timed out, landed."""
    return fly_and_record("demo", "time.timeout_s=3", "swarm.rows=1", "swarm.columns=2", "swarm.leaders=[1]")


def test_a_file_cut_short_anywhere_is_refused_in_a_sentence(small, tmp_path):
    for data in torn(small.path.read_bytes()):
        (tmp_path / "torn.mcap").write_bytes(data)
        with pytest.raises(UnreadableRecording, match=r"^\S*torn\.mcap: ") as refusal:
            read(tmp_path / "torn.mcap")
        assert "\n" not in str(refusal.value)


def test_a_flipped_bit_is_refused_or_harmless_but_never_a_crash(small, tmp_path):
    path = tmp_path / "flipped.mcap"
    refused = 0  # the rest hit what is not read: paddings, indices, frames of the wire
    for data in flipped(small.path.read_bytes()):
        path.write_bytes(data)
        try:
            assert read(path).scenario == small.scenario
        except UnreadableRecording:
            refused += 1
    assert refused > 30
