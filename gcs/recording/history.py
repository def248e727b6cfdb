"""A recording as arrays over its ticks: what replay, report and video show.

T ticks of the whole flight, take-off and landing included; N vehicles in the order of their system ids. NaN where
nothing was told.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gcs.events import Rating
from gcs.track import Parts, Track
from scenarios import Scenario

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Integers = npt.NDArray[np.int64]


class Kind(Enum):
    """What a happening is about."""

    PHASE = "phase"
    DISTRUST = "distrust"
    """A robot's trust fell below 0.5, or rose above it again."""
    RATING = "rating"
    ROLES = "roles"
    """Who leads, and who is left behind."""
    FAULT = "fault"
    """The truth of a simulation, which no flight knew; never shown to participants of a study."""
    LINK = "link"
    """A vehicle fell silent, or is heard again."""
    WORD = "word"
    """Of the operator, or of an autopilot."""
    PROBLEM = "problem"


@dataclass(frozen=True, slots=True)
class Happening:
    """Something that one would want to jump to."""

    time_ns: int
    tick: int
    """Row of the arrays."""
    mission_s: float
    """NaN outside the mission."""
    kind: Kind
    vehicle: int | None
    """System id, if it is about one."""
    words: str


@dataclass(frozen=True, slots=True)
class FaultSpan:
    """While a fault acted, as the simulation told it."""

    vehicle: int | None
    """Who is blamed; None of what strikes everyone."""
    kind: str
    from_s: float
    """Since mission start."""
    to_s: float
    """Infinite where it never ended."""


@dataclass(frozen=True, slots=True, eq=False)
class Links:
    """How vehicles were heard over the flight, where the link told: L moments."""

    time_ns: Integers
    """(L,)"""
    received: Integers
    """(L, N) frames since the vehicle was first heard."""
    lost: Integers
    """(L, N)"""


@dataclass(frozen=True, slots=True, eq=False)
class History:
    """One flight, tick by tick."""

    path: Path
    scenario: Scenario
    metadata: Mapping[str, str]
    """Versions, seed, wall time."""
    problem: str | None
    """Why the flight could not be completed, or why the recording ends before it."""
    ids: tuple[int, ...]
    """System ids."""
    number: Integers
    """(T,) of each tick; there are gaps where a damaged recording was recovered."""
    time_ns: Integers
    """(T,) when it was decided."""
    lateness_s: Array
    """(T,) after its deadline."""
    frames: Integers
    """(T,) how many received frames it consumed."""
    phase: tuple[str, ...]
    """(T,) as gcs.flight_state.Phase calls it."""
    mission_s: Array
    """(T,) since mission start; NaN outside the mission."""
    task: tuple[str, ...]
    """(T,) of the mission; "" outside it."""
    position: Array
    """(T, N, 3) m: north, east of the swarm's origin, height above home; the truth where it was told."""
    measured: bool
    """Whether positions are telemetry, because nothing told the truth."""
    reported: Array
    """(T, N, 3) the same by telemetry."""
    velocity_ned: Array
    """(T, N, 3) m/s, by telemetry."""
    age_s: Array
    """(T, N) of telemetry."""
    attitude_rpy: Array
    """(T, N, 3) rad, as last told."""
    battery: Array
    """(T, N) 0 … 1, as last told."""
    armed: Flags
    """(T, N) as last told."""
    custom_mode: Integers
    """(T, N) the autopilot's number of its mode, as last told."""
    asked_ned: Array
    """(T, N, 3) m/s that the controller asked for."""
    sent_ned: Array
    """(T, N, 3) m/s that passed the gate; NaN for vehicles that were sent nothing."""
    verdict: Integers
    """(T, N) of the gate; −1 where it was not asked."""
    trust: Array
    """(T, N) 0 … 1; NaN outside the mission."""
    weights: Array
    """(T, N, N) row i is how much robot i heeds each; NaN where no control law ran."""
    virtual_ne: Array
    """(T, 2) m: the virtual leader; NaN outside the mission."""
    virtual_velocity_ne: Array
    """(T, 2) m/s."""
    ratings: tuple[Rating, ...]
    """What people said, with the time at which it counted."""
    parts: tuple[Parts, ...]
    """Who led and who was left behind, whenever it changed."""
    faults: tuple[FaultSpan, ...]
    happenings: tuple[Happening, ...]
    """In the order of time."""
    links: Links | None
    track: Track | None
    """The mission up to its read-out, for its score."""


def load(path: Path) -> History:
    """Read a recording, or the one in a run's folder. Raises UnreadableRecording."""
    raise NotImplementedError(path)
