"""What happened in a flight that one would want to jump to: pure functions of a recording's arrays."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from gcs.events import Event, Rating
from gcs.flight_state import Phase
from gcs.gate import LOST_NS
from gcs.recording import sentences
from gcs.recording.faults import FaultSpan
from gcs.scoring import DISTRUSTED
from gcs.track import Parts

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


class Kind(Enum):
    """What a happening is about."""

    PHASE = "phase"
    """Of the flight, or of its mission."""
    DISTRUST = "distrust"
    """A robot's trust fell below 0.5, or rose above it again."""
    RATING = "rating"
    ROLES = "roles"
    """Who leads, and who is left behind."""
    FAULT = "fault"
    """The truth of a simulation, which no flight knew; never shown to participants of a study."""
    LINK = "link"
    """A vehicle fell silent, or is heard again."""
    HANDS = "hands"
    """A vehicle is not ours any more, or is ours again."""
    WORD = "word"
    """Of the operator, or of an autopilot: a refusal, too."""
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


Found = tuple[int, Kind, int | None, str]
"""Row of the arrays, what it is about, system id or None, words."""


def phases(phase: Sequence[str], task: Sequence[str]) -> Iterator[Found]:
    """Every new phase of the flight and task of its mission, the first of each too. (T,) each."""
    before = "", ""
    for row, (name, mission) in enumerate(zip(phase, task, strict=True)):
        now = name, mission if name == Phase.MISSION.value else ""
        if now[0] != before[0]:
            yield row, Kind.PHASE, None, sentences.phase(*now)
        elif now[1] != before[1]:
            yield row, Kind.PHASE, None, sentences.next_task(now[1])
        before = now


def operators_words(said: Iterable[tuple[int, Event]]) -> Iterator[Found]:
    """(row, word) each."""
    return ((row, Kind.WORD, None, sentences.operator(word)) for row, word in said)


def vehicles_words(said: Iterable[tuple[int, int, str]]) -> Iterator[Found]:
    """(row, system id, words) each."""
    return ((row, Kind.WORD, system, sentences.vehicle(system, text)) for row, system, text in said)


def ratings(said: Iterable[tuple[int, Rating]]) -> Iterator[Found]:
    """(row, rating) each."""
    return ((row, Kind.RATING, rating.vehicle, sentences.rating(rating)) for row, rating in said)


def distrust(trust: Array, ids: Sequence[int]) -> Iterator[Found]:
    """(T, N) trust falling below DISTRUSTED and rising again; who has no trust yet is not distrusted."""
    for row, column, fell in _changes(trust < DISTRUSTED):
        if fell or not math.isnan(trust[row, column]):
            yield row, Kind.DISTRUST, ids[column], sentences.distrust(ids[column], fell=fell)


def silences(age_s: Array, ids: Sequence[int]) -> Iterator[Found]:
    """(T, N) age of telemetry growing beyond what the gate takes for lost, and ending."""
    for row, column, lost in _changes(age_s > LOST_NS / 1e9):
        yield row, Kind.LINK, ids[column], sentences.silence(ids[column], lost=lost)


def _changes(flags: Flags) -> Iterator[tuple[int, int, bool]]:
    """(row, column, to what) of each change down (T, N) flags that are false at first."""
    before = np.vstack([np.zeros((1, flags.shape[1]), bool), flags[:-1]])
    for row, column in np.argwhere(flags != before).tolist():
        yield row, column, bool(flags[row, column])


def roles(parts: Sequence[Parts], mission_s: Array) -> Iterator[Found]:
    """Who leads in whose place, who is left behind and taken back. mission_s: (T,)"""
    for before, now in pairwise(parts):
        for system, words in sentences.parts(before, now):
            yield row_at(mission_s, now.time_s), Kind.ROLES, system, words


def faults(spans: Sequence[FaultSpan], mission_s: Array) -> Iterator[Found]:
    """Faults beginning and ending. mission_s: (T,)"""
    for span in spans:
        yield row_at(mission_s, span.from_s), Kind.FAULT, span.vehicle, f"a fault begins: {span.words}"
        if math.isfinite(span.to_s):
            yield row_at(mission_s, span.to_s), Kind.FAULT, span.vehicle, f"a fault ends: {span.words}"


def ordered(found: Iterable[Found]) -> list[Found]:
    """By their rows, and of one row causes first: a fault begins behind the phase that it begins in, and before what
    followed from it; all else stays in its order.
    """
    late = {Kind.FAULT: 1, Kind.DISTRUST: 2, Kind.ROLES: 2}
    return sorted(found, key=lambda one: (one[0], late.get(one[1], 0)))


def row_at(times: Array | npt.NDArray[np.int64], time: float) -> int:
    """The first row at which (T,) times, NaN here and there, are no earlier; the last where all are."""
    there = np.flatnonzero(times >= time)
    return int(there[0]) if there.size else len(times) - 1
