"""A recorded flight as link and clock: the same loop decides it again, with its own scenario or with another."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass

from gcs.choices import AS_IT_IS, BadUsageError, Choices
from gcs.events import Event
from gcs.flight import Flight
from gcs.loop import Record, Tick, fly
from gcs.recording.reader import RecordedTick
from gcs.replay.pages import Pages
from scenarios import Scenario
from wire.frames import Frame


class EndOfRecording(Exception):
    """The flight was cut short: its last recorded tick has been decided again."""


class Recorded:
    """Frames and times of a recording; to wait is to turn a page. What is sent goes nowhere but into `sent`."""

    def __init__(self, pages: Sequence[RecordedTick]) -> None:
        self._pages = pages
        self._page = -1
        self.sent: list[list[bytes]] = [[] for _ in pages]

    def now(self) -> int:
        """The recorded time of the current tick. Raises EndOfRecording where there is none."""
        if not self._pages:
            raise EndOfRecording
        return self._pages[max(self._page, 0)].time_ns

    def sleep_until(self, _time_ns: int) -> None:
        """On to the next tick. Raises EndOfRecording where none is left."""
        self._page += 1
        if self._page == len(self._pages):
            raise EndOfRecording

    def receive(self) -> list[Frame]:
        """What the flight received at this tick."""
        return self._pages[self._page].received

    def send(self, _system: int, frame: bytes) -> None:
        """Kept for comparison."""
        self.sent[self._page].append(frame)

    @property
    def rejected(self) -> int:
        """Nothing: only good frames are recorded."""
        return 0

    def events(self) -> tuple[Event, ...]:
        """What people said at this tick."""
        return self._pages[self._page].events


@dataclass(frozen=True, slots=True)
class Again:
    """What deciding again came to, tick by tick."""

    sent: list[list[bytes]]
    """Frames of each tick; none of those behind the end of a flight that would have been shorter."""
    mission_s: list[float]
    """Since mission start, by this decision; NaN outside the mission."""
    problem: str | None
    """Why the flight could not be completed, by this decision, as far as it was decided."""


def again(pages: Pages, scenario: Scenario | None = None, records: Iterable[Record] = ()) -> Again:
    """Decide on the recorded telemetry, and what people said; scenario: another than its own."""
    flight = flight_of(pages, scenario)
    link, notes = Recorded(pages.ticks), _Notes()
    with suppress(EndOfRecording):
        fly(link, link, flight, (notes, *records), period_ns=flight.scenario.time.period_ns, events=link.events)
    return Again(link.sent, notes.mission_s + [math.nan] * (len(pages.ticks) - len(notes.mission_s)), notes.problem)


def flight_of(pages: Pages, scenario: Scenario | None = None) -> Flight:
    """Who decides: people could say something if they could when it was flown."""
    return Flight(scenario or pages.told.scenario, ratings=() if pages.told.rated else None)


def chosen(pages: Pages, choices: Choices) -> Scenario | None:
    """The recording's scenario with these choices; None without any. Raises as they do, and BadUsageError."""
    if choices == AS_IT_IS:
        return None
    was = pages.told.scenario
    scenario = choices.revised(was, source=str(pages.told.path))
    for key, before, after in (
        ("time.period_s", was.time.period_s, scenario.time.period_s),
        ("swarm.rows × swarm.columns", was.swarm.count, scenario.swarm.count),
    ):
        if after != before:
            raise BadUsageError(f"{key} = {after}: it was recorded with {before}, and can be decided again only so")
    return scenario


class _Notes:
    """A `Record` of what a decision says of itself."""

    def __init__(self) -> None:
        self.mission_s: list[float] = []
        self.problem: str | None = None

    def tick(self, tick: Tick) -> None:
        self.mission_s.append(tick.diagnosis.mission_s)
        self.problem = tick.state.problem
