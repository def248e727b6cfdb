"""One flight from scenario to summary: loop, recording, score, picture. Link and clock come from outside."""

from __future__ import annotations

import datetime as dt
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from gcs import console
from gcs.emergency import LastResort
from gcs.events import Rating
from gcs.flight import Flight
from gcs.flight_state import FlightState, left_behind
from gcs.loop import Clock, Link, Record, Tick, fly
from gcs.operator import Operator
from gcs.output import PICTURE
from gcs.recording.files import FAULTS, MADE, PLANNED, SUMMARY
from gcs.recording.journal import Journal, Journaled
from gcs.recording.reader import RECORDING
from gcs.recording.writer import IN_LARGE_CHUNKS_NS, Recorder, Tap
from gcs.scoring import min_separation, score
from gcs.shielded import Shielded, in_words
from gcs.summary import Reception, Summary, collision, severity_of, trust_of
from gcs.track import Track, Tracker
from gcs.truth import Truth
from gcs.versions import installed
from gcs.words import faults
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
        summary = _summary(
            name, scenario, reached.state, failure, tracker.track, seed, took_s, path, link.rejected, reception()
        )
        recorder.add_metadata(SUMMARY, {"json": beside(summary).json().decode()})
        return summary

    def beside(summary: Summary) -> Summary:
        """With what failed beside the flight, so far."""
        journal = None if recording.journal is None else recording.journal.problem
        return _with_problem(summary, recorder.problem, journal, *(record.problem for record in shielded))

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
                beside(came_of_it(_failure(error))).save(out)
            raise
        summary = came_of_it()
    return _written(beside(summary), tracker.track if pictured else None, scenario, out)


class _Reached:
    """A record that keeps how far the flight came."""

    def __init__(self, state: FlightState) -> None:
        self.state = state

    def tick(self, tick: Tick) -> None:
        self.state = tick.state


def _failure(error: BaseException) -> str:
    if isinstance(error, KeyboardInterrupt):
        return "ended at once by Ctrl-C: its vehicles were not told to land"
    return f"the flight failed: {in_words(error)}; its vehicles were told to land"


def _with_problem(summary: Summary, *problems: str | None) -> Summary:
    """The first there is; the flight's own comes before all others."""
    problem = summary.problem or next(filter(None, problems), None)
    return summary if problem is None else replace(summary, problem=problem, passed=False)


def _written(summary: Summary, track: Track | None, scenario: Scenario, out: Path) -> Summary:
    """Leaves a picture of the track and summary.json; what keeps them from being written is a problem of the flight."""
    picture = out / PICTURE
    try:
        if track is not None:
            from gcs.picture import draw

            draw(track, scenario, picture, problem=summary.problem)
        summary.save(out)
    except Exception as error:  # whatever it is, a flight that was flown is told of
        why = (error.strerror or error) if isinstance(error, OSError) else in_words(error)
        problem = f"{out}: the results cannot be written: {why}"
        summary = replace(summary, problem="; ".join(filter(None, (summary.problem, problem))), passed=False)
        with suppress(OSError):
            picture.unlink(missing_ok=True)  # torn; and there may be room for the summary now
            summary.save(out)
    return summary


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


def _summary(
    name: str,
    scenario: Scenario,
    state: FlightState,
    failure: str | None,
    track: Track | None,
    seed: int | None,
    took_s: float,
    recording: Path,
    rejected_frames: int,
    reception: Reception,
) -> Summary:
    result = None if track is None else score(track, scenario)
    closest = None if track is None else min_separation(track.position)
    simulated_s = state.tick * scenario.time.period_s
    problem = "; ".join(filter(None, (state.problem or collision(closest), failure))) or None
    return Summary(
        scenario=name,
        controller=scenario.control.rule,
        trust=trust_of(scenario),
        severity=severity_of(scenario),
        seed=seed,
        heading_error_deg=None if result is None else result.heading_error_deg,
        distance_to_target_m=None if result is None else result.distance_to_target_m,
        min_separation_m=None if result is None else result.min_separation_m,
        passed=bool(result and result.passed and problem is None),
        detected={} if result is None else {str(k): v for k, v in result.detected.items()},
        false_alarms=0 if result is None else result.false_alarms,
        left_behind=left_behind(state),
        simulated_s=round(simulated_s, 6),
        real_time_factor=round(simulated_s / took_s, 2),
        recording=str(recording),
        profile=scenario.control.profile,
        scored_on="telemetry" if track is not None and track.measured else "truth",
        faults=faults(scenario),
        swarm_heading_error_deg=None if result is None else result.swarm_heading_error_deg,
        rejected_frames=rejected_frames,
        rejections=dict(reception.rejections),
        loss=reception.loss,
        problem=problem,
    )
