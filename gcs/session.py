"""One flight from scenario to summary: loop, recording, score, picture. Link and clock come from outside."""

from __future__ import annotations

import datetime as dt
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from gcs import console
from gcs.emergency import LastResort
from gcs.events import Rating
from gcs.flight import Flight
from gcs.flight_state import FlightState
from gcs.loop import Clock, Link, Record, Tick, fly
from gcs.operator import Operator
from gcs.outcome import failure_of, summary_of, with_problem, written
from gcs.recording.files import FAULTS, MADE, PLANNED, SUMMARY
from gcs.recording.journal import Journal, Journaled
from gcs.recording.reader import RECORDING
from gcs.recording.writer import IN_LARGE_CHUNKS_NS, Recorder, Tap
from gcs.shielded import Shielded
from gcs.summary import Reception, Summary
from gcs.track import Tracker
from gcs.truth import Truth
from gcs.versions import installed
from scenarios import Scenario


@dataclass(frozen=True, slots=True)
class Recording:
    """How a flight is recorded."""

    flush_ns: int = IN_LARGE_CHUNKS_NS
    """How long anything may wait to be written."""
    decodes: bool = False
    """Whether MAVLink messages are written as JSON, beside their frames."""
    journal: Journal | None = None
    """Where frames that are sent are noted first."""


AS_IN_RUN = Recording()
"""As a flight is recorded that can be flown again."""


def flown(
    name: str,
    scenario: Scenario,
    link: Link,
    clock: Clock,
    *,
    seed: int | None,
    out: Path,
    operator: Operator,
    watching: Callable[[Flight], Iterable[Record]],
    ratings: Sequence[Rating] | None = None,
    recording: Recording = AS_IN_RUN,
    reception: Callable[[], Reception] = Reception,
    faults_made: bool = True,
    pictured: bool = True,
    say: Callable[[str], None] = console.say,
) -> Summary:
    """Fly a scenario over a link; leaves run.mcap, summary.json and, if pictured, trajectory.png in `out`.

    name: how the summary calls the scenario;  watching: builds what shows the flight while it goes on;
    ratings: known beforehand, () where only live ones may come, None where nobody rates.
    reception: tells how the vehicles were heard, where the link knows;  faults_made: whether the link makes the
    scenario's faults, and they are not left to vehicles behind it.
    A recording or a display that fails is said at once and in the summary; the flight goes on. Any other error of the
    loop lands the fleet before it is raised, and is the problem that recording and summary.json tell. Raises
    RecordingError before take-off where `out` cannot be written.
    """
    flight = Flight(scenario, ratings=ratings)
    truth = Truth(flight.ids)
    tracker = Tracker(flight, truth, faults_made=faults_made)
    if recording.journal is not None:
        link = Journaled(link, clock, recording.journal)
    began = time.perf_counter()
    recorder = Recorder(
        out / RECORDING,
        scenario,
        truth,
        start_ns=clock.now(),
        metadata=_metadata(name, seed, ratings, faults_made=faults_made),
        flush_ns=recording.flush_ns,
        decodes=recording.decodes,
        reception=reception,
        faults_made=faults_made,
        say=say,
    )
    noted = Tap(link, clock, recorder)
    last_resort, reached = LastResort(noted, clock, flight.ids, say), _Reached(flight.start())

    def came_of_it(failure: str | None = None) -> Summary:
        """Without what failed beside the flight; the recording is told both."""
        took_s, path = time.perf_counter() - began, (out / RECORDING).resolve()
        summary = summary_of(
            name, scenario, reached.state, failure, tracker.track, seed, took_s, path, link.rejected, reception()
        )
        recorder.add_metadata(SUMMARY, {"json": beside(summary).json().decode()})
        return summary

    def beside(summary: Summary) -> Summary:
        """With what failed beside the flight, so far."""
        journal = None if recording.journal is None else recording.journal.problem
        return with_problem(summary, recorder.problem, journal, *(record.problem for record in shielded))

    with recorder:
        records: tuple[tuple[str, Record], ...] = (
            ("the last resort", last_resort),
            ("the flight's state", reached),
            ("the truth", truth),
            ("the track", tracker),
            ("the recording", recorder),
            *(("the display", display) for display in watching(flight)),
        )
        shielded = [Shielded(record, name, say) for name, record in records]
        try:
            with last_resort:
                fly(noted, clock, flight, shielded, period_ns=scenario.time.period_ns, events=operator.events)
        except BaseException as error:
            with suppress(Exception):  # that it failed is what there is to be raised
                beside(came_of_it(failure_of(error))).save(out)
            raise
        summary = came_of_it()
    return written(beside(summary), tracker.track if pictured else None, scenario, out)


class _Reached:
    """A record that keeps how far the flight came."""

    def __init__(self, state: FlightState) -> None:
        self.state = state

    def tick(self, tick: Tick) -> None:
        self.state = tick.state


def _metadata(name: str, seed: int | None, ratings: Sequence[Rating] | None, *, faults_made: bool) -> dict[str, str]:
    """Versions, seed, who rates, whose the faults are and wall time: outside the promise of same seed, same bytes."""
    return {
        "scenario": name,
        "seed": "" if seed is None else str(seed),
        "ratings": "" if ratings is None else "known beforehand" if ratings else "live",
        FAULTS: MADE if faults_made else PLANNED,
        "started": dt.datetime.now(dt.UTC).isoformat(timespec="seconds"),
        **installed(),
    }
