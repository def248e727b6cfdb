"""Seeded randomness of one vehicle: measurement noise and gusts, each stream drawn in order from mission start.

A stream is named by (seed, vehicle, purpose), so that adding a vehicle or a purpose changes no other stream.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from enum import IntEnum

import numpy as np

BLOCK = 256
"""Draws at a time: one call of numpy for many messages."""


class Purpose(IntEnum):
    """What a stream is for."""

    MEASUREMENT = 1
    GUST = 2
    TURBULENCE = 3
    FAULT_GUST = 4


def generator(seed: int, vehicle: int, purpose: Purpose) -> np.random.Generator:
    """The stream of one vehicle and one purpose."""
    return np.random.default_rng([seed, vehicle, purpose])


def white(rng: np.random.Generator, deviations: tuple[float, ...]) -> Iterator[tuple[float, ...]]:
    """Independent normal draws without end, one tuple at a time, each axis with its standard deviation."""
    while True:
        for draw in (rng.standard_normal((BLOCK, len(deviations))) * np.array(deviations)).tolist():
            yield tuple(draw)


def gusts(
    rng: np.random.Generator, *, deviation: float, correlation_s: float, dt: float
) -> Iterator[tuple[float, ...]]:
    """First-order Gauss–Markov wind (north, east) [m/s], a sample every `dt` seconds, stationary from the first.

    w ← a w + σ √(1 − a²) ξ with a = e^(−dt/T): standard deviation σ and correlation e^(−t/T) for any dt.
    """
    keep = math.exp(-dt / correlation_s)
    fresh = deviation * math.sqrt(1.0 - keep * keep)
    north, east = (deviation * rng.standard_normal(2)).tolist()
    for draw_n, draw_e in white(rng, (fresh, fresh)):
        yield north, east
        north, east = keep * north + draw_n, keep * east + draw_e


class Held:
    """A stream by time: each draw lasts so long, whoever asks and however often, at times that never fall.

    The n-th is valid until n periods after time 0, the first before that too.
    """

    def __init__(self, stream: Iterator[tuple[float, ...]], *, period_s: float) -> None:
        self._stream, self._period_s = stream, period_s
        self._draw = next(stream)
        self._draws = 1

    def at(self, time_s: float) -> tuple[float, ...]:
        """The draw that is valid then."""
        due = math.ceil(time_s / self._period_s - 1e-6)
        while self._draws < due:
            self._draw, self._draws = next(self._stream), self._draws + 1
        return self._draw
