"""The paper's fault as a function of a commanded velocity."""

from math import cos, hypot, pi, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.degradation import FADE_BELOW, degrade

CRUISE, OFFSET = 1.5, 0.47

speeds = st.floats(0, 10)
headings = st.floats(-pi, pi)
fractions = st.floats(0, 1)


def fault(velocity, *, cruise=CRUISE, max_speed=0.4, offset=OFFSET):
    return degrade(velocity, cruise=cruise, max_speed_fraction=max_speed, offset_fraction=offset)


def polar(speed, heading):
    return speed * cos(heading), speed * sin(heading)


@pytest.mark.parametrize("max_speed", [0.4, 0.7])
def test_at_cruise_northwards_it_crawls_north_and_drifts_west(max_speed):
    assert fault((CRUISE, 0.0), max_speed=max_speed) == pytest.approx((max_speed * CRUISE, -OFFSET * CRUISE))


@pytest.mark.parametrize(
    ("commanded", "left"), [((1, 0), (0, -1)), ((0, 1), (1, 0)), ((-1, 0), (0, 1)), ((0, -1), (-1, 0))]
)
def test_the_offset_points_left_of_the_direction_as_seen_from_above(commanded, left):
    north, east = fault((CRUISE * commanded[0], CRUISE * commanded[1]), max_speed=0.0)
    assert (north, east) == pytest.approx((OFFSET * CRUISE * left[0], OFFSET * CRUISE * left[1]))


def test_the_offset_comes_after_the_cap_and_may_exceed_it():
    assert hypot(*fault((CRUISE, 0.0), max_speed=0.4)) == pytest.approx(CRUISE * hypot(0.4, OFFSET))


@given(headings, st.floats(0.7 * CRUISE, 10))
def test_above_the_cap_how_fast_it_was_asked_to_fly_makes_no_difference(heading, speed):
    assert fault(polar(speed, heading), max_speed=0.7) == pytest.approx(fault(polar(CRUISE, heading), max_speed=0.7))


@given(headings, st.floats(FADE_BELOW * CRUISE, 0.4 * CRUISE))
def test_below_the_cap_only_the_offset_is_added(heading, speed):
    flown = fault(polar(speed, heading))
    wanted, left = polar(speed, heading), polar(OFFSET * CRUISE, heading - pi / 2)
    assert flown == pytest.approx((wanted[0] + left[0], wanted[1] + left[1]))


@given(headings, st.floats(0, 1))
def test_the_offset_fades_linearly_to_zero_below_three_tenths_of_cruise(heading, part):
    north, east = fault(polar(part * FADE_BELOW * CRUISE, heading), max_speed=0.0)
    assert hypot(north, east) == pytest.approx(part * OFFSET * CRUISE, abs=1e-12)


def test_it_fades_at_three_tenths():
    assert FADE_BELOW == 0.3


def test_a_robot_asked_to_stop_stops():
    assert fault((0.0, 0.0)) == (0.0, 0.0)
    assert fault((-0.0, 0.0)) == (0.0, 0.0)


@given(headings, speeds, headings, fractions, fractions)
def test_turning_the_command_turns_what_is_flown(heading, speed, turn, max_speed, offset):
    straight = fault(polar(speed, heading), max_speed=max_speed, offset=offset)
    turned = fault(polar(speed, heading + turn), max_speed=max_speed, offset=offset)
    north, east = straight
    assert turned == pytest.approx(
        (north * cos(turn) - east * sin(turn), north * sin(turn) + east * cos(turn)), abs=1e-9
    )


@given(headings, speeds, fractions, st.floats(0.1, 10))
def test_only_speeds_in_units_of_cruise_matter(heading, speed, max_speed, scale):
    north, east = fault(polar(speed, heading), max_speed=max_speed)
    scaled = fault(polar(scale * speed, heading), max_speed=max_speed, cruise=scale * CRUISE)
    assert scaled == pytest.approx((scale * north, scale * east), abs=1e-9)


@given(headings, st.floats(0, CRUISE))
def test_a_motor_that_may_reach_cruise_and_does_not_drift_is_healthy(heading, speed):
    assert fault(polar(speed, heading), max_speed=1.0, offset=0.0) == pytest.approx(polar(speed, heading), abs=1e-12)


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), fractions, fractions)
def test_what_is_flown_is_never_faster_than_cap_and_offset_together(north, east, max_speed, offset):
    flown = fault((north, east), max_speed=max_speed, offset=offset)
    assert hypot(*flown) <= CRUISE * hypot(max_speed, offset) + 1e-9
