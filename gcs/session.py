"""One flight from scenario to summary: loop, recording, score, picture. Link and clock come from outside."""

from __future__ import annotations

import datetime as dt
import platform
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from importlib.metadata import version
from itertools import count
from pathlib import Path

from gcs import console
from gcs.emergency import LastResort
from gcs.events import Rating
from gcs.flight import Flight
from gcs.flight_state import FlightState, left_behind
from gcs.loop import Clock, Link, Record, fly
from gcs.operator import Operator
from gcs.recording.reader import RECORDING
from gcs.recording.writer import SUMMARY, Recorder, RecordingError, Tap
from gcs.scoring import min_separation, score
from gcs.shielded import Shielded
from gcs.summary import Summary, collision, severity_of, trust_of
from gcs.track import Track, Tracker
from gcs.truth import Truth
from gcs.words import faults
from scenarios import Scenario

PICTURE = "trajectory.png"


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
    say: Callable[[str], None] = console.say,
) -> Summary:
    """Fly a scenario over a link; leaves run.mcap, summary.json and trajectory.png in `out`.

    name: how the summary calls the scenario;  watching: builds what shows the flight while it goes on;
    ratings: known beforehand, () where only live ones may come, None where nobody rates.
    A recording or a display that fails is said at once and in the summary; the flight goes on. Any other error lands
    the fleet before it is raised. Raises RecordingError before take-off where `out` cannot be written.
    """
    flight = Flight(scenario, ratings=ratings)
    truth = Truth(flight.ids)
    tracker = Tracker(flight, truth)
    began = time.perf_counter()
    start_ns = clock.now()
    metadata = _metadata(name, seed, ratings)
    with ExitStack() as stack:
        recorder = Recorder(out / RECORDING, scenario, truth, start_ns=start_ns, metadata=metadata, say=say)
        last_resort = LastResort(link, clock, flight.ids, say)
        records: tuple[tuple[str, Record], ...] = (
            ("the last resort", last_resort),
            ("the truth", truth),
            ("the track", tracker),
            ("the recording", recorder),
            *(("the display", display) for display in watching(flight)),
        )
        shielded = [stack.enter_context(Shielded(record, name, say)) for name, record in records]
        with last_resort:
            state = fly(
                Tap(link, clock, recorder),
                clock,
                flight,
                shielded,
                period_ns=scenario.time.period_ns,
                events=operator.events,
            )
        took_s = time.perf_counter() - began
        track = tracker.track
        recording = (out / RECORDING).resolve()
        summary = _summary(name, scenario, state, track, seed, took_s, recording, link.rejected)
        recorder.add_metadata(SUMMARY, {"json": summary.json().decode()})
    problem = summary.problem or recorder.problem or next(filter(None, (record.problem for record in shielded)), None)
    if problem is not None:
        summary = replace(summary, problem=problem, passed=False)
    _write_results(summary, track, scenario, out)
    return summary


def _write_results(summary: Summary, track: Track | None, scenario: Scenario, out: Path) -> None:
    """summary.json and the picture. Raises RecordingError."""
    try:
        summary.save(out)
        if track is not None:
            from gcs.picture import draw

            draw(track, scenario, out / PICTURE, problem=summary.problem)
    except OSError as error:
        raise RecordingError(f"{out}: the results cannot be written: {error.strerror or error}") from None


def make_room(folder: Path) -> Path | None:
    """Take what an earlier run left out of the way: its recording is kept under the time it was closed at."""
    for name in ("summary.json", PICTURE):
        (folder / name).unlink(missing_ok=True)
    recording = folder / RECORDING
    if not recording.is_file() or recording.stat().st_size == 0:
        return None
    closed = dt.datetime.fromtimestamp(recording.stat().st_mtime, dt.UTC).strftime("%Y%m%dT%H%M%S")
    namesakes = _namesakes(folder, f"run-{closed}", ".mcap")
    return recording.rename(next(path for path in namesakes if not path.exists()))


def output_folder(out: Path | None, name: str) -> Path:
    """Where a run writes, made and tried. Raises RecordingError."""
    now = dt.datetime.now(dt.UTC).strftime("%Y%m%dT%H%M%S")
    folder = Path("runs") / f"{now}-{Path(name).stem}" if out is None else out
    try:
        folder = _new(folder) if out is None else folder
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".writable"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise RecordingError(f"--out {folder}: cannot be written: {error.strerror or error}") from None
    return folder


def _new(folder: Path) -> Path:
    """This folder, or the first of its namesakes that nobody has: two runs may begin in one second."""
    for candidate in _namesakes(folder.parent, folder.name):
        try:
            candidate.mkdir(parents=True)
        except FileExistsError:
            continue
        return candidate
    raise AssertionError("names never end")


def _namesakes(folder: Path, stem: str, suffix: str = "") -> Iterator[Path]:
    """This name in the folder, then the same numbered from 2, without end."""
    yield folder / f"{stem}{suffix}"
    for number in count(2):
        yield folder / f"{stem}-{number}{suffix}"


def _metadata(name: str, seed: int | None, ratings: Sequence[Rating] | None) -> dict[str, str]:
    """Versions, seed, who rates and wall time: outside the promise of same seed, same bytes."""
    packages = ("trustr", "jsbsim", "pymavlink", "numpy", "mcap")
    return {
        "scenario": name,
        "seed": "" if seed is None else str(seed),
        "ratings": "" if ratings is None else "known beforehand" if ratings else "live",
        "started": dt.datetime.now(dt.UTC).isoformat(timespec="seconds"),
        "python": platform.python_version(),
        **{package: _version(package) for package in packages},
    }


def _version(package: str) -> str:
    try:
        return version(package)
    except ImportError:
        return "absent"


def _summary(
    name: str,
    scenario: Scenario,
    state: FlightState,
    track: Track | None,
    seed: int | None,
    took_s: float,
    recording: Path,
    rejected_frames: int,
) -> Summary:
    result = None if track is None else score(track, scenario)
    closest = None if track is None else min_separation(track.position)
    simulated_s = state.tick * scenario.time.period_s
    problem = state.problem or collision(closest)
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
        problem=problem,
    )
