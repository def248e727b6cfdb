"""Parameter values: the bytes of PX4, the conversion of ArduPilot."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from wire.frames import Framer, Sender
from wire.frames import decode as message
from wire.modes import ARDUPILOT, PX4
from wire.parameters import decode, encode

UINT8, INT8, UINT16, INT16, UINT32, INT32, REAL32 = 1, 2, 3, 4, 5, 6, 9
RANGES = {
    UINT8: (0, 255), INT8: (-128, 127), UINT16: (0, 65535), INT16: (-32768, 32767), UINT32: (0, 2**32 - 1),
    INT32: (-(2**31), 2**31 - 1),
}  # fmt: skip
whole_kinds = st.sampled_from(sorted(RANGES))


def over_the_wire(value, kind, autopilot):
    """What a client understands of what an autopilot says."""
    payload = encode(value, kind, autopilot) + struct.pack("<HH16sB", 1, 0, b"A_NAME", kind)
    (frame,) = Framer().frames(0, Sender(1, 1).frame(dialect.MAVLINK_MSG_ID_PARAM_VALUE, payload))
    return decode(frame.payload, message(frame).param_type, autopilot)


@pytest.mark.parametrize(
    ("value", "bits"), [(1, 0x00000001), (-1, 0xFFFFFFFF), (3, 0x00000003), (1_000_000, 0x000F4240)]
)
def test_px4_tells_a_whole_number_by_its_bytes(value, bits):
    assert encode(value, INT32, PX4) == bits.to_bytes(4, "little")
    assert decode(bits.to_bytes(4, "little"), INT32, PX4) == value


def test_ardupilot_tells_a_whole_number_as_a_float():
    five = struct.pack("<f", 5.0)
    assert encode(5, INT8, ARDUPILOT) == five
    assert decode(five, INT8, ARDUPILOT) == 5
    assert isinstance(decode(five, INT8, ARDUPILOT), int)


def test_the_one_taken_for_the_other_is_nonsense_so_the_difference_matters():
    assert decode(encode(3, INT32, PX4), INT32, ARDUPILOT) == 0
    assert decode(encode(3, INT32, ARDUPILOT), INT32, PX4) == 0x40400000


@given(whole_kinds.flatmap(lambda kind: st.tuples(st.just(kind), st.integers(*RANGES[kind]))))
def test_px4s_whole_numbers_come_back_to_the_last_bit(kind_and_value):
    kind, value = kind_and_value
    assert over_the_wire(value, kind, PX4) == value


@given(whole_kinds.flatmap(lambda kind: st.tuples(st.just(kind), st.integers(*RANGES[kind]))))
def test_ardupilots_whole_numbers_come_back_as_far_as_float32_goes(kind_and_value):
    kind, value = kind_and_value
    assert over_the_wire(value, kind, ARDUPILOT) == struct.unpack("<f", struct.pack("<f", value))[0]
    assert abs(value) > 2**24 or over_the_wire(value, kind, ARDUPILOT) == value


@given(st.floats(width=32, allow_nan=False), st.sampled_from([PX4, ARDUPILOT, 0]))
def test_floats_are_floats_for_everybody(value, autopilot):
    assert over_the_wire(value, REAL32, autopilot) == value


@pytest.mark.parametrize("bits", [0x7F800001, 0x7FBFFFFF, 0xFF800001])
def test_bits_that_look_like_no_number_come_back_too(bits):
    assert over_the_wire(bits, UINT32, PX4) == bits


@given(st.binary(max_size=30), st.integers(0, 255), st.sampled_from([PX4, ARDUPILOT, 0]))
def test_whatever_is_told_raises_nothing(value, kind, autopilot):
    assert isinstance(decode(value, kind, autopilot), (int, float))


def test_no_number_told_as_a_whole_number_stays_none():
    assert math.isnan(decode(struct.pack("<f", math.nan), INT32, ARDUPILOT))
    assert decode(struct.pack("<f", math.inf), INT32, ARDUPILOT) == math.inf


@pytest.mark.parametrize(
    ("value", "kind"), [(256, UINT8), (-129, INT8), (2**31, INT32), (math.nan, INT32), (1e39, REAL32)]
)
@pytest.mark.parametrize("autopilot", [PX4, ARDUPILOT])
def test_what_does_not_fit_is_refused(value, kind, autopilot):
    with pytest.raises(ValueError, match=rf"does not fit a parameter of type {kind}"):
        encode(value, kind, autopilot)
