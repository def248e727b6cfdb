"""ArduCopter as its clients meet it: the order of things, what it ignores, what it does by itself."""

import math
from dataclasses import replace

import pytest
from clients import (
    ACCEPTED,
    ALTITUDE_HOLD,
    ARM,
    BODY_NED,
    BRAKE,
    DENIED,
    FAILED,
    FORCED,
    GUIDED,
    LAND,
    LANDING,
    LOCAL_POSITION,
    LOITER,
    MODE,
    OFFBOARD,
    REQUEST,
    RETURN,
    RTL,
    SET_INTERVAL,
    STABILIZE,
    TAKE_OFF,
    UNSUPPORTED,
    VERSION,
    WITH_YAW,
    Flight,
    command_int,
    parameter,
    setpoint,
)
from hypothesis import given
from hypothesis import strategies as st

from fdm import arducopter
from fdm.commands import FORCE_DISARM
from fdm.modes import Mode, Pilot, Setpoint, Situation
from fdm.parameters import table
from fdm.rules import Action, rules

RULES = rules(table("ardupilot"))
OFFSET_NED, BODY_OFFSET_NED = 7, 9
AUTO, GLOBAL, RELATIVE = 3, 0, 3


def copter(**options):
    return Flight(autopilot="ardupilot", **options)


def ready(**options):
    flight = copter(**options)
    flight.wait(3.2)
    return flight


# The order of things


def test_it_is_taken_for_an_arducopter_in_stabilize_and_says_nothing_unasked():
    flight = copter()
    flight.wait(5.0)
    beats = flight.all("HEARTBEAT")
    assert len(beats) == 5
    for beat in beats:
        assert (beat.type, beat.autopilot, beat.base_mode, beat.custom_mode) == (2, 3, 1, STABILIZE)
    assert {m.get_type() for _, m in flight.heard if m.get_srcComponent() == 1} == {"HEARTBEAT"}


@pytest.mark.parametrize(
    ("seconds", "flags", "result", "words"),
    [(2.9, None, FAILED, "PreArm: EKF is still settling"), (3.0, 0x33F, ACCEPTED, "Arming motors")],
)
def test_it_can_be_armed_when_its_estimator_and_its_checks_say_so(seconds, flags, result, words):
    flight = copter()
    flight.wait(seconds)
    flight.ask(REQUEST, 193)
    flight.ask(REQUEST, 1)
    told = flight.last("EKF_STATUS_REPORT").flags
    assert (told == 0x33F) is (flags == 0x33F)
    assert bool(flight.last("SYS_STATUS").onboard_control_sensors_health & 0x10000000) is (flags == 0x33F)
    assert flight.ask(ARM, 1) == result
    assert flight.words() == [words]


def test_a_whole_flight_in_the_order_that_it_asks_for():
    flight = ready()
    seen = []

    def note(result=None):
        beat = flight.last("HEARTBEAT")
        seen.append((result, beat.custom_mode, beat.base_mode == 129))

    note(flight.ask(TAKE_OFF, 0, 0, 0, 0, 0, 0, 10))
    note(flight.ask(MODE, 1, GUIDED))
    note(flight.ask(TAKE_OFF, 0, 0, 0, 0, 0, 0, 10))
    note(flight.ask(ARM, 1))
    note(flight.ask(TAKE_OFF, 0, 0, 0, 0, 0, 0, 10))
    flight.ask(REQUEST, 245)
    flight.wait(2.0)
    flight.ask(REQUEST, 245)
    note()
    flight.wait(8.0)
    assert flight.position == pytest.approx((0.0, 0.0, -10.0), abs=0.1)
    flight.stream(5.0, (3.0, 0.0, 0.0))
    assert flight.velocity == pytest.approx((3.0, 0.0, 0.0), abs=0.1)
    note(flight.ask(LAND))
    flight.wait(40.0)
    note(flight.ask(ARM, 1))
    assert seen == [
        (FAILED, STABILIZE, False),
        (ACCEPTED, GUIDED, False),
        (FAILED, GUIDED, False),
        (ACCEPTED, GUIDED, True),
        (ACCEPTED, GUIDED, True),
        (None, GUIDED, True),
        (ACCEPTED, LANDING, True),
        (FAILED, LANDING, False),
    ]
    assert [m.landed_state for m in flight.all("EXTENDED_SYS_STATE")] == [1, 3]
    assert flight.words() == [
        "Take-off refused: set GUIDED first",
        "Take-off refused: arm first",
        "Arming motors",
        "Disarming motors",
        "Arm: Land mode not armable",
    ]
    assert flight.ask(MODE, 1, GUIDED) == ACCEPTED
    assert flight.ask(ARM, 1) == ACCEPTED


def test_a_second_take_off_in_the_air_is_refused():
    flight = ready().guided(3.0)
    assert flight.ask(TAKE_OFF, 0, 0, 0, 0, 0, 0, 20) == FAILED
    assert flight.words()[-1] == "Take-off refused: already flying"


@pytest.mark.parametrize("height", [0.0, -5.0, math.nan])
def test_a_take_off_needs_a_height(height):
    flight = ready()
    flight.ask(MODE, 1, GUIDED)
    flight.ask(ARM, 1)
    assert flight.ask(TAKE_OFF, 0, 0, 0, 0, 0, 0, height) == FAILED
    assert flight.words()[-1] == "Take-off refused: name a height above home"


@pytest.mark.parametrize(
    ("number", "params", "result"),
    [
        (ARM, (0.5,), UNSUPPORTED),
        (MODE, (1, BRAKE), ACCEPTED),
        (MODE, (1, LOITER), ACCEPTED),
        (MODE, (1, RTL), ACCEPTED),
        (MODE, (1, AUTO), FAILED),
        (MODE, (1, 99), FAILED),
        (MODE, (0, GUIDED), DENIED),
        (MODE, (1, math.nan), DENIED),
        (LAND, (), ACCEPTED),
        (RETURN, (), ACCEPTED),
        (REQUEST, (9999,), FAILED),
        (SET_INTERVAL, (9999, 1), DENIED),
        (520, (1,), ACCEPTED),
        (410, (), ACCEPTED),
        (31, (), UNSUPPORTED),
    ],
)
def test_every_command_is_answered_as_arducopter_does(number, params, result):
    flight = ready()
    assert flight.ask(number, *params) == result
    assert len(flight.all("COMMAND_ACK")) == 1


@pytest.mark.parametrize(("frame", "result"), [(RELATIVE, ACCEPTED), (6, ACCEPTED), (GLOBAL, DENIED), (1, DENIED)])
def test_a_take_off_as_command_int_is_above_home(frame, result):
    flight = ready()
    flight.ask(MODE, 1, GUIDED)
    flight.ask(ARM, 1)
    flight.send(command_int(TAKE_OFF, frame=frame, z=4.0))
    assert flight.last("COMMAND_ACK").result == result
    flight.wait(6.0)
    assert -flight.position[2] == pytest.approx(4.0 if result == ACCEPTED else 0.0, abs=0.1)


# Set-points


@pytest.mark.parametrize(("mask", "frame"), [(FORCED, BODY_NED), (WITH_YAW, 1), (0x0DC7, OFFSET_NED), (0x0DC7, 9)])
def test_velocities_are_flown_in_every_frame_that_it_understands(mask, frame):
    heading = math.radians(60)
    flight = copter(yaw=heading).guided(5.0)
    flight.stream(5.0, (2.0, 0.0, 0.0), mask=mask, frame=frame, yaw=heading)
    turned = frame in (BODY_NED, BODY_OFFSET_NED)
    expected = (2 * math.cos(heading), 2 * math.sin(heading), 0.0) if turned else (2.0, 0.0, 0.0)
    assert flight.velocity == pytest.approx(expected, abs=0.05)


@pytest.mark.parametrize("mode", [STABILIZE, LOITER, BRAKE, LANDING, RTL])
def test_set_points_outside_guided_are_ignored_and_counted(mode):
    flight = copter().guided(20.0)
    flight.ask(MODE, 1, mode)
    flight.stream(1.0, (3.0, 0.0, 0.0))
    assert abs(flight.velocity[0]) < 0.05
    assert flight.endpoint.refused_setpoints == {"mode": 20}
    assert flight.endpoint.first_motion_step is None


def test_a_climb_on_the_ground_is_ignored_and_calls_a_take_off_off():
    flight = ready()
    flight.ask(MODE, 1, GUIDED)
    flight.ask(ARM, 1)
    flight.stream(3.0, (0.0, 0.0, -2.0))
    assert flight.vehicle.landed
    assert flight.ask(TAKE_OFF, 0, 0, 0, 0, 0, 0, 5) == ACCEPTED
    flight.send(setpoint((0.0, 0.0, -2.0)))
    flight.wait(3.0)
    assert flight.vehicle.landed


def test_a_set_point_on_the_way_up_is_flown_instead():
    flight = ready()
    flight.ask(MODE, 1, GUIDED)
    flight.ask(ARM, 1)
    flight.ask(TAKE_OFF, 0, 0, 0, 0, 0, 0, 20)
    flight.wait(4.0)
    flight.stream(4.0, (1.0, 0.0, 0.0))
    assert flight.velocity == pytest.approx((1.0, 0.0, 0.0), abs=0.05)
    assert -flight.position[2] < 15.0


@pytest.mark.parametrize(("stock", "silence_s"), [(False, 0.5), (True, 3.0)])
def test_silent_set_points_stop_it_in_guided_for_ever(stock, silence_s):
    flight = copter(stock=stock).guided(10.0)
    flight.stream(4.0, (3.0, 0.0, 0.0))
    flight.endpoint.step(7)
    flight.send(setpoint((3.0, 0.0, 0.0)))
    flight.endpoint.step(round(silence_s * 250) - 1)
    assert arducopter.steered(flight.pilot)
    flight.endpoint.step(1)
    assert not arducopter.steered(flight.pilot)
    flight.wait(2.0)
    assert flight.speed < 0.1
    held = flight.position
    flight.wait(60.0)
    assert flight.position == pytest.approx(held, abs=0.3)
    assert flight.pilot.mode is Mode.GUIDED
    flight.stream(4.0, (0.0, 1.0, 0.0))
    assert flight.velocity == pytest.approx((0.0, 1.0, 0.0), abs=0.05)


def test_its_patience_is_a_parameter():
    flight = copter().guided(5.0)
    flight.send(parameter("GUID_TIMEOUT", 1.5))
    flight.send(setpoint((1.0, 0.0, 0.0)))
    flight.endpoint.step(374)
    assert arducopter.steered(flight.pilot)
    flight.endpoint.step(1)
    assert not arducopter.steered(flight.pilot)


# Modes without a radio


@pytest.mark.parametrize("mode", [STABILIZE, ALTITUDE_HOLD, LOITER, 16])
def test_modes_that_read_a_stick_sink(mode):
    flight = copter().guided(20.0)
    assert flight.ask(MODE, 1, mode) == ACCEPTED
    flight.wait(3.0)
    assert flight.velocity == pytest.approx((0.0, 0.0, 2.5), abs=0.1)
    flight.wait(20.0)
    assert not flight.pilot.armed
    assert flight.vehicle.landed


def test_brake_stops_and_stays():
    flight = copter().guided(10.0)
    flight.stream(4.0, (3.0, 0.0, 0.0))
    assert flight.ask(MODE, 1, BRAKE) == ACCEPTED
    flight.wait(4.0)
    held = flight.position
    flight.wait(30.0)
    assert flight.position == pytest.approx(held, abs=0.1)
    assert held[2] == pytest.approx(-10.0, abs=0.5)


def test_a_return_climbs_goes_home_lands_and_cannot_be_armed_in():
    flight = copter().guided(5.0)
    flight.stream(6.0, (5.0, 0.0, 0.0))
    assert flight.ask(RETURN) == ACCEPTED
    highest = 0.0
    for _ in range(80):
        flight.wait(1.0)
        highest = max(highest, -flight.position[2])
    assert highest == pytest.approx(15.0, abs=0.5)
    assert not flight.pilot.armed
    assert flight.position == pytest.approx((0.0, 0.0, 0.0), abs=0.7)
    assert flight.last("HEARTBEAT").custom_mode == RTL
    assert flight.ask(ARM, 1) == FAILED
    assert flight.words()[-1] == "Arm: RTL mode not armable"


def test_armed_and_idle_it_disarms_after_its_delay():
    flight = ready()
    flight.ask(MODE, 1, GUIDED)
    flight.ask(ARM, 1)
    flight.wait(9.8)
    assert flight.pilot.armed
    flight.wait(0.4)
    assert not flight.pilot.armed


def test_force_stops_the_rotors_in_the_air():
    flight = copter().guided(10.0)
    assert flight.ask(ARM, 0) == FAILED
    assert flight.words()[-1] == "Disarm: not landed"
    assert flight.ask(ARM, 0, FORCE_DISARM) == ACCEPTED
    assert not flight.vehicle.armed


# The ground station


def beating(flight, seconds):
    for _ in range(round(seconds)):
        flight.beat()
        flight.wait(1.0)


def test_five_seconds_after_the_ground_stations_last_heartbeat_it_lands_at_the_very_step():
    flight = copter().guided(10.0)
    beating(flight, 10)
    flight.endpoint.step(13)
    flight.beat()
    flight.endpoint.step(1249)
    assert flight.pilot.mode is Mode.GUIDED
    flight.endpoint.step(1)
    flight.listen()
    assert flight.pilot.mode is Mode.LAND
    assert flight.words()[-1] == "GCS Failsafe - Landing"
    flight.beat()
    assert flight.words()[-1] == "GCS Failsafe Cleared"
    beating(flight, 40)
    assert not flight.pilot.armed


def test_whoever_flies_on_without_the_ground_station_is_borne_with_for_as_long_as_it_was():
    flight = copter().guided(20.0)
    flight.beat()
    flight.wait(6.0)
    assert flight.pilot.mode is Mode.LAND
    assert flight.ask(MODE, 1, GUIDED) == ACCEPTED
    flight.endpoint.step(1249)
    assert flight.pilot.mode is Mode.GUIDED
    flight.endpoint.step(1)
    assert flight.pilot.mode is Mode.LAND
    flight.wait(30.0)
    assert not flight.pilot.armed


def test_who_never_sends_a_heartbeat_leaves_it_hovering():
    flight = copter().guided(10.0)
    flight.stream(2.0, (1.0, 0.0, 0.0))
    flight.wait(120.0)
    assert flight.pilot.mode is Mode.GUIDED
    assert flight.position[2] == pytest.approx(-10.0, abs=0.3)


def test_stock_it_hovers_for_ever_without_a_ground_station():
    flight = copter(stock=True).guided(10.0)
    flight.beat()
    flight.wait(120.0)
    assert flight.position == pytest.approx((0.0, 0.0, -10.0), abs=0.3)


def test_only_the_system_that_it_is_told_is_its_ground_station():
    flight = copter().guided(10.0)
    flight.mav.srcSystem = 254
    flight.beat()
    flight.wait(10.0)
    assert flight.pilot.mode is Mode.GUIDED
    flight.mav.srcSystem = 255
    flight.beat()
    flight.mav.srcSystem = 254
    beating(flight, 6)
    assert flight.pilot.mode is Mode.LAND


def test_on_the_ground_a_lost_ground_station_stops_the_rotors_and_forbids_arming():
    flight = ready()
    flight.ask(MODE, 1, GUIDED)
    flight.beat()
    flight.ask(ARM, 1)
    flight.wait(5.1)
    assert not flight.pilot.armed
    assert flight.ask(ARM, 1) == FAILED
    assert flight.words()[-2:] == ["GCS Failsafe - Disarming", "PreArm: GCS failsafe on"]
    flight.beat()
    assert flight.ask(ARM, 1) == ACCEPTED


@pytest.mark.parametrize(
    ("action", "mode", "words"),
    [(Action.LAND, Mode.LAND, "GCS Failsafe - Landing"), (Action.RETURN, Mode.RETURN, "GCS Failsafe - RTL")],
)
@given(heard_s=st.floats(1.0, 50.0), silence_s=st.floats(2.0, 120.0))
def test_it_acts_at_the_very_instant_that_parameters_name(action, mode, words, heard_s, silence_s):
    told = replace(RULES, station_silence_s=silence_s, after_station=action)
    pilot = Pilot(armed=True, mode=Mode.GUIDED, airborne=True, station_s=heard_s)

    def at(time_s):
        return Situation(time_s, (5.0, 0.0, -10.0), (0.0, 0.0, 0.0), 0.0, on_ground=False)

    acts_s = arducopter.deadline(pilot, told)
    assert acts_s == heard_s + silence_s
    assert arducopter.advance(pilot, at(acts_s - 1e-4), told).pilot.mode is Mode.GUIDED
    outcome = arducopter.advance(pilot, at(acts_s), told)
    assert (outcome.pilot.mode, [text for _, text in outcome.words]) == (mode, [words])
    assert arducopter.advance(outcome.pilot, at(acts_s + 1.0), told).words == ()


@given(st.floats(0.0, 100.0), st.floats(0.1, 5.0))
def test_silence_means_zero_velocity_at_the_very_instant(heard_s, silence_s):
    told = replace(RULES, setpoint_silence_s=silence_s)
    pilot = Pilot(armed=True, mode=Mode.GUIDED, airborne=True, setpoint=Setpoint(heard_s, (3.0, 1.0, -1.0)))

    def at(time_s):
        return Situation(time_s, (5.0, 0.0, -10.0), (3.0, 1.0, -1.0), 0.0, on_ground=False)

    stops_s = arducopter.deadline(pilot, told)
    assert arducopter.velocity(arducopter.advance(pilot, at(stops_s - 1e-4), told).pilot, at(stops_s), told)[0] == 3.0
    stopped = arducopter.advance(pilot, at(stops_s), told).pilot
    assert arducopter.velocity(stopped, at(stops_s), told) == (0.0, 0.0, 0.0)
    assert stopped.mode is Mode.GUIDED


def test_a_client_that_asks_for_streams_gets_them():
    flight = ready()
    assert flight.ask(SET_INTERVAL, LOCAL_POSITION, 100_000) == ACCEPTED
    flight.wait(1.0)
    assert len(flight.all("LOCAL_POSITION_NED")) == 10
    assert flight.ask(REQUEST, VERSION) == ACCEPTED


def test_what_px4_calls_offboard_is_its_mode_number_six():
    flight = ready()
    assert flight.ask(MODE, 1, *OFFBOARD) == ACCEPTED
    assert flight.pilot.mode is Mode.RETURN
