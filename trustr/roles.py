"""Who leads, who is left behind, and who stands where when somebody is: what trust means for each robot's part."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from trustr.network import Array

Flags = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.intp]

LOSES, GAINS = 0.5, 0.7
"""Trust below which a leader passes its role on, and from which a robot may take it: between the two nobody changes."""
HOPELESS, PATIENCE_S = 0.05, 5.0
"""A robot with less trust than this for so long is beyond repair."""


@dataclass(frozen=True, slots=True, eq=False)
class Roles:
    """The parts of N robots at one tick."""

    leaders: Indices
    """(L,) who knows where the virtual leader is; place k was given to the scenario's k-th leader at first."""
    hopeless_s: Array
    """(N,) s: for how long each robot has been below HOPELESS."""
    left: Flags
    """(N,) left behind: no longer of the swarm, until the supervisor takes it back."""

    @staticmethod
    def of(count: int, leaders: Indices) -> Roles:
        """As the scenario has them."""
        return Roles(leaders, np.zeros(count), np.zeros(count, bool))


def hand_over(roles: Roles, *, trust: Array, heard: Flags, offset_ne: Array) -> Roles:
    """Distrusted or silent leaders pass their role to the most trusted robot that has none, if one is trusted enough.

    trust: (N,);  heard: (N,);  offset_ne: (N, 2) m, places in the formation: among robots trusted alike (to a tenth)
    the one closest to the leader's place takes over, so that leaders stay where they steer best.
    """
    fit = heard & ~roles.left
    lost = ~fit[roles.leaders] | (trust[roles.leaders] < LOSES)
    if not lost.any():
        return roles
    leaders = roles.leaders.copy()
    for place in np.flatnonzero(lost):
        free = np.flatnonzero(fit & (trust >= GAINS) & ~np.isin(np.arange(len(trust)), leaders))
        if not free.size:
            break
        away = np.hypot(*(offset_ne[free] - offset_ne[leaders[place]]).T).round(3)  # whichever way the formation points
        leaders[place] = free[np.lexsort((away, -np.round(trust[free], 1)))[0]]
    return replace(roles, leaders=leaders)


def leave_behind(roles: Roles, *, trust: Array, dt: float) -> Roles:
    """Count for how long each robot has been hopeless; to a tick; after PATIENCE_S it is left, for good."""
    hopeless_s = np.where(trust < HOPELESS, roles.hopeless_s + dt, 0.0)
    return replace(roles, hopeless_s=hopeless_s, left=roles.left | (hopeless_s >= PATIENCE_S - 1e-9))


def taken_back(roles: Roles, robots: Flags) -> Roles:
    """The supervisor wants these robots (N,) in the swarm again; they have to be hopeless anew to be left anew."""
    return replace(roles, left=roles.left & ~robots, hopeless_s=np.where(robots, 0.0, roles.hopeless_s))


def closed_up(offset_ne: Array, files: tuple[Indices, ...], left: Flags) -> Array:
    """Places (N, 2) m without holes: in each file the robots that remain move up to its front, in their order.

    files: indices of the robots of each file, front to rear. Who is left behind keeps its place; nobody goes there.
    """
    places = offset_ne.copy()
    for file in files if left.any() else ():
        remain = file[~left[file]]
        places[remain] = offset_ne[file[: len(remain)]]
    return places
