"""Software that nobody here wrote reads our recordings: mcap's reader and protobuf's decoder, Rerun, Foxglove's SDK."""

import subprocess
import sys
from collections import Counter
from functools import cache
from pathlib import Path

import pytest
from flights import SHORT, messages, recorded, scratch
from foxglove import messages as foxglove
from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
from foxglove_schemas_protobuf.Log_pb2 import Log
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.json_format import MessageToDict
from google.protobuf.message_factory import GetMessageClass
from mcap.reader import SeekingReader
from rerun.chunk import McapReader
from viewed import viewed, xyz

FIXES = tuple(f"/uav/{system}/fix" for system in range(1, 7))
WELL_KNOWN = {
    "/tf": "foxglove.FrameTransforms",
    "/swarm/scene": "foxglove.SceneUpdate",
    "/log": "foxglove.Log",
    **dict.fromkeys(FIXES, "foxglove.LocationFix"),
}


def flight():
    return recorded("demo", *SHORT)


@cache
def counts():
    """Topic → how many messages the file holds, by reading all of it."""
    return Counter(topic for topic, _, _ in messages(flight().path))


def summary():
    with flight().path.open("rb") as stream:
        return SeekingReader(stream, validate_crcs=True).get_summary()


def test_the_summary_counts_every_message_of_every_channel():
    told = summary()
    assert {
        channel.topic: told.statistics.channel_message_counts[n] for n, channel in told.channels.items()
    } == counts()
    assert told.statistics.message_count == counts().total()
    assert told.statistics.chunk_count == len(told.chunk_indexes)
    assert told.statistics.attachment_count == len(told.attachment_indexes) == 1
    assert told.statistics.metadata_count == len(told.metadata_indexes)


def test_the_summary_finds_every_message_by_its_time():
    with flight().path.open("rb") as stream:
        reader = SeekingReader(stream, validate_crcs=True)
        told = reader.get_summary()
        middle = (told.statistics.message_start_time + told.statistics.message_end_time) // 2
        early = sum(1 for _ in reader.iter_messages(ending_before=middle))
        late = sum(1 for _ in reader.iter_messages(starting_at=middle))
    assert min(early, late) > 1000
    assert early + late == counts().total()


def test_what_viewers_draw_has_the_schemas_that_they_know():
    told = summary()
    by_topic = {channel.topic: channel for channel in told.channels.values()}
    for topic, name in WELL_KNOWN.items():
        channel = by_topic[topic]
        schema = told.schemas[channel.schema_id]
        assert (channel.message_encoding, schema.encoding, schema.name) == ("protobuf", "protobuf", name)


def test_every_channel_but_those_of_raw_frames_has_a_schema():
    told = summary()
    bare = {channel.topic for channel in told.channels.values() if channel.schema_id == 0}
    assert bare == {topic for topic in counts() if topic.endswith("/raw")}


def test_every_protobuf_message_is_decoded_by_what_the_file_says_of_it():
    decoded = viewed(flight().path)
    assert {topic: len(told) for topic, told in decoded.items()} == {topic: counts()[topic] for topic in WELL_KNOWN}
    for topic, told in decoded.items():
        assert {message.DESCRIPTOR.full_name for _, message in told} == {WELL_KNOWN[topic]}


@cache
def rerun_rows():
    """(topic, component) → how many values Rerun made of it."""
    rows = Counter()
    for chunk in McapReader(flight().path).stream():
        if not chunk.is_static:
            batch = chunk.to_record_batch()
            for name in batch.schema.names:
                rows[chunk.entity_path, name] += len(batch.column(name).drop_null())
    return rows


def test_rerun_finds_every_transform():
    drawn = sum(len(message.transforms) for _, message in viewed(flight().path)["/tf"])
    for part in ("child_frame", "parent_frame", "quaternion", "translation"):
        assert rerun_rows()["/tf", f"Transform3D:{part}"] == drawn > 1000


@pytest.mark.parametrize("topic", FIXES)
def test_rerun_puts_every_fix_on_its_map(topic):
    assert rerun_rows()[topic, "GeoPoints:positions"] == rerun_rows()[topic, "CoordinateFrame:frame"] == counts()[topic]


def test_rerun_reads_the_log_and_the_scene():
    assert rerun_rows()["/log", "TextLog:text"] == rerun_rows()["/log", "TextLog:level"] == counts()["/log"]
    assert rerun_rows()["/swarm/scene", "foxglove.SceneUpdate:message"] == counts()["/swarm/scene"]


def test_rerun_has_a_vehicle_where_we_put_it():
    _, wanted = viewed(flight().path)["/tf"][-1]
    chunks = (c for c in McapReader(flight().path).stream() if c.entity_path == "/tf" and not c.is_static)
    last = list(chunks)[-1].to_record_batch()
    frames, places = (
        last.column(f"Transform3D:{part}").to_pylist()[-len(wanted.transforms) :]
        for part in ("child_frame", "translation")
    )
    placed = {frame: tuple(place) for [frame], [place] in zip(frames, places, strict=True)}
    assert placed == {one.child_frame_id: pytest.approx(xyz(one.translation), abs=1e-4) for one in wanted.transforms}


def rerun_check(path):
    """(exit code, {topic: verdict}) of Rerun's own check of every message."""
    rerun = Path(sys.executable).with_name("rerun")
    home = {"HOME": str(scratch())}  # where it keeps its settings; without any it reports to nobody
    told = subprocess.run(
        [rerun, "mcap", "check", "--full", path], env=home, capture_output=True, text=True, check=False
    )
    lines = [line.split() for line in told.stdout.splitlines()]
    return told.returncode, {words[3]: words[0] for words in lines if len(words) > 3 and words[3].startswith("/")}


def test_rerun_finds_nothing_wrong_with_the_file():
    assert rerun_check(flight().path) == (0, dict.fromkeys(counts(), "ok"))


def test_rerun_does_find_a_file_that_is_torn():
    torn = scratch() / "torn.mcap"
    torn.write_bytes(flight().path.read_bytes()[:-1000])
    assert rerun_check(torn)[0] != 0


@cache
def as_foxglove_has_it(name):
    """The message class of Foxglove's own SDK."""
    schema = getattr(foxglove, name).get_schema()
    pool = DescriptorPool()
    for file in FileDescriptorSet.FromString(schema.data).file:
        pool.Add(file)
    return GetMessageClass(pool.FindMessageTypeByName(schema.name))


@pytest.mark.parametrize("topic", ["/tf", "/swarm/scene", "/log", "/uav/5/fix"])
def test_foxglove_reads_every_message_as_we_do(topic):
    theirs = as_foxglove_has_it(WELL_KNOWN[topic].removeprefix("foxglove."))
    for _, message in viewed(flight().path)[topic]:
        read = theirs.FromString(message.SerializeToString())
        assert MessageToDict(read) == MessageToDict(message)


def test_we_read_what_foxglove_writes():
    time = foxglove.Timestamp(12, 34)
    log = foxglove.Log(timestamp=time, level=foxglove.LogLevel.Warning, message="distrusted", name="distrust/uav_5")
    read = Log.FromString(log.encode())
    assert (read.level, read.message, read.name, read.timestamp.ToNanoseconds()) == (
        Log.WARNING,
        "distrusted",
        "distrust/uav_5",
        12_000_000_034,
    )
    fix = foxglove.LocationFix(frame_id="uav_1", latitude=41.5, longitude=-81.5, altitude=300.0)
    told = LocationFix.FromString(fix.encode())
    assert (told.frame_id, told.latitude, told.longitude, told.altitude) == ("uav_1", 41.5, -81.5, 300.0)
