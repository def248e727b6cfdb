"""Other ground stations' logs: every whole frame comes out of them, and no other, whatever happened to the bytes."""

import struct

import pytest
from fastcrc import crc16
from hypothesis import example, given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs.recording.strays import JOURNAL
from gcs.recording.tlog import Entries, Entry, entries, packed

START_US = 1_700_000_000_000_000
EXTRAS = {number: kind.crc_extra for number, kind in dialect.mavlink_map.items()}
BEYOND = {0xABCDE: 77, 0xABCDF: 200}
"""Messages that our dialect lacks, and their CRC_EXTRA."""


def raw(message, payload, *, version=2, signed=False, sequence=0):
    """A frame of vehicle 7, by the book."""
    if version == 1:
        body = struct.pack("<BBBBB", len(payload), sequence, 7, 1, message) + payload
        magic = b"\xfe"
    else:
        low, high = message & 0xFFFF, message >> 16
        body = struct.pack("<BBBBBBHB", len(payload), signed, 0, sequence, 7, 1, low, high) + payload
        magic = b"\xfd"
    extra = (EXTRAS | BEYOND)[message]
    return magic + body + struct.pack("<H", crc16.mcrf4xx(body + bytes([extra]))) + b"\5signature 13b"[:13] * signed


@st.composite
def frames(draw, messages=(0, 30, 32, 84, 253)):
    """A frame of either version, signed or not."""
    version, message = draw(st.sampled_from([1, 2, 2])), draw(st.sampled_from(messages))
    payload = draw(st.binary(min_size=version == 2, max_size=60))
    signed = version == 2 and draw(st.booleans())
    return raw(
        message, payload, version=version if message < 256 else 2, signed=signed, sequence=draw(st.integers(0, 255))
    )


LOGS = st.lists(frames(), min_size=1, max_size=12).map(
    lambda raws: [Entry(START_US + place * 20_000, frame) for place, frame in enumerate(raws)]
)


def vouched(frame):
    """What a frame's CRC speaks for: all but its signature, which takes the key to check."""
    return frame[:-13] if frame[0] == 0xFD and frame[2] else frame


def on_disk(log):
    return b"".join(packed(entry.time_us * 1000, entry.raw) for entry in log)


def ends(log):
    """Where each entry of a log ends."""
    places, at = [], 0
    for entry in log:
        at += 8 + len(entry.raw)
        places.append(at)
    return places


def read(data):
    """The entries, and how many bytes were none."""
    found = Entries(data)
    return list(found), found.skipped


@given(LOGS)
def test_a_whole_log_is_read_to_the_byte(log):
    assert read(on_disk(log)) == (log, 0)


@given(LOGS, st.data())
def test_a_torn_tail_costs_the_torn_entry_alone(log, data):
    cut = data.draw(st.integers(0, ends(log)[-1]))
    whole = [entry for entry, end in zip(log, ends(log), strict=True) if end <= cut]
    assert read(on_disk(log)[:cut])[0] == whole


@given(LOGS, st.data())
def test_a_flipped_bit_costs_no_more_than_its_own_entry(log, data):
    """Its CRC does not speak for an entry's time and signature: with a bit flipped there it comes out as well, at a
    time that is not far off.
    """
    place = data.draw(st.integers(0, ends(log)[-1] * 8 - 1))
    damaged = bytearray(on_disk(log))
    damaged[place // 8] ^= 1 << place % 8
    hit = next(number for number, end in enumerate(ends(log)) if end > place // 8)
    found = list(Entries(bytes(damaged), JOURNAL))
    others = log[:hit] + log[hit + 1 :]
    if len(found) == len(log):
        was, now = log[hit], found.pop(hit)
        assert vouched(now.raw) == vouched(was.raw)
        at_an_end = hit in (0, len(log) - 1)
        assert len(log) < 3 or abs(now.time_us - was.time_us) <= (JOURNAL.silent_us if at_an_end else 300_000)
    assert len(log) < 3 or found == others


@given(LOGS, st.data())
def test_what_lies_between_entries_is_stepped_over(log, data):
    junk = data.draw(st.binary(min_size=1, max_size=400))
    at = data.draw(st.sampled_from([0, *ends(log)]))
    whole = on_disk(log)
    found, skipped = read(whole[:at] + junk + whole[at:])
    assert found == log
    assert skipped == len(junk)


@given(LOGS, st.data())
def test_a_piece_that_is_gone_or_overwritten_leaves_only_true_frames_in_their_order(log, data):
    first, last = sorted(data.draw(st.tuples(*[st.integers(0, ends(log)[-1])] * 2)))
    whole = on_disk(log)
    rest = data.draw(st.sampled_from([b"", bytes(last - first), b"\xff" * (last - first)]))
    found, _ = read(whole[:first] + rest + whole[last:])
    true = iter(log)
    assert all(any(vouched(entry.raw) == vouched(one.raw) for one in true) for entry in found)
    before = sum(end <= first for end in ends(log))
    assert found[:before] == log[:before]


@given(st.binary(max_size=2000))
@example(b"\0" * 8 + b"\xfd")
@example(b"\0" * 8 + b"\xfe\0\0\1\1")
def test_what_is_no_log_holds_nothing(data):
    assert read(data) == ([], len(data))


def test_a_frame_between_two_damaged_ones_is_kept():
    log = told(*range(START_US, START_US + 5))
    damaged = bytearray(on_disk(log))
    for number in (1, 3):
        damaged[ends(log)[number] - 1] ^= 0xFF
    assert read(bytes(damaged))[0] == log[::2]


def test_frames_without_times_are_no_log():
    """As in the .raw that MAVProxy writes beside its log: what precedes a frame may look like a time."""
    frames = [raw(30, bytes(6), sequence=sequence) for sequence in range(200)]
    assert read(b"".join(frames) + b"\1")[0] == []


def told(*times_us):
    """A log with a frame at each of these times."""
    return [Entry(time_us, raw(30, b"%d" % place)) for place, time_us in enumerate(times_us)]


@pytest.mark.parametrize("bit", range(28, 64))
@pytest.mark.parametrize("hit", [{0}, {1}, {5}, {6}, {0, 1}, {2, 3}, {5, 6}, {1, 2, 3, 4}])
def test_a_frame_whose_time_cannot_be_has_that_of_the_one_before(hit, bit):
    """Or of one behind it, where it is the first; in our journals, well within what tells two notes of one frame."""
    log = told(*range(START_US, START_US + 7 * 20_000, 20_000))
    wrong = [Entry(time_us ^ (place in hit) << bit - place % 2, raw) for place, (time_us, raw) in enumerate(log)]
    found = Entries(on_disk(wrong), JOURNAL)
    read = list(found)
    assert [entry.raw for entry in read] == [entry.raw for entry in log]
    assert all(read[place] == entry for place, entry in enumerate(log) if place not in hit)
    assert all(abs(now.time_us - was.time_us) <= 100_000 for now, was in zip(read, log, strict=True))
    assert (found.mended, found.skipped) == (len(hit), 0)


def test_a_log_in_which_nothing_has_a_time_is_none():
    log = told(1 << 60, 1 << 61)
    assert read(on_disk(log)) == ([], len(on_disk(log)))


@pytest.mark.parametrize(
    "times_us",
    [
        (0, 5, START_US, START_US + 5),
        (START_US, START_US + 5, START_US - 10**10, START_US - 10**10 + 5),
        (START_US, START_US + 60_000_000, START_US + 3_600_000_000),
        (START_US, START_US + 60_000_000, START_US + 7_200_000_000, START_US + 7_200_000_005),
        (START_US, START_US - 400_000, START_US + 10),
    ],
    ids=["a clock is set", "a clock is set back", "silence", "long silence", "links out of order"],
)
def test_clocks_and_links_that_behave_as_they_do_are_no_damage(times_us):
    log = told(*times_us)
    assert read(on_disk(log)) == (log, 0)


def test_a_message_beyond_our_dialect_is_kept_when_another_bears_it_out():
    log = [Entry(START_US, frame) for frame in (raw(0xABCDE, b"one"), raw(0, b"\1"), raw(0xABCDE, b"and another"))]
    assert read(on_disk(log)) == (log, 0)
    assert read(on_disk(log[:2]))[0] == log[1:2]


@given(st.lists(frames(messages=(0, *BEYOND)), min_size=3, max_size=12), st.data())
def test_a_flipped_bit_makes_no_message_beyond_our_dialect(raws, data):
    log = [Entry(START_US, frame) for frame in raws]
    place = data.draw(st.integers(0, ends(log)[-1] * 8 - 1))
    damaged = bytearray(on_disk(log))
    damaged[place // 8] ^= 1 << place % 8
    true = iter(raws)
    assert all(any(vouched(entry.raw) == vouched(one) for one in true) for entry in read(bytes(damaged))[0])


def test_a_log_is_a_file(tmp_path):
    log = told(START_US, START_US + 1)
    (tmp_path / "mav.tlog").write_bytes(on_disk(log))
    assert list(entries(tmp_path / "mav.tlog")) == log
    with pytest.raises(FileNotFoundError):
        entries(tmp_path / "other.tlog")
