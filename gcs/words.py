"""What was flown, what went wrong and how it ended, in words."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from gcs.scoring import Score
from gcs.summary import Summary
from scenarios import (
    CompassBias,
    FalseReport,
    Fault,
    FrozenTelemetry,
    GpsDrift,
    GpsJump,
    LaggingTelemetry,
    MotorDegradation,
    RotorFault,
    Scenario,
    StuckVelocity,
    WindFault,
)

CONTROLLERS = {
    "average": "Averaged update (eq. 1)",
    "median": "Coordinate-wise median",
    "wmsr-1": "W-MSR, F = 1",
    "wmsr-2": "W-MSR, F = 2",
}


def controller_name(scenario: Scenario) -> str:
    """How a person calls this flight's controller."""
    control = scenario.control
    if control.rule in CONTROLLERS:
        return CONTROLLERS[control.rule]
    profile = "" if control.profile == "paper" else f", {control.profile} profile"
    rule = {"trust-r": "Trust-R", "confidence-decay": "Confidence decay"}.get(control.rule, control.rule)
    return f"{rule}, trust from {scenario.trust.source}{profile}"


def faults(scenario: Scenario) -> list[str]:
    """What goes wrong with whom."""
    return [_fault(fault) for fault in scenario.fault]


def _fault(fault: Fault) -> str:
    when = ", ".join(_when(fault))
    return f"{_what(fault)} ({when})" if when else _what(fault)


def _what(fault: Fault) -> str:
    robot = f"robot {fault.vehicle}"
    match fault:
        case MotorDegradation(max_speed_fraction=1.0) if fault.offset_fraction:
            return f"{robot} pushed to its left by {fault.offset_fraction:.0%} of cruise"
        case MotorDegradation():
            return f"{robot} at {fault.max_speed_fraction:.0%} speed"
        case RotorFault():
            left = (f"{fault.efficiency:.0%} thrust", f"{fault.speed_limit:.0%} speed")
            worse = left[fault.speed_limit < fault.efficiency]
            return f"a rotor of {robot} at {worse}" if fault.efficiency else f"a broken rotor on {robot}"
        case CompassBias():
            return f"the compass of {robot} off by {fault.bias_deg:g}°"
        case StuckVelocity():
            return f"{robot} stuck with its set-point"
        case WindFault():
            gusts = f" and gusts of {fault.gust_m_s:g} m/s" if fault.gust_m_s else ""
            return f"wind of {fault.speed_m_s:g} m/s{gusts} on {'everyone' if fault.everyone else robot}"
        case GpsDrift():
            return f"the GPS of {robot} drifting by {fault.rate_m_s:g} m/s"
        case GpsJump():
            return f"the GPS of {robot} off by {fault.distance_m:g} m"
        case FalseReport():
            return f"{robot} lying about its velocity by {fault.offset_m_s:g} m/s"
        case LaggingTelemetry():
            return f"telemetry of {robot} late by {fault.lag_s:g} s"
        case FrozenTelemetry():
            return f"telemetry of {robot} frozen"
    raise TypeError(f"a fault without words: {fault!r}")


def _when(fault: Fault) -> Iterator[str]:
    if fault.grows_over_s:
        yield f"growing over {fault.grows_over_s:g} s"
    if fault.period_s is not None and fault.on_fraction < 1.0:
        yield f"on for {fault.on_fraction:.0%} of every {fault.period_s:g} s"
    if fault.onset_s and fault.end_s is not None:
        yield f"from {fault.onset_s:g} s to {fault.end_s:g} s"
    elif fault.onset_s:
        yield f"from {fault.onset_s:g} s on"
    elif fault.end_s is not None:
        yield f"until {fault.end_s:g} s"


def robots(systems: Sequence[int]) -> str:
    """In words: robot 5; robots 2, 5."""
    return f"{'robot' if len(systems) == 1 else 'robots'} {', '.join(map(str, systems))}"


def missing(count: int, what: str) -> str:
    """1 message is missing; 2 messages are missing."""
    return f"{count} {what} is missing" if count == 1 else f"{count} {what}s are missing"


@dataclass(frozen=True, slots=True)
class Ending:
    """How a flight ended, as everything that shows it calls it."""

    word: Literal["passed", "failed", "no score", "not completed"]
    why: str
    """What the word does not say; "" where it says all."""

    @property
    def good(self) -> bool:
        """Flown to its end, and well."""
        return self.word == "passed"

    def __str__(self) -> str:
        """not completed: vehicle 3 fell silent."""
        return f"{self.word}: {self.why}" if self.why else self.word


def ending(problem: str | None, passed: bool | None) -> Ending:
    """problem: why it could not be completed;  passed: None where there is no score."""
    if problem is not None:
        return Ending("not completed", problem)
    if passed is None:
        return Ending("no score", "it ended before its read-out")
    return Ending("passed" if passed else "failed", "")


def measured(score: Score, scenario: Scenario) -> Iterator[str]:
    """What a flight is judged by, and what was allowed; the closest two robots only where they came too close."""
    expect = scenario.expect
    yield f"heading off by {score.heading_error_deg:.1f}° (allowed {expect.heading_error_deg:g}°)"
    yield f"{score.distance_to_target_m:.1f} m from the target (allowed {expect.distance_to_target_m:g} m)"
    if score.min_separation_m < expect.min_separation_m:
        yield f"robots as close as {score.min_separation_m:.2f} m (allowed {expect.min_separation_m:g} m)"


def verdict(summary: Summary) -> str:
    """Two or three lines: what was flown, and how it ended."""
    trust = "" if summary.trust is None else f", trust from {summary.trust}"
    flight = f"{summary.scenario}: {summary.controller}{trust}, {' and '.join(summary.faults) or 'no fault'}"
    if summary.heading_error_deg is None or summary.distance_to_target_m is None or summary.min_separation_m is None:
        return f"{flight}\n{ending(summary.problem, None)}"
    ended = ending(summary.problem, summary.passed)
    closest = summary.min_separation_m
    apart = "" if math.isinf(closest) else f", robots never closer than {closest:.1f} m"
    without = f", without {robots(summary.left_behind)}" if summary.left_behind else ""
    on = "" if summary.scored_on == "truth" else " (by telemetry: no truth was told)"
    return (
        f"{flight}\n{ended.word}: heading off by {summary.heading_error_deg:.1f}°, "
        f"{summary.distance_to_target_m:.1f} m from the target{apart}{without}{on}\n"
        f"{summary.simulated_s:.1f} s flown at {summary.real_time_factor:.0f} × real time"
    )
