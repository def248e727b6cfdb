"""The paper's motor degradation, as a pure function of a commanded velocity.

Section "Task Scenario Design" of the paper: "a fixed offset perpendicular to the direction of velocity and a restricted
maximum speed". Which way, of what, and in which order are readings that the paper's table of results decides:
the cap is a fraction of cruise, the offset follows the cap and points to the left as seen from above.
"""

from __future__ import annotations

import math

FADE_BELOW = 0.3
"""Of cruise: below this commanded speed the offset fades linearly to zero, so that a robot asked to stop, stops."""


def degrade(
    velocity_ne: tuple[float, float], *, cruise: float, max_speed_fraction: float, offset_fraction: float
) -> tuple[float, float]:
    """What a degraded vehicle does with a commanded horizontal velocity.

    velocity_ne: (north, east) m/s, finite;  cruise: m/s;  fractions are of cruise.
    Returns (north, east) m/s.
    """
    north, east = velocity_ne
    speed = math.hypot(north, east)
    if speed == 0.0:
        return 0.0, 0.0
    along_n, along_e = north / speed, east / speed
    capped = min(speed, max_speed_fraction * cruise)
    offset = offset_fraction * cruise * min(1.0, speed / (FADE_BELOW * cruise))
    return capped * along_n + offset * along_e, capped * along_e - offset * along_n
