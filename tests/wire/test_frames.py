"""Frames: what pymavlink writes we read, what we write it reads, and nothing that is broken takes others with it."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from wire.frames import Framer, Sender, decode, sender_of, target_system

NOW = 1_700_000_000_000_000_000
MESSAGES = sorted(dialect.mavlink_map.items())
message_ids = st.sampled_from([number for number, _ in MESSAGES])
every_message = pytest.mark.parametrize(("number", "kind"), MESSAGES, ids=[kind.msgname for _, kind in MESSAGES])


def heartbeat(sender=None, mode=7):
    return (sender or Sender(1, 1)).pack(dialect.MAVLink_heartbeat_message(2, 12, 0x81, mode, 4, 3))


def cut(data):
    """(frames, framer) of one datagram."""
    framer = Framer()
    return framer.frames(NOW, data), framer


def raws(data):
    return [frame.raw for frame in cut(data)[0]]


@st.composite
def genuine(draw):
    """A frame of any message of the dialect with any payload."""
    number = draw(message_ids)
    size = dialect.mavlink_map[number].unpacker.size
    return Sender(draw(st.integers(1, 255)), draw(st.integers(1, 255))).frame(
        number, draw(st.binary(min_size=size, max_size=size))
    )


# --- ours against pymavlink's


@every_message
def test_frames_packed_by_hand_are_read_by_pymavlink_and_by_us(number, kind):
    payload = random.Random(number).randbytes(kind.unpacker.size - 1) + b"\1"
    data = Sender(7, 42).frame(number, payload)
    (frame,), _ = cut(data)
    told = dialect.MAVLink(None).decode(bytearray(data))
    assert (told.get_msgId(), told.get_srcSystem(), told.get_srcComponent()) == (number, 7, 42)
    assert frame == (NOW, 7, 42, number, payload, data)


@every_message
def test_target_system_is_what_pymavlink_decodes(number, kind):
    for seed in range(5):
        payload = random.Random(seed).randbytes(kind.unpacker.size - 1) + b"\1"
        (frame,), _ = cut(Sender(1, 1).frame(number, payload))
        assert target_system(frame) == getattr(decode(frame), "target_system", 0)


@every_message
def test_a_target_among_cut_off_zeros_is_everybody(number, kind):
    (frame,), _ = cut(Sender(1, 1).frame(number, bytes(kind.unpacker.size)))
    assert frame.payload == b"\0"
    assert target_system(frame) == 0


def test_one_sender_numbers_its_frames_in_one_row_however_they_are_packed():
    sender = Sender(3, 1)
    sequence = []
    for _ in range(150):
        sequence += [decode(frame).get_seq() for frame in cut(heartbeat(sender) + sender.frame(0, bytes(9)))[0]]
    assert sequence == [number % 256 for number in range(300)]


@given(st.integers(0, 2**32 - 1))
def test_a_message_comes_back_as_it_was_packed(mode):
    (frame,), _ = cut(heartbeat(Sender(250, 200), mode))
    beat = decode(frame)
    assert (beat.custom_mode, beat.type, beat.autopilot, beat.base_mode, beat.system_status) == (mode, 2, 12, 0x81, 4)
    assert (frame.system, frame.component, frame.message) == (250, 200, 0)


def test_mavlink_1_is_read_too():
    packer = dialect.MAVLink(None, srcSystem=9, srcComponent=1)
    data = bytes(dialect.MAVLink_heartbeat_message(2, 3, 0x51, 5, 4, 3).pack(packer, force_mavlink1=True))
    assert data[0] == 0xFE
    (frame,), framer = cut(data)
    assert (frame.system, frame.component, frame.message, frame.raw) == (9, 1, 0, data)
    assert decode(frame).custom_mode == 5
    assert framer.rejected == framer.garbage_bytes == 0


@given(st.integers(1, 255), st.integers(0, 255), st.booleans())
def test_a_frame_tells_its_sender_without_being_taken_apart(system, component, old):
    packer = dialect.MAVLink(None, srcSystem=system, srcComponent=component)
    message = dialect.MAVLink_heartbeat_message(2, 3, 0x51, 5, 4, 3)
    assert sender_of(bytes(message.pack(packer, force_mavlink1=old))) == (system, component)


def test_a_signed_frame_is_read_with_its_signature():
    packer = dialect.MAVLink(None, srcSystem=9, srcComponent=1)
    packer.signing.secret_key, packer.signing.sign_outgoing, packer.signing.timestamp = bytes(32), True, 1
    data = bytes(dialect.MAVLink_heartbeat_message(2, 3, 0x51, 5, 4, 3).pack(packer))
    (signed, plain), _ = cut(data + heartbeat())
    assert signed.raw == data
    assert len(data) == len(plain.raw) + 13
    assert signed.payload == bytes([5, 0, 0, 0, 2, 3, 0x51, 4, 3])


# --- many frames, and what may lie between them


@given(st.lists(genuine(), max_size=8))
def test_frames_of_a_datagram_are_told_apart_in_order(frames):
    found, framer = cut(b"".join(frames))
    assert [frame.raw for frame in found] == frames
    assert framer.rejected == framer.garbage_bytes == 0


junk = st.binary(max_size=40).map(lambda data: data.translate(None, b"\xfd\xfe"))


@given(st.lists(st.tuples(junk, genuine()), max_size=6), junk)
def test_garbage_between_frames_is_counted_and_costs_no_frame(pieces, rest):
    found, framer = cut(b"".join(garbage + frame for garbage, frame in pieces) + rest)
    assert [frame.raw for frame in found] == [frame for _, frame in pieces]
    assert framer.garbage_bytes == sum(len(garbage) for garbage, _ in pieces) + len(rest)
    assert framer.rejected == 0


@given(
    st.binary(max_size=600) | st.lists(st.sampled_from([b"\xfd", b"\xfe", b"\0", b"\xff"]), max_size=99).map(b"".join)
)
def test_bytes_of_any_kind_raise_nothing_and_every_one_is_accounted_for(data):
    found, framer = cut(data)
    assert framer.garbage_bytes + sum(len(frame.raw) for frame in found) == len(data)


@given(st.lists(genuine() | junk, max_size=6))
def test_every_byte_belongs_to_a_frame_or_to_the_garbage(pieces):
    data = b"".join(pieces)
    found, framer = cut(data)
    assert framer.garbage_bytes + sum(len(frame.raw) for frame in found) == len(data)


def test_a_frame_cut_short_at_any_byte_costs_only_itself():
    before, victim, after = heartbeat(mode=1), heartbeat(mode=2), heartbeat(mode=3)
    for length in range(len(victim)):
        assert raws(before + victim[:length] + after) == [before, after], f"cut after {length} bytes"


@pytest.mark.parametrize("length", range(1, 21))
def test_a_frame_cut_short_at_the_end_of_its_datagram_is_counted(length):
    victim = heartbeat(mode=2)
    assert len(victim) == 21
    found, framer = cut(heartbeat(mode=1) + victim[:length])
    assert len(found) == 1
    assert framer.truncated == 1
    assert framer.garbage_bytes == length


@pytest.mark.parametrize("magic", [0xFD, 0xFE])
def test_a_header_that_claims_255_bytes_does_not_eat_the_frames_behind_it(magic):
    liar = bytes([magic, 255, 0, 0, 0, 1, 1, 0, 0, 0])
    frames = [heartbeat(mode=mode) for mode in range(20)]
    assert raws(liar + b"".join(frames)) == frames
    assert raws(liar + frames[0]) == frames[:1]


def test_nothing_is_kept_from_one_datagram_for_the_next():
    framer, whole = Framer(), heartbeat()
    assert framer.frames(NOW, whole[:10]) == []
    assert framer.frames(NOW, whole[10:]) == []
    assert [frame.raw for frame in framer.frames(NOW, whole)] == [whole]


# --- what is refused, and counted


@pytest.mark.parametrize("byte", range(1, 21))
def test_a_frame_with_any_one_bit_flipped_is_refused_and_its_neighbour_is_not(byte):
    for bit in range(8):
        spoilt = bytearray(heartbeat(mode=1))
        spoilt[byte] ^= 1 << bit
        healthy = heartbeat(mode=2)
        found, framer = cut(bytes(spoilt) + healthy)
        assert [frame.raw for frame in found] == [healthy]
        assert framer.rejected >= 1


def test_a_wrong_checksum_is_counted():
    data = bytearray(heartbeat())
    data[-1] ^= 0x55
    found, framer = cut(bytes(data))
    assert found == []
    assert (framer.bad_crc, framer.unknown, framer.truncated) == (1, 0, 0)


def test_an_unknown_message_is_counted():
    assert 0xABCDEF not in dialect.mavlink_map
    data = bytes([0xFD, 1, 0, 0, 0, 1, 1, 0xEF, 0xCD, 0xAB, 0, 0, 0])
    found, framer = cut(data)
    assert found == []
    assert (framer.bad_crc, framer.unknown, framer.truncated) == (0, 1, 0)


def test_a_frame_with_a_flag_that_nobody_knows_is_refused():
    data = bytearray(heartbeat())
    data[2] = 0x02
    found, framer = cut(bytes(data))
    assert found == []
    assert framer.unknown == 1


def test_counts_go_on_from_datagram_to_datagram():
    framer = Framer()
    for _ in range(3):
        framer.frames(NOW, b"noise")
        framer.frames(NOW, heartbeat()[:-1])
    assert framer.truncated == framer.rejected == 3
    assert framer.garbage_bytes == 3 * (5 + 20)
