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
MISSED_S = 1.0
"""A leader that is not heard for so long passes its role on: a gap of a few ticks changes nothing."""
HOPELESS, PATIENCE_S = 0.05, 5.0
"""A robot with less trust than this for so long is beyond repair."""
GONE_S = 3.5
"""After so long a robot that was left behind is out of the others' plane: until then they keep clear of it."""


@dataclass(frozen=True, slots=True, eq=False)
class Roles:
    """The parts of N robots at one tick."""

    leaders: Indices
    """(L,) who knows where the virtual leader is; place k was given to the scenario's k-th leader at first."""
    silent_s: Array
    """(N,) s: for how long each robot has not been heard."""
    hopeless_s: Array
    """(N,) s: for how long each robot has been below HOPELESS."""
    left_s: Array
    """(N,) s: for how long each robot has been left behind; NaN for those of the swarm."""

    @staticmethod
    def of(count: int, leaders: Indices) -> Roles:
        """As the scenario has them."""
        return Roles(leaders, np.zeros(count), np.zeros(count), np.full(count, np.nan))

    @property
    def left(self) -> Flags:
        """(N,) left behind: no longer of the swarm, until the supervisor takes it back."""
        return np.asarray(np.isfinite(self.left_s))

    @property
    def gone(self) -> Flags:
        """(N,) left behind, and out of the others' plane by now."""
        return np.asarray(self.left_s >= GONE_S - 1e-9)


def hand_over(roles: Roles, *, trust: Array, heard: Flags, offset_ne: Array, places: Indices, dt: float) -> Roles:
    """Distrusted or silent leaders pass their role to the most trusted robot that has none, if one is trusted enough.

    trust: (N,);  heard: (N,);  offset_ne: (N, 2) m, the formation;  places: (L,) whose places the leaders steer best
    from, the scenario's own leaders'. Among robots trusted alike (to a tenth) the one closest to such a place takes
    over. Of a leader that was left behind the best there is takes over, trusted enough or not: somebody must lead.
    """
    silent_s = np.where(heard, 0.0, roles.silent_s + dt)
    roles = replace(roles, silent_s=silent_s)
    fit = heard & ~roles.left
    lost = (trust < LOSES) | (silent_s >= MISSED_S - 1e-9) | roles.left
    if not lost[roles.leaders].any():
        return roles
    leaders = roles.leaders.copy()
    for place in np.flatnonzero(lost[leaders]):
        enough = 0.0 if roles.left[leaders[place]] else GAINS
        free = np.flatnonzero(fit & (trust >= enough) & ~np.isin(np.arange(len(trust)), leaders))
        if free.size:
            away = np.hypot(*(offset_ne[free] - offset_ne[places[place]]).T).round(3)  # however the formation is turned
            leaders[place] = free[np.lexsort((away, -np.round(trust[free], 1)))[0]]
    return replace(roles, leaders=leaders)


def leave_behind(roles: Roles, *, trust: Array, dt: float) -> Roles:
    """Count for how long each robot has been hopeless; after PATIENCE_S, to a tick, it is left behind.

    Never so many that those who stay are not more than half: a swarm that trusts nobody has no better half to be.
    """
    hopeless_s = np.where(trust < HOPELESS, roles.hopeless_s + dt, 0.0)
    left_s = roles.left_s + dt
    beyond = np.flatnonzero((hopeless_s >= PATIENCE_S - 1e-9) & ~roles.left)
    room = max(0, (len(trust) - 1) // 2 - int(np.count_nonzero(roles.left)))
    worst_first = beyond[np.argsort(trust[beyond], kind="stable")]
    left_s[worst_first[:room]] = 0.0
    return replace(roles, hopeless_s=hopeless_s, left_s=left_s)


def taken_back(roles: Roles, robots: Flags) -> Roles:
    """The supervisor wants these robots (N,) in the swarm again; they have to be hopeless anew to be left anew."""
    return replace(
        roles,
        left_s=np.where(robots, np.nan, roles.left_s),
        hopeless_s=np.where(robots, 0.0, roles.hopeless_s),
    )


def closed_up(offset_ne: Array, files: tuple[Indices, ...], left: Flags) -> Array:
    """Places (N, 2) m without holes: in each file the robots that remain move up to its front, in their order.

    files: indices of the robots of each file, front to rear. Their mean stays where it was, so that the mission is
    flown and judged by the same point. Who is left behind keeps its place; nobody goes there.
    """
    places = offset_ne.copy()
    if left.any() and not left.all():
        for file in files:
            remain = file[~left[file]]
            places[remain] = offset_ne[file[: len(remain)]]
        places[~left] -= (places - offset_ne)[~left].mean(axis=0)
    return places
