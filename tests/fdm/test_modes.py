"""PX4's mode machine without a vehicle, and what both machines share: situations in, modes and velocities out."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fdm import arducopter, px4
from fdm.modes import PRESS_DOWN, Link, Loss, Mode, Phase, Pilot, Result, Setpoint, Situation, heading, phase
from fdm.parameters import table
from fdm.rules import Action, rules

RULES = rules(table("px4"))
PERIOD = 0.05
NORTHWARDS = (2.0, 0.0, 0.0)
ACCEPTED, REJECTED = Result.ACCEPTED, Result.REJECTED


def at(time_s, *, height=10.0, velocity=(0.0, 0.0, 0.0), on_ground=False, yaw=0.0, ne=(3.0, 4.0)):
    return Situation(time_s, (*ne, -height), velocity, yaw, on_ground)


def standing(time_s):
    return at(time_s, height=0.0, on_ground=True)


def flying(mode=Mode.HOLD, **known):
    return Pilot(armed=True, mode=mode, airborne=True, **known)


def live(pilot, situation, from_s, to_s, told=RULES):
    """Advance every period; gives the pilot at the end and [(time, word)] on the way."""
    said = []
    for n in range(round(from_s / PERIOD), round(to_s / PERIOD) + 1):
        outcome = px4.advance(pilot, situation(n * PERIOD), told)
        pilot = outcome.pilot
        said += [(n * PERIOD, words) for _, words in outcome.words]
    return pilot, said


heard_now = Setpoint(time_s=20.0, velocity_ned=NORTHWARDS)
heard_long_ago = Setpoint(time_s=10.0, velocity_ned=NORTHWARDS)


@pytest.mark.parametrize(
    ("before", "setpoint", "asked", "after", "result"),
    [
        (Mode.HOLD, None, Mode.HOLD, Mode.HOLD, ACCEPTED),
        (Mode.HOLD, None, Mode.TAKEOFF, Mode.TAKEOFF, ACCEPTED),
        (Mode.HOLD, None, Mode.LAND, Mode.LAND, ACCEPTED),
        (Mode.HOLD, None, Mode.RETURN, Mode.RETURN, ACCEPTED),
        (Mode.HOLD, heard_now, Mode.OFFBOARD, Mode.OFFBOARD, ACCEPTED),
        (Mode.HOLD, None, Mode.OFFBOARD, Mode.HOLD, REJECTED),
        (Mode.HOLD, heard_long_ago, Mode.OFFBOARD, Mode.HOLD, REJECTED),
        (Mode.HOLD, heard_now, None, Mode.HOLD, REJECTED),
        (Mode.TAKEOFF, None, Mode.HOLD, Mode.HOLD, ACCEPTED),
        (Mode.TAKEOFF, heard_now, Mode.OFFBOARD, Mode.OFFBOARD, ACCEPTED),
        (Mode.TAKEOFF, heard_long_ago, Mode.OFFBOARD, Mode.TAKEOFF, REJECTED),
        (Mode.TAKEOFF, None, Mode.LAND, Mode.LAND, ACCEPTED),
        (Mode.OFFBOARD, heard_now, Mode.HOLD, Mode.HOLD, ACCEPTED),
        (Mode.OFFBOARD, heard_now, Mode.LAND, Mode.LAND, ACCEPTED),
        (Mode.OFFBOARD, heard_long_ago, Mode.OFFBOARD, Mode.OFFBOARD, REJECTED),
        (Mode.LAND, None, Mode.HOLD, Mode.HOLD, ACCEPTED),
        (Mode.LAND, heard_now, Mode.OFFBOARD, Mode.OFFBOARD, ACCEPTED),
        (Mode.LAND, None, Mode.LAND, Mode.LAND, ACCEPTED),
        (Mode.RETURN, None, Mode.HOLD, Mode.HOLD, ACCEPTED),
        (Mode.RETURN, None, None, Mode.RETURN, REJECTED),
    ],
)
def test_a_mode_that_is_asked_for_is_flown_or_refused_in_words(before, setpoint, asked, after, result):
    outcome = px4.set_mode(flying(before, setpoint=setpoint), at(20.1), RULES, asked)
    assert (outcome.pilot.mode, outcome.result) == (after, result)
    assert bool(outcome.words) is (result is REJECTED or asked is Mode.TAKEOFF)


@pytest.mark.parametrize("before", px4_modes := [Mode.HOLD, Mode.TAKEOFF, Mode.OFFBOARD, Mode.RETURN, Mode.LAND])
def test_a_take_off_interrupts_whatever_is_flown(before):
    outcome = px4.take_off(flying(before, loss=Loss(Link.SETPOINTS, 19.0)), at(20.0), RULES, 12.0)
    assert (outcome.pilot.mode, outcome.result, outcome.pilot.loss) == (Mode.TAKEOFF, ACCEPTED, None)
    assert outcome.pilot.anchor_ned == (3.0, 4.0, -12.0)


@pytest.mark.parametrize(("height", "down"), [(0.0, -2.5), (10.0, -10.0)])
def test_the_mode_takeoff_goes_to_the_parameters_height_or_stays_above_it(height, down):
    outcome = px4.set_mode(flying(), at(20.0, height=height), RULES, Mode.TAKEOFF)
    assert outcome.pilot.anchor_ned == (3.0, 4.0, down)


@pytest.mark.parametrize(("seconds", "agreed"), [(0.0, False), (0.98, False), (1.0, True), (5.0, True)])
def test_arming_is_refused_in_the_first_second(seconds, agreed):
    outcome = px4.arm(px4.boot(), standing(seconds), RULES)
    assert (outcome.result is ACCEPTED, outcome.pilot.armed) == (agreed, agreed)
    assert outcome.words[0][1] == ("Armed by external command" if agreed else "Arming denied: sensors are settling")


def test_arming_twice_changes_nothing():
    pilot = flying(Mode.OFFBOARD)
    outcome = px4.arm(pilot, at(20.0), RULES)
    assert outcome.result is ACCEPTED
    assert outcome.pilot == pilot
    assert outcome.words == ()


def test_arming_begins_in_hold_with_the_heading_and_the_home_of_the_moment():
    left_over = Pilot(mode=Mode.LAND, anchor_ned=(9.0, 9.0, 9.0), yaw=1.0, loss=Loss(Link.STATION, 3.0), airborne=True)
    pilot = px4.arm(left_over, at(20.0, height=0.0, on_ground=True, yaw=-2.0), RULES).pilot
    assert pilot == Pilot(armed=True, mode=Mode.HOLD, yaw=-2.0, home_ned=(3.0, 4.0, 0.0), grounded_since_s=20.0)


@pytest.mark.parametrize(("setpoint", "agreed"), [(heard_now, True), (heard_long_ago, False)])
def test_it_arms_in_offboard_only_while_set_points_come(setpoint, agreed):
    outcome = px4.arm(Pilot(mode=Mode.OFFBOARD, setpoint=setpoint), standing(20.1), RULES)
    assert outcome.pilot.armed is agreed
    assert outcome.pilot.mode is Mode.OFFBOARD
    assert agreed or outcome.words[0][1] == "Arming denied: Offboard without set-points"


@pytest.mark.parametrize(("heard_s", "agreed"), [(None, True), (10.1, True), (9.9, False)])
def test_it_is_not_armed_after_its_ground_station_is_gone(heard_s, agreed):
    outcome = px4.arm(Pilot(station_s=heard_s), standing(20.0), RULES)
    assert outcome.pilot.armed is agreed
    assert agreed or outcome.words[0][1] == "Arming denied: no ground station is heard"


@pytest.mark.parametrize("pilot", [Pilot(), flying()])
@pytest.mark.parametrize("height", [0.0, -300.0])
def test_a_take_off_downwards_is_refused(pilot, height):
    outcome = px4.take_off(pilot, standing(20.0), RULES, height)
    assert outcome.result is REJECTED
    assert outcome.pilot == pilot
    assert "below home" in outcome.words[0][1]


def test_a_take_off_that_is_asked_for_before_arming_begins_with_it():
    told = px4.take_off(Pilot(), standing(20.0), RULES, 12.0)
    assert (told.result, told.pilot.armed, told.pilot.mode) == (ACCEPTED, False, Mode.TAKEOFF)
    assert px4.advance(told.pilot, standing(20.5), RULES).pilot == told.pilot
    armed = px4.arm(told.pilot, standing(21.0), RULES).pilot
    assert (armed.armed, armed.mode, armed.climbing, armed.anchor_ned) == (True, Mode.TAKEOFF, True, (3.0, 4.0, -12.0))
    assert px4.velocity(armed, standing(21.0), RULES) == (0.0, 0.0, -RULES.takeoff_m_s)


@pytest.mark.parametrize("between", [Mode.HOLD, Mode.LAND, None])
def test_a_take_off_that_was_called_off_before_arming_is_forgotten(between):
    pilot = px4.take_off(Pilot(), standing(20.0), RULES, 12.0).pilot
    if between is None:
        pilot = px4.disarm(pilot, standing(20.5), force=False).pilot
    else:
        pilot = px4.set_mode(pilot, standing(20.5), RULES, between).pilot
    armed = px4.arm(pilot, standing(21.0), RULES).pilot
    assert (armed.mode, armed.climbing, armed.anchor_ned) == (Mode.HOLD, False, None)


@pytest.mark.parametrize(
    ("on_ground", "force", "agreed"),
    [(True, False, True), (True, True, True), (False, False, False), (False, True, True)],
)
@pytest.mark.parametrize(("machine", "refusal"), [(px4, Result.REJECTED), (arducopter, Result.FAILED)])
def test_in_the_air_only_force_disarms(machine, refusal, on_ground, force, agreed):
    outcome = machine.disarm(flying(), at(20.0, on_ground=on_ground), force=force)
    assert (outcome.result, outcome.pilot.armed) == (ACCEPTED if agreed else refusal, not agreed)


@pytest.mark.parametrize("machine", [px4, arducopter])
def test_a_disarmed_vehicle_may_be_disarmed_in_any_place(machine):
    assert machine.disarm(machine.boot(), at(20.0), force=False).result is ACCEPTED


# Silence


def test_silent_set_points_lead_to_hold_then_to_land():
    offboard = flying(Mode.OFFBOARD, setpoint=Setpoint(10.0, NORTHWARDS))

    def coasting(t):
        return at(t, velocity=NORTHWARDS)

    pilot, said = live(offboard, coasting, 10.0, 10.45)
    assert (pilot.mode, said) == (Mode.OFFBOARD, [])
    assert px4.velocity(pilot, coasting(10.45), RULES) == NORTHWARDS

    pilot, said = live(pilot, coasting, 10.5, 10.5)
    assert (pilot.mode, [word for _, word in said]) == (Mode.HOLD, ["Set-points lost: holding"])
    assert px4.velocity(pilot, coasting(10.5), RULES) == (0.0, 0.0, 0.0)

    pilot, said = live(pilot, at, 10.55, 15.45)
    assert (pilot.mode, said) == (Mode.HOLD, [])
    pilot, said = live(pilot, at, 15.5, 15.55)
    assert (pilot.mode, [word for _, word in said]) == (Mode.LAND, ["Set-points did not come back: landing"])

    pilot, said = live(pilot, standing, 25.0, 25.45)
    assert (pilot.armed, said) == (True, [])
    pilot, said = live(pilot, standing, 25.5, 25.55)
    assert (pilot.armed, [word for _, word in said]) == (False, ["Landed, disarmed"])


def test_set_points_just_within_half_a_second_are_enough():
    pilot = flying(Mode.OFFBOARD, setpoint=Setpoint(10.0, NORTHWARDS))
    for n in range(20, 40):
        pilot = px4.hear(pilot, Setpoint(n * 0.5, NORTHWARDS))
        pilot, said = live(pilot, at, n * 0.5, n * 0.5 + 0.45)
        assert (pilot.mode, said) == (Mode.OFFBOARD, [])


def test_set_points_that_come_back_are_not_flown_until_offboard_is_asked_for_again():
    pilot, _ = live(flying(Mode.OFFBOARD, setpoint=Setpoint(10.0, NORTHWARDS)), at, 10.0, 12.0)
    for n in range(240, 400):
        pilot = px4.hear(pilot, Setpoint(n * PERIOD, NORTHWARDS))
        pilot, _ = live(pilot, at, n * PERIOD, n * PERIOD)
        assert not px4.steered(pilot)
        assert pilot.mode is (Mode.HOLD if n * PERIOD < 15.5 - 1e-9 else Mode.LAND)
    assert px4.steered(px4.set_mode(pilot, at(20.0), RULES, Mode.OFFBOARD).pilot)


@pytest.mark.parametrize("asked", [Mode.OFFBOARD, Mode.HOLD])
def test_a_ground_station_that_comes_back_calls_the_landing_off(asked):
    pilot = flying(Mode.OFFBOARD, setpoint=Setpoint(10.0, NORTHWARDS))
    pilot, _ = live(pilot, at, 10.0, 15.0)
    assert pilot.loss is not None
    pilot = px4.hear(pilot, Setpoint(15.0, NORTHWARDS))
    pilot = px4.set_mode(pilot, at(15.0), RULES, asked).pilot
    for n in range(30, 44):
        pilot = px4.hear(pilot, Setpoint(n * 0.5, NORTHWARDS))
        pilot, said = live(pilot, at, n * 0.5, n * 0.5 + 0.45)
        assert (pilot.mode, said) == (asked, [])


@pytest.mark.parametrize(
    ("action", "mode"), [(Action.LAND, Mode.LAND), (Action.RETURN, Mode.RETURN), (Action.HOLD, Mode.HOLD)]
)
def test_the_failsafe_times_and_actions_are_parameters(action, mode):
    told = replace(RULES, setpoint_silence_s=2.0, action_delay_s=1.0, after_setpoints=action)
    pilot = flying(Mode.OFFBOARD, setpoint=Setpoint(10.0, NORTHWARDS))
    assert px4.advance(pilot, at(11.99), told).pilot.mode is Mode.OFFBOARD
    pilot = px4.advance(pilot, at(12.0), told).pilot
    assert pilot.mode is Mode.HOLD
    assert px4.advance(pilot, at(12.99), told).pilot.mode is Mode.HOLD
    pilot = px4.advance(pilot, at(13.0), told).pilot
    assert (pilot.mode, pilot.loss) == (mode, None)


def test_only_offboard_watches_set_points():
    for mode in (Mode.HOLD, Mode.LAND, Mode.RETURN):
        pilot, _ = live(flying(mode, setpoint=heard_long_ago), at, 11.0, 40.0)
        assert (pilot.mode, pilot.loss) == (mode, None)


@pytest.mark.parametrize("mode", [Mode.HOLD, Mode.TAKEOFF, Mode.OFFBOARD])
def test_a_silent_ground_station_leads_to_hold_then_to_land_in_every_mode_but_landing(mode):
    pilot = flying(mode, station_s=10.0, setpoint=Setpoint(1e3, NORTHWARDS))
    pilot, said = live(pilot, at, 11.0, 19.95)
    assert (pilot.mode, said) == (mode, [])
    pilot, said = live(pilot, at, 20.0, 24.95)
    assert (pilot.mode, [word for _, word in said]) == (Mode.HOLD, ["Ground station lost: holding"])
    pilot, said = live(pilot, at, 25.0, 25.0)
    assert (pilot.mode, [word for _, word in said]) == (Mode.LAND, ["Ground station is not back: landing"])


@pytest.mark.parametrize("mode", [Mode.LAND, Mode.RETURN])
def test_who_is_on_the_way_down_goes_on_without_a_ground_station(mode):
    pilot, said = live(flying(mode, station_s=10.0), at, 11.0, 40.0)
    assert (pilot.mode, said) == (mode, [(pytest.approx(20.0), "Ground station lost")])


def test_a_ground_station_that_was_never_heard_is_not_lost():
    pilot, said = live(flying(), at, 10.0, 100.0)
    assert (pilot.mode, said) == (Mode.HOLD, [])


@pytest.mark.parametrize("asked", [Mode.OFFBOARD, Mode.HOLD, Mode.TAKEOFF])
def test_a_person_may_fly_on_without_the_ground_station_that_is_lost_for_as_long_as_it_was_waited_for(asked):
    pilot, _ = live(flying(station_s=10.0), at, 11.0, 21.0)
    assert (pilot.mode, pilot.station_lost) == (Mode.HOLD, True)
    pilot = px4.hear(pilot, Setpoint(1e3, NORTHWARDS))
    pilot = px4.set_mode(pilot, at(21.0), RULES, asked).pilot
    pilot, said = live(pilot, lambda t: at(t, height=5.0), 21.0, 30.95)
    assert (pilot.mode, said) == (asked, [])
    pilot, said = live(pilot, lambda t: at(t, height=5.0), 31.0, 36.0)
    assert pilot.mode is Mode.LAND
    assert [word for _, word in said] == ["Ground station lost: holding", "Ground station is not back: landing"]
    back = px4.hear_station(pilot, at(36.1))
    assert [word for _, word in back.words] == ["Ground station is heard again"]


@pytest.mark.parametrize("machine", [px4, arducopter])
def test_on_the_ground_a_lost_ground_station_is_not_brought_back_by_a_mode(machine):
    told = rules(table("px4" if machine is px4 else "ardupilot"))
    pilot = Pilot(station_s=10.0, station_lost=True)
    mode = Mode.RETURN if machine is px4 else Mode.GUIDED
    pilot = machine.set_mode(pilot, standing(50.0), told, mode).pilot
    assert not machine.arm(pilot, standing(50.1), told).pilot.armed


def test_a_ground_station_lost_while_it_holds_for_want_of_set_points_moves_no_landing():
    told = replace(RULES, station_silence_s=3.0)
    pilot = flying(Mode.OFFBOARD, setpoint=Setpoint(10.0, NORTHWARDS), station_s=10.0)
    pilot, _ = live(pilot, at, 10.0, 15.45, told)
    assert pilot.station_lost
    assert pilot.mode is Mode.HOLD
    assert live(pilot, at, 15.5, 15.5, told)[0].mode is Mode.LAND


def test_a_ground_station_lost_where_silent_set_points_only_hold_brings_it_down():
    told = replace(RULES, station_silence_s=3.0, after_setpoints=Action.HOLD)
    pilot = flying(Mode.OFFBOARD, setpoint=Setpoint(10.0, NORTHWARDS), station_s=10.0)
    pilot, _ = live(pilot, at, 10.0, 17.95, told)
    assert pilot.mode is Mode.HOLD
    assert live(pilot, at, 18.0, 18.0, told)[0].mode is Mode.LAND


# On the ground


def test_armed_but_idle_it_disarms_after_ten_seconds():
    pilot = px4.arm(Pilot(), standing(20.0), RULES).pilot
    pilot, said = live(pilot, standing, 20.0, 29.95)
    assert (pilot.armed, said) == (True, [])
    pilot, said = live(pilot, standing, 30.0, 30.05)
    assert (pilot.armed, [word for _, word in said]) == (False, ["Disarmed: no take-off"])


@pytest.mark.parametrize("mode", [Mode.HOLD, Mode.OFFBOARD])
def test_on_the_ground_again_it_disarms_after_two_seconds_whatever_the_mode(mode):
    pilot = flying(mode, setpoint=Setpoint(1e3, NORTHWARDS))
    pilot, _ = live(pilot, standing, 20.0, 21.95)
    assert pilot.armed
    pilot, said = live(pilot, standing, 22.0, 22.05)
    assert (pilot.armed, [word for _, word in said]) == (False, ["Landed, disarmed"])


def test_a_disarming_time_of_nothing_never_disarms_in_the_air():
    told = replace(RULES, landed_disarm_s=0.0, idle_disarm_s=0.0)
    assert live(flying(Mode.HOLD), at, 20.0, 30.0, told)[0].armed


def test_who_is_asked_to_climb_off_the_ground_is_not_disarmed():
    climb = Setpoint(1e3, (0.0, 0.0, -1.0))
    assert live(flying(Mode.OFFBOARD, setpoint=climb), standing, 20.0, 40.0)[0].armed


def test_a_bounce_starts_the_landing_clock_again():
    pilot = flying(Mode.LAND)
    pilot, _ = live(pilot, standing, 20.0, 20.4)
    pilot, _ = live(pilot, at, 20.45, 20.45)
    pilot, _ = live(pilot, standing, 20.5, 20.95)
    assert pilot.armed
    pilot, _ = live(pilot, standing, 21.0, 21.05)
    assert not pilot.armed


@pytest.mark.parametrize(("height", "mode"), [(9.75, Mode.TAKEOFF), (9.85, Mode.HOLD), (10.15, Mode.HOLD)])
def test_take_off_ends_within_two_decimetres(height, mode):
    pilot = px4.take_off(flying(), at(20.0, height=0.0), RULES, 10.0).pilot
    pilot = px4.advance(pilot, at(25.0, height=height), RULES).pilot
    assert pilot.mode is mode
    assert pilot.climbing is (mode is Mode.TAKEOFF)
    assert pilot.anchor_ned == (3.0, 4.0, -10.0)


@pytest.mark.parametrize("mode", [Mode.HOLD, Mode.OFFBOARD, Mode.LAND, Mode.RETURN])
def test_on_the_ground_it_presses_down(mode):
    along = Setpoint(20.0, (1.0, 1.0, 0.5))
    assert px4.velocity(flying(mode, setpoint=along), standing(20.0), RULES) == (0.0, 0.0, PRESS_DOWN)


def test_take_off_and_an_offboard_climb_leave_the_ground_straight_up():
    pilot = px4.take_off(flying(), standing(20.0), RULES, 10.0).pilot
    assert px4.velocity(pilot, standing(20.0), RULES) == (0.0, 0.0, -1.5)
    climb = Setpoint(20.0, (1.0, 1.0, -2.0))
    assert px4.velocity(flying(Mode.OFFBOARD, setpoint=climb), standing(20.0), RULES) == (0.0, 0.0, -2.0)


# Velocities


@pytest.mark.parametrize(("height", "down"), [(50.0, 1.5), (3.01, 1.5), (2.99, 0.7)])
def test_landing_slows_near_the_ground(height, down):
    assert px4.velocity(flying(Mode.LAND), at(20.0, height=height), RULES) == pytest.approx((0.0, 0.0, down))


@pytest.mark.parametrize(
    ("off_by", "expected"),
    [
        ((1.0, 0.0, 0.0), (-0.95, 0.0, 0.0)),
        ((0.0, -2.0, 0.0), (0.0, 1.9, 0.0)),
        ((0.0, 0.0, 1.0), (0.0, 0.0, -0.95)),
        ((300.0, -400.0, 0.0), (-1.8, 2.4, 0.0)),
        ((0.0, 0.0, -100.0), (0.0, 0.0, 3.0)),
    ],
)
def test_hold_pulls_back_in_proportion_up_to_its_speed(off_by, expected):
    north, east, down = off_by
    pilot = flying(anchor_ned=(3.0 - north, 4.0 - east, -10.0 - down))
    assert px4.velocity(pilot, at(20.0), RULES) == pytest.approx(expected)


def test_hold_takes_its_place_once_it_has_stopped():
    pilot = px4.advance(flying(), at(20.0, velocity=(0.31, 0.0, 0.0)), RULES).pilot
    assert pilot.anchor_ned is None
    pilot = px4.advance(pilot, at(20.05, velocity=(0.2, 0.0, 0.2)), RULES).pilot
    assert pilot.anchor_ned == (3.0, 4.0, -10.0)


def test_land_takes_its_place_while_it_comes_down():
    pilot = px4.advance(flying(Mode.LAND), at(20.0, velocity=(0.31, 0.0, 1.5)), RULES).pilot
    assert pilot.anchor_ned is None
    pilot = px4.advance(pilot, at(20.05, velocity=(0.2, 0.2, 1.5)), RULES).pilot
    assert pilot.anchor_ned == (3.0, 4.0, -10.0)


@pytest.mark.parametrize(
    ("asked", "flown"),
    [
        ((2.0, -1.0, 0.5), (2.0, -1.0, 0.5)),
        ((0.0, 12.0, 0.0), (0.0, 12.0, 0.0)),
        ((30.0, 40.0, 0.0), (7.2, 9.6, 0.0)),
        ((0.0, 0.0, 9.0), (0.0, 0.0, 1.5)),
        ((0.0, 0.0, -9.0), (0.0, 0.0, -3.0)),
        ((3e38, 0.0, 3e38), (12.0, 0.0, 1.5)),
    ],
)
def test_offboard_flies_what_is_asked_within_limits(asked, flown):
    pilot = flying(Mode.OFFBOARD, setpoint=Setpoint(20.0, asked))
    assert px4.velocity(pilot, at(20.0), RULES) == pytest.approx(flown)


def heading_of(pilot):
    return heading(pilot, PERIOD, steered=px4.steered(pilot))


@pytest.mark.parametrize("mode", [Mode.HOLD, Mode.TAKEOFF, Mode.LAND, Mode.RETURN])
def test_a_heading_asked_for_counts_only_in_offboard(mode):
    turning = Setpoint(20.0, NORTHWARDS, yaw=2.0, yaw_rate=1.0)
    assert heading_of(flying(mode, yaw=0.5, setpoint=turning)) == 0.5


@pytest.mark.parametrize(
    ("setpoint", "expected"),
    [
        (Setpoint(20.0, NORTHWARDS), 0.5),
        (Setpoint(20.0, NORTHWARDS, yaw=-2.0), -2.0),
        (Setpoint(20.0, NORTHWARDS, yaw=6.0), 6.0 - math.tau),
        (Setpoint(20.0, NORTHWARDS, yaw_rate=0.4), 0.52),
    ],
)
def test_offboard_keeps_the_heading_asked_for_or_its_own(setpoint, expected):
    assert heading_of(flying(Mode.OFFBOARD, yaw=0.5, setpoint=setpoint)) == pytest.approx(expected)


def test_a_yaw_rate_turns_round_and_round():
    pilot = flying(Mode.OFFBOARD, yaw=3.0, setpoint=Setpoint(20.0, NORTHWARDS, yaw_rate=0.5))
    for _ in range(200):
        pilot = pilot._replace(yaw=heading_of(pilot))
    assert pilot.yaw == pytest.approx(math.remainder(3.0 + 0.5 * 10.0, math.tau))


# The way home


@pytest.mark.parametrize(
    ("machine", "ne", "height", "return_height"),
    [
        (px4, (0.0, 100.0), 10.0, 60.0),
        (px4, (0.0, 100.0), 80.0, 80.0),
        (px4, (30.0, 40.0), 10.0, 50.0),
        (px4, (1.0, 0.0), 3.0, 10.0),
        (arducopter, (0.0, 100.0), 10.0, 15.0),
        (arducopter, (0.0, 100.0), 20.0, 20.0),
        (arducopter, (0.0, 4.0), 5.0, 12.0),
        (arducopter, (0.0, 0.0), 5.0, 7.5),
    ],
)
def test_a_return_is_as_high_as_parameters_say_and_lower_near_home(machine, ne, height, return_height):
    told = rules(table("px4" if machine is px4 else "ardupilot"))
    pilot = machine.set_mode(flying(), at(20.0, height=height, ne=ne), told, Mode.RETURN).pilot
    assert (pilot.mode, pilot.anchor_ned) == (Mode.RETURN, (0.0, 0.0, pytest.approx(-return_height)))


@pytest.mark.parametrize("machine", [px4, arducopter])
def test_a_return_climbs_then_goes_home_then_comes_down_there(machine):
    told = rules(table("px4" if machine is px4 else "ardupilot"))
    pilot = machine.set_mode(flying(home_ned=(1.0, 2.0, 0.0)), at(20.0, ne=(51.0, 2.0)), told, Mode.RETURN).pilot
    down = pilot.anchor_ned[2]

    north, east, climb = machine.velocity(pilot, at(20.0, ne=(51.0, 2.0)), told)
    assert (north, east) == (0.0, 0.0)
    assert climb < -1.0

    level = machine.velocity(pilot, at(30.0, height=-down, ne=(51.0, 2.0)), told)
    assert level == pytest.approx((-told.return_m_s, 0.0, 0.0))
    arriving = at(40.0, height=-down, ne=(1.4, 2.0), velocity=(-1.0, 0.0, 0.0))
    assert phase(machine.advance(pilot, arriving, told).pilot, arriving) is Phase.IN_AIR

    over_home = at(41.0, height=-down, ne=(1.1, 2.0))
    pilot = machine.advance(pilot, over_home, told).pilot
    assert (pilot.mode, phase(pilot, over_home)) == (Mode.RETURN, Phase.LANDING)
    assert machine.velocity(pilot, over_home, told) == pytest.approx((-0.095, 0.0, told.landing_fast_m_s))


@pytest.mark.parametrize(
    ("pilot", "now", "expected"),
    [
        (Pilot(), standing(1.0), Phase.ON_GROUND),
        (flying(Mode.TAKEOFF, climbing=True), standing(1.0), Phase.ON_GROUND),
        (flying(Mode.TAKEOFF, climbing=True), at(1.0), Phase.TAKING_OFF),
        (flying(Mode.GUIDED, climbing=True), at(1.0), Phase.TAKING_OFF),
        (flying(Mode.GUIDED), at(1.0), Phase.IN_AIR),
        (flying(Mode.LAND), at(1.0), Phase.LANDING),
        (Pilot(mode=Mode.LAND), at(1.0), Phase.IN_AIR),
    ],
)
def test_the_phase_of_a_flight_is_told(pilot, now, expected):
    assert phase(pilot, now) is expected


# Whatever happens

events = st.tuples(
    st.sampled_from(["advance", "arm", "disarm", "kill", "take off", "hear", "station", None, *Mode]),
    st.floats(0.0, 3.0),
    st.booleans(),
    st.tuples(*[st.floats(-5.0, 5.0)] * 3),
)
PX4_MODES = frozenset(px4_modes)
ARDUCOPTER_MODES = frozenset(Mode) - PX4_MODES | {Mode.RETURN, Mode.LAND}


def happen(machine, told, pilot, event, now, velocity):
    match event:
        case "arm":
            return machine.arm(pilot, now, told).pilot
        case "disarm" | "kill":
            return machine.disarm(pilot, now, force=event == "kill").pilot
        case "take off":
            return machine.take_off(pilot, now, told, 10.0).pilot
        case "hear":
            return machine.hear(pilot, Setpoint(now.time_s, velocity)) if machine.hears(pilot) else pilot
        case "station":
            return machine.hear_station(pilot, now).pilot
        case "advance":
            return machine.advance(pilot, now, told).pilot
        case _:
            return machine.set_mode(pilot, now, told, event).pilot


@given(
    story=st.lists(events, max_size=60),
    kind=st.sampled_from([("px4", px4, PX4_MODES), ("ardupilot", arducopter, ARDUCOPTER_MODES)]),
    stock=st.booleans(),
)
def test_whatever_happens_it_keeps_its_promises(story, kind, stock):
    name, machine, modes = kind
    told = rules(table(name, stock))
    pilot, time = machine.boot(), 0.0
    for event, seconds, on_ground, velocity in story:
        if isinstance(event, Mode) and event not in modes:
            continue
        time += seconds
        now = at(time, height=0.0 if on_ground else 10.0, velocity=velocity, on_ground=on_ground)
        before = pilot
        pilot = happen(machine, told, pilot, event, now, velocity)
        assert pilot.mode in modes
        assert event == "arm" or before.armed or not pilot.armed
        assert event == "kill" or on_ground or pilot.armed or not before.armed
        assert not (pilot.climbing and not pilot.armed)
        asked = machine.velocity(pilot, now, told)
        assert math.hypot(*asked) < 12.5
        if machine is arducopter:
            assert not on_ground or pilot.climbing or asked[2] > 0.0
        if before.loss is not None and pilot.loss is not None:
            assert event == "advance" or pilot.loss == before.loss
        if event == "advance" and pilot.armed:
            assert machine.deadline(pilot, told) > time
            if machine.steered(pilot):
                assert time - pilot.setpoint.time_s < told.setpoint_silence_s
        if event in (Mode.OFFBOARD, "arm") and machine.steered(pilot) and before != pilot:
            assert time - pilot.setpoint.time_s < told.setpoint_silence_s


@given(
    heard_s=st.floats(5.0, 50.0),
    silence_s=st.floats(0.1, 5.0),
    delay_s=st.floats(0.0, 20.0),
    action=st.sampled_from([Action.LAND, Action.RETURN]),
)
def test_px4_stops_and_acts_at_the_very_instants_that_parameters_name(heard_s, silence_s, delay_s, action):
    told = replace(RULES, setpoint_silence_s=silence_s, action_delay_s=delay_s, after_setpoints=action)
    pilot = flying(Mode.OFFBOARD, setpoint=Setpoint(heard_s, NORTHWARDS))
    stops_s = px4.deadline(pilot, told)
    assert stops_s == heard_s + silence_s
    assert px4.advance(pilot, at(stops_s - 1e-4), told).pilot.mode is Mode.OFFBOARD
    pilot = px4.advance(pilot, at(stops_s), told).pilot
    assert pilot.mode is Mode.HOLD
    assert px4.velocity(pilot, at(stops_s, velocity=NORTHWARDS), told) == (0.0, 0.0, 0.0)
    acts_s = px4.deadline(pilot, told)
    assert acts_s == pytest.approx(stops_s + delay_s)
    if delay_s > 1e-3:
        assert px4.advance(pilot, at(acts_s - 1e-4), told).pilot.mode is Mode.HOLD
    assert px4.advance(pilot, at(acts_s), told).pilot.mode is Mode(action.value)
