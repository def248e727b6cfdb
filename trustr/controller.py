"""One tick of the swarm's control: what is known of every robot in, a velocity command for every robot out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from trustr.consensus import Heard, Rule, weighted_mean
from trustr.leader import VirtualLeader, navigational_feedback
from trustr.network import Array, Graph, neighbours
from trustr.roles import Roles, closed_up, hand_over, leave_behind
from trustr.separation import separation


@dataclass(frozen=True, slots=True, eq=False)
class Settings:
    """What stays the same through a flight."""

    rule: Rule
    """One of `consensus.RULES`, or a researcher's own."""
    offset_ne: Array
    """(N, 2) m, each robot's place in the formation."""
    files: tuple[npt.NDArray[np.intp], ...]
    """Indices of the robots of each file of the formation, front to rear."""
    leaders: npt.NDArray[np.intp]
    """(L,) indices of the robots that hear the virtual leader, to begin with."""
    hand_over: bool
    """Distrusted leaders pass their role on."""
    leave_behind: bool
    """Robots beyond repair are left behind."""
    c1: float
    """1/s."""
    c2: float
    """Without unit."""
    feedback_cap: float
    """m/s."""
    response_s: float
    """s: first-order response of the vehicles, for the feed-forward of the virtual leader's acceleration; 0 is none."""
    swarm_feedback: bool
    """Leaders steer the mean of the robots they trust (δx and δu of eq. 11 are the swarm's), not themselves."""
    formation_gain: float
    """1/s: every robot back to its place among those it trusts; 0 in the paper."""
    range_m: float
    """R of eq. 13."""
    best_range_m: float
    """ρ of eq. 13."""
    decay: float
    """γ of eq. 13."""
    weights: Literal["sender", "literal"]
    """How η of eq. 13 is read."""
    eta: float
    threshold: float
    """Trust below which a sender's η is `eta`."""
    confidence: float
    """c of λ_t = c e^(−γt), the rule `confidence-decay`."""
    confidence_decay: float
    """1/s: γ of the same."""
    separation_radius: float
    """m."""
    separation_gain: float
    """1/s."""
    berth: float
    """m: the separation radius from robots whose trust is below the threshold; 0 makes no difference."""
    berth_gain: float
    """1/s."""


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """What a tick knows: measured, in the swarm's NED frame, horizontal."""

    position_ne: Array
    """(N, 2) m."""
    velocity_ne: Array
    """(N, 2) m/s."""
    heard: npt.NDArray[np.bool_]
    """(N,) False where data are stale, missing or not finite."""
    trust: Array
    """(N,) in [0, 1]."""
    time_s: float = 0.0
    """Since mission start."""
    beside_ne: Array | None = None
    """(N, 2) m: where robots are thought to be that are not heard, NaN where nobody is: others keep apart from them.
    None is nobody."""


@dataclass(frozen=True, slots=True, eq=False)
class Memory:
    """What one tick leaves to the next."""

    time_s: float
    """Of that tick, since mission start."""
    first_ne: Array
    """(N, 2) m/s: the velocities of the mission's first tick."""
    standing: Array
    """(N,) s: ∫ (trust − ½) dt."""
    roles: Roles


@dataclass(frozen=True, slots=True, eq=False)
class Decision:
    """What a tick commands, and why."""

    velocity_ne: Array
    """(N, 2) m/s; zero for robots that are not heard."""
    graph: Graph
    """Who heeds whom: robots that were left behind speak to nobody."""
    weights: Array
    """(E,) one for each edge of the graph."""
    roles: Roles
    """Who led, and who was left behind."""


def decide(
    memory: Memory | None, observation: Observation, virtual: VirtualLeader, settings: Settings
) -> tuple[Memory, Decision]:
    """Eq. 11 and 12 (or another rule than eq. 12) for all robots at once, separation added.

    memory: what the tick before returned; None at the first.
    A robot that is not heard has weight exactly 0 with every other, and is commanded to stand still. One that was left
    behind has weight 0 too; it is told to go along with the others, who keep their distance from it, and whoever flies
    it takes it out of their way.
    """
    heard = (
        observation.heard & np.isfinite(observation.position_ne).all(1) & np.isfinite(observation.velocity_ne).all(1)
    )
    position, velocity = _of_the_heard(observation.position_ne, heard), _of_the_heard(observation.velocity_ne, heard)
    memory = _remembered(memory, observation, velocity, heard, settings)
    roles, left = memory.roles, memory.roles.left
    around = neighbours(position, heard, range_m=settings.range_m).without(roles.gone)
    graph = around.without(left)
    agreement = settings.rule(
        Heard(graph, velocity, observation.trust, observation.time_s, memory.first_ne, memory.standing), settings
    )
    weights, consensus = agreement.weights, agreement.velocity_ne
    command = consensus.copy()
    leaders = roles.leaders[~left[roles.leaders]]
    place = position - closed_up(settings.offset_ne, settings.files, left)
    if settings.swarm_feedback:
        # Followers know no path: whatever the leaders' feedback sums up to shears the formation and stays, and the mean
        # is off by it. So leaders answer for the mean, and the formation closes up (docs/recommended-profile.md).
        swarm_place = weighted_mean(graph, weights, place)
        trusted = np.count_nonzero(heard & ~left & (observation.trust >= settings.threshold))
        followers_a_leader = trusted / max(1, int(np.count_nonzero(heard[leaders])))
        command -= settings.formation_gain * np.where(left[:, None], 0.0, place - swarm_place)
        command[leaders] += navigational_feedback(
            swarm_place[leaders],
            consensus[leaders],
            virtual,
            c1=settings.c1,
            c2=settings.c2,
            cap=settings.feedback_cap,
            lead_s=settings.response_s * followers_a_leader,
        )
    else:
        command[leaders] += navigational_feedback(
            place[leaders],
            velocity[leaders],
            virtual,
            c1=settings.c1,
            c2=settings.c2,
            cap=settings.feedback_cap,
        )
    close, where = around, position
    if observation.beside_ne is not None:
        silent = ~heard & np.isfinite(observation.beside_ne).all(1)
        where = np.where(silent[:, None], observation.beside_ne, position)
        close = neighbours(where, heard | silent, range_m=settings.range_m).without(roles.gone)
    command += separation(
        close,
        where,
        radius=settings.separation_radius,
        gain=settings.separation_gain,
        shunned=observation.trust < settings.threshold,
        berth=settings.berth,
        berth_gain=settings.berth_gain,
    )
    return memory, Decision(_of_the_heard(command, heard), graph, weights, roles)


def _remembered(
    memory: Memory | None,
    observation: Observation,
    velocity: Array,
    heard: npt.NDArray[np.bool_],
    settings: Settings,
) -> Memory:
    """The memory this tick decides with, and leaves."""
    trust, now = observation.trust, observation.time_s
    if memory is None:
        memory = Memory(now, velocity, np.zeros(len(velocity)), Roles.of(len(velocity), settings.leaders))
    roles, dt = memory.roles, now - memory.time_s
    if settings.leave_behind:
        roles = leave_behind(roles, trust=trust, dt=dt)
    if settings.hand_over:
        roles = hand_over(roles, trust=trust, heard=heard, offset_ne=settings.offset_ne, places=settings.leaders, dt=dt)
    return Memory(now, memory.first_ne, memory.standing + (trust - 0.5) * dt, roles)


def _of_the_heard(vectors: Array, heard: npt.NDArray[np.bool_]) -> Array:
    """(N, 2) with zero for whom is not heard: whatever is not finite stops here."""
    return vectors if heard.all() else np.where(heard[:, None], vectors, 0.0)
