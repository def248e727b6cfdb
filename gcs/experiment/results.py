"""What an experiment leaves behind: tables for people, columns for programs, one object of JSON."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import orjson
from rich import box
from rich.table import Table

from gcs.experiment.cells import MARGIN, Cell, cells, suites
from gcs.experiment.conduct import Conducted, Timing
from gcs.experiment.run import RunResult
from gcs.statistics import PairedDifference, Share, Spread

POINTS = f"{100 * MARGIN:g} points"
FILES = ("table.md", "cells.csv", "runs.csv", "experiment.json")
DOWN = "▼"
LEFT_OUT = ("runs", "false alarms", "passed where")
"""On a terminal."""
OF_SEVERAL_FIGURES = (
    "heading_error_deg",
    "distance_to_target_m",
    "detected",
    "against_reference",
    "passed_where_reference_did",
)


@dataclass(frozen=True, slots=True)
class Results:
    """Of a whole experiment."""

    title: str
    seeds: int
    reference: str | None
    cells: list[Cell]
    suites: list[Cell]
    """Conditions pooled."""
    runs: list[RunResult]
    timing: Timing

    @staticmethod
    def of(conducted: Conducted, *, title: str, seeds: int, reference: str | None) -> Results:
        """All that can be said of these runs."""
        runs = conducted.runs
        every, pooled = cells(runs, reference=reference), suites(runs, reference=reference)
        return Results(title, seeds, reference, every, pooled, runs, conducted.timing)

    @property
    def incomplete(self) -> list[RunResult]:
        """Runs that could not be completed."""
        return [run for run in self.runs if run.problem is not None]

    def json(self, option: int = 0) -> bytes:
        """One object: what is not a number is null."""
        said = {field.name: getattr(self, field.name) for field in fields(self) if field.name != "runs"}
        said["incomplete"] = [_which(run) | {"problem": run.problem} for run in self.incomplete]
        return orjson.dumps(said, option=option)

    def save(self, folder: Path) -> None:
        """FILES. Raises OSError."""
        (folder / "table.md").write_text("\n".join(self._markdown()) + "\n", encoding="utf-8")
        _write_csv(folder / "cells.csv", [_flat(cell) for cell in self.cells])
        _write_csv(folder / "runs.csv", [_flat_run(run) for run in self.runs])
        (folder / "experiment.json").write_bytes(self.json(orjson.OPT_INDENT_2) + b"\n")

    def show(self, console: Any) -> None:
        """The suites, their conditions pooled, in the columns that a terminal has room for."""
        table = Table(title=self.title, title_justify="left", title_style="bold", box=box.SIMPLE, collapse_padding=True)
        rows = [_row(cell.suite, cell, DOWN) for cell in self.suites]
        columns = [place for place, name in enumerate(self._head("suite")) if not name.startswith(LEFT_OUT)]
        for place in columns:
            table.add_column(self._head("suite")[place], no_wrap=place > 0)
        for row in rows:
            table.add_row(*(row[place] for place in columns if place < len(row)))
        console.print(table)
        if any(cell.below_reference for cell in self.suites):
            console.print(f"{DOWN}: {self._below}", highlight=False)

    @property
    def _below(self) -> str:
        """What is said of an arm that falls short."""
        return f"below {self.reference} − {POINTS}"

    def _markdown(self) -> Iterator[str]:
        yield f"# {self.title}\n"
        yield f"{self.seeds} seeds; in brackets and after ±, 95 % intervals.\n"
        for suite in dict.fromkeys(cell.suite for cell in self.suites):
            every = [cell for cell in self.cells if cell.suite == suite]
            pooled = [cell for cell in self.suites if cell.suite == suite]
            yield f"## {suite}\n"
            yield from _table(
                self._head("condition"), (_row(cell.condition or "", cell, self._below) for cell in every)
            )
            if len({cell.condition for cell in every}) > 1:
                yield "\nAll conditions pooled:\n"
                yield from _table(self._head("suite"), (_row(suite, cell, self._below) for cell in pooled))
            yield ""
        if self.incomplete:
            yield "## Not completed\n"
            yield from (
                f"- {run.suite}, {run.condition}, {run.arm}, seed {run.seed}: {run.problem}" for run in self.incomplete
            )

    def _head(self, first: str) -> tuple[str, ...]:
        head = (first, "arm", "runs", "passed", "heading error", "distance", "found after", "false alarms")
        if self.reference is None:
            return head
        return (*head, f"against {self.reference}", f"passed where {self.reference} did")


def _row(name: str, cell: Cell, below: str) -> tuple[str, ...]:
    """below: what is said where the arm falls short of the reference."""
    row = (
        name,
        cell.arm,
        f"{cell.passed.n}",
        _share(cell.passed),
        _spread(cell.heading_error_deg, "°"),
        _spread(cell.distance_to_target_m, " m"),
        _found(cell),
        f"{cell.false_alarms}",
    )
    if cell.passed_where_reference_did is None:
        return row
    return (
        *row,
        _difference(cell.against_reference) + (f", {below}" if cell.below_reference else ""),
        f"{_share(cell.passed_where_reference_did)} of {cell.passed_where_reference_did.n}",
    )


def _share(share: Share) -> str:
    if share.n == 0:
        return "–"
    return f"{100 * share.rate:.0f} % [{100 * share.low:.0f}, {100 * share.high:.0f}]"


def _spread(spread: Spread | None, unit: str) -> str:
    if spread is None:
        return "–"
    half = "" if math.isnan(spread.ci95) else f" ± {spread.ci95:.2f}"
    return f"{spread.mean:.2f}{half}{unit}"


def _found(cell: Cell) -> str:
    if cell.detected is None:
        return "–"
    median = "not found" if cell.detection_s is None else f"{cell.detection_s:.1f} s"
    if cell.slowest_s is not None and cell.slowest_s != cell.detection_s:
        median += f", at most {cell.slowest_s:.1f} s"
    return f"{median} ({cell.detected.count}/{cell.detected.n})"


def _difference(difference: PairedDifference | None) -> str:
    if difference is None:
        return "–"
    mean, low, high = (
        f"{100 * share:+.0f}".replace("-", "−") for share in (difference.difference, difference.low, difference.high)
    )
    return f"{mean} [{low}, {high}]"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    for row in (head, ("---",) * len(head), *rows):
        yield f"| {' | '.join(row)} |"


def _which(run: RunResult) -> dict[str, Any]:
    return {"suite": run.suite, "condition": run.condition, "arm": run.arm, "seed": run.seed}


def _flat(cell: Cell) -> dict[str, Any]:
    """A column a figure: field_figure where a field has several, and none of them where it is None."""
    flat: dict[str, Any] = {}
    for name, value in asdict(cell).items():
        if isinstance(value, dict):
            flat |= {f"{name}_{key}": figure for key, figure in value.items()}
        elif name not in OF_SEVERAL_FIGURES:
            flat[name] = value
    return flat


def _flat_run(run: RunResult) -> dict[str, Any]:
    detected = " ".join(f"{vehicle}:{seconds:g}" for vehicle, seconds in run.detected.items())
    return asdict(run) | {"detected": detected}


def _write_csv(path: Path, rows: list[dict[str, Any]]) -> None:
    """Every column that any row has."""
    columns = list(dict.fromkeys(name for row in rows for name in row))
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
