"""What healthy vehicles are like, found from synthetic flights of vehicles that are known."""

from dataclasses import replace
from math import exp

import numpy as np
import pytest

from trustr.identification import FINEST, MARGIN, Sample, _tolerances, identify
from trustr.response import Response, followed

DT = 0.1
QUAD = Response(0.147, 0.298)
SLOW = Response(0.37, 0.92)


def flight(response, *, seconds=15.0, seed=0, count=4, dt=DT, quickness=1.0):
    """A flight of perfect vehicles whose commands change every other second, each robot's at will."""
    rng = np.random.default_rng(seed)
    held = rng.uniform(-quickness, quickness, (round(seconds / 2.0) + 1, count, 2))
    commanded = np.repeat(held, round(2.0 / dt), axis=0)[: round(seconds / dt)]
    velocity = followed(response, commanded[0], commanded, dt=dt)
    return Sample(commanded, velocity, moved_by(velocity, dt))


def moved_by(velocity, dt=DT):
    """Positions (T, N, 2) of vehicles that fly so."""
    steps = 0.5 * dt * (velocity[1:] + velocity[:-1])
    return np.concatenate([np.zeros_like(velocity[:1]), np.cumsum(steps, axis=0)])


def noisy(sample, *, velocity_m_s, position_m, seed=0):
    rng = np.random.default_rng(seed)
    return replace(
        sample,
        velocity_ne=sample.velocity_ne + velocity_m_s * rng.standard_normal(sample.velocity_ne.shape),
        position_ne=sample.position_ne + position_m * rng.standard_normal(sample.position_ne.shape),
    )


def all_but_perfect(sample):
    """With a millimetre of noise, so that what is left unexplained is white, and no bounds are looked for."""
    return noisy(sample, velocity_m_s=1e-3, position_m=1e-3)


def blown_about(sample, *, gust_m_s, time_s=1.0, seed=0):
    """The same flight with a first-order Gauss–Markov disturbance on every velocity, and where that leads."""
    rng, kept = np.random.default_rng(seed), exp(-DT / time_s)
    gust = np.zeros_like(sample.velocity_ne)
    for tick in range(1, len(gust)):
        gust[tick] = kept * gust[tick - 1] + gust_m_s * (1 - kept**2) ** 0.5 * rng.standard_normal(gust[0].shape)
    velocity = sample.velocity_ne + gust
    return replace(sample, velocity_ne=velocity, position_ne=moved_by(velocity))


@pytest.mark.parametrize("response", [QUAD, SLOW, Response(0.0, 0.5), Response(0.3, 0.1)], ids=str)
def test_delay_and_lag_of_vehicles_without_fail_are_found(response):
    found = identify([all_but_perfect(flight(response))], dt=DT)
    assert found.response.delay_s == pytest.approx(response.delay_s, abs=1e-3)
    assert found.response.lag_s == pytest.approx(response.lag_s, abs=1e-3)
    assert found.response.jerk == found.response.acceleration == np.inf
    assert found.unexplained == pytest.approx(1e-3, rel=0.1)


@pytest.mark.parametrize("response", [QUAD, SLOW], ids=str)
def test_delay_and_lag_are_found_in_noise(response):
    found = identify([noisy(flight(response), velocity_m_s=0.1, position_m=0.1)], dt=DT)
    assert found.response.delay_s == pytest.approx(response.delay_s, abs=0.03)
    assert found.response.lag_s == pytest.approx(response.lag_s, abs=0.04)
    assert found.response.jerk == np.inf
    assert found.unexplained == pytest.approx(0.1, rel=0.05)


def test_bounds_of_acceleration_and_jerk_are_found_whatever_the_delay():
    """A fit that moves the delay along with the rest ends in a whole tick near to where it began."""
    response = Response(0.15, 0.37, 2.35, 3.8)
    sample = noisy(flight(response, seconds=8.0, count=4, quickness=3.0), velocity_m_s=0.02, position_m=0.0)
    found = identify([sample], dt=DT).response
    assert found.delay_s == pytest.approx(response.delay_s, abs=0.02)
    assert found.lag_s == pytest.approx(response.lag_s, abs=0.03)
    assert found.acceleration == pytest.approx(response.acceleration, rel=0.03)
    assert found.jerk == pytest.approx(response.jerk, rel=0.05)


def test_a_tick_of_another_length_finds_the_same_vehicles():
    found = identify([all_but_perfect(flight(QUAD, dt=0.05))], dt=0.05)
    assert found.response.delay_s == pytest.approx(QUAD.delay_s, abs=1e-3)
    assert found.response.lag_s == pytest.approx(QUAD.lag_s, abs=1e-3)


def test_one_vehicle_is_enough():
    found = identify([all_but_perfect(flight(QUAD, count=1))], dt=DT)
    assert found.response.lag_s == pytest.approx(QUAD.lag_s, abs=1e-3)
    assert found.tolerance == FINEST


def test_of_a_perfect_fleet_nothing_finer_than_the_floor_is_asked():
    """The predicted place, summed by rectangles, is off by half a tick of each change of velocity: far below that."""
    found = identify([all_but_perfect(flight(QUAD, quickness=0.3))], dt=DT)
    assert (found.tolerance, found.place_tolerance) == (FINEST, FINEST)


def test_how_much_the_flights_moved_is_told():
    still, quick = (identify([all_but_perfect(flight(QUAD, quickness=speed))], dt=DT).moved for speed in (0.2, 2.0))
    assert quick == pytest.approx(10 * still, rel=1e-3)


@pytest.mark.parametrize("noise", [0.05, 0.2])
def test_noise_of_telemetry_alone_is_no_vagary_of_the_vehicles(noise):
    """Watched with its own noise taken off, it asks for no more than about half of it, white as it is."""
    found = identify([noisy(flight(QUAD), velocity_m_s=noise, position_m=noise)], dt=DT)
    assert found.tolerance < max(FINEST, 0.5 * noise)
    assert found.place_tolerance < max(2 * FINEST, 0.6 * noise)


def blown(*rows, gust_m_s):
    """A flight in which these robots are blown about."""
    calm = flight(QUAD)
    gusts = blown_about(calm, gust_m_s=gust_m_s)
    velocity, position = calm.velocity_ne.copy(), calm.position_ne.copy()
    velocity[:, rows], position[:, rows] = gusts.velocity_ne[:, rows], gusts.position_ne[:, rows]
    return replace(calm, velocity_ne=velocity, position_ne=position)


def tolerance(sample):
    """Of the response residual [m/s], where the response is known."""
    return _tolerances([sample], QUAD, DT)[0]


def test_tolerance_grows_with_what_blows_one_vehicle_about():
    tolerances = [tolerance(blown(1, gust_m_s=gust)) for gust in (0.1, 0.2)]
    assert tolerances[1] == pytest.approx(2 * tolerances[0], rel=0.1)
    assert 0.1 < tolerances[1] / MARGIN < 0.3


def test_what_blows_all_about_is_left_to_be_seen_in_flight():
    """Every tick of flight it is estimated anew as the swarm's unrest, and no tolerance needs to hold it."""
    one, everyone = (tolerance(blown(*rows, gust_m_s=0.2)) for rows in ([1], range(4)))
    assert everyone < one / 3
