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
        """The suites, their conditions pooled."""
        head = self._head("suite")
        table = Table(*head, title=self.title, title_justify="left", title_style="bold", box=box.SIMPLE)
        for before, cell in zip((None, *self.suites), self.suites, strict=False):
            first = before is None or before.suite != cell.suite
            table.add_row(*_row(cell.suite if first else "", cell), end_section=False)
        console.print(table)

    def _markdown(self) -> Iterator[str]:
        yield f"# {self.title}\n"
        yield f"{self.seeds} seeds; in brackets and after ±, 95 % intervals.\n"
        for suite in dict.fromkeys(cell.suite for cell in self.suites):
            every = [cell for cell in self.cells if cell.suite == suite]
            pooled = [cell for cell in self.suites if cell.suite == suite]
            yield f"## {suite}\n"
            yield from _table(self._head("condition"), (_row(cell.condition or "", cell) for cell in every))
            if len({cell.condition for cell in every}) > 1:
                yield "\nAll conditions pooled:\n"
                yield from _table(self._head("suite"), (_row(suite, cell) for cell in pooled))
            yield ""
        if self.incomplete:
            yield "## Not completed\n"
            yield from (
                f"- {run.suite}, {run.condition}, {run.arm}, seed {run.seed}: {run.problem}" for run in self.incomplete
            )

    def _head(self, first: str) -> tuple[str, ...]:
        head = (first, "arm", "passed", "heading error", "distance", "found after", "false alarms")
        if self.reference is None:
            return head
        return (*head, f"against {self.reference}", f"passed where {self.reference} did")


def _row(name: str, cell: Cell) -> tuple[str, ...]:
    row = (
        name,
        cell.arm,
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
        _difference(cell.against_reference, below=cell.below_reference),
        _share(cell.passed_where_reference_did),
    )


def _share(share: Share) -> str:
    if share.n == 0:
        return "–"
    return f"{share.count}/{share.n} = {100 * share.rate:.0f} % [{100 * share.low:.0f}, {100 * share.high:.0f}]"


def _spread(spread: Spread | None, unit: str) -> str:
    if spread is None:
        return "–"
    half = "" if math.isnan(spread.ci95) else f" ± {spread.ci95:.2f}"
    return f"{spread.mean:.2f}{half}{unit}"


def _found(cell: Cell) -> str:
    if cell.detected is None:
        return "–"
    median = "not found" if cell.detection_s is None else f"{cell.detection_s:.1f} s"
    return f"{median} ({cell.detected.count}/{cell.detected.n})"


def _difference(difference: PairedDifference | None, *, below: bool) -> str:
    if difference is None:
        return "–"
    percent = [
        f"{100 * value:+.0f}".replace("-", "−") for value in (difference.difference, difference.low, difference.high)
    ]
    return f"{percent[0]} [{percent[1]}, {percent[2]}]" + (f", below by more than {POINTS}" if below else "")


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
