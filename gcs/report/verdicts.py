"""The tables of a report: how flights ended, side by side, and robot by robot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gcs.report.series import heeded
from gcs.report.told import Told
from gcs.words import faults, robots

PASSED, FAILED, NEITHER = "good", "bad", ""
"""How a cell is marked."""


@dataclass(frozen=True, slots=True)
class Cell:
    """One figure of a flight."""

    said: str
    note: str = ""
    """What was allowed, or what it rests on."""
    mark: str = NEITHER


@dataclass(frozen=True, slots=True)
class Row:
    """One flight, or one robot."""

    name: str
    cells: tuple[Cell, ...]
    note: str = ""
    """Under its name."""


@dataclass(frozen=True, slots=True)
class Table:
    """Rows under headings; the first heading is of the names."""

    headings: tuple[str, ...]
    rows: tuple[Row, ...]


def verdicts(flights: Sequence[Told]) -> Table:
    """How each flight ended: what it was judged by against what was allowed."""
    headings = (
        "flight",
        "verdict",
        "heading error",
        "to the target",
        "closest two",
        "what went wrong",
        "distrusted after",
        "left behind",
    )
    titles = [told.history.scenario.title for told in flights]
    notes = titles if len(set(titles)) > 1 else [""] * len(titles)
    rows = (Row(told.name, _verdict(told), note) for told, note in zip(flights, notes, strict=True))
    return Table(headings, tuple(rows))


def _verdict(told: Told) -> tuple[Cell, ...]:
    score, expect = told.score, told.history.scenario.expect
    wrong = faults(told.history.scenario)
    untold = Cell("–")
    judged = (untold, untold, untold)
    if score is not None:
        judged = (
            _at_most(score.heading_error_deg, expect.heading_error_deg, "°"),
            _at_most(score.distance_to_target_m, expect.distance_to_target_m, " m"),
            _apart(score.min_separation_m, expect.min_separation_m),
        )
    left = told.parts_at_the_end().left_behind
    return (
        _ended(told),
        *judged,
        Cell("; ".join(wrong[:3]) + (f"; {len(wrong) - 3} more" if len(wrong) > 3 else "") or "nothing"),
        _distrusted(told),
        Cell(robots(left) if left else "nobody"),
    )


def _ended(told: Told) -> Cell:
    grounds = ["by telemetry: no truth was told"] if told.history.measured else []
    grounds += ["from a recovered recording"] if told.history.recovered is not None else []
    rests_on = "; ".join(grounds)
    if told.history.problem is not None:
        return Cell("not completed", told.history.problem, FAILED)
    if told.score is None:
        return Cell("no score", "ended before its read-out", FAILED)
    return Cell("passed", rests_on, PASSED) if told.passed else Cell("failed", rests_on, FAILED)


def _at_most(value: float, allowed: float, unit: str) -> Cell:
    return Cell(f"{value:.1f}{unit}", f"at most {allowed:g}{unit}", PASSED if value <= allowed else FAILED)


def _apart(value: float, allowed: float) -> Cell:
    if math.isinf(value):
        return Cell("–", "one robot alone")
    return Cell(f"{value:.1f} m", f"at least {allowed:g} m", PASSED if value >= allowed else FAILED)


def _distrusted(told: Told) -> Cell:
    """Who was rightly distrusted, how soon, and how many wrongly."""
    if told.trust_source is None:
        return Cell("–", "asks for no trust")
    if told.score is None:
        return Cell("–")
    found = [f"robot {system}: {after_s:.1f} s" for system, after_s in told.score.detected.items()]
    failed = [system for system, look in zip(told.history.ids, told.looks, strict=True) if look == "failed"]
    missed = [system for system in failed if system not in told.score.detected]
    wrongly = told.score.false_alarms
    notes = [f"never: {robots(missed)}"] if missed else []
    notes.append(f"{wrongly} false alarm{'' if wrongly == 1 else 's'}" if wrongly else "no false alarm")
    mark = FAILED if missed or wrongly else PASSED if found else NEITHER
    return Cell("; ".join(found) or "nobody", ", ".join(notes), mark)


def robot_by_robot(told: Told) -> Table:
    """Figures of each robot, beside its lines."""
    headings = (
        "robot",
        "part",
        "trust, least",
        "trust, last",
        "heeded, last",
        "battery, last",
        "telemetry, oldest",
        "set-points changed",
    )
    history, rows = told.history, told.mission
    trust = history.trust[rows] if told.trust_source is not None else np.full((len(rows), told.count), np.nan)
    share = heeded(history.weights[rows], told.scored)
    parts = told.parts_at_the_end()
    table = []
    for row, system in enumerate(history.ids):
        part = "left behind" if system in parts.left_behind else "leader" if system in parts.leaders else "follower"
        look = "" if told.looks[row] == "healthy" else told.looks[row]
        figures = (
            Cell(part, look, FAILED if look == "failed" else NEITHER),
            _figure(_least(trust[:, row]), ".2f"),
            _figure(_last(trust[:, row]), ".2f"),
            _figure(_last(share[:, row]), ".1%"),
            _figure(_last(history.battery[:, row]), ".0%"),
            _figure(-_least(-history.age_s[:, row]), ".2f", " s"),
            Cell(str(int((history.verdict[:, row] > 0).sum()))),
        )
        table.append(Row(str(system), figures))
    return Table(headings, tuple(table))


def _figure(value: float, form: str, unit: str = "") -> Cell:
    return Cell("–" if math.isnan(value) else f"{value:{form}}{unit}")


def _least(values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
    known = values[np.isfinite(values)]
    return float(known.min()) if known.size else math.nan


def _last(values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
    known = values[np.isfinite(values)]
    return float(known[-1]) if known.size else math.nan
