"""Commands as MAVLink: pymavlink reads what we meant."""

from math import isnan

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs.commands import (
    Arm,
    Beat,
    ChangeMode,
    Kill,
    Land,
    RequestMessage,
    RequestParameter,
    RequestStream,
    SetVelocity,
    TakeOff,
    TakeOffAboveHome,
)
from gcs.messages import Encoder
from wire.modes import ARDUCOPTER_MODES, PX4_MODES

OFFBOARD = PX4_MODES["offboard"]
NAN = "no number"


def read(command, *, system=3, time_ms=0):
    """What pymavlink makes of one frame of ours."""
    (message,) = dialect.MAVLink(None).parse_buffer(Encoder(system).encode(command, time_ms))
    assert (message.get_srcSystem(), message.get_srcComponent()) == (255, 190)
    return message


def params(message):
    values = [getattr(message, f"param{k}") for k in range(1, 8)]
    return [NAN if isnan(value) else value for value in values]


@pytest.mark.parametrize(
    ("command", "number", "expected"),
    [
        (RequestStream(32, 0.1), 511, [32, 100_000, 0, 0, 0, 0, 0]),
        (RequestStream(33, -1e-6), 511, [33, -1, 0, 0, 0, 0, 0]),
        (RequestMessage(49), 512, [49, 0, 0, 0, 0, 0, 0]),
        (Arm(), 400, [1, 0, 0, 0, 0, 0, 0]),
        (Kill(), 400, [0, 21196, 0, 0, 0, 0, 0]),
        (TakeOff(330.0), 22, [0, 0, 0, NAN, NAN, NAN, 330]),
        (TakeOffAboveHome(10.0), 22, [0, 0, 0, 0, 0, 0, 10]),
        (ChangeMode(OFFBOARD.main, OFFBOARD.sub), 176, [1, 6, 0, 0, 0, 0, 0]),
        (ChangeMode(4, 3), 176, [1, 4, 3, 0, 0, 0, 0]),
        (ChangeMode(ARDUCOPTER_MODES["guided"], 0), 176, [1, 4, 0, 0, 0, 0, 0]),
        (Land(), 21, [0, 0, 0, 0, 0, 0, 0]),
    ],
)
def test_a_command_is_a_command_long_to_one_autopilot(command, number, expected):
    message = read(command)
    assert message.get_type() == "COMMAND_LONG"
    assert (message.target_system, message.target_component) == (3, 1)
    assert (message.command, message.confirmation) == (number, 0)
    assert params(message) == expected


@pytest.mark.parametrize("name", ["GUID_TIMEOUT", "SIXTEEN_LETTERS_"])
def test_a_parameter_is_asked_for_by_its_name_alone(name):
    message = read(RequestParameter(name))
    assert message.get_type() == "PARAM_REQUEST_READ"
    assert (message.target_system, message.target_component) == (3, 1)
    assert (message.param_id, message.param_index) == (name, -1)


def test_a_beat_is_that_of_a_ground_station_that_runs():
    beat = read(Beat())
    assert (beat.get_type(), beat.type, beat.autopilot, beat.system_status) == ("HEARTBEAT", 6, 8, 4)


speeds = st.floats(-20, 20, width=32)


@given(speeds, speeds, speeds, st.floats(-4, 4, width=32), st.integers(1, 255), st.integers(0, 2**32 - 1))
def test_a_set_point_says_velocity_and_yaw_in_the_local_frame_and_nothing_else(north, east, down, yaw, system, time_ms):
    message = read(SetVelocity(north, east, down, yaw), system=system, time_ms=time_ms)
    assert message.get_type() == "SET_POSITION_TARGET_LOCAL_NED"
    assert (message.vx, message.vy, message.vz, message.yaw) == (north, east, down, yaw)
    assert (message.coordinate_frame, message.type_mask) == (1, 0x9C7)
    assert (message.target_system, message.target_component, message.time_boot_ms) == (system, 1, time_ms)


def test_every_vehicle_has_its_own_sequence():
    one, other = Encoder(1), Encoder(2)
    sequences = [frame[4] for frame in (one.encode(Arm(), 0), other.encode(Arm(), 0), one.encode(Land(), 0))]
    assert sequences == [0, 0, 1]
