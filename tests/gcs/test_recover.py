"""Recordings that were torn, damaged or cut into parts: what is made of them, and that none of it is wrong."""

import random
import shlex
from io import BytesIO
from itertools import accumulate, pairwise

import orjson
import pytest
from flights import SOAK, fly_and_record, messages, scratch
from hypothesis import given
from hypothesis import strategies as st
from mcap import records
from mcap.reader import SeekingReader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import Writer

from gcs.output import Unwritable
from gcs.recording.channels import RAW, Channel, Message, raw_topic
from gcs.recording.files import DROPPED, METADATA, PART, SCENARIO
from gcs.recording.history import load
from gcs.recording.mcap_file import McapFile
from gcs.recording.merge import completed
from gcs.recording.reader import SENT, UnreadableRecording, read
from gcs.recording.recover import rebuilt
from gcs.recording.salvage import salvage
from gcs.recording.seal import sealed
from gcs.recording.strays import JOURNAL
from gcs.recording.tally import Tally
from gcs.recording.tlog import Entries, Entry, packed
from gcs.recording.writer import PROMPTLY_NS
from gcs.replay.verify import decide_again
from gcs.session import Recording
from wire.frames import Sender

CUTS, FLIPS = (10_000, 1_000) if SOAK else (60, 120)
FEW = ("time.timeout_s=1.5", "swarm.rows=1", "swarm.columns=2", "swarm.leaders=[1]")
PERIOD_NS = 100_000_000


@pytest.fixture(scope="module")
def small():
    """A recording of seconds, in chunks as small as those of live flights."""
    return fly_and_record("demo", *FEW, recording=Recording(flush_ns=PROMPTLY_NS)).path


@pytest.fixture(scope="module")
def true(small):
    return messages(small)


@pytest.fixture(scope="module")
def chunks(small):
    """(end in the file, messages up to it) of each chunk."""
    data = small.read_bytes()
    every = [one for one in StreamReader(BytesIO(data), emit_chunks=True).records if isinstance(one, Chunk)]
    indexes = SeekingReader(BytesIO(data)).get_summary().chunk_indexes
    ends = [index.chunk_start_offset + index.chunk_length for index in indexes]
    counts = (sum(isinstance(record, records.Message) for record in breakup_chunk(chunk)) for chunk in every)
    return list(zip(ends, accumulate(counts), strict=True))


def folder_of(data, *, journal=None, **parts):
    """A run's folder with these bytes of its recording, its journal and further parts."""
    folder = scratch()
    for name, content in {"run.mcap": data, "run.tlog": journal, **parts}.items():
        if content is not None:
            (folder / name).write_bytes(content)
    return folder


def recovered(data, *, journal=None, **parts):
    """What is made of these bytes, with those of a journal and of further parts: how, and its messages."""
    folder = folder_of(data, journal=journal, **parts)
    out = folder / "recovered.mcap"
    recovery = rebuilt(folder / "run.mcap", journal=None, out=out)
    return recovery, messages(out if recovery.out else folder / "run.mcap")


def journal_of(every):
    return b"".join(packed(time_ns, data) for topic, time_ns, data in every if topic.endswith("/raw"))


def flipped(data, rng):
    wrong, bit = bytearray(data), rng.randrange(len(data) * 8)
    wrong[bit // 8] ^= 1 << bit % 8
    return bytes(wrong)


def test_of_a_file_cut_short_anywhere_all_whole_chunks_are_recovered_and_nothing_else(small, true, chunks):
    data, rng = small.read_bytes(), random.Random(1)
    for size in (rng.randrange(len(data)) for _ in range(CUTS)):
        whole = max((count for end, count in chunks if end <= size), default=0)
        if whole == 0:
            with pytest.raises(UnreadableRecording, match="no MCAP file, or nothing that a CRC vouches for is left"):
                recovered(data[:size])
        else:
            assert recovered(data[:size])[1] == true[:whole]


def test_a_flipped_bit_costs_one_chunk_at_most_and_whatever_is_left_is_true(small, true, chunks):
    data, rng = small.read_bytes(), random.Random(2)
    counts = [0, *(count for _, count in chunks)]
    without = [true[:before] + true[after:] for before, after in pairwise(counts)]
    for _ in range(FLIPS):
        recovery, found = recovered(flipped(data, rng))
        assert found == true or found in without
        assert found == true or recovery.damaged_bytes > 0


def test_a_flipped_bit_in_a_torn_file_costs_no_more(small, true, chunks):
    rng, (end, count) = random.Random(3), chunks[-2]
    torn = small.read_bytes()[:end]
    unnamed = 0
    for _ in range(FLIPS // 4):
        recovery, found = recovered(flipped(torn, rng))
        unnamed += recovery.parts[0].unnamed
        assert set(found) <= set(true[:count])
        assert count - len(found) <= recovery.parts[0].unnamed + max(
            after - before for (_, before), (_, after) in zip([(0, 0), *chunks], chunks, strict=False)
        )
    assert unnamed > 0 or not SOAK


def test_frames_whose_topic_is_lost_with_the_first_chunk_are_known_by_their_sender(small, true, chunks):
    (_, first), (end, count) = chunks[0], chunks[-1]
    torn = bytearray(small.read_bytes()[:end])
    torn[chunks[0][0] - 100] ^= 1
    recovery, found = recovered(bytes(torn))
    frames = [message for message in true[first:count] if message[0].endswith("/raw")]
    assert [message for message in found if message[0].endswith("/raw")] == frames
    assert recovery.parts[0].unnamed == count - first - len(found)
    assert "lost with the name of their topic" in recovery.metadata()["words"]


def test_topics_are_told_again_often_enough_that_a_torn_long_recording_keeps_them(tmp_path):
    with McapFile(tmp_path / "long.mcap") as file:
        channel = file.channel("/tick", "json", file.schema("trustr.Tick", "jsonschema", b"{}"))
        for time in range(200):
            file.add(channel, time, random.Random(time).randbytes(10_000))
            file.flush()
    data = bytearray((tmp_path / "long.mcap").read_bytes()[:-1000])
    data[5000] ^= 1
    left = salvage(bytes(data))
    assert len(left.damage) == 1
    assert (left.counts.total(), left.unnamed) == (199, 0)
    assert {message.channel[:3] for message in left.messages()} == {("/tick", "json", "trustr.Tick")}


def test_metadata_with_a_flipped_bit_is_not_believed(small):
    data = bytearray(small.read_bytes())
    data[data.index(b"python") + len(b"python....")] ^= 1
    recovery, _ = recovered(bytes(data))
    assert recovery.lacking == ["its metadata: versions, seed, and when it was flown"]
    assert "its metadata" in load(recovery.out).recovered["lost"]


class Flying:
    """A made-up flight: what it received and sent, and its topics, tick by tick; in a journal, a moment later."""

    def __init__(self, turns):
        vehicles, station = [Sender(1, 1), Sender(2, 1)], Sender(255, 190)
        self.messages, self.journal = [], []
        for number, (came, went) in enumerate(turns):
            tick_ns = (1_000 + number) * PERIOD_NS
            for place in range(came):
                system = place % 2
                raw = vehicles[system].frame(0, bytes([number, place, 1]))
                self._add(raw_topic(system + 1, 1), tick_ns - PERIOD_NS // 2 + place * 1000, raw, later_ns=0)
            for place in range(went):
                raw = station.frame(0, bytes([number, place, 1]))
                for _vehicle in vehicles:
                    self._add(SENT, tick_ns + 5_000_000 + place * 1000, raw, later_ns=50_000)
            for topic in ("/swarm/state", "/tick"):
                data = orjson.dumps({"tick": number, "topic": topic})
                self.messages.append(Message(Channel(topic, "json"), tick_ns, data))

    def _add(self, topic, time_ns, raw, *, later_ns):
        self.messages.append(Message(Channel(topic, RAW), time_ns, raw))
        self.journal.append(Entry((time_ns + later_ns) // 1000, raw))


TURNS = st.lists(st.tuples(st.integers(0, 3), st.integers(0, 2)), min_size=1, max_size=8).map(Flying)


def read_alike(every):
    return [(message.channel.topic, message.data) for message in every]


@given(TURNS, st.data())
def test_with_a_whole_journal_every_frame_is_put_where_it_was(flying, data):
    lost = data.draw(st.sets(st.integers(0, len(flying.messages) - 1)))
    left = [message for place, message in enumerate(flying.messages) if place not in lost]
    expected = [one for place, one in enumerate(flying.messages) if place not in lost or one.channel.encoding == RAW]
    assert read_alike(completed(left, flying.journal, period_ns=PERIOD_NS)) == read_alike(expected)


@given(TURNS, st.data())
def test_what_either_has_is_kept_in_its_order_and_nothing_is_there_twice(flying, data):
    lost = data.draw(st.sets(st.integers(0, len(flying.messages) - 1)))
    left = [message for place, message in enumerate(flying.messages) if place not in lost]
    skipped = data.draw(st.sets(st.integers(0, max(0, len(flying.journal) - 1))))
    journal = [entry for place, entry in enumerate(flying.journal) if place not in skipped]
    found = read_alike(completed(left, journal, period_ns=PERIOD_NS))
    assert is_within(read_alike(left), found)
    assert is_within([entry.raw for entry in journal], [content for _, content in found])
    either = {entry.raw for entry in journal} | {message.data for message in left}
    assert set(found) == {one for one in read_alike(flying.messages) if one[1] in either}
    assert len(found) <= len(flying.messages)


def is_within(few, many):
    """Whether the few stand among the many, in their order."""
    rest = iter(many)
    return all(one in rest for one in few)


def test_a_wrong_time_among_frames_that_read_alike_is_of_that_frame_alone():
    """A heartbeat leaves for several vehicles at once."""
    flying = Flying([(0, 1)] * 3)
    first, *others = flying.journal
    wrong = [first._replace(time_us=first.time_us + (1 << 41)), *others]
    assert len(list(completed(flying.messages, wrong, period_ns=PERIOD_NS))) == len(flying.messages) + 1


def test_a_damaged_time_in_a_journal_makes_no_frame(small, true):
    messages, journal, rng = list(salvage(small.read_bytes()).messages()), journal_of(true), random.Random(4)
    starts = [0, *accumulate(len(data) + 8 for topic, _, data in true if topic.endswith("/raw"))][:-1]
    for start in (starts[0], starts[-1], *rng.choices(starts, k=40)):
        wrong = bytearray(journal)
        wrong[start + rng.randrange(8)] ^= 1 << rng.randrange(8)
        entries = list(Entries(bytes(wrong), JOURNAL))
        assert list(completed(messages, entries, period_ns=PERIOD_NS)) == messages


def test_a_journal_of_another_flight_is_left_out_and_where_it_was_named_refused(small, true, gcs):
    data = small.read_bytes()
    other = b"".join(packed(entry.time_us * 1000, entry.raw) for entry in Flying([(3, 2)] * 20).journal)
    torn = folder_of(data[: len(data) // 2], journal=other)
    code, out, _ = gcs("log", "recover", torn, "--json")
    told = orjson.loads(out)
    assert (code, told["frames_added"], told["journal"]) == (0, 0, None)
    assert "another flight" in told["left_out"][str(torn / "run.tlog")]
    assert set(messages(torn / "run-recovered.mcap")) <= set(true)
    code, _, err = gcs("log", "recover", torn, "--journal", torn / "run.tlog", "--out", torn / "named.mcap")
    assert (code, err.count("\n")) == (2, 1)
    assert "it is the journal of another flight: none of its frames was noted while the recording was" in err
    assert not (torn / "named.mcap").exists()
    assert "nothing to recover" in gcs("log", "recover", folder_of(data, journal=other))[1]


@pytest.mark.parametrize(
    ("shared", "due", "same"),
    [(0, 0, False), (0, 400, False), (2265, 3258, False), (3258, 3258, True), (95, 100, True)],
)
def test_flights_of_one_scenario_have_much_in_common_and_notes_of_one_flight_nearly_all(shared, due, same):
    """The third: the demo, flown with seeds 1 and 2, and torn at 16 s."""
    told = Tally(messages=5000, begin_ns=0, end_ns=16 * 10**9, added=0, shared=shared, due=due)
    assert told.of_one_flight is same


def test_a_torn_recording_with_its_journal_has_every_frame_and_is_decided_again_as_far_as_its_ticks_go(small, true):
    data = small.read_bytes()
    recovery, found = recovered(data[: len(data) // 2], journal=journal_of(true))
    frames = [content for topic, _, content in true if topic.endswith("/raw")]
    assert [content for topic, _, content in found if topic.endswith("/raw")] == frames
    assert recovery.added > 0
    again = decide_again(recovery.out)
    assert again.difference is None
    assert again.ticks == sum(topic == "/tick" for topic, _, _ in found)


def test_a_recording_damaged_in_the_middle_with_its_journal_lacks_ticks_and_says_so(small, true, chunks):
    data = bytearray(small.read_bytes())
    data[chunks[5][0] - 50] ^= 8
    recovery, found = recovered(bytes(data), journal=journal_of(true))
    assert [one for one in found if one[0].endswith("/raw")] == [one for one in true if one[0].endswith("/raw")]
    gap = set(range(16)) - set(load(recovery.out).number.tolist())
    assert len(gap) == 1
    verification = decide_again(recovery.out)
    assert verification.difference is None
    assert verification.gaps[0].first in gap
    assert not verification.identical


def written(path, every, source, *, number, dropped, finish):
    """A part of a recording."""
    file, channels = McapFile(path), {}
    about = next(one for one in source.metadata if one.name == METADATA).metadata
    file.metadata(METADATA, sealed(METADATA, about | {PART: str(number), DROPPED: str(dropped)}))
    scenario = source.attachments[0]
    file.attach(0, SCENARIO, scenario.media_type, scenario.data)
    for (topic, encoding, *_schema), time_ns, data in every:
        if topic not in channels:
            channels[topic] = file.channel(topic, encoding)
        file.add(channels[topic], time_ns, data)
    file.flush()
    if finish:
        file.finish()
    file.close()
    return path.read_bytes()


@pytest.fixture(scope="module")
def parts(small):
    """The recording as a disk that was full for a third of it left it, torn."""
    left, folder = salvage(small.read_bytes()), scratch()
    every = list(left.messages())
    third = len(every) // 3
    first = written(folder / "1", every[:third], left, number=1, dropped=0, finish=False)
    second = written(folder / "2", every[2 * third :], left, number=2, dropped=third, finish=False)
    return first, second, third


def test_parts_are_joined_and_what_the_disk_did_not_take_is_told(parts, true):
    first, second, third = parts
    recovery, found = recovered(first, **{"run.part2.mcap": second})
    assert found == true[:third] + true[2 * third :]
    assert recovery.dropped == third
    assert read(recovery.out).scenario.swarm.count == 2
    assert f"{third} messages that the disk did not take" in load(recovery.out).recovered["words"]


def test_parts_are_joined_in_the_order_that_they_tell_whatever_they_are_called(parts, true):
    first, second, third = parts
    recovery, found = recovered(second, **{"run.part2.mcap": first})
    assert found == true[:third] + true[2 * third :]
    assert [part.path.name for part in recovery.parts] == ["run.part2.mcap", "run.mcap"]


def test_a_part_of_another_flight_is_left_out(parts, true):
    first, second, third = parts
    other = salvage(second)
    for record in other.metadata:
        record.metadata["started"] = "2001-01-01T00:00:00+00:00"
    foreign = written(scratch() / "foreign", list(other.messages()), other, number=2, dropped=0, finish=False)
    recovery, found = recovered(first, **{"run.part2.mcap": foreign, "run.part3.mcap": second})
    assert found == true[:third] + true[2 * third :]
    assert [(path.name, why) for path, why in recovery.left_out] == [("run.part2.mcap", "it is of another flight")]


def test_a_part_that_is_missing_is_told_though_it_is_the_first(parts, true):
    _, second, third = parts
    recovery, found = recovered(None, **{"run.part2.mcap": second})
    assert (found, recovery.missing) == (true[2 * third :], [1])
    assert "part 1 of the recording: it is not there" in recovery.metadata()["words"]


def test_whoever_names_a_part_is_sent_to_the_whole(parts, gcs):
    first, second, _ = parts
    folder = folder_of(first, **{"run.part2.mcap": second})
    code, _, err = gcs("log", "recover", folder / "run.part2.mcap")
    assert (code, err.count("\n")) == (2, 1)
    assert f"gcs log recover {folder / 'run.mcap'} joins all" in err


def test_the_frames_that_the_disk_did_not_take_come_from_the_journal(parts, true):
    first, second, third = parts
    recovery, found = recovered(first, journal=journal_of(true), **{"run.part2.mcap": second})
    frames = [content for topic, _, content in true if topic.endswith("/raw")]
    assert [content for topic, _, content in found if topic.endswith("/raw")] == frames
    assert recovery.added == sum(topic.endswith("/raw") for topic, _, _ in true[third : 2 * third])


def test_a_whole_recording_needs_none_of_it(small, gcs):
    code, out, _ = gcs("log", "recover", small)
    assert code == 0
    assert "nothing to recover" in out
    assert not small.with_name("run-recovered.mcap").exists()
    code, out, _ = gcs("log", "recover", small, "--json")
    assert (code, orjson.loads(out)["recovered"]) == (0, None)


@pytest.mark.parametrize(
    ("options", "vouched"),
    [({}, True), ({"enable_crcs": False}, False), ({"use_chunking": False}, False)],
    ids=["as usual", "without CRCs", "without chunks"],
)
def test_another_programs_file_that_is_whole_needs_none_of_it_and_is_not_called_damaged(
    options, vouched, tmp_path, gcs
):
    with (tmp_path / "camera.mcap").open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start(library="another")
        channel = writer.register_channel("/camera", "cdr", writer.register_schema("sensor/Image", "ros2msg", b"x"))
        for time_ns in range(100):
            writer.add_message(channel, time_ns, b"pixels", time_ns)
        writer.finish()
    code, out, _ = gcs("log", "recover", tmp_path / "camera.mcap")
    assert code == 0
    assert "whole: 100 messages" in out
    assert ("no CRC vouches for 100 of them" in out) is not vouched
    assert "nothing to recover" in out
    assert [path.name for path in tmp_path.iterdir()] == ["camera.mcap"]


def test_an_imported_log_needs_none_of_it(true, gcs, tmp_path):
    (tmp_path / "mav.tlog").write_bytes(journal_of(true))
    assert gcs("log", "import", tmp_path / "mav.tlog")[0] == 0
    code, out, _ = gcs("log", "recover", tmp_path / "mav.mcap")
    assert (code, "nothing to recover" in out) == (0, True)


def test_what_was_found_lost_and_written_is_told_in_words_and_as_json(small, true, gcs, tmp_path):
    data = small.read_bytes()
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(data[: len(data) // 2])
    (tmp_path / "torn.tlog").write_bytes(journal_of(true))
    code, out, _ = gcs("log", "recover", torn)
    assert code == 0
    for words in ("torn: it ends without its summary", "cannot be read", "frames added", "torn-recovered.mcap"):
        assert words in out
    code, out, _ = gcs("log", "recover", torn, "--json", "--out", tmp_path / "other.mcap")
    told = orjson.loads(out)
    assert told["messages"] == len(messages(tmp_path / "other.mcap"))
    assert told["frames_added"] > 0
    assert told["parts"][0]["ended"] is False
    assert torn.read_bytes() == data[: len(data) // 2]


def test_what_is_there_already_is_not_overwritten(small, tmp_path):
    (tmp_path / "run.mcap").write_bytes(small.read_bytes()[:-100])
    with pytest.raises(Unwritable, match="is there already"):
        rebuilt(tmp_path / "run.mcap", journal=None, out=tmp_path / "run.mcap")


@pytest.mark.parametrize("content", [b"", b"hello\n" * 1000, bytes(5000)], ids=["empty", "text", "zeros"])
def test_a_file_of_which_nothing_is_left_is_refused_in_a_sentence(content, gcs, tmp_path):
    (tmp_path / "run.mcap").write_bytes(content)
    code, out, err = gcs("log", "recover", tmp_path)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert "no MCAP file, or nothing that a CRC vouches for is left" in err


def test_a_journal_alone_is_to_be_imported(true, gcs, tmp_path):
    journal = tmp_path / "run.tlog"
    journal.write_bytes(journal_of(true))
    for named, why in ((journal, "no recording:"), (tmp_path, "is not there;")):
        code, _, err = gcs("log", "recover", named)
        assert code == 2
        assert f": {why} gcs log import {journal} makes " in err


def test_refusals_of_torn_recordings_name_the_command_that_rebuilds_them(small, tmp_path, gcs):
    torn = tmp_path / "my run.mcap"
    torn.write_bytes(small.read_bytes()[:-100])
    with pytest.raises(UnreadableRecording, match=r"my run\.mcap: torn or damaged; .* rebuilds it$") as told:
        read(torn)
    command = str(told.value).split("; ")[1].removesuffix(" rebuilds it")
    assert gcs(*shlex.split(command)[1:])[0] == 0
    assert len(messages(tmp_path / "my run-recovered.mcap")) > 0
