"""How a robot that is beyond repair leaves the swarm, and comes back if the supervisor wants it back.

It goes along with the others while it sinks below them, for so many seconds and no more, for what it says of its height
may be what is wrong with it; only then it stops, and holds there or lands. Who was taken back climbs where nobody is
above it.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from gcs.events import Rating
from gcs.telemetry import Flags, Swarm
from scenarios.fence import BELOW
from trustr.roles import Roles

Array = npt.NDArray[np.float64]

LOWER = 1.0
"""m: a robot this much lower than another may climb into it …"""
ABOVE = 1.5
"""m, horizontal: … where the other is this close."""
TAKES_BACK = 4
"""A rating from which the supervisor wants a robot back that was left behind."""


def wanted_back(ratings: Iterable[Rating], roles: Roles, swarm: Swarm, flying: Flags) -> Flags:
    """(N,) who was left behind, still flies our set-points, and is praised by name."""
    praised = {rating.vehicle for rating in ratings if rating.rating >= TAKES_BACK}
    named = np.array([system in praised for system in swarm.ids])
    return np.asarray(named & roles.left & flying)


def lowered(roles: Roles, swarm: Swarm, position_ne: Array) -> Array:
    """(N,) m: how far below the swarm's altitude each robot is to fly."""
    return np.where(roles.left | _under_another(swarm, position_ne), BELOW, 0.0)


def settled(velocity_ned: Array, roles: Roles) -> Array:
    """Set-points (N, 3) m/s with those who are out of the others' way standing still, whatever height they report."""
    return np.where(roles.gone[:, None], 0.0, velocity_ned)


def _under_another(swarm: Swarm, position_ne: Array) -> Flags:
    """(N,) robots that have another above them."""
    height = -swarm.position_ned[:, 2]
    apart = position_ne[:, None] - position_ne[None]
    near = np.hypot(apart[..., 0], apart[..., 1]) < ABOVE
    return np.asarray((near & (height[None] > height[:, None] + LOWER)).any(axis=1))
