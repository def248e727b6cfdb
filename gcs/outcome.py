"""What came of a flight: its summary, its picture, and the one problem that is told of it."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from gcs.flight_state import FlightState, left_behind
from gcs.output import PICTURE
from gcs.scoring import min_separation, score
from gcs.shielded import in_words
from gcs.summary import Reception, Summary, collision, severity_of, trust_of
from gcs.track import Track
from gcs.words import faults
from scenarios import Scenario


def summary_of(
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
    """A flight in figures, before anything beside it is said to have failed.

    failure: why our own code ended it;  track: None where the mission never began;  took_s: of wall time.
    """
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


def failure_of(error: BaseException) -> str:
    """What is told of a flight that our own code, or a second Ctrl-C, broke off."""
    if isinstance(error, KeyboardInterrupt):
        return "ended at once by Ctrl-C: its vehicles were not told to land"
    return f"the flight failed: {in_words(error)}; its vehicles were told to land"


def with_problem(summary: Summary, *problems: str | None) -> Summary:
    """The first there is; the flight's own comes before all others."""
    problem = summary.problem or next(filter(None, problems), None)
    return summary if problem is None else replace(summary, problem=problem, passed=False)


def written(summary: Summary, track: Track | None, scenario: Scenario, out: Path) -> Summary:
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
