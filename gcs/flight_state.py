"""What changes in a flight, and what a tick of it has to say."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
import numpy.typing as npt

from gcs.beliefs import Belief
from gcs.commands import Command
from gcs.events import Rating
from gcs.swarm_frame import SwarmFrame
from trustr.controller import Decision, Memory
from trustr.leader import VirtualLeader

Array = npt.NDArray[np.float64]


class Phase(Enum):
    """What the flight is about."""

    JOIN = "joining"
    CLIMB = "taking off"
    TAKE_CONTROL = "taking control"
    RUN_UP = "running up"
    MISSION = "mission"
    LAND = "landing"
    DONE = "done"


BEFORE_MISSION = (Phase.CLIMB, Phase.TAKE_CONTROL, Phase.RUN_UP)
"""In the air already: without one of them the mission cannot begin, so all come down."""


@dataclass(frozen=True, slots=True)
class Asked:
    """What one vehicle was last asked for, and when."""

    commands: tuple[Command, ...] = ()
    tick: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class FlightState:
    """Everything that changes."""

    tick: int
    """The tick to be decided next."""
    phase: Phase
    phase_tick: int
    """The phase's first tick."""
    asked: tuple[Asked, ...]
    """(N) what each vehicle was last asked for, so that asking again can wait."""
    sent_ned: Array
    """(N, 3) m/s: the set-points sent last."""
    belief: Belief
    """Of each robot's health."""
    frame: SwarmFrame | None = None
    """None until every vehicle has told where it is."""
    shift_ne: Array | None = None
    """(N, 2) m: add to a position in a vehicle's own frame, get the swarm's."""
    mission_tick: int | None = None
    memory: Memory | None = None
    """What the controller keeps from tick to tick; None before the mission."""
    problem: str | None = None
    """Why the flight could not be completed."""

    @property
    def done(self) -> bool:
        """Nothing is left to decide."""
        return self.phase is Phase.DONE


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """What a tick decided, and from what."""

    phase: Phase
    mission_s: float
    """Since mission start; NaN before."""
    task: str
    virtual: VirtualLeader | None
    trust: Array
    """(N,)"""
    decision: Decision | None
    """None outside the mission."""
    position_ne: Array
    """(N, 2) m in the swarm's frame; NaN until that is known."""
    asked_ned: Array | None = None
    """(N, 3) m/s that the controller wanted; None where no set-points flow."""
    sent_ned: Array | None = None
    """(N, 3) m/s after the gate."""
    verdict: npt.NDArray[np.int8] | None = None
    """(N,) of the gate."""
    commanded: npt.NDArray[np.bool_] | None = None
    """(N,) whom a set-point was sent to."""
    belief: Belief | None = None
    """What the trust was drawn from; None before the mission."""
    ratings: tuple[Rating, ...] = ()
    """What people said that counted at this tick."""


def entered(state: FlightState, phase: Phase) -> FlightState:
    """The first tick of a phase; nobody has been asked for anything in it."""
    return replace(state, phase=phase, phase_tick=state.tick, asked=(Asked(),) * len(state.asked))


def abandoned(state: FlightState) -> FlightState:
    """Land before the mission is over: its clock stops, so that nobody scores what the landing does."""
    return replace(entered(state, Phase.LAND), mission_tick=None)


def failed(state: FlightState, problem: str, phase: Phase) -> FlightState:
    """On to `phase`, and why; the first problem of a flight is the one that is told."""
    return replace(entered(state, phase), problem=state.problem or problem)


def left_behind(state: FlightState) -> list[int]:
    """System ids of the robots that the swarm went on without."""
    return [] if state.memory is None else [int(row) + 1 for row in np.flatnonzero(state.memory.roles.left)]
