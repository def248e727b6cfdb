"""A summary in words."""

from __future__ import annotations

from gcs.summary import Summary


def verdict(summary: Summary) -> str:
    """One or two lines: what was flown, and how it ended."""
    trust = "" if summary.trust is None else f", trust from {summary.trust}"
    fault = "no fault" if summary.severity is None else f"one robot at {summary.severity:.0%} speed"
    flight = f"{summary.scenario}: {summary.controller}{trust}, {fault}"
    if summary.heading_error_deg is None or summary.distance_to_target_m is None or summary.min_separation_m is None:
        return f"{flight}\nended before its read-out: no score"
    passed = "passed" if summary.passed else "failed"
    on = "" if summary.scored_on == "truth" else " (by telemetry: no truth was told)"
    return (
        f"{flight}\n{passed}: heading off by {summary.heading_error_deg:.1f}°, "
        f"{summary.distance_to_target_m:.1f} m from the target, "
        f"robots never closer than {summary.min_separation_m:.1f} m{on}\n"
        f"{summary.simulated_s:.1f} s flown at {summary.real_time_factor:.0f} × real time"
    )
