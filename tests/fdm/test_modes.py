"""The mode machine without a vehicle: situations in, modes and velocities out."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fdm import modes
from fdm.modes import Failsafe, Mode, Pilot, Setpoint, Situation

FAILSAFE = Failsafe()
PERIOD = 0.05
NORTHWARDS = (2.0, 0.0, 0.0)


def at(time_s, *, height=10.0, velocity=(0.0, 0.0, 0.0), on_ground=False, yaw=0.0):
    return Situation(time_s, (3.0, 4.0, -height), velocity, yaw, on_ground)


def standing(time_s):
    return at(time_s, height=0.0, on_ground=True)


def flying(mode=Mode.HOLD, **known):
    return Pilot(armed=True, mode=mode, airborne=True, **known)


def live(pilot, situation, from_s, to_s):
    """Advance every period; gives the pilot at the end and [(time, word)] on the way."""
    said = []
    for n in range(round(from_s / PERIOD), round(to_s / PERIOD) + 1):
        outcome = modes.advance(pilot, situation(n * PERIOD), FAILSAFE)
        pilot = outcome.pilot
        said += [(n * PERIOD, words) for _, words in outcome.words]
    return pilot, said


heard_now = Setpoint(time_s=20.0, velocity_ned=NORTHWARDS)
heard_long_ago = Setpoint(time_s=10.0, velocity_ned=NORTHWARDS)


@pytest.mark.parametrize(
    ("before", "setpoint", "asked", "after", "agreed"),
    [
        (Mode.HOLD, None, Mode.HOLD, Mode.HOLD, True),
        (Mode.HOLD, None, Mode.LAND, Mode.LAND, True),
        (Mode.HOLD, heard_now, Mode.OFFBOARD, Mode.OFFBOARD, True),
        (Mode.HOLD, None, Mode.OFFBOARD, Mode.HOLD, False),
        (Mode.HOLD, heard_long_ago, Mode.OFFBOARD, Mode.HOLD, False),
        (Mode.TAKEOFF, None, Mode.HOLD, Mode.HOLD, True),
        (Mode.TAKEOFF, heard_now, Mode.OFFBOARD, Mode.OFFBOARD, True),
        (Mode.TAKEOFF, heard_long_ago, Mode.OFFBOARD, Mode.TAKEOFF, False),
        (Mode.TAKEOFF, None, Mode.LAND, Mode.LAND, True),
        (Mode.OFFBOARD, heard_now, Mode.HOLD, Mode.HOLD, True),
        (Mode.OFFBOARD, heard_now, Mode.LAND, Mode.LAND, True),
        (Mode.OFFBOARD, heard_long_ago, Mode.OFFBOARD, Mode.OFFBOARD, False),
        (Mode.LAND, None, Mode.HOLD, Mode.HOLD, True),
        (Mode.LAND, heard_now, Mode.OFFBOARD, Mode.OFFBOARD, True),
        (Mode.LAND, None, Mode.LAND, Mode.LAND, True),
    ],
)
def test_a_mode_that_is_asked_for_is_flown_or_refused(before, setpoint, asked, after, agreed):
    outcome = modes.set_mode(flying(before, setpoint=setpoint), at(20.1), asked, FAILSAFE)
    assert (outcome.pilot.mode, outcome.accepted) == (after, agreed)
    assert bool(outcome.words) is not agreed


@pytest.mark.parametrize(("before", "after"), [(mode, Mode.TAKEOFF) for mode in Mode])
def test_a_take_off_interrupts_whatever_is_flown(before, after):
    outcome = modes.take_off(flying(before, land_at_s=25.0), at(20.0), 12.0)
    assert (outcome.pilot.mode, outcome.accepted, outcome.pilot.land_at_s) == (after, True, None)
    assert outcome.pilot.anchor_ned == (3.0, 4.0, -12.0)


@pytest.mark.parametrize(("seconds", "agreed"), [(0.0, False), (0.98, False), (1.0, True), (5.0, True)])
def test_arming_is_refused_in_the_first_second(seconds, agreed):
    outcome = modes.arm(Pilot(), standing(seconds))
    assert (outcome.accepted, outcome.pilot.armed) == (agreed, agreed)
    assert outcome.words[0][1] == ("Armed by external command" if agreed else "Arming denied: sensors are settling")


def test_arming_twice_changes_nothing():
    pilot = flying(Mode.OFFBOARD)
    outcome = modes.arm(pilot, at(20.0))
    assert outcome.accepted
    assert outcome.pilot == pilot
    assert outcome.words == ()


def test_arming_begins_in_hold_with_the_heading_of_the_moment():
    left_over = Pilot(mode=Mode.LAND, anchor_ned=(9.0, 9.0, 9.0), yaw=1.0, land_at_s=3.0, airborne=True)
    pilot = modes.arm(left_over, at(20.0, height=0.0, on_ground=True, yaw=-2.0)).pilot
    assert pilot == Pilot(armed=True, mode=Mode.HOLD, yaw=-2.0, grounded_since_s=20.0)


@pytest.mark.parametrize(
    ("pilot", "height", "word"),
    [(Pilot(), 10.0, "arm first"), (flying(), 0.0, "below home"), (flying(), -300.0, "below home")],
)
def test_a_take_off_is_refused_disarmed_and_downwards(pilot, height, word):
    outcome = modes.take_off(pilot, standing(20.0), height)
    assert not outcome.accepted
    assert outcome.pilot == pilot
    assert word in outcome.words[0][1]


@pytest.mark.parametrize(
    ("on_ground", "force", "agreed"),
    [(True, False, True), (True, True, True), (False, False, False), (False, True, True)],
)
def test_in_the_air_only_force_disarms(on_ground, force, agreed):
    outcome = modes.disarm(flying(), at(20.0, on_ground=on_ground), force=force)
    assert (outcome.accepted, outcome.pilot.armed) == (agreed, not agreed)


def test_a_disarmed_vehicle_may_be_disarmed_in_any_place():
    assert modes.disarm(Pilot(), at(20.0), force=False).accepted


def test_silent_set_points_lead_to_hold_then_to_land():
    offboard = flying(Mode.OFFBOARD, setpoint=Setpoint(10.0, NORTHWARDS))

    def coasting(t):
        return at(t, velocity=NORTHWARDS)

    pilot, said = live(offboard, coasting, 10.0, 10.45)
    assert (pilot.mode, said) == (Mode.OFFBOARD, [])
    assert modes.command(pilot, coasting(10.45)) == NORTHWARDS

    pilot, said = live(pilot, coasting, 10.55, 10.55)
    assert (pilot.mode, [word for _, word in said]) == (Mode.HOLD, ["Set-points lost: holding"])
    assert modes.command(pilot, coasting(10.55)) == (0.0, 0.0, 0.0)

    pilot, said = live(pilot, at, 10.6, 15.5)
    assert (pilot.mode, said) == (Mode.HOLD, [])
    pilot, said = live(pilot, at, 15.55, 15.6)
    assert (pilot.mode, [word for _, word in said]) == (Mode.LAND, ["Set-points did not come back: landing"])

    pilot, said = live(pilot, standing, 25.0, 25.45)
    assert (pilot.armed, said) == (True, [])
    pilot, said = live(pilot, standing, 25.5, 25.55)
    assert (pilot.armed, [word for _, word in said]) == (False, ["Landed, disarmed"])


def test_set_points_just_within_half_a_second_are_enough():
    pilot = flying(Mode.OFFBOARD, setpoint=Setpoint(10.0, NORTHWARDS))
    for n in range(20, 40):
        pilot = modes.hear(pilot, Setpoint(n * 0.5, NORTHWARDS))
        pilot, said = live(pilot, at, n * 0.5, n * 0.5 + 0.45)
        assert (pilot.mode, said) == (Mode.OFFBOARD, [])


@pytest.mark.parametrize("asked", [Mode.OFFBOARD, Mode.HOLD])
def test_a_ground_station_that_comes_back_calls_the_landing_off(asked):
    pilot = flying(Mode.OFFBOARD, setpoint=Setpoint(10.0, NORTHWARDS))
    pilot, _ = live(pilot, at, 10.0, 15.0)
    assert pilot.land_at_s is not None
    pilot = modes.hear(pilot, Setpoint(15.0, NORTHWARDS))
    pilot = modes.set_mode(pilot, at(15.0), asked, FAILSAFE).pilot
    for n in range(30, 44):
        pilot = modes.hear(pilot, Setpoint(n * 0.5, NORTHWARDS))
        pilot, said = live(pilot, at, n * 0.5, n * 0.5 + 0.45)
        assert (pilot.mode, said) == (asked, [])


def test_the_failsafe_times_are_parameters():
    patient = Failsafe(setpoint_silence_s=2.0, land_after_s=1.0)
    pilot = flying(Mode.OFFBOARD, setpoint=Setpoint(10.0, NORTHWARDS))
    assert modes.advance(pilot, at(11.99), patient).pilot.mode is Mode.OFFBOARD
    pilot = modes.advance(pilot, at(12.01), patient).pilot
    assert pilot.mode is Mode.HOLD
    assert modes.advance(pilot, at(13.0), patient).pilot.mode is Mode.HOLD
    assert modes.advance(pilot, at(13.02), patient).pilot.mode is Mode.LAND


def test_only_offboard_watches_set_points():
    for mode in (Mode.HOLD, Mode.LAND):
        pilot, _ = live(flying(mode, setpoint=heard_long_ago), at, 11.0, 40.0)
        assert (pilot.mode, pilot.land_at_s) == (mode, None)


def test_armed_but_idle_it_disarms_after_ten_seconds():
    pilot = modes.arm(Pilot(), standing(20.0)).pilot
    pilot, said = live(pilot, standing, 20.0, 29.95)
    assert (pilot.armed, said) == (True, [])
    pilot, said = live(pilot, standing, 30.0, 30.05)
    assert (pilot.armed, [word for _, word in said]) == (False, ["Disarmed: no take-off"])


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
    pilot = modes.take_off(flying(), at(20.0, height=0.0), 10.0).pilot
    pilot = modes.advance(pilot, at(25.0, height=height), FAILSAFE).pilot
    assert pilot.mode is mode
    assert pilot.anchor_ned == (3.0, 4.0, -10.0)


@pytest.mark.parametrize("mode", [Mode.HOLD, Mode.OFFBOARD, Mode.LAND])
def test_on_the_ground_it_presses_down(mode):
    climb = Setpoint(20.0, (1.0, 1.0, -2.0))
    assert modes.command(flying(mode, setpoint=climb), standing(20.0)) == (0.0, 0.0, modes.PRESS_DOWN)


def test_only_take_off_leaves_the_ground():
    pilot = modes.take_off(flying(), standing(20.0), 10.0).pilot
    assert modes.command(pilot, standing(20.0)) == (0.0, 0.0, -modes.TAKEOFF_SPEED)


@pytest.mark.parametrize(
    ("height", "down"), [(50.0, modes.DESCENT_SPEED), (3.01, modes.DESCENT_SPEED), (2.99, modes.LANDING_SPEED)]
)
def test_landing_slows_near_the_ground(height, down):
    assert modes.command(flying(Mode.LAND), at(20.0, height=height)) == (0.0, 0.0, down)


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
    assert modes.command(pilot, at(20.0)) == pytest.approx(expected)


def test_hold_takes_its_place_once_it_has_stopped():
    pilot = modes.advance(flying(), at(20.0, velocity=(0.31, 0.0, 0.0)), FAILSAFE).pilot
    assert pilot.anchor_ned is None
    pilot = modes.advance(pilot, at(20.05, velocity=(0.2, 0.0, 0.2)), FAILSAFE).pilot
    assert pilot.anchor_ned == (3.0, 4.0, -10.0)


def test_land_takes_its_place_while_it_comes_down():
    pilot = modes.advance(flying(Mode.LAND), at(20.0, velocity=(0.31, 0.0, 1.5)), FAILSAFE).pilot
    assert pilot.anchor_ned is None
    pilot = modes.advance(pilot, at(20.05, velocity=(0.2, 0.2, 1.5)), FAILSAFE).pilot
    assert pilot.anchor_ned == (3.0, 4.0, -10.0)


@pytest.mark.parametrize(
    ("asked", "flown"),
    [
        ((2.0, -1.0, 0.5), (2.0, -1.0, 0.5)),
        ((0.0, 12.0, 0.0), (0.0, 12.0, 0.0)),
        ((30.0, 40.0, 0.0), (7.2, 9.6, 0.0)),
        ((0.0, 0.0, 9.0), (0.0, 0.0, modes.OFFBOARD_DESCENT)),
        ((0.0, 0.0, -9.0), (0.0, 0.0, -modes.OFFBOARD_CLIMB)),
        ((3e38, 0.0, 3e38), (12.0, 0.0, modes.OFFBOARD_DESCENT)),
    ],
)
def test_offboard_flies_what_is_asked_within_limits(asked, flown):
    pilot = flying(Mode.OFFBOARD, setpoint=Setpoint(20.0, asked))
    assert modes.command(pilot, at(20.0)) == pytest.approx(flown)


@pytest.mark.parametrize("mode", [Mode.HOLD, Mode.TAKEOFF, Mode.LAND])
def test_a_heading_asked_for_counts_only_in_offboard(mode):
    turning = Setpoint(20.0, NORTHWARDS, yaw=2.0, yaw_rate=1.0)
    assert modes.heading(flying(mode, yaw=0.5, setpoint=turning), PERIOD) == 0.5


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
    assert modes.heading(flying(Mode.OFFBOARD, yaw=0.5, setpoint=setpoint), PERIOD) == pytest.approx(expected)


def test_a_yaw_rate_turns_round_and_round():
    pilot = flying(Mode.OFFBOARD, yaw=3.0, setpoint=Setpoint(20.0, NORTHWARDS, yaw_rate=0.5))
    for _ in range(200):
        pilot = pilot._replace(yaw=modes.heading(pilot, PERIOD))
    assert pilot.yaw == pytest.approx(math.remainder(3.0 + 0.5 * 10.0, math.tau))


events = st.tuples(
    st.sampled_from(["advance", "arm", "disarm", "kill", "take off", "hear", *Mode]),
    st.floats(0.0, 3.0),
    st.booleans(),
    st.tuples(*[st.floats(-5.0, 5.0)] * 3),
)


@given(st.lists(events, max_size=60))
def test_whatever_happens_it_arms_only_when_told_and_stays_armed_in_the_air(story):
    pilot, time = Pilot(), 0.0
    for event, seconds, on_ground, velocity in story:
        time += seconds
        now = at(time, height=0.0 if on_ground else 10.0, velocity=velocity, on_ground=on_ground)
        before = pilot
        match event:
            case "arm":
                pilot = modes.arm(pilot, now).pilot
            case "disarm" | "kill":
                pilot = modes.disarm(pilot, now, force=event == "kill").pilot
            case "take off":
                pilot = modes.take_off(pilot, now, 10.0).pilot
            case "hear":
                pilot = modes.hear(pilot, Setpoint(time, velocity))
            case Mode():
                pilot = modes.set_mode(pilot, now, event, FAILSAFE).pilot
            case _:
                pilot = modes.advance(pilot, now, FAILSAFE).pilot
        assert event == "arm" or before.armed or not pilot.armed
        assert event == "kill" or on_ground or pilot.armed or not before.armed
        if pilot.armed and pilot.mode is Mode.OFFBOARD and event == "advance":
            assert time - pilot.setpoint.time_s <= FAILSAFE.setpoint_silence_s
        assert math.hypot(*modes.command(pilot, now)) < 12.5
