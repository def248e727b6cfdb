"""A journal holds every frame of a flight in whole entries, each before it goes, and stops nothing when it cannot."""

import os
from pathlib import Path

import pytest
from disks import Limited
from flights import SHORT, Arriving, Counting, Saying, failing, fly_and_record, messages, scratch
from hypothesis import given
from hypothesis import strategies as st

from gcs.lockstep import Lockstep
from gcs.recording.files import RecordingError
from gcs.recording.journal import Journal, Journaled
from gcs.recording.tlog import entries, packed
from gcs.session import Recording, flown
from scenarios import load
from wire.frames import Sender
from wire.payloads import LOCAL_POSITION_NED

NOW_NS, SECOND_NS = 1_600_000_000_123_456_789, 1_000_000_000


def silent(words):
    raise AssertionError(words)


def journaled(folder, *words, **options):
    """The demo, flown with a journal."""
    with Journal(folder / "run.tlog", silent) as journal:
        return fly_and_record(
            "demo",
            *words,
            out=folder,
            through=lambda world, _clock: Arriving(world, journal.arrived),
            recording=Recording(journal=journal),
            **options,
        )


def test_it_holds_the_frames_of_the_recording_in_their_order_and_at_their_times(tmp_path):
    flight = journaled(tmp_path, *SHORT)
    raw = [(time_ns // 1000, data) for topic, time_ns, data in messages(flight.path) if topic.endswith("/raw")]
    assert list(entries(tmp_path / "run.tlog")) == raw
    assert len(raw) > 3000


class Nothing:
    """A clock and a link on which nothing comes; what is sent is looked for on the disk first."""

    def __init__(self, path=None):
        self._path = path
        self.noted_first, self.sent = [], []
        self.rejected = 3

    def now(self):
        return NOW_NS

    def receive(self):
        return []

    def send(self, system, frame):
        self.sent.append((system, frame))
        if self._path is not None:
            self.noted_first.append(self._path.read_bytes().endswith(packed(NOW_NS, frame)))


def frame(number):
    return Sender(1 + number % 250, 1).frame(LOCAL_POSITION_NED, bytes(4 * [number % 256]))


def test_a_frame_is_on_the_disk_before_it_is_sent(tmp_path):
    board = Nothing(tmp_path / "run.tlog")
    with Journal(tmp_path / "run.tlog", silent) as journal:
        link = Journaled(board, board, journal)
        for number in range(5):
            link.send(number, frame(number))
    assert board.noted_first == [True] * 5
    assert link.rejected == 3


def test_a_journal_that_cannot_be_written_keeps_no_frame_from_leaving(tmp_path):
    board, said = Nothing(), []
    with Journal(tmp_path / "run.tlog", said.append) as journal, Limited(0):
        link = Journaled(board, board, journal)
        for number in range(5):
            link.send(number, frame(number))
    assert board.sent == [(number, frame(number)) for number in range(5)]
    assert said == [f"gcs: {tmp_path}/run.tlog: the journal misses frames: File too large; the flight goes on"]
    assert journal.problem == f"{tmp_path}/run.tlog: 5 frames are missing: File too large"


def test_not_even_a_journal_that_is_broken_keeps_a_frame_from_leaving(tmp_path):
    board = Nothing()
    with Journal(tmp_path / "run.tlog", silent) as journal:
        journal.note = None
        with pytest.raises(TypeError):
            Journaled(board, board, journal).send(1, frame(1))
    assert board.sent == [(1, frame(1))]


@given(st.lists(st.tuples(st.integers(0, 60), st.integers(1, 8)), min_size=1, max_size=8))
def test_whatever_fits_is_noted_whole_and_the_rest_is_counted(rounds):
    """rounds: how many bytes there is room for beyond what is there, and how many frames come then."""
    path, said, number, noted = scratch() / "run.tlog", [], 0, 0
    with Journal(path, said.append) as journal:
        for room, count in rounds:
            with Limited(path.stat().st_size + room):
                for _ in range(count):
                    journal.note(NOW_NS, frame(number))
                    number += 1
            held = [entry.raw for entry in entries(path)]
            assert b"".join(packed(NOW_NS, raw) for raw in held) == path.read_bytes()
            assert noted <= len(held)
            noted = len(held)
            assert noted + journal.missing == number
    assert (journal.problem is None) == (noted == number)
    assert len(said) <= 2 * len(rounds)


def test_it_says_when_it_goes_on_and_what_it_lacks(tmp_path):
    said, path = [], tmp_path / "run.tlog"
    with Journal(path, said.append) as journal:
        for number in range(12):
            with Limited(70 if 3 <= number < 6 else 1000):
                journal.note(NOW_NS + number * SECOND_NS // 4, frame(number))
            if number == 8:
                assert len(said) == 1
    assert [entry.raw for entry in entries(path)] == [frame(number) for number in (0, 1, 2, *range(6, 12))]
    assert said[1:] == [f"gcs: {path}: the journal goes on; 3 frames are missing"]


def test_it_does_not_say_so_each_time_that_a_short_frame_still_fits(tmp_path):
    said, path = [], tmp_path / "run.tlog"
    with Journal(path, said.append) as journal:
        for number in range(40):
            with Limited(0 if number % 2 else 1000):
                journal.note(NOW_NS + number * SECOND_NS // 10, frame(number))
    assert [words.split(": ")[2] for words in said] == ["the journal misses frames"]
    assert journal.problem.startswith(f"{path}: 20 frames are missing: ")


def test_one_frame_that_is_missing_is_one(tmp_path):
    with Journal(tmp_path / "run.tlog", str) as journal, Limited(0):
        journal.note(NOW_NS, frame(1))
    assert journal.problem == f"{tmp_path}/run.tlog: 1 frame is missing: File too large"


@pytest.mark.parametrize("make", [Path.mkdir, os.mkfifo, Path.touch], ids=["folder", "pipe", "file"])
def test_it_takes_nobodys_place(tmp_path, make):
    """Nor waits for anybody to read from a pipe."""
    make(tmp_path / "run.tlog")
    with pytest.raises(RecordingError, match=r"run\.tlog: the journal cannot be written: File exists$"):
        Journal(tmp_path / "run.tlog", silent)


def test_what_the_last_resort_sends_is_in_it(tmp_path):
    """And in the recording."""
    sent = []
    with Journal(tmp_path / "run.tlog", silent) as journal:
        world = Lockstep.of(load("demo"), seed=1)
        link = Counting(world)
        with pytest.raises(ZeroDivisionError):
            flown(
                "demo",
                load("demo"),
                link,
                world,
                seed=1,
                out=tmp_path,
                operator=Saying(failing(31, ZeroDivisionError())),
                watching=lambda _flight: (),
                recording=Recording(journal=journal),
                say=sent.append,
            )
    noted = [entry.raw for entry in entries(tmp_path / "run.tlog")]
    assert noted == [frame for _, frame in link.sent]
    held = messages(tmp_path / "run.mcap")
    assert [data for topic, _, data in held if topic == "/mavlink/255_190/raw"] == noted
    assert sum(topic == "/mavlink/255_190/raw" for topic, _, _ in held[-2000:]) > 100
