"""How healthy vehicles answer velocity commands."""

from math import exp, inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from trustr.response import Motion, Response, follow, followed, held_back, mean_lag_s

DT = 0.1
ARDUCOPTER = Response(0.3, 0.4, 2.5, 5.0)

delays, lags = st.floats(0, 1), st.floats(0.02, 3)
free = st.builds(Response, delays, lags)
bounded = st.builds(Response, delays, st.just(0.0) | lags, st.floats(0.2, 20), st.floats(0.2, 50))
flights = st.integers(1, 30).flatmap(lambda t: arrays(float, (t, 2, 2), elements=st.floats(-10, 10)))


def step(response, *, height=1.0, seconds=6.0, dt=DT):
    """(T,) north velocity of a vehicle at rest that is told, from the first tick on, to fly so fast."""
    rest = np.zeros((1, 2))
    motion, flown = Motion(rest, rest), [0.0]
    depth = held_back(response, dt)
    commanded = np.zeros((depth, 1, 2))
    for _ in range(round(seconds / dt)):
        commanded = np.concatenate([commanded[1:], [[[height, 0.0]]]])
        motion = follow(response, motion, commanded, dt=dt)
        flown.append(float(motion.velocity_ne[0, 0]))
    return np.array(flown)


def closed_form(response, *, dt=DT, seconds=6.0):
    """1 − e^(−(t − delay)/lag) from the delay on."""
    into = np.maximum(dt * np.arange(round(seconds / dt) + 1) - response.delay_s, 0.0)
    return 1.0 - np.exp(-into / response.lag_s)


# --- a lag behind a delay


@pytest.mark.parametrize("dt", [0.02, 0.05, 0.1, 0.2])
@pytest.mark.parametrize("ticks", [0, 1, 3, 7])
@pytest.mark.parametrize("lag_s", [0.05, 0.298, 2.0])
def test_a_step_after_whole_ticks_of_delay_is_answered_exactly_as_the_closed_form_says(dt, ticks, lag_s):
    response = Response(ticks * dt, lag_s)
    assert step(response, dt=dt) == pytest.approx(closed_form(response, dt=dt), abs=1e-12)


@pytest.mark.parametrize("delay_s", [0.3, 0.7, 1.2])
def test_a_delay_that_rounding_puts_just_below_whole_ticks_is_whole(delay_s):
    assert delay_s / DT != round(delay_s / DT)
    flown = step(Response(delay_s, 0.3))
    ticks = round(delay_s / DT)
    assert not flown[: ticks + 1].any()
    assert flown[ticks + 1] == pytest.approx(1 - exp(-DT / 0.3), abs=1e-12)


@given(delays, lags)
def test_a_fraction_of_a_tick_lies_between_its_neighbours(delay_s, lag_s):
    whole = np.floor(delay_s / DT) * DT
    sooner, between, later = (step(Response(delay, lag_s), seconds=2.0) for delay in (whole, delay_s, whole + DT))
    assert (between <= sooner + 1e-9).all()
    assert (between >= later - 1e-9).all()


def test_half_a_tick_of_delay_is_the_mean_of_none_and_one():
    halves = step(Response(0.0, 0.3)) + step(Response(DT, 0.3))
    assert step(Response(DT / 2, 0.3)) == pytest.approx(halves / 2, abs=1e-12)


@pytest.mark.parametrize("ticks", [0, 2, 5])
def test_without_a_lag_the_command_is_flown_once_it_acts(ticks):
    flown = step(Response(ticks * DT, 0.0), seconds=2.0)
    assert flown.tolist() == [0.0] * (ticks + 1) + [1.0] * (20 - ticks)


@given(flights, free)
def test_the_answer_stays_among_what_was_commanded(commanded, response):
    flown = followed(response, commanded[0], commanded, dt=DT)
    assert (flown <= commanded.max(0) + 1e-9).all()
    assert (flown >= commanded.min(0) - 1e-9).all()


@given(flights, flights, free)
def test_answers_of_vehicles_without_bounds_add_up(one, other, response):
    ticks = min(len(one), len(other))
    one, other = one[:ticks], other[:ticks]
    both = followed(response, one[0] + other[0], one + other, dt=DT)
    apart = followed(response, one[0], one, dt=DT) + followed(response, other[0], other, dt=DT)
    assert both == pytest.approx(apart, abs=1e-9)


def test_half_the_tick_tells_the_same():
    """With whole ticks of delay, a command that is held acts alike however often it is sent."""
    rng, response = np.random.default_rng(1), Response(0.2, 0.298)
    commanded = rng.uniform(-2, 2, (50, 3, 2))
    slowly = followed(response, commanded[0], commanded, dt=0.1)
    quickly = followed(response, commanded[0], np.repeat(commanded, 2, axis=0), dt=0.05)
    assert quickly[::2] == pytest.approx(slowly, abs=1e-12)


# --- bounds


@given(flights, bounded, st.sampled_from([0.05, 0.1, 0.2]))
def test_acceleration_and_its_change_stay_within_their_bounds(commanded, response, dt):
    depth = held_back(response, dt)
    padded = np.concatenate([np.repeat(commanded[:1], depth - 1, axis=0), commanded])
    rest = np.zeros((2, 2))
    motion = Motion(rest, rest)
    for tick in range(len(commanded)):
        before = motion
        motion = follow(response, before, padded[tick : tick + depth], dt=dt)
        assert np.linalg.norm(motion.acceleration_ne, axis=1).max() <= response.acceleration * (1 + 1e-9)
        change = np.linalg.norm(motion.acceleration_ne - before.acceleration_ne, axis=1)
        assert change.max() <= response.jerk * dt * (1 + 1e-9)
        faster = np.linalg.norm(motion.velocity_ne - before.velocity_ne, axis=1)
        assert faster.max() <= response.acceleration * dt * (1 + 1e-9)


@given(st.floats(0.1, 1), st.floats(0.5, 10), st.floats(0.5, 20), st.floats(0.1, 10))
def test_vehicles_with_bounds_arrive_and_do_not_overshoot(lag_s, acceleration, jerk, height):
    response = Response(0.1, lag_s, acceleration, jerk)
    within_s = 15 * lag_s + 2 * height / acceleration + acceleration / jerk + 4 * (height / jerk) ** 0.5
    flown = step(response, height=height, seconds=within_s)
    assert flown[-1] == pytest.approx(height, abs=1e-3 * height)
    assert flown.max() <= 1.02 * height + jerk * DT**2  # what the jerk can do in one tick


@pytest.mark.parametrize("height", [0.1, 2.0])
@pytest.mark.parametrize("jerk", [0.5, 20.0])
def test_bounds_without_a_lag_are_no_division_by_nothing(height, jerk):
    flown = step(Response(0.0, 0.0, 2.5, jerk), height=height, seconds=10.0)
    assert np.isfinite(flown).all()
    assert flown[-1] == pytest.approx(height, abs=3 * jerk * DT**2)


def test_a_large_step_takes_the_time_that_constant_jerk_and_acceleration_take():
    """0 → 10 m/s at 2.5 m/s² with 5 m/s³: half a second each to build up and take off, 3.5 s between."""
    flown = step(Response(0.0, 0.02, 2.5, 5.0), height=10.0)
    times = DT * np.arange(len(flown))
    middle = (times > 1.0) & (times < 3.0)
    assert np.diff(flown)[middle[:-1]] == pytest.approx(2.5 * DT, rel=1e-9)
    assert flown[45] == pytest.approx(10.0, abs=0.2)
    assert flown[40] < 9.5


def test_small_steps_do_not_feel_the_bounds():
    """Its own second-order build-up of acceleration aside, a lag: late by A/J at the most."""
    height = 1e-4
    flown = step(Response(0.2, 0.5, 2.5, 1e3), height=height) / height
    assert flown == pytest.approx(closed_form(Response(0.2, 0.5)), abs=0.02)


@given(flights, st.floats(-np.pi, np.pi))
def test_turning_the_world_turns_the_answer(commanded, angle):
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    flown = followed(ARDUCOPTER, np.zeros((2, 2)), commanded, dt=DT)
    assert followed(ARDUCOPTER, np.zeros((2, 2)), commanded @ turn, dt=DT) == pytest.approx(flown @ turn, abs=1e-6)


@given(flights, free | bounded)
def test_no_vehicle_feels_another(commanded, response):
    together = followed(response, commanded[0], commanded, dt=DT)
    for row in range(2):
        alone = commanded[:, row : row + 1]
        assert (followed(response, alone[0], alone, dt=DT)[:, 0] == together[:, row]).all()


@given(flights, free | bounded)
def test_a_whole_flight_is_its_ticks_one_after_the_other(commanded, response):
    depth = held_back(response, DT)
    held = np.repeat(commanded[:1], depth, axis=0)
    motion = Motion(commanded[0], np.zeros((2, 2)))
    flown = [motion.velocity_ne]
    for command in commanded[:-1]:
        held = np.concatenate([held[1:], command[None]])
        motion = follow(response, motion, held, dt=DT)
        flown.append(motion.velocity_ne)
    assert (followed(response, commanded[0], commanded, dt=DT) == np.array(flown)).all()


# --- how late, all in all


@given(free)
def test_without_bounds_the_mean_lag_is_delay_and_lag(response):
    assert mean_lag_s(response) == pytest.approx(response.delay_s + response.lag_s)


@pytest.mark.parametrize("height", [0.1, 1.0, 10.0])
def test_bounds_that_nothing_reaches_do_not_count(height):
    assert mean_lag_s(Response(0.2, 0.5, 1e6, 1e6), step=height) == pytest.approx(0.7, abs=1e-6)


def test_with_bounds_the_mean_lag_is_that_of_the_answer():
    """∫ (1 − v) dt by the trapezoid rule over the flown step."""
    late = 1.0 - step(ARDUCOPTER, seconds=20.0)
    assert mean_lag_s(ARDUCOPTER) == pytest.approx(np.trapezoid(late, dx=DT), abs=0.02)


def test_larger_steps_are_answered_later():
    lags_s = [mean_lag_s(ARDUCOPTER, step=height) for height in (0.01, 0.1, 1.0, 5.0)]
    assert lags_s == sorted(lags_s)
    assert lags_s[0] == pytest.approx(0.7, abs=0.02)


def test_a_step_down_is_as_late_as_a_step_up():
    assert mean_lag_s(ARDUCOPTER, step=-2.0) == pytest.approx(mean_lag_s(ARDUCOPTER, step=2.0))


def test_what_is_remembered_reaches_back_to_the_command_that_acts():
    assert [held_back(Response(delay, 0.3, inf, inf), DT) for delay in (0.0, 0.05, 0.1, 0.3, 0.31)] == [2, 2, 3, 5, 5]
