"""Payloads packed by hand against pymavlink's, to the byte."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from wire import payloads
from wire.frames import Framer, Sender, decode
from wire.payloads import LocalPosition, PositionTarget, SimState

floats = st.floats(width=32)
numbers = st.floats(width=32, allow_nan=False)
byte, u16, u32, i32 = (st.integers(0, 2**8 - 1), st.integers(0, 2**16 - 1), st.integers(0, 2**32 - 1),
                       st.integers(-(2**31), 2**31 - 1))  # fmt: skip

INTEGERS = {
    "time_boot_ms": u32, "type_mask": u16, "target_system": byte, "target_component": byte, "coordinate_frame": byte,
    "lat_int": i32, "lon_int": i32,
}  # fmt: skip
HOT = {
    LocalPosition: (
        payloads.LOCAL_POSITION_NED,
        dialect.MAVLink_local_position_ned_message,
        payloads.pack_local_position,
        payloads.unpack_local_position,
    ),
    PositionTarget: (
        payloads.SET_POSITION_TARGET_LOCAL_NED,
        dialect.MAVLink_set_position_target_local_ned_message,
        payloads.pack_position_target,
        payloads.unpack_position_target,
    ),
    SimState: (
        payloads.SIM_STATE,
        dialect.MAVLink_sim_state_message,
        payloads.pack_sim_state,
        payloads.unpack_sim_state,
    ),
}
hot = pytest.mark.parametrize("record", HOT, ids=lambda record: record.__name__)


def any_of(record, real=numbers):
    return st.builds(record, **{name: INTEGERS.get(name, real) for name in record._fields})


@hot
@given(st.data())
def test_frames_are_pymavlinks_to_the_byte(record, data):
    number, kind, pack, _ = HOT[record]
    message = data.draw(any_of(record, floats))
    theirs = Sender(5, 200).pack(kind(**message._asdict()))
    assert Sender(5, 200).frame(number, pack(message)) == theirs


@hot
@given(st.data())
def test_a_payload_comes_back_as_it_was_packed(record, data):
    _, _, pack, unpack = HOT[record]
    message = data.draw(any_of(record))
    assert unpack(pack(message)) == message


@hot
@given(st.data())
def test_zeros_that_were_cut_off_come_back(record, data):
    _, _, pack, unpack = HOT[record]
    message = data.draw(any_of(record, st.just(0.0) | numbers))
    assert unpack(pack(message).rstrip(b"\0")) == message


@hot
def test_a_payload_of_nothing_is_all_zeros(record):
    unpack = HOT[record][3]
    assert unpack(b"") == unpack(b"\0") == record(*[0] * len(record._fields))


@hot
@given(st.data(), st.binary(min_size=1, max_size=20))
def test_bytes_of_extensions_that_are_not_invented_yet_are_ignored(record, data, more):
    _, _, pack, unpack = HOT[record]
    message = data.draw(any_of(record))
    assert unpack(pack(message) + more) == message


@hot
@given(st.data())
def test_we_read_what_pymavlink_packs_and_it_reads_what_we_pack(record, data):
    number, kind, pack, unpack = HOT[record]
    message = data.draw(any_of(record))
    theirs, ours = Framer().frames(
        0, Sender(1, 1).pack(kind(**message._asdict())) + Sender(1, 1).frame(number, pack(message))
    )
    assert unpack(theirs.payload) == message
    assert {name: getattr(decode(ours), name) for name in record._fields} == message._asdict()


@hot
@given(st.binary(max_size=300))
def test_payloads_of_any_length_raise_nothing(record, payload):
    assert isinstance(HOT[record][3](payload), record)
