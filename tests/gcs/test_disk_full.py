"""A disk that fills up in flight: the flight goes on, it is told at once, and nothing that was written is lost."""

import io
from contextlib import suppress
from pathlib import Path

import pytest
from disks import Limited, on_a_small_disk
from flights import SHORT, fly_and_record, messages, recorded
from mcap.exceptions import EndOfFile
from mcap.reader import SeekingReader
from mcap.records import Message, Metadata
from mcap.stream_reader import StreamReader

from gcs.recording.files import DROPPED, METADATA, PART, SCENARIO, further_parts
from gcs.recording.tlog import entries

MEBIBYTE = 1 << 20
SECOND = 10
"""Ticks."""


@pytest.fixture(scope="module")
def undisturbed():
    """The same flight on a disk with room for it."""
    return recorded("demo", *SHORT)


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """(what was told of it, the folder with what it left)."""
    disk, copies = (tmp_path_factory.mktemp(name) for name in ("disk", "copies"))
    script = Path(__file__).with_name("fly_on_a_small_disk.py")
    return on_a_small_disk(9 * MEBIBYTE, disk, script, disk, copies), copies


def said(flight, words):
    """The tick at which this was said, once."""
    (tick,) = (tick for tick, sentence in flight[0]["said"] if words in sentence)
    return tick


def last_tick(path):
    return sum(topic == "/tick" for topic, _, _ in messages(path))


def summary(path):
    with path.open("rb") as stream:
        reader = SeekingReader(stream, validate_crcs=True)
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        return reader.get_summary(), metadata[METADATA], [record.name for record in reader.iter_attachments()]


def test_the_flight_is_the_same_and_its_summary_says_what_is_missing(flight, undisturbed):
    told, _ = flight
    assert told["heading_error_deg"] == undisturbed.summary.heading_error_deg
    assert "run.mcap: the recording stopped: No space left on device; " in told["problem"]
    assert told["problem"].endswith(" messages are missing; it goes on in run.part2.mcap")


def test_it_is_told_within_a_second_of_the_first_tick_that_is_not_recorded(flight):
    assert said(flight, "run.mcap: the recording stopped: No space left on device") - SECOND <= last_tick(
        flight[1] / "run.mcap"
    )


def test_each_thing_is_said_once(flight):
    assert len(flight[0]["said"]) == 4  # that the recording and the journal stop, and that they go on


def test_what_the_full_disk_holds_is_a_recording_without_an_end_and_nothing_torn(flight, undisturbed):
    records = StreamReader(io.BytesIO((flight[1] / "full-run.mcap").read_bytes()), validate_crcs=True).records
    found = []
    with pytest.raises(EndOfFile):
        found.extend(record.data for record in records if isinstance(record, Message))
    assert found == [data for _, _, data in messages(undisturbed.path)][: len(found)]
    assert len(found) > 1000


def test_it_goes_on_in_another_file_when_there_is_room_and_not_a_message_is_counted_wrongly(flight, undisturbed):
    _, folder = flight
    whole, (first, second) = messages(undisturbed.path), (messages(path) for path in parts(folder))
    assert whole[: len(first)] == first
    assert whole[-len(second) :] == second
    _, metadata, attachments = summary(folder / "run.part2.mcap")
    assert metadata[PART] == "2"
    assert int(metadata[DROPPED]) == len(whole) - len(first) - len(second)
    assert f"{metadata[DROPPED]} messages are missing" in flight[0]["problem"]
    assert attachments == [SCENARIO]


def parts(folder):
    return [folder / "run.mcap", *further_parts(folder / "run.mcap")]


def test_when_there_is_room_the_first_file_is_given_its_summary_too(flight):
    for path in parts(flight[1]):
        index, metadata, _ = summary(path)
        assert index.statistics.message_count == len(messages(path))
        assert metadata["scenario"] == "demo"


def test_the_journal_too_goes_on_and_counts_what_it_lacks(flight, undisturbed):
    told, folder = flight
    whole = [data for topic, _, data in messages(undisturbed.path) if topic.endswith("/raw")]
    noted, before = ([entry.raw for entry in entries(folder / name)] for name in ("run.tlog", "full-run.tlog"))
    behind = len(noted) - len(before)
    assert noted == whole[: len(before)] + whole[-behind:]
    assert len(whole) - len(noted) == told["missing"]
    assert said(flight, f"run.tlog: the journal goes on; {told['missing']} frames are missing") > said(
        flight, "run.tlog: the journal misses frames: No space left on device"
    )


def test_the_journal_holds_frames_that_the_recording_has_no_room_for(flight):
    _, folder = flight
    recorded = sum(topic.endswith("/raw") for topic, _, _ in messages(folder / "run.mcap"))
    assert len(list(entries(folder / "full-run.tlog"))) > recorded + 100


def held(path):
    """(its metadata, how many messages it holds), whether or not there was room for its summary."""
    records, found = StreamReader(io.BytesIO(path.read_bytes()), validate_crcs=True).records, []
    with suppress(EndOfFile):
        found.extend(records)
    metadata = next(record.metadata for record in found if isinstance(record, Metadata))
    return metadata, sum(isinstance(record, Message) for record in found)


def test_a_recording_goes_on_in_as_many_files_as_it_takes(tmp_path, undisturbed):
    """Here no file may grow beyond so much, and what is written next to it has room again."""
    heard = []
    with Limited(250_000):
        flight = fly_and_record("demo", *SHORT, out=tmp_path, say=heard.append)
    found = parts(tmp_path)
    assert len(found) > 2
    assert [held(path)[0][PART] for path in found] == [str(number + 1) for number in range(len(found))]
    missing = len(messages(undisturbed.path)) - sum(held(path)[1] for path in found)
    assert f"{missing} messages are missing; it goes on in {found[-1].name}" in flight.summary.problem
    assert [words.split(": ")[1] for words in heard if "the recording goes on" in words] == [*map(str, found[1:])]


def test_a_recording_that_never_goes_on_leaves_what_it_had_and_says_so(tmp_path):
    heard = []
    (tmp_path / "run.part2.mcap").mkdir()
    with Limited(100_000):
        flight = fly_and_record("demo", *SHORT, out=tmp_path, say=heard.append)
    (stopped, *_), told = heard, f"{tmp_path}/run.mcap: the recording stopped: File too large; "
    assert stopped.startswith(f"gcs: {told}the flight goes on")
    assert flight.summary.problem.startswith(told)
    assert flight.summary.heading_error_deg is not None
    assert held(tmp_path / "run.mcap")[1] > 1000
