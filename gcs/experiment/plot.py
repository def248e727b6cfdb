"""Pictures of an experiment: a row for each condition, or for each suite where they are many; a panel for each arm."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

from gcs.experiment.cells import Cell
from gcs.experiment.results import POINTS, Results
from gcs.statistics import Share, Spread

FINE, BELOW, TWIN = "#0072B2", "#D55E00", "#8C8C8C"
"""Blue and vermilion of M. Okabe and K. Ito's palette, which nobody confuses; the reference is grey."""
MOST_ROWS = 30
"""Conditions that get a row each; of more than that, a suite gets one."""
ROW, PANEL, LETTER = 0.2, 0.95, 0.065
"""Inches: height of a row, widths of a panel and of a letter in the names beside the first."""
LEAST = 1e-3
"""Where a logarithmic axis begins at the latest; it has no zero."""
NARROWEST = 12.0
"""Ratio of a logarithmic axis's ends, at least: so that it has two ticks."""
DPI = 200
PASS_RATE, ERRORS = "pass_rate.png", "errors.png"


@dataclass(frozen=True, slots=True)
class Mark:
    """A figure and its interval."""

    at: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Figure:
    """What one band of panels shows."""

    label: str
    of: Callable[[Cell], Mark | None]
    logarithmic: bool


def _rate(cell: Cell) -> Mark | None:
    share: Share = cell.passed
    if share.n == 0:
        return None
    return Mark(100 * share.rate, 100 * share.low, 100 * share.high)


def _mean(spread: Spread | None) -> Mark | None:
    if spread is None:
        return None
    half = 0.0 if math.isnan(spread.ci95) else spread.ci95
    return Mark(spread.mean, spread.mean - half, spread.mean + half)


RATE = Figure("passed [%]", _rate, logarithmic=False)
HEADING = Figure("heading error [°]", lambda cell: _mean(cell.heading_error_deg), logarithmic=True)
DISTANCE = Figure("distance to target [m]", lambda cell: _mean(cell.distance_to_target_m), logarithmic=True)


def draw(results: Results, folder: Path) -> tuple[str, ...]:
    """Names of the files. Raises OSError."""
    pooled = len({(cell.suite, cell.condition) for cell in results.cells}) > MOST_ROWS
    shown = results.suites if pooled else results.cells
    with mpl.rc_context({"text.parse_math": False, "font.size": 8, "axes.linewidth": 0.6}):
        _picture(results, shown, (RATE,), folder / PASS_RATE)
        _picture(results, shown, (HEADING, DISTANCE), folder / ERRORS)
    return PASS_RATE, ERRORS


def _picture(results: Results, shown: Sequence[Cell], bands: Sequence[Figure], path: Path) -> None:
    arms = list(dict.fromkeys(cell.arm for cell in shown))
    rows = _rows(shown)
    names = 0.3 + LETTER * max(len(condition or suite) for suite, condition in rows)
    size = max(names + PANEL * len(arms), 6.0), len(bands) * (ROW * (len(rows) + 1) + 0.75) + 0.9
    figure, axes = plt.subplots(len(bands), len(arms), figsize=size, dpi=DPI, squeeze=False, layout="constrained")
    for band, line in zip(bands, axes, strict=True):
        marks = [mark for cell in shown if (mark := band.of(cell)) is not None]
        for arm, panel in zip(arms, line, strict=True):
            _lay_out(panel, band, marks, rows, names=panel is line[0])
            _fill(panel, band, [cell for cell in shown if cell.arm == arm], _twins(results, shown, arm), rows)
            panel.set_title(fill(arm, 13), fontsize=8, fontweight="bold")
        line[len(arms) // 2].set_xlabel(band.label)
    figure.suptitle(fill(results.title, int(13 * size[0])), fontsize=9)
    figure.legend(handles=_legend(results), loc="outside lower center", ncols=3, frameon=False)
    figure.savefig(path)
    plt.close(figure)


Row = tuple[str, str | None]
"""(suite, condition): None is a suite's own line, be it a heading or all its conditions pooled."""


def _rows(shown: Sequence[Cell]) -> dict[Row, int]:
    """From the top; above its conditions each suite has a heading."""
    rows: dict[Row, int] = {}
    for cell in shown:
        rows.setdefault((cell.suite, None), len(rows))
        rows.setdefault((cell.suite, cell.condition), len(rows))
    return rows


def _twins(results: Results, shown: Sequence[Cell], arm: str) -> list[Cell]:
    """The reference's cells, for every panel but its own."""
    return [] if arm == results.reference else [cell for cell in shown if cell.arm == results.reference]


def _lay_out(panel: Any, band: Figure, marks: Sequence[Mark], rows: dict[Row, int], *, names: bool) -> None:
    """Axes, names, and stripes that lead the eye."""
    panel.set_ylim(len(rows) - 0.4, -0.6)
    for number in range(1, len(rows), 2):
        panel.axhspan(number - 0.5, number + 0.5, color="#F4F4F4", lw=0, zorder=0)
    panel.set_yticks(list(rows.values()))
    panel.set_yticklabels([suite if condition is None else f"{condition}   " for suite, condition in rows])
    headings = any(condition is not None for _, condition in rows)
    for label, (_, condition) in zip(panel.get_yticklabels(), rows, strict=True):
        label.set_fontweight("bold" if headings and condition is None else "normal")
    panel.tick_params(axis="y", length=0, labelleft=names)
    panel.tick_params(axis="x", width=0.6, length=2.5)
    panel.spines[["top", "right", "left"]].set_visible(False)
    panel.grid(axis="x", color="#DDDDDD", lw=0.5, zorder=0)
    panel.set_axisbelow(True)
    if band.logarithmic and marks:
        panel.set_xscale("log")
        low, high = max(0.7 * min(mark.at for mark in marks), LEAST), 1.3 * max(mark.high for mark in marks)
        wider = max(1.0, math.sqrt(NARROWEST / (high / low)))
        panel.set_xlim(low / wider, high * wider)
        panel.xaxis.set_major_locator(LogLocator(subs=(1.0, 3.0), numticks=9))
        panel.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        panel.xaxis.set_minor_locator(NullLocator())
        panel.xaxis.set_minor_formatter(NullFormatter())
    elif not band.logarithmic:
        panel.set_xlim(-6, 106)
        panel.set_xticks([0, 50, 100])


def _fill(panel: Any, band: Figure, mine: Sequence[Cell], twins: Sequence[Cell], rows: dict[Row, int]) -> None:
    for cell in twins:
        if (mark := band.of(cell)) is not None:
            panel.plot(mark.at, rows[cell.suite, cell.condition], "|", color=TWIN, ms=8, mew=1.2, zorder=2)
    for cell in mine:
        if (mark := band.of(cell)) is not None:
            place, color = rows[cell.suite, cell.condition], BELOW if cell.below_reference else FINE
            low = max(mark.low, panel.get_xlim()[0])
            panel.plot([low, mark.high], [place, place], color=color, lw=1.3, solid_capstyle="butt", zorder=3)
            panel.plot(mark.at, place, "v" if cell.below_reference else "o", color=color, ms=4, zorder=4)


def _legend(results: Results) -> list[Line2D]:
    fine = Line2D([], [], color=FINE, marker="o", ms=4, lw=1.3, label="with its 95 % interval")
    if results.reference is None:
        return [fine]
    below = f"passes less often than {results.reference}, by more than {POINTS}"
    return [
        fine,
        Line2D([], [], color=BELOW, marker="v", ms=4, lw=1.3, label=below),
        Line2D([], [], color=TWIN, marker="|", ms=8, mew=1.2, lw=0, label=results.reference),
    ]
