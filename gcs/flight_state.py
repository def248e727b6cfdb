"""What changes in a flight, and what a tick of it has to say."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
import numpy.typing as npt

from gcs.beliefs import Belief
from gcs.commands import Command
from gcs.events import Rating
from gcs.hands import Hands
from gcs.swarm_frame import SwarmFrame
from gcs.telemetry import Flags, Swarm
from trustr.controller import Decision, Memory
from trustr.leader import VirtualLeader

Array = npt.NDArray[np.float64]


Commands = list[tuple[int, Command]]
"""System id and command, in the order in which they leave."""


class Phase(Enum):
    """What the flight is about."""

    JOIN = "joining"
    CLIMB = "taking off"
    TAKE_CONTROL = "taking control"
    RUN_UP = "running up"
    MISSION = "mission"
    HOLD = "holding"
    LAND = "landing"
    DONE = "done"


BEFORE_MISSION = (Phase.CLIMB, Phase.TAKE_CONTROL, Phase.RUN_UP)
"""In the air already: without one of them the mission cannot begin, so all come down."""
IN_THE_AIR = (*BEFORE_MISSION, Phase.MISSION, Phase.HOLD)


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
    """(N, 3) m/s: the set-points sent last, as they were sent; zero for vehicles that were sent none."""
    commanded: Flags
    """(N,) whom they were sent to."""
    belief: Belief
    """Of each robot's health."""
    hands: Hands
    """Who flies whom."""
    start_ns: int | None = None
    """When the first tick was decided, from which the others' deadlines follow; None before it."""
    now_ns: int | None = None
    """When the last tick was decided."""
    apart_ns: int | None = None
    """When we last sent nobody anything, or heard nobody, for so long that vehicles may do without us."""
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

    @property
    def released(self) -> Flags:
        """(N,) vehicles that a pilot, or their autopilot, took from us."""
        return self.hands.released

    @property
    def over(self) -> Phase:
        """The phase in which a flight that cannot go on ends: whoever is armed on the ground is not ours to land."""
        return Phase.DONE if self.phase is Phase.JOIN else Phase.LAND

    def mission_s(self, period_s: float) -> float:
        """Since mission start; NaN before."""
        return math.nan if self.mission_tick is None else (self.tick - self.mission_tick) * period_s

    def when(self, period_s: float) -> str:
        """For a sentence on what happened at this tick."""
        if self.phase is not Phase.MISSION or self.mission_tick is None:
            return f"while {self.phase.value}"
        return f"{self.mission_s(period_s):.1f} s into the mission"

    def lateness_ns(self, now_ns: int, period_ns: int) -> int:
        """How far this tick is behind its deadline, reckoned from the first."""
        return 0 if self.start_ns is None else now_ns - self.start_ns - self.tick * period_ns

    def position_ne(self, swarm: Swarm) -> Array:
        """(N, 2) m in the swarm's frame; NaN until that is known."""
        return np.asarray(swarm.position_ned[:, :2] + (np.nan if self.shift_ne is None else self.shift_ne))


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


Step = tuple[FlightState, Commands, Diagnosis]
"""What a tick comes to."""


def entered(state: FlightState, phase: Phase) -> FlightState:
    """The first tick of a phase; nobody has been asked for anything in it."""
    return replace(state, phase=phase, phase_tick=state.tick, asked=(Asked(),) * len(state.asked))


def abandoned(state: FlightState, phase: Phase) -> FlightState:
    """Land, or hold, before the mission is over: its clock stops, so that nobody scores what comes after."""
    return replace(entered(state, phase), mission_tick=None)


def failed(state: FlightState, problem: str, phase: Phase) -> FlightState:
    """On to `phase`, and why; the first problem of a flight is the one that is told."""
    return replace(entered(state, phase), problem=state.problem or problem)


def left_behind(state: FlightState) -> list[int]:
    """System ids of the robots that the swarm went on without."""
    return [] if state.memory is None else [int(row) + 1 for row in np.flatnonzero(state.memory.roles.left)]
