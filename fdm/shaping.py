"""How a slow autopilot takes up a velocity: jerk and acceleration limited, and late, as pure functions.

ArduCopter shapes what it is asked for in the same way: a velocity error asks for an acceleration, first in proportion,
then, for large errors, by the square root that a constant jerk can still brake from; acceleration and jerk are bounded.
Source: `shape_vel_accel` and `sqrt_controller`, ArduPilot libraries/AP_Math/control.cpp.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from scenarios import Scenario

Level = tuple[float, float]
"""(north, east)."""

SHAPING_S = 0.02
"""How often a shaped velocity is renewed."""


class Motion(NamedTuple):
    """What is asked of the flight controller on the level."""

    velocity_ne: Level
    acceleration_ne: Level = (0.0, 0.0)


def shape_of(scenario: Scenario) -> Callable[[Motion, Level], Motion] | None:
    """`shape` with the scenario's parameters, a step of SHAPING_S; None where vehicles are not slowed down."""
    told = scenario.vehicle
    if not told.lag_s and told.acceleration_m_s2 is None and told.jerk_m_s3 is None:
        return None
    return partial(
        shape,
        lag_s=told.lag_s,
        acceleration_m_s2=told.acceleration_m_s2 or math.inf,
        jerk_m_s3=told.jerk_m_s3 or math.inf,
        dt=SHAPING_S,
    )


def shape(
    motion: Motion,
    wanted_ne: Level,
    *,
    lag_s: float,
    acceleration_m_s2: float = math.inf,
    jerk_m_s3: float = math.inf,
    dt: float,
) -> Motion:
    """The motion `dt` seconds later, on its way to a wanted velocity [m/s].

    lag_s:             time constant of the last part of the way, v − wanted ~ e^(−t/lag); 0 arrives as fast as the
                       other two allow
    acceleration_m_s2: bound of |dv/dt|;  jerk_m_s3: bound of |da/dt|
    """
    error_n, error_e = wanted_ne[0] - motion.velocity_ne[0], wanted_ne[1] - motion.velocity_ne[1]
    error = math.hypot(error_n, error_e)
    asked = min(_approach(error, lag_s=lag_s, jerk=jerk_m_s3, dt=dt), acceleration_m_s2) / error if error > 0.0 else 0.0
    change_n = asked * error_n - motion.acceleration_ne[0]
    change_e = asked * error_e - motion.acceleration_ne[1]
    change = math.hypot(change_n, change_e)
    share = min(1.0, jerk_m_s3 * dt / change) if change > 0.0 else 0.0
    north, east = motion.acceleration_ne[0] + share * change_n, motion.acceleration_ne[1] + share * change_e
    return Motion((motion.velocity_ne[0] + north * dt, motion.velocity_ne[1] + east * dt), (north, east))


def _approach(error: float, *, lag_s: float, jerk: float, dt: float) -> float:
    """The acceleration [m/s²] that leads from a velocity error [m/s] to none with no more jerk than this.

    Near the end it is rate × error, which is exactly e^(−t/lag). There the jerk is rate² × error; where that would be
    too much it is the acceleration that falls by jerk × dt a step and meets the line with its slope.
    """
    rate = (-math.expm1(-dt / lag_s) if lag_s > 0.0 else 1.0) / dt
    if error * rate * rate <= jerk:
        return rate * error
    excess = error - (jerk / rate**2 - jerk * dt / rate) / 2
    return jerk * (math.sqrt(dt * dt / 4 + 2 * excess / jerk) - dt / 2)
