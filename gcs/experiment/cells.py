"""What the runs of an experiment amount to: one cell a condition and arm, and one a suite and arm."""

from __future__ import annotations

import math
import statistics
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from gcs.experiment.run import RunResult
from gcs.statistics import PairedDifference, Share, Spread

MARGIN = 0.05
"""An arm is below the reference where its whole interval lies more than this under it."""


@dataclass(frozen=True, slots=True)
class Cell:
    """All seeds of an arm in a condition; or in all conditions of a suite, pooled."""

    suite: str
    condition: str | None
    """None: all of the suite's."""
    arm: str
    passed: Share
    """Of the runs that are results."""
    heading_error_deg: Spread | None
    """Over the runs that came to their read-out; so the distance."""
    distance_to_target_m: Spread | None
    min_separation_m: float | None
    """Of all runs."""
    detected: Share | None
    """Of all faulty vehicles; None where there is nobody to find, or a rule that does not look."""
    detection_s: float | None
    """Median from onset to detection, one never found counting as the longest; None where most are not found."""
    slowest_s: float | None
    """The longest from onset to detection, of those that were found."""
    false_alarms: int
    """Healthy vehicles distrusted, added up over the runs."""
    incomplete: int
    """Runs that could not be completed; they have not passed."""
    crashed: int
    """Runs that ended in an error of the program's: no results, and in none of the figures; nor are their pairs."""
    against_reference: PairedDifference | None
    """Of the pass rates, seed by seed; None for the reference itself, and where it was not flown."""
    below_reference: bool
    """The whole interval of the difference lies below −MARGIN."""
    passed_where_reference_did: Share | None
    """Of the runs whose twin under the reference arm passed."""


def cells(runs: Sequence[RunResult], *, reference: str | None) -> list[Cell]:
    """One a condition and arm, in the order of the runs."""
    return _grouped(runs, reference, pooled=False)


def suites(runs: Sequence[RunResult], *, reference: str | None) -> list[Cell]:
    """One a suite and arm, its conditions pooled."""
    return _grouped(runs, reference, pooled=True)


def _grouped(runs: Sequence[RunResult], reference: str | None, *, pooled: bool) -> list[Cell]:
    groups: dict[tuple[str, str | None, str], list[RunResult]] = defaultdict(list)
    for run in runs:
        groups[run.suite, None if pooled else run.condition, run.arm].append(run)
    twins = {(run.suite, run.condition, run.seed): run for run in runs if run.arm == reference and not run.crashed}
    found = [_cell(*place, group, twins, itself=place[-1] == reference) for place, group in groups.items()]
    order = {place: number for number, place in enumerate(dict.fromkeys((c.suite, c.condition) for c in found))}
    return sorted(found, key=lambda cell: order[cell.suite, cell.condition])


def _cell(
    suite: str,
    condition: str | None,
    arm: str,
    every: list[RunResult],
    twins: dict[tuple[str, str, int], RunResult],
    *,
    itself: bool,
) -> Cell:
    """itself: it is the reference."""
    runs = [run for run in every if not run.crashed]
    pairs = [
        (run.passed, twin.passed)
        for run in runs
        if (twin := twins.get((run.suite, run.condition, run.seed))) is not None
    ]
    against = None if itself or not pairs else PairedDifference.of(pairs)
    faulty = sum(run.faulty for run in runs)
    found = [seconds for run in runs for seconds in run.detected.values()]
    separations = [run.min_separation_m for run in runs if run.min_separation_m is not None]
    return Cell(
        suite=suite,
        condition=condition,
        arm=arm,
        passed=Share.of(sum(run.passed for run in runs), len(runs)),
        heading_error_deg=_spread([run.heading_error_deg for run in runs]),
        distance_to_target_m=_spread([run.distance_to_target_m for run in runs]),
        min_separation_m=min(separations, default=None),
        detected=Share.of(min(len(found), faulty), faulty) if faulty else None,
        detection_s=_median(found, faulty),
        slowest_s=max(found, default=None),
        false_alarms=sum(run.false_alarms for run in runs),
        incomplete=sum(run.problem is not None for run in runs),
        crashed=len(every) - len(runs),
        against_reference=against,
        below_reference=against is not None and against.high < -MARGIN,
        passed_where_reference_did=_where([mine for mine, theirs in pairs if theirs]) if pairs else None,
    )


def _spread(values: Sequence[float | None]) -> Spread | None:
    known = [value for value in values if value is not None]
    return Spread.of(known) if known else None


def _median(found: list[float], faulty: int) -> float | None:
    """Of as many as are faulty."""
    if not faulty:
        return None
    median = statistics.median(found + [math.inf] * (faulty - len(found)))
    return median if math.isfinite(median) else None


def _where(passes: list[bool]) -> Share:
    return Share.of(sum(passes), len(passes))
