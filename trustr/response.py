"""How a healthy vehicle answers velocity commands: a delay, then a first-order lag."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from trustr.network import Array


@dataclass(frozen=True, slots=True)
class Response:
    """Answer to a velocity step of height 1: 0 until `delay_s`, then 1 − e^(−(t − delay)/lag)."""

    delay_s: float
    lag_s: float

    @property
    def mean_lag_s(self) -> float:
        """∫ (1 − answer) dt."""
        return self.delay_s + self.lag_s


def held_back(response: Response, dt: float) -> int:
    """Commands that must be remembered, the newest included."""
    return math.floor(response.delay_s / dt + 1e-9) + 2


def follow(response: Response, velocity_ne: Array, commanded_ne: Array, *, dt: float) -> Array:
    """What a healthy vehicle flies a tick later, (N, 2) m/s.

    velocity_ne: (N, 2) m/s, now;  commanded_ne: (D, N, 2) m/s, the last D ≥ `held_back` commands, each held for a tick,
    the newest last and sent now. Exact for commands that are held: the delay's fraction of a tick mixes two of them.
    """
    ticks = response.delay_s / dt
    whole = math.floor(ticks + 1e-9)
    late = max(0.0, ticks - whole)
    acting = late * commanded_ne[-2 - whole] + (1.0 - late) * commanded_ne[-1 - whole]
    share = 1.0 - math.exp(-dt / response.lag_s) if response.lag_s > 0.0 else 1.0
    return np.asarray(velocity_ne + share * (acting - velocity_ne))


def followed(response: Response, first_ne: Array, commanded_ne: Array, *, dt: float) -> Array:
    """A whole flight of healthy vehicles, (T, N, 2) m/s, from what they fly at first and T commands."""
    depth = held_back(response, dt)
    padded = np.concatenate([np.repeat(commanded_ne[:1], depth - 1, axis=0), commanded_ne])
    flown = np.empty_like(commanded_ne)
    flown[0] = first_ne
    for tick in range(len(commanded_ne) - 1):
        flown[tick + 1] = follow(response, flown[tick], padded[tick : tick + depth], dt=dt)
    return flown
