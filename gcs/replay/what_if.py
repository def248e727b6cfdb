"""What another controller, or other parameters, would have commanded on the telemetry of a recorded flight.

The telemetry does not answer: the vehicles go on as they were commanded when it was recorded. So this tells, at each
tick, what would have been sent to the swarm as it then was; `gcs run run.mcap` flies it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import orjson
from rich import box
from rich.table import Table

from gcs.choices import Choices
from gcs.console import say, write
from gcs.guard import DONE
from gcs.replay.again import Pages, again, chosen, flight_of, is_setpoint, velocity_of
from gcs.scoring import DISTRUSTED
from gcs.summary import trust_of
from gcs.track import Track, Tracker
from gcs.truth import Truth
from gcs.words import faults
from scenarios import Scenario
from wire.frames import Framer, target_system

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Vehicle:
    """One vehicle's set-points, as they were sent and as they would have been."""

    vehicle: int
    """System id."""
    setpoints: int
    """That were sent, or would have been."""
    differ: int
    """Of these: whose velocity is another, or that only one of the two decisions sends."""
    rms_m_s: float | None
    """Root mean square of the difference, over those that both send; null of none."""
    largest_m_s: float | None
    largest_tick: int | None
    largest_s: float | None
    """Of that tick, since mission start; null outside the mission."""
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
    """At which one differs; null if none does."""
    first_s: float | None
    """Of that tick, since mission start; null outside the mission."""
    vehicles: list[Vehicle]
    problem: str | None
    """Why the flight would not have been completed."""

    def json(self) -> bytes:
        """One object."""
        return orjson.dumps(asdict(self))


def what_if(path: Path, choices: Choices, *, as_json: bool, console: Any) -> int:
    """Say what would have been commanded. A difference is an answer, and no failure: 0."""
    pages = Pages.of(path)
    scenario = chosen(pages, choices) or pages.told.scenario
    answer = compared(pages, scenario)
    for caveat in _caveats(pages, scenario, answer):
        say(caveat)
    if as_json:
        write(answer.json())
    else:
        trusted = any(trust_of(one) is not None for one in (pages.told.scenario, scenario))
        _show(answer, trusted=trusted, console=console)
    return DONE


def compared(pages: Pages, scenario: Scenario) -> WhatIf:
    """Decide with this scenario, and set what it sends beside what was sent."""
    flight = flight_of(pages, scenario)
    truth = Truth(flight.ids)
    tracker = Tracker(flight, truth)
    second = again(pages, scenario, (truth, tracker))
    seconds = [None if math.isnan(time_s) else round(time_s, 6) for time_s in second.mission_s]
    both = _Both.of([page.sent for page in pages.ticks], second.sent, count=len(flight.ids))
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
        vehicles=[
            Vehicle(
                system,
                setpoints[row],
                differ[row],
                *_size(both.apart_m_s[:, row], seconds),
                before.get(system),
                after.get(system),
            )
            for row, system in enumerate(flight.ids)
        ],
        problem=second.problem if second.problem != pages.told.problem else None,
    )


class _Both(NamedTuple):
    """Set-points to N vehicles at T ticks, as they were sent and as they would have been."""

    there: Flags
    """(T, N) where there is one."""
    differ: Flags
    """(T, N) where they are not the same."""
    apart_m_s: Array
    """(T, N) how far; NaN where only one is sent."""

    @staticmethod
    def of(sent: Sequence[Sequence[bytes]], decided: Sequence[Sequence[bytes]], *, count: int) -> _Both:
        """From the frames of each tick."""
        was, would_be = _velocities(sent, count), _velocities(decided, count)
        there = ~np.isnan(was[..., 0]) | ~np.isnan(would_be[..., 0])
        return _Both(there, there & ~(was == would_be).all(axis=-1), np.linalg.norm(would_be - was, axis=-1))


def _velocities(sent: Sequence[Sequence[bytes]], count: int) -> Array:
    """(T, N, 3) m/s of each tick's set-points; NaN where there is none."""
    velocity = np.full((len(sent), count, 3), np.nan)
    for tick, frames in enumerate(sent):
        for raw in filter(is_setpoint, frames):
            (frame,) = Framer().frames(0, raw)
            velocity[tick, target_system(frame) - 1] = velocity_of(frame.payload)
    return velocity


def _size(apart: Array, seconds: Sequence[float | None]) -> tuple[float | None, float | None, int | None, float | None]:
    """RMS and largest of (T,) differences, the tick of the largest, and its time; NaN where only one was sent."""
    if np.isnan(apart).all():
        return None, None, None, None
    tick = int(np.nanargmax(apart))
    return float(np.sqrt(np.nanmean(apart**2))), float(apart[tick]), tick, seconds[tick]


def _distrusted(track: Track | None, scenario: Scenario) -> dict[int, float]:
    """System id → when its trust first fell below 0.5, of those of whom it did; of nobody by a rule without trust."""
    if track is None or trust_of(scenario) is None:
        return {}
    below = track.trust < DISTRUSTED
    return {
        row + 1: round(float(track.time_s[np.argmax(below[:, row])]), 6)
        for row in np.flatnonzero(below.any(axis=0)).tolist()
    }


def _caveats(pages: Pages, scenario: Scenario, answer: WhatIf) -> Iterator[str]:
    """What the answer does not say of itself."""
    if pages.beyond:
        yield (
            f"the recording lacks frames from tick {pages.gaps[0].first} on: "
            f"{answer.ticks_beyond_gaps} ticks that it has behind them are left out"
        )
    track = pages.told.track
    if trust_of(scenario) == "truth" and (track is None or track.measured):
        known = ", ".join(faults(scenario)) or "it has none, so everybody is trusted"
        yield f"nothing told the truth of this flight; trust is from the faults of its scenario: {known}"


def _show(answer: WhatIf, *, trusted: bool, console: Any) -> None:
    console.print(_headline(answer), highlight=False, soft_wrap=True)
    if answer.problem is not None:
        words = f"the flight would not have been completed: {answer.problem}"
        console.print(words, highlight=False, markup=False, soft_wrap=True)
    if answer.differ:
        console.print(_table(answer, trusted=trusted))
        console.print(
            "The telemetry is of the flight as it was flown, and does not answer; `gcs run RECORDING` flies it."
        )


def _headline(answer: WhatIf) -> str:
    if answer.first_tick is None:
        return f"all {answer.setpoints} set-points would have been the same"
    when = "" if answer.first_s is None else f", {answer.first_s:.1f} s into the mission"
    others = f"{answer.differ} of {answer.setpoints} set-points would have been others"
    return f"{others}, from tick {answer.first_tick} on{when}"


def _table(answer: WhatIf, *, trusted: bool) -> Table:
    table = Table("robot", box=box.SIMPLE)
    for heading in ("set-points", "others", "RMS", "largest", "at", *TRUST[: 2 * trusted]):
        table.add_column(heading, justify="right")
    for vehicle in answer.vehicles:
        cells = (
            str(vehicle.setpoints),
            str(vehicle.differ),
            _speed(vehicle.rms_m_s),
            _speed(vehicle.largest_m_s),
            _time(vehicle.largest_s if vehicle.differ else None),
            _time(vehicle.distrusted_s),
            _time(vehicle.would_be_distrusted_s),
        )
        table.add_row(str(vehicle.vehicle), *cells[: len(cells) - 2 + 2 * trusted])
    return table


TRUST = ("distrusted from", "would be from")


def _speed(value: float | None) -> str:
    if value is None:
        return "–"
    return "< 0.001 m/s" if 0.0 < value < 0.001 else f"{value:.3f} m/s"


def _time(value: float | None) -> str:
    return "–" if value is None else f"{value:.1f} s"
