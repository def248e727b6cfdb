"""Frames out of a byte stream: in pieces of any size, among noise, and behind headers that lie."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from wire.frames import LONGEST, PATIENCE_NS, Framer, Sender, StreamFramer

NOW = 1_700_000_000_000_000_000
HEARTBEAT = bytes([0xFD, 255, 0, 0, 0, 1, 1, 0, 0, 0])
"""A header that claims 255 bytes of payload, of a message that exists."""


def heartbeat(mode):
    return Sender(1, 1).pack(dialect.MAVLink_heartbeat_message(2, 12, 0x81, mode, 4, 3))


def pieces(data, sizes):
    """A stream as a line delivers it."""
    for size in sizes:
        if not data:
            return
        yield data[:size]
        data = data[size:]
    yield data


def heard(framer, data, sizes=(), time_ns=NOW):
    return [frame.raw for piece in pieces(data, sizes) for frame in framer.frames(time_ns, piece)]


frames = st.lists(st.integers(0, 2**32 - 1).map(heartbeat), max_size=8)
sizes = st.lists(st.integers(0, 40), max_size=60)


@given(frames, sizes)
def test_a_stream_gives_its_frames_in_whatever_pieces_it_comes(sent, cuts):
    framer = StreamFramer()
    assert heard(framer, b"".join(sent), cuts) == sent
    assert framer.waiting == framer.rejected == framer.garbage_bytes == 0


@given(frames, st.binary(max_size=40).map(lambda data: data.translate(None, b"\xfd\xfe")), sizes)
def test_noise_between_frames_costs_none(sent, noise, cuts):
    framer = StreamFramer()
    assert heard(framer, noise + b"".join(frame + noise for frame in sent), cuts) == sent
    assert framer.garbage_bytes == len(noise) * (len(sent) + 1)


@given(st.lists(st.binary(max_size=600), max_size=12))
def test_bytes_of_any_kind_raise_nothing_are_accounted_for_and_are_not_hoarded(chunks):
    framer, found = StreamFramer(), 0
    for chunk in chunks:
        found += sum(len(frame.raw) for frame in framer.frames(NOW, chunk))
        assert framer.waiting < LONGEST
    assert framer.garbage_bytes + found + framer.waiting == sum(map(len, chunks))


@given(st.binary(max_size=600), frames)
def test_once_its_patience_is_over_a_stream_gives_what_a_datagram_of_the_same_bytes_gives(junk, sent):
    data = junk + b"".join(sent)
    framer = StreamFramer()
    found = heard(framer, data, (7,) * 200) + heard(framer, b"", time_ns=NOW + PATIENCE_NS + 1)
    datagrams = Framer()
    assert found == [frame.raw for frame in datagrams.frames(NOW, data)]
    assert framer.rejections() == datagrams.rejections()
    assert framer.garbage_bytes == datagrams.garbage_bytes


def test_a_header_that_lies_about_its_length_delays_frames_and_loses_none():
    framer, sent = StreamFramer(), [heartbeat(mode) for mode in range(20)]
    found = [len(heard(framer, data)) for data in (HEARTBEAT, *sent)]
    assert sum(found) == 20
    assert found.index(13) == 13, "10 + 255 + 2 bytes claimed, 10 + 13 × 21 came"
    assert framer.rejections() == {"bad checksum": 1, "unknown message": 0, "cut short": 0}


def test_a_header_that_lies_delays_for_no_longer_than_a_frame_may_take():
    framer, beat = StreamFramer(), heartbeat(1)
    assert heard(framer, HEARTBEAT * 5 + beat) == []
    assert heard(framer, b"", time_ns=NOW + PATIENCE_NS) == []
    assert heard(framer, b"", time_ns=NOW + PATIENCE_NS + 1) == [beat]
    assert framer.rejections()["cut short"] == 5


def test_a_frame_that_began_late_has_its_own_time():
    framer, first, second = StreamFramer(), heartbeat(1), heartbeat(2)
    assert heard(framer, first[:5]) == []
    assert heard(framer, second[:5], time_ns=NOW + PATIENCE_NS + 1) == []
    assert heard(framer, second[5:], time_ns=NOW + 2 * PATIENCE_NS) == [second]


def test_a_slow_frame_that_is_complete_at_last_is_a_frame():
    framer, beat = StreamFramer(), heartbeat(1)
    assert heard(framer, beat[:5]) == []
    assert heard(framer, beat[5:], time_ns=NOW + 10 * PATIENCE_NS) == [beat]


@pytest.mark.parametrize("length", range(1, 21))
def test_a_frame_cut_short_costs_only_itself(length):
    framer = StreamFramer()
    sent = [heartbeat(mode) for mode in range(20)]
    assert heard(framer, sent[0] + sent[1][:length] + b"".join(sent[2:]) + bytes(LONGEST)) == [sent[0], *sent[2:]]


def test_frames_have_the_time_of_their_last_byte():
    framer, beat = StreamFramer(), heartbeat(1)
    framer.frames(NOW, beat[:-1])
    assert [frame.time_ns for frame in framer.frames(NOW + 5, beat[-1:])] == [NOW + 5]
