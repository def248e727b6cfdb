"""A summary in words."""

from __future__ import annotations

import math

from gcs.summary import Summary
from scenarios import Fault, MotorDegradation, Scenario


def faults(scenario: Scenario) -> list[str]:
    """What goes wrong with whom."""
    return [_fault(fault) for fault in scenario.fault]


def _fault(fault: Fault) -> str:
    if isinstance(fault, MotorDegradation):
        return f"robot {fault.vehicle} at {fault.max_speed_fraction:.0%} speed"
    return f"a broken rotor on robot {fault.vehicle}"


def verdict(summary: Summary) -> str:
    """Two or three lines: what was flown, and how it ended."""
    trust = "" if summary.trust is None else f", trust from {summary.trust}"
    flight = f"{summary.scenario}: {summary.controller}{trust}, {' and '.join(summary.faults) or 'no fault'}"
    if summary.heading_error_deg is None or summary.distance_to_target_m is None or summary.min_separation_m is None:
        return f"{flight}\nended before its read-out: no score"
    closest = summary.min_separation_m
    apart = "" if math.isinf(closest) else f", robots never closer than {closest:.1f} m"
    on = "" if summary.scored_on == "truth" else " (by telemetry: no truth was told)"
    return (
        f"{flight}\n{'passed' if summary.passed else 'failed'}: heading off by {summary.heading_error_deg:.1f}°, "
        f"{summary.distance_to_target_m:.1f} m from the target{apart}{on}\n"
        f"{summary.simulated_s:.1f} s flown at {summary.real_time_factor:.0f} × real time"
    )
