"""The tables of a report: how flights ended, side by side, and robot by robot."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from gcs.recording.history import Kind
from gcs.report.distrust import distrusts
from gcs.report.series import heeded
from gcs.report.telling import counted, some
from gcs.report.told import Told
from gcs.words import ending, faults, robots

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
    judged = (Cell("–"), Cell("–"), Cell("–"))
    if score is not None:
        judged = (
            _at_most(score.heading_error_deg, expect.heading_error_deg, "°"),
            _at_most(score.distance_to_target_m, expect.distance_to_target_m, " m"),
            _apart(score.min_separation_m, expect.min_separation_m),
        )
    left = told.parts_at_the_end().left_behind
    return (_ended(told), *judged, _wrong(told), _distrusted(told), Cell(robots(left) if left else "nobody"))


def _ended(told: Told) -> Cell:
    """How it ended, and what that rests on."""
    ended = ending(told.history.problem, None if told.score is None else told.score.passed)
    return Cell(ended.word, "; ".join(filter(None, (ended.why, *_grounds(told)))), PASSED if ended.good else FAILED)


def _grounds(told: Told) -> Iterator[str]:
    history = told.history
    if told.score is None and history.problem is None:
        yield from [one.words for one in history.happenings if one.kind is Kind.WORD and one.vehicle is None][-1:]
    if history.measured:
        yield "by telemetry: no truth was told"
        mute = [history.ids[row] for row in np.flatnonzero(told.meant & ~told.scored)]
        if mute:
            yield f"without {robots(mute)}, lost by telemetry"
    if history.recovered is not None:
        yield "from a recovered recording"


def _wrong(told: Told) -> Cell:
    """What acted, as far as that is known."""
    if not told.faults_known:
        planned = faults(told.history.scenario)
        return Cell("unknown", f"the scenario has {some(planned, most=MOST_FAULTS)}" if planned else "")
    acted = list(dict.fromkeys(span.words for span in told.history.acted))
    return Cell(
        some(acted, most=MOST_FAULTS, between="; ") if acted else "nothing",
        "by the scenario" if told.planned else "",
    )


MOST_FAULTS = 3
"""Named in a cell."""


def _at_most(value: float, allowed: float, unit: str) -> Cell:
    return Cell(f"{value:.1f}{unit}", f"at most {allowed:g}{unit}", PASSED if value <= allowed else FAILED)


def _apart(value: float, allowed: float) -> Cell:
    if math.isinf(value):
        return Cell("–", "no two in the air")
    return Cell(f"{value:.1f} m", f"at least {allowed:g} m", PASSED if value >= allowed else FAILED)


def _distrusted(told: Told) -> Cell:
    """Who was rightly distrusted, how soon, and how many wrongly."""
    if told.trust_source is None:
        return Cell("–", "asks for no trust")
    if not told.mission.size:
        return Cell("–")
    about = distrusts(told)
    if not told.faults_known:
        fell = [f"robot {one.system}: at {one.wrongly_s:.1f} s" for one in about]
        return Cell("; ".join(fell) or "nobody", "nobody knows whether rightly" if fell else "")
    found = [f"robot {one.system}: {one.delay_s:.1f} s" for one in about if one.found]
    missed = [one.system for one in about if one.missed]
    wrongly = sum(one.wronged for one in about)
    notes = [f"never: {robots(missed)}"] if missed else []
    notes.append(counted(wrongly, "false alarm") if wrongly else "no false alarm")
    notes += ["by the scenario"] if told.planned else []
    mark = NEITHER if told.planned else FAILED if missed or wrongly else PASSED if found else NEITHER
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
            Cell(part, look, FAILED if look == "failed" and not told.planned else NEITHER),
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
