"""How a healthy vehicle answers velocity commands: late, with a lag, and no faster than its bounds let it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from trustr.network import Array

FINELY = 4
"""Steps a tick for vehicles with bounds."""


@dataclass(frozen=True, slots=True)
class Response:
    """A delay, then a first-order lag: a velocity step of height 1 is answered by 1 − e^(−(t − delay)/lag).

    Autopilots that shape what they are asked for (ArduCopter, say) bound acceleration and jerk besides: a velocity
    error then asks for an acceleration in proportion, 1/lag, or where that is less by the square root that a constant
    jerk can still brake from. Source: `shape_vel_accel` and `sqrt_controller`, ArduPilot libraries/AP_Math/control.cpp.
    """

    delay_s: float
    lag_s: float
    acceleration: float = math.inf
    """m/s²."""
    jerk: float = math.inf
    """m/s³."""


class Motion(NamedTuple):
    """What N vehicles fly."""

    velocity_ne: Array
    """(N, 2) m/s."""
    acceleration_ne: Array
    """(N, 2) m/s²; of vehicles without bounds it is not kept."""


def held_back(response: Response, dt: float) -> int:
    """Commands that must be remembered, the newest included."""
    return math.floor(response.delay_s / dt + 1e-9) + 2


def follow(response: Response, motion: Motion, commanded_ne: Array, *, dt: float) -> Motion:
    """What healthy vehicles fly a tick later.

    commanded_ne: (D, N, 2) m/s, the last D ≥ `held_back` commands, each held for a tick, the newest last and sent now.
    Without bounds it is exact but for the fraction of a tick in the delay, which mixes two commands.
    """
    ticks = response.delay_s / dt
    whole = math.floor(ticks + 1e-9)
    late = max(0.0, ticks - whole)
    acting = late * commanded_ne[-2 - whole] + (1.0 - late) * commanded_ne[-1 - whole]
    if math.isinf(response.jerk):
        share = 1.0 - math.exp(-dt / response.lag_s) if response.lag_s > 0.0 else 1.0
        return Motion(motion.velocity_ne + share * (acting - motion.velocity_ne), motion.acceleration_ne)
    for _ in range(FINELY):
        motion = _shaped(response, motion, acting, dt / FINELY)
    return motion


def _shaped(response: Response, motion: Motion, wanted_ne: Array, dt: float) -> Motion:
    """A short step of vehicles with bounds."""
    error_ne = wanted_ne - motion.velocity_ne
    error = np.maximum(np.hypot(error_ne[:, 0], error_ne[:, 1]), 1e-9)
    in_proportion = response.jerk * response.lag_s**2
    by_root = np.sqrt(2.0 * response.jerk * np.maximum(error - 0.5 * in_proportion, 0.0))
    by_lag = error / max(response.lag_s, 1e-9)
    asked = np.minimum(np.where(error <= in_proportion, by_lag, by_root), response.acceleration)
    change_ne = error_ne * (asked / error)[:, None] - motion.acceleration_ne
    change = np.maximum(np.hypot(change_ne[:, 0], change_ne[:, 1]), 1e-9)
    acceleration_ne = motion.acceleration_ne + change_ne * np.minimum(1.0, response.jerk * dt / change)[:, None]
    return Motion(motion.velocity_ne + acceleration_ne * dt, acceleration_ne)


def followed(response: Response, first_ne: Array, commanded_ne: Array, *, dt: float) -> Array:
    """A whole flight of healthy vehicles, (T, N, 2) m/s, from what they fly at first and T commands."""
    depth = held_back(response, dt)
    padded = np.concatenate([np.repeat(commanded_ne[:1], depth - 1, axis=0), commanded_ne])
    motion = Motion(first_ne, np.zeros_like(first_ne))
    flown = np.empty_like(commanded_ne)
    flown[0] = first_ne
    for tick in range(len(commanded_ne) - 1):
        motion = follow(response, motion, padded[tick : tick + depth], dt=dt)
        flown[tick + 1] = motion.velocity_ne
    return flown


def mean_lag_s(response: Response, *, step: float = 1.0) -> float:
    """∫ (1 − v / step) dt of the answer to a velocity step [m/s]: how late the vehicle is, all in all [s]."""
    if math.isinf(response.jerk):
        return response.delay_s + response.lag_s
    dt, horizon_s = 0.02, 30.0
    commanded = np.tile([step, 0.0], (round(horizon_s / dt), 1, 1))
    motion, lag = Motion(np.zeros((1, 2)), np.zeros((1, 2))), response.delay_s
    for _ in commanded:
        lag += (1.0 - float(motion.velocity_ne[0, 0]) / step) * dt
        motion = _shaped(response, motion, commanded[0], dt)
    return lag
