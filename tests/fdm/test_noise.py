"""Seeded randomness against closed forms. Bounds are five standard errors wide, computed; seeds are fixed."""

import itertools
import math

import numpy as np
import pytest

from fdm import noise
from fdm.noise import Purpose, generator, gusts, white


def take(stream, count):
    return np.array(list(itertools.islice(stream, count)))


def rng(seed=1, vehicle=1, purpose=Purpose.GUST):
    return generator(seed, vehicle, purpose)


@pytest.mark.parametrize("deviations", [(0.1, 0.1, 0.05, 0.05), (2.0,)])
def test_white_noise_has_its_deviation_on_every_axis_and_no_mean(deviations):
    n = 40_000
    draws = take(white(rng(), deviations), n)
    sigma = np.array(deviations)
    assert np.all(np.abs(draws.mean(axis=0)) < 5 * sigma / math.sqrt(n))
    assert np.all(np.abs(draws.std(axis=0) / sigma - 1) < 5 / math.sqrt(2 * n))


def test_white_noise_is_white_and_its_axes_know_nothing_of_each_other():
    n = 40_000
    draws = take(white(rng(), (1.0, 1.0, 1.0)), n)
    bound = 5 / math.sqrt(n)
    for lag in (1, 2, 20):
        assert np.all(np.abs((draws[:-lag] * draws[lag:]).mean(axis=0)) < bound)
    across = np.corrcoef(draws.T)
    assert np.all(np.abs(across[~np.eye(3, dtype=bool)]) < bound)


def test_an_axis_without_noise_is_exactly_zero():
    assert not take(white(rng(), (0.0, 1.0)), 1000)[:, 0].any()


@pytest.mark.parametrize(("dt", "correlation_s"), [(0.05, 2.0), (0.05, 0.2), (0.5, 2.0)])
def test_gusts_have_the_deviation_and_the_memory_of_a_gauss_markov_wind(dt, correlation_s):
    n, sigma = 100_000, 0.7
    draws = take(gusts(rng(), deviation=sigma, correlation_s=correlation_s, dt=dt), n)
    a = math.exp(-dt / correlation_s)
    # Standard error of the variance of a first-order process, and Bartlett's of its correlations.
    spread = math.sqrt(2 / n * (1 + a * a) / (1 - a * a))
    variance = (draws**2).mean(axis=0)
    assert np.all(np.abs(variance / sigma**2 - 1) < 5 * spread)
    for lag in (1, round(0.5 * correlation_s / dt), round(correlation_s / dt)):
        seen = (draws[:-lag] * draws[lag:]).mean(axis=0) / variance
        b = a ** (2 * lag)
        error = math.sqrt(((1 + a * a) * (1 - b) / (1 - a * a) - 2 * lag * b) / n)
        assert np.all(np.abs(seen - math.exp(-lag * dt / correlation_s)) < 5 * error + 1e-12)
    axes = math.sqrt((1 + a * a) / (1 - a * a) / n)
    assert abs((draws[:, 0] * draws[:, 1]).mean()) < 5 * axes * sigma**2


@pytest.mark.parametrize("at", [0, 1, 30])
def test_gusts_are_as_strong_at_first_as_ever(at):
    winds = [take(gusts(rng(vehicle=v), deviation=0.7, correlation_s=2.0, dt=0.05), at + 1)[at] for v in range(1, 501)]
    n = 2 * len(winds)
    assert abs(np.std(winds) / 0.7 - 1) < 5 / math.sqrt(2 * n)
    assert abs(np.mean(winds)) < 5 * 0.7 / math.sqrt(n)


def test_the_same_name_gives_the_same_numbers():
    assert np.array_equal(take(white(rng(), (1.0,)), 1000), take(white(rng(), (1.0,)), 1000))


def test_every_seed_vehicle_and_purpose_has_numbers_of_its_own():
    names = itertools.product((0, 1, 2, 2**40), (1, 2, 250), Purpose)
    first = [generator(*name).standard_normal(4).tolist() for name in names]
    flat = list(itertools.chain(*first))
    assert len(set(flat)) == len(flat)


@pytest.mark.parametrize("block", [1, 7, 1000])
def test_how_many_are_drawn_at_a_time_changes_nothing(monkeypatch, block):
    expected = take(white(rng(), (1.0, 2.0, 3.0)), 1500)
    windy = take(gusts(rng(), deviation=1.0, correlation_s=2.0, dt=0.05), 1500)
    monkeypatch.setattr(noise, "BLOCK", block)
    assert np.array_equal(take(white(rng(), (1.0, 2.0, 3.0)), 1500), expected)
    assert np.array_equal(take(gusts(rng(), deviation=1.0, correlation_s=2.0, dt=0.05), 1500), windy)
