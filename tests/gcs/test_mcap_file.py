"""The file as we write it, held to the one that the mcap library writes, and to a disk that takes no more."""

import hashlib
import io
import struct
from pathlib import Path

import pytest
from disks import Limited
from flights import scratch
from hypothesis import given
from hypothesis import strategies as st
from mcap.exceptions import EndOfFile
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, Message, SummaryOffset
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import CompressionType, Writer

from gcs.recording.mcap_file import TOLD_AGAIN_BYTES, McapFile

TOPICS = ("/a", "/b", "/ü")
MESSAGES = st.tuples(st.sampled_from(range(len(TOPICS))), st.integers(0, 2**63), st.binary(max_size=40))
STEPS = st.lists(st.one_of(MESSAGES, st.sampled_from(["flush", "attach", "metadata"])), max_size=40)


class Library:
    """The mcap library behind the same methods."""

    def __init__(self, path):
        self._stream = path.open("wb")
        self._writer = Writer(self._stream, compression=CompressionType.LZ4)
        self._writer.start(library="trustr")
        self.schema, self.channel = self._writer.register_schema, self._writer.register_channel
        self.metadata, self.flush = self._writer.add_metadata, self._writer.flush

    def add(self, channel, time_ns, data):
        self._writer.add_message(channel, time_ns, data, time_ns)

    def attach(self, time_ns, name, media_type, data):
        self._writer.add_attachment(time_ns, time_ns, name, media_type, data)

    def finish(self):
        self._writer.finish()
        self._stream.close()


def written(file, steps):
    """The same into either; topics are defined when they are first spoken of."""
    schema, channels = file.schema("S", "jsonschema", b"{}"), {}
    for step in steps:
        if step == "flush":
            file.flush()
        elif step == "attach":
            file.attach(7, "scenario.json", "application/json", b"{}")
        elif step == "metadata":
            file.metadata("trustr", {"seed": "1", "ünicode": "✓"})
        else:
            topic, time_ns, data = step
            if topic not in channels:
                channels[topic] = file.channel(TOPICS[topic], "json", schema if topic else 0)
            file.add(channels[topic], time_ns, data)
    file.finish()


@pytest.fixture(scope="module")
def paths():
    folder = scratch()
    return folder / "ours.mcap", folder / "theirs.mcap"


def both(paths, steps):
    ours, theirs = paths
    written(McapFile(ours), steps)
    written(Library(theirs), steps)
    return ours.read_bytes(), theirs.read_bytes()


def reader(data):
    return SeekingReader(io.BytesIO(data), validate_crcs=True)


def footer(data):
    *_, last = StreamReader(io.BytesIO(data), validate_crcs=True).records
    return last


@given(STEPS)
def test_messages_chunks_and_their_indexes_are_the_librarys_to_the_byte(paths, steps):
    ours, theirs = both(paths, steps)
    assert ours[: footer(ours).summary_start] == theirs[: footer(theirs).summary_start]


@given(STEPS)
def test_readers_find_in_its_summary_what_they_find_in_the_librarys(paths, steps):
    ours, theirs = (reader(data).get_summary() for data in both(paths, steps))
    for group in ("statistics", "schemas", "channels", "chunk_indexes", "attachment_indexes", "metadata_indexes"):
        assert getattr(ours, group) == getattr(theirs, group)


@given(STEPS)
def test_readers_that_seek_find_by_it_what_they_find_by_the_librarys(paths, steps):
    ours, theirs = both(paths, steps)
    for options in ({}, {"reverse": True}, {"topics": ["/a"]}, {"starting_at": 2**61, "ending_before": 2**62}):
        assert list(reader(ours).iter_messages(**options)) == list(reader(theirs).iter_messages(**options))
    assert list(reader(ours).iter_attachments()) == list(reader(theirs).iter_attachments())
    assert list(reader(ours).iter_metadata()) == list(reader(theirs).iter_metadata())


@given(STEPS)
def test_its_footer_says_where_each_part_of_the_summary_is(paths, steps):
    ours, _ = both(paths, steps)
    found = footer(ours)
    summary = StreamReader(io.BytesIO(ours[found.summary_start :]), skip_magic=True)
    offsets = [record for record in summary.records if isinstance(record, SummaryOffset)]
    for offset in offsets:
        assert ours[offset.group_start] == offset.group_opcode
        assert offset.group_length > 0
    assert sum(offset.group_length for offset in offsets) == found.summary_offset_start - found.summary_start


def test_a_chunk_is_closed_before_it_is_much_larger_than_a_mebibyte(paths):
    ours, theirs = both(paths, [(0, time, bytes(1000)) for time in range(2500)])
    assert ours[: footer(ours).summary_start] == theirs[: footer(theirs).summary_start]
    assert [1 << 20 <= chunk.uncompressed_size < (1 << 20) + 1100 for chunk in chunks(ours)] == [True, True, False]


def chunks(data):
    return [record for record in StreamReader(io.BytesIO(data), emit_chunks=True).records if isinstance(record, Chunk)]


def test_what_was_flushed_has_left_the_process(paths):
    path, _ = paths
    with McapFile(path) as file:
        channel = file.channel("/a", "json")
        for time in range(5):
            file.add(channel, time, b"%d" % time)
            file.flush()
            assert list(prefix(path.read_bytes())) == [b"%d" % before for before in range(time + 1)]


def prefix(data):
    """The messages of a file without an end; whatever is wrong but its missing end raises."""
    try:
        for record in StreamReader(io.BytesIO(data), validate_crcs=True).records:
            if isinstance(record, Message):
                yield record.data
    except EndOfFile:
        pass


def random(number):
    return hashlib.sha512(b"%d" % number).digest()


def file_of(path, count):
    """Messages that do not compress, a chunk each."""
    file = McapFile(path)
    channel = file.channel("/a", "json")
    for number in range(count):
        file.add(channel, number, random(number))
        file.flush()
    return file, channel


@pytest.mark.parametrize("room", [1, 9, 60, 150])
def test_a_chunk_that_the_disk_took_half_of_is_cut_off_again(paths, room):
    path, _ = paths
    file, channel = file_of(path, 3)
    before = path.read_bytes()
    with Limited(len(before) + room):
        file.add(channel, 4, random(4))
        file.add(channel, 5, random(5))
        with pytest.raises(OSError, match="File too large"):
            file.flush()
    assert path.read_bytes() == before
    assert file.dropped == 2
    file.close()
    assert list(prefix(path.read_bytes())) == [random(number) for number in range(3)]


def test_a_file_that_had_no_room_for_its_end_is_finished_when_there_is(paths):
    path, _ = paths
    file, _ = file_of(path, 3)
    before = path.read_bytes()
    for room in (3, 100, 400):
        with Limited(len(before) + room), pytest.raises(OSError, match="File too large"):
            file.finish()
        assert path.read_bytes() == before
    file.finish()
    assert [message.data for _, _, message in reader(path.read_bytes()).iter_messages()] == [
        random(number) for number in range(3)
    ]
    assert reader(path.read_bytes()).get_summary().statistics.message_count == 3


def test_a_dropped_chunk_is_in_no_summary(paths):
    path, _ = paths
    file, channel = file_of(path, 2)
    other = file.channel("/late", "json", file.schema("Late", "jsonschema", b"{}"))
    file.add(channel, 10**9, random(8))
    file.add(other, 10**9, random(9))
    with Limited(path.stat().st_size + 20), pytest.raises(OSError, match="File too large"):
        file.flush()
    file.finish()
    summary = reader(path.read_bytes()).get_summary()
    assert summary.statistics.message_count == 2
    assert (summary.statistics.message_start_time, summary.statistics.message_end_time) == (0, 1)
    assert [channel.topic for channel in summary.channels.values()] == ["/a"]
    assert summary.schemas == {}


def test_a_place_that_takes_nothing_is_refused_at_once():
    with pytest.raises(OSError, match="No space left on device"):
        McapFile(Path("/dev/full"))


def failing_behind_a_flush(path):
    with McapFile(path) as file:
        channel = file.channel("/a", "json")
        file.add(channel, 1, b"kept")
        file.flush()
        file.add(channel, 2, b"not")
        raise ZeroDivisionError


def test_an_error_in_its_block_leaves_what_was_flushed_and_no_summary(paths):
    path, _ = paths
    with pytest.raises(ZeroDivisionError):
        failing_behind_a_flush(path)
    assert list(prefix(path.read_bytes())) == [b"kept"]


class Untruncatable:
    """The file beneath, of which for a while nothing can be cut off, as on a disk that answers nothing."""

    def __init__(self, file):
        self._file = file
        self.answers = False

    def truncate(self, size):
        if not self.answers:
            raise OSError("Input/output error")
        return self._file.truncate(size)

    def __getattr__(self, name):
        return getattr(self._file, name)


def test_what_could_not_be_cut_off_at_once_is_cut_off_before_anything_is_written_behind_it(paths):
    path, _ = paths
    file, channel = file_of(path, 3)
    before = path.read_bytes()
    file._file = disk = Untruncatable(file._file)
    with Limited(len(before) + 60):
        file.add(channel, 4, random(4))
        with pytest.raises(OSError, match="File too large"):
            file.flush()
        with pytest.raises(OSError, match="Input/output error"):
            file.finish()
    assert path.stat().st_size == len(before) + 60
    disk.answers = True
    file.finish()
    assert path.read_bytes().startswith(before)
    assert [message.data for _, _, message in reader(path.read_bytes()).iter_messages()] == [
        random(number) for number in range(3)
    ]


@pytest.mark.parametrize("wrong", [(1, -1, b"before 1970"), (1, 5, None), (-1, 5, b"no channel")], ids=str)
def test_a_message_that_is_none_raises_and_leaves_a_whole_file_without_it(paths, wrong):
    path, _ = paths
    file, channel = file_of(path, 2)
    with pytest.raises((TypeError, struct.error)):
        file.extend([(channel, 2, random(2)), wrong])
    file.add(channel, 3, random(3))
    file.finish()
    assert [message.data for _, _, message in reader(path.read_bytes()).iter_messages()] == [
        random(number) for number in range(4)
    ]


def test_a_chunk_that_cannot_be_packed_is_left_out_and_the_file_is_finished_all_the_same(paths):
    path, _ = paths
    file, channel = file_of(path, 2)
    file.add(channel, 2, "no bytes")
    with pytest.raises(TypeError):
        file.flush()
    assert file.dropped == 1
    file.finish()
    assert reader(path.read_bytes()).get_summary().statistics.message_count == 2


def test_a_chunk_that_is_damaged_takes_no_topics_name_along_for_long(paths):
    path, _ = paths
    file = McapFile(path)
    channels = [file.channel(topic, "json", file.schema("S", "jsonschema", b"{}")) for topic in TOPICS]
    while path.stat().st_size < 2.2 * TOLD_AGAIN_BYTES:
        file.extend((channel, 1, random(number)) for number in range(300) for channel in channels)
        file.flush()
    file.finish()
    told = [[record.topic for record in breakup_chunk(chunk) if isinstance(record, Channel)]
            for chunk in chunks(path.read_bytes())]  # fmt: skip
    assert [topics for topics in told if topics] == [list(TOPICS)] * 3
    assert len(told) > 10
