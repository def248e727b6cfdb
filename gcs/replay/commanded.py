"""What another controller, or other parameters, would have commanded on the telemetry of a recorded flight.

The telemetry does not answer: the vehicles go on as they were commanded when it was recorded. So this tells, at each
tick, what would have been sent to the swarm as it then was; `gcs run run.mcap` flies it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import filterfalse
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import orjson

from gcs.replay.again import again, flight_of
from gcs.replay.pages import Pages
from gcs.replay.setpoints import content, is_setpoint, velocity_of
from gcs.scoring import DISTRUSTED
from gcs.summary import trust_of
from gcs.track import Track, Tracker
from gcs.truth import Truth
from scenarios import Scenario
from wire.frames import Framer, target_system

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Frames = Sequence[Sequence[bytes]]
"""Of each tick."""


@dataclass(frozen=True, slots=True)
class ToOne:
    """One vehicle's set-points, as they were sent and as they would have been."""

    vehicle: int
    """System id."""
    setpoints: int
    """That were sent, or would have been."""
    differ: int
    """Of these: in which anything is another, or that only one of the two decisions sends."""
    rms_m_s: float | None
    """Root mean square of the difference in velocity, over those in the mission that both send; null of none."""
    largest_m_s: float | None
    """In the mission, before it or after it."""
    largest_tick: int | None
    largest_s: float | None
    """Of that tick, since mission start, negative before it; null where there was no mission."""
    distrusted_s: float | None
    """When its trust first fell below 0.5 in the flight, since mission start; null if it never did, or none was asked
    for."""
    would_be_distrusted_s: float | None


@dataclass(frozen=True, slots=True)
class WhatIf:
    """The answer."""

    ticks: int
    """That were decided again."""
    ticks_beyond_gaps: int
    """That were not: the recording lacks something before them."""
    setpoints: int
    differ: int
    first_tick: int | None
    """At which a set-point differs; null if none does."""
    first_s: float | None
    """Of that tick, since mission start, negative before it; null where there was no mission."""
    other_frames_differ: int
    """Frames besides set-points (commands, requests) that are others, or that only one of the decisions sends."""
    vehicles: list[ToOne]
    problem: str | None
    """Why the flight would not have been completed, as far as it was decided."""
    only_the_world_changed: bool
    """Whether no decision asks for anything that is not as it was recorded."""
    further_parts: list[str]
    """Files in which the recording goes on, of which nothing was decided."""
    ends_before_flight: bool
    """Whether the recording does."""

    def json(self) -> bytes:
        """One object."""
        return orjson.dumps(asdict(self))


def compared(pages: Pages, scenario: Scenario) -> WhatIf:
    """Decide with this scenario, and set what it sends beside what was sent."""
    flight = flight_of(pages, scenario)
    truth = Truth(flight.ids)
    tracker = Tracker(flight, truth)
    second = again(pages, scenario, (truth, tracker))
    sent = [page.sent for page in pages.ticks]
    both = _Both.of(sent, second.sent, count=len(flight.ids))
    seconds = [pages.mission_s(page.time_ns) for page in pages.ticks]
    in_mission = np.isfinite(second.mission_s)
    before = _distrusted(pages.told.track, pages.told.scenario)
    after = _distrusted(tracker.track, scenario)
    first = int(np.argmax(both.differ.any(axis=1))) if both.differ.any() else None
    setpoints, differ = both.there.sum(axis=0).tolist(), both.differ.sum(axis=0).tolist()
    return WhatIf(
        ticks=len(pages.ticks),
        ticks_beyond_gaps=len(pages.beyond),
        setpoints=sum(setpoints),
        differ=sum(differ),
        first_tick=first,
        first_s=None if first is None else seconds[first],
        other_frames_differ=sum(map(_others, sent, second.sent)),
        vehicles=[
            ToOne(
                system,
                setpoints[row],
                differ[row],
                *_size(both.apart_m_s[:, row], in_mission, seconds),
                before.get(system),
                after.get(system),
            )
            for row, system in enumerate(flight.ids)
        ],
        problem=second.problem,
        only_the_world_changed=scenario != pages.told.scenario and _asked(scenario) == _asked(pages.told.scenario),
        further_parts=[part.name for part in pages.parts],
        ends_before_flight=pages.cut_short,
    )


class _Both(NamedTuple):
    """Set-points to N vehicles at T ticks, as they were sent and as they would have been."""

    there: Flags
    """(T, N) where there is one."""
    differ: Flags
    """(T, N) where they are not the same to the bit."""
    apart_m_s: Array
    """(T, N) how far; NaN where only one is sent."""

    @staticmethod
    def of(sent: Frames, decided: Frames, *, count: int) -> _Both:
        """From the frames of each tick."""
        was, would_be = dict(_setpoints(sent)), dict(_setpoints(decided))
        there, differ = np.zeros((2, len(sent), count), dtype=bool)
        for at in was.keys() | would_be.keys():
            there[at], differ[at] = True, was.get(at) != would_be.get(at)
        shape = (len(sent), count, 3)
        return _Both(there, differ, np.linalg.norm(_velocities(would_be, shape) - _velocities(was, shape), axis=-1))


def _setpoints(sent: Frames) -> Iterator[tuple[tuple[int, int], bytes]]:
    """Tick and row of each, and its payload."""
    for tick, frames in enumerate(sent):
        for raw in filter(is_setpoint, frames):
            (frame,) = Framer().frames(0, raw)
            yield (tick, target_system(frame) - 1), frame.payload


def _velocities(setpoints: dict[tuple[int, int], bytes], shape: tuple[int, int, int]) -> Array:
    """(T, N, 3) m/s; NaN where there is none."""
    velocity = np.full(shape, np.nan)
    for at, payload in setpoints.items():
        velocity[at] = velocity_of(payload)
    return velocity


def _others(sent: Sequence[bytes], decided: Sequence[bytes]) -> int:
    """How many frames of a tick, besides set-points, differ; in whichever order they were sent."""
    was, would_be = (Counter(map(content, filterfalse(is_setpoint, frames))) for frames in (sent, decided))
    return max((was - would_be).total(), (would_be - was).total())


def _size(
    apart: Array, in_mission: Flags, seconds: Sequence[float | None]
) -> tuple[float | None, float | None, int | None, float | None]:
    """RMS of (T,) differences in the mission, and the largest of all, its tick, and its time; NaN where one was sent.

    None of what there is none.
    """
    if np.isnan(apart).all():
        return None, None, None, None
    tick, flown = int(np.nanargmax(apart)), apart[in_mission & ~np.isnan(apart)]
    rms = float(np.sqrt(np.mean(flown**2))) if flown.size else None
    return rms, float(apart[tick]), tick, seconds[tick]


def _distrusted(track: Track | None, scenario: Scenario) -> dict[int, float]:
    """System id → when its trust first fell below 0.5, of those of whom it did; of nobody by a rule without trust."""
    if track is None or trust_of(scenario) is None:
        return {}
    below = track.trust < DISTRUSTED
    return {
        row + 1: round(float(track.time_s[np.argmax(below[:, row])]), 6)
        for row in np.flatnonzero(below.any(axis=0)).tolist()
    }


OF_THE_WORLD = {"title", "noise", "wind", "vehicle", "expect", "fault"}
"""Sections that the simulation obeys, or by which a flight is judged; of faults a decision may know who has them."""


def _asked(scenario: Scenario) -> tuple[Any, ...]:
    """All of a scenario that a decision may ask for: by trust from the truth, when each fault acts."""
    kept = scenario.model_dump(exclude=OF_THE_WORLD)
    del kept["time"]["physics_hz"]
    acts = [(fault.blamed, fault.onset_s, fault.end_s, fault.period_s, fault.on_fraction) for fault in scenario.fault]
    return kept, acts
