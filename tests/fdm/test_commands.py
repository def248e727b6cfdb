"""Commands in every message that carries one, to a PX4; test_arducopter.py has the other autopilot's."""

import math

import pytest
from clients import (
    ACCEPTED,
    ARM,
    DENIED,
    LAND,
    LOCAL_POSITION,
    MODE,
    PLACE,
    REJECTED,
    REQUEST,
    RETURN,
    SET_INTERVAL,
    TAKE_OFF,
    UNSUPPORTED,
    VERSION,
    Flight,
    command_int,
    setpoint,
)
from pymavlink.dialects.v20 import ardupilotmega as dialect

from fdm.modes import Mode

CUSTOM = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
SET_MODE = 11
GLOBAL, LOCAL, RELATIVE, RELATIVE_INT = 0, 1, 3, 6


def ready(autopilot="px4"):
    flight = Flight(autopilot=autopilot)
    flight.wait(3.2)
    return flight


def old_set_mode(custom_mode, *, base_mode=CUSTOM, system=1):
    return dialect.MAVLink_set_mode_message(system, base_mode, custom_mode)


def answered(flight):
    """(command, result) of the last answer, which must be the only one."""
    (answer,) = flight.all("COMMAND_ACK")
    assert (answer.target_system, answer.target_component) == (255, 190)
    return answer.command, answer.result


@pytest.mark.parametrize(
    ("main_sub", "mode"),
    [((4, 2), "takeoff"), ((4, 3), "hold"), ((4, 5), "return"), ((4, 6), "land"), ((6, 0), "offboard")],
)
def test_every_mode_that_needs_no_radio_can_be_asked_for_in_the_air(main_sub, mode):
    flight = Flight().hover(5.0)
    flight.send(setpoint((0, 0, 0)))
    assert flight.ask(MODE, CUSTOM, *main_sub) == ACCEPTED
    assert flight.pilot.mode is Mode(mode)
    assert flight.last("HEARTBEAT").custom_mode == main_sub[0] << 16 | main_sub[1] << 24


@pytest.mark.parametrize("main_sub", [(1, 0), (2, 0), (3, 0), (4, 1), (4, 4), (4, 99), (7, 0), (99, 0)])
def test_modes_of_sticks_and_missions_are_refused_in_words(main_sub):
    flight = Flight().hover(5.0)
    assert flight.ask(MODE, CUSTOM, *main_sub) == REJECTED
    assert flight.words()[-1] == "This mode is not available"
    assert flight.pilot.mode is Mode.HOLD


def test_a_mode_without_the_flag_that_says_it_is_custom_is_denied():
    assert ready().ask(MODE, 0, 4, 6) == DENIED


@pytest.mark.parametrize(
    ("autopilot", "custom_mode", "acknowledged", "mode"),
    [
        ("px4", 6 << 24 | 4 << 16, MODE, Mode.LAND),
        ("px4", 5 << 24 | 4 << 16, MODE, Mode.RETURN),
        ("ardupilot", 4, SET_MODE, Mode.GUIDED),
        ("ardupilot", 17, SET_MODE, Mode.BRAKE),
    ],
)
def test_the_old_message_set_mode_still_works(autopilot, custom_mode, acknowledged, mode):
    flight = ready(autopilot)
    flight.send(old_set_mode(custom_mode))
    assert answered(flight) == (acknowledged, ACCEPTED)
    assert flight.pilot.mode is mode


def test_the_old_message_set_mode_is_refused_like_the_command():
    flight = ready()
    flight.send(old_set_mode(6 << 16))
    assert answered(flight) == (MODE, REJECTED)
    flight.heard.clear()
    flight.send(old_set_mode(6 << 16, base_mode=0))
    assert answered(flight) == (MODE, DENIED)
    flight.heard.clear()
    flight.send(old_set_mode(6 << 24 | 4 << 16, system=2))
    assert not flight.all("COMMAND_ACK")


@pytest.mark.parametrize(
    ("number", "params", "result"),
    [
        (ARM, (1,), ACCEPTED),
        (MODE, (CUSTOM, 4, 6), ACCEPTED),
        (LAND, (), ACCEPTED),
        (RETURN, (), ACCEPTED),
        (SET_INTERVAL, (LOCAL_POSITION, 50_000), ACCEPTED),
        (REQUEST, (VERSION,), ACCEPTED),
        (31, (), UNSUPPORTED),
    ],
)
def test_command_int_does_what_command_long_does(number, params, result):
    flight = ready()
    flight.send(command_int(number, *params))
    assert answered(flight) == (number, result)


@pytest.mark.parametrize(
    ("frame", "z", "height"),
    [
        (GLOBAL, PLACE.altitude_m + 4.0, 4.0),
        (RELATIVE, 4.0, 4.0),
        (RELATIVE_INT, 4.0, 4.0),
        (GLOBAL, math.nan, 2.5),
        (LOCAL, 4.0, None),
    ],
)
def test_a_take_off_as_command_int_says_what_its_altitude_counts_from(frame, z, height):
    flight = ready()
    flight.ask(ARM, 1)
    flight.heard.clear()
    flight.send(command_int(TAKE_OFF, frame=frame, z=z))
    assert answered(flight) == (TAKE_OFF, DENIED if height is None else ACCEPTED)
    flight.wait(8.0)
    assert -flight.position[2] == pytest.approx(height or 0.0, abs=0.1)


def test_take_off_by_mode_goes_to_the_height_of_the_parameter():
    flight = ready()
    flight.send(dialect.MAVLink_param_set_message(1, 1, b"MIS_TAKEOFF_ALT", 4.0, dialect.MAV_PARAM_TYPE_REAL32))
    flight.ask(ARM, 1)
    assert flight.ask(MODE, CUSTOM, 4, 2) == ACCEPTED
    flight.wait(8.0)
    assert -flight.position[2] == pytest.approx(4.0, abs=0.1)
    assert flight.pilot.mode is Mode.HOLD


def test_a_return_flies_home_and_lands_there():
    flight = Flight().hover(5.0).offboard((4.0, 0.0, 0.0), 8.0)
    away = flight.position[0]
    assert away > 20.0
    assert flight.ask(RETURN) == ACCEPTED
    highest = 0.0
    for _ in range(70):
        flight.wait(1.0)
        highest = max(highest, -flight.position[2])
    assert highest == pytest.approx(away, abs=3.0)  # 45° of cone
    assert not flight.pilot.armed
    assert flight.position == pytest.approx((0.0, 0.0, 0.0), abs=0.5)


@pytest.mark.parametrize(
    ("number", "kind"), [(410, "HOME_POSITION"), (520, "AUTOPILOT_VERSION"), (510, "MESSAGE_INTERVAL")]
)
def test_commands_of_old_clients_are_understood(number, kind):
    flight = ready()
    flight.heard.clear()
    assert flight.ask(number, LOCAL_POSITION) == ACCEPTED
    assert len(flight.all(kind)) == 1


def test_an_offboard_climb_takes_off_from_the_ground():
    flight = ready()
    flight.ask(ARM, 1)
    flight.offboard((0.0, 0.0, -1.0), 4.0)
    assert flight.velocity == pytest.approx((0.0, 0.0, -1.0), abs=0.05)
    assert -flight.position[2] > 3.0
    assert flight.pilot.mode is Mode.OFFBOARD


def test_it_may_be_armed_in_offboard_while_set_points_come():
    flight = ready()
    flight.stream(0.2, (0.0, 0.0, -1.0))
    assert flight.ask(MODE, CUSTOM, 6, 0) == ACCEPTED
    assert flight.ask(ARM, 1) == ACCEPTED
    flight.stream(4.0, (0.0, 0.0, -1.0))
    assert -flight.position[2] > 3.0


def test_a_client_may_ask_for_the_take_off_first_and_arm_then():
    flight = ready()
    nothing = math.nan
    altitude = PLACE.altitude_m + 5.0
    assert flight.ask(TAKE_OFF, -1, 0, 0, nothing, nothing, nothing, altitude) == ACCEPTED
    flight.wait(2.0)
    assert flight.position == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)
    assert flight.last("HEARTBEAT").custom_mode == 4 << 16 | 2 << 24
    assert not flight.last("HEARTBEAT").base_mode & 128
    assert flight.ask(ARM, 1) == ACCEPTED
    flight.wait(8.0)
    assert -flight.position[2] == pytest.approx(5.0, abs=0.3)
    assert flight.pilot.mode is Mode.HOLD


def test_disarmed_it_never_moves_whatever_is_asked():
    flight = ready()
    for number, params in ((MODE, (CUSTOM, 4, 2)), (TAKE_OFF, (0,) * 6 + (500,)), (RETURN, ()), (LAND, ())):
        flight.ask(number, *params)
        flight.stream(0.5, (3.0, 0.0, -3.0))
        assert flight.ask(MODE, CUSTOM, 6, 0) == ACCEPTED
        flight.stream(0.5, (3.0, 0.0, -3.0))
    assert flight.position == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)
    assert not flight.vehicle.armed
