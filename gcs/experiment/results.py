"""What an experiment leaves behind: tables for people, columns for programs, one object of JSON."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from importlib.metadata import version
from pathlib import Path
from typing import Any

import orjson

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
class Asked:
    """What this call was to fly."""

    command: str
    only: tuple[str, ...]
    """Suites and conditions; all, if empty."""
    seeds: int
    seeds_of_file: int

    @property
    def part(self) -> str | None:
        """In words, where it is not the whole experiment."""
        fewer = [f"seeds 1 to {self.seeds} of {self.seeds_of_file}"] if self.seeds < self.seeds_of_file else []
        return "; ".join([*(f"only {pattern}" for pattern in self.only), *fewer]) or None


@dataclass(frozen=True, slots=True)
class Results:
    """Of an experiment, or of the part of it that was asked for."""

    title: str
    version: str
    sources: dict[str, int]
    """Runs by the digest of the sources that flew them, the most first."""
    asked: Asked
    seeds: int
    reference: str | None
    cells: list[Cell]
    suites: list[Cell]
    """Conditions pooled."""
    runs: list[RunResult]
    timing: Timing

    @staticmethod
    def of(conducted: Conducted, *, title: str, reference: str | None, asked: Asked) -> Results:
        """All that can be said of these runs."""
        runs = conducted.runs
        return Results(
            title=title,
            version=version("trustr"),
            sources=dict(Counter(run.code for run in runs).most_common()),
            asked=asked,
            seeds=asked.seeds,
            reference=reference,
            cells=cells(runs, reference=reference),
            suites=suites(runs, reference=reference),
            runs=runs,
            timing=conducted.timing,
        )

    @property
    def incomplete(self) -> list[RunResult]:
        """Runs that could not be completed."""
        return [run for run in self.runs if run.problem is not None]

    def json(self, option: int = 0) -> bytes:
        """One object: what is not a number is null."""
        said = {field.name: getattr(self, field.name) for field in fields(self) if field.name != "runs"}
        said["incomplete"] = [_which(run) | {"problem": run.problem, "crashed": run.crashed} for run in self.incomplete]
        return orjson.dumps(said, option=option)

    def save(self, folder: Path) -> None:
        """FILES. Raises OSError."""
        (folder / "table.md").write_text("\n".join(self._markdown()) + "\n", encoding="utf-8")
        _write_csv(folder / "cells.csv", [_flat(cell) for cell in self.cells])
        _write_csv(folder / "runs.csv", [_flat_run(run) for run in self.runs])
        (folder / "experiment.json").write_bytes(self.json(orjson.OPT_INDENT_2) + b"\n")

    @property
    def below(self) -> str:
        """What is said of an arm that falls short."""
        return f"below {self.reference} − {POINTS}"

    def _markdown(self) -> Iterator[str]:
        yield f"# {self.title}\n"
        yield f"`{self.asked.command}`, trustr {self.version}: {self._flown_by}.\n"
        if self.asked.part is not None:
            yield f"A part of the experiment: {self.asked.part}.\n"
        yield f"{self.seeds} seeds; in brackets and after ±, 95 % intervals.\n"
        for suite in dict.fromkeys(cell.suite for cell in self.suites):
            every = [cell for cell in self.cells if cell.suite == suite]
            pooled = [cell for cell in self.suites if cell.suite == suite]
            yield f"## {suite}\n"
            yield from _table(self._head("condition"), (_row(cell.condition or "", cell, self.below) for cell in every))
            if len({cell.condition for cell in every}) > 1:
                yield "\nAll conditions pooled:\n"
                yield from _table(self._head("suite"), (_row(suite, cell, self.below) for cell in pooled))
            yield ""
        if self.incomplete:
            yield "## Not completed\n"
            yield from (
                f"- {run.suite}, {run.condition}, {run.arm}, seed {run.seed}: {run.problem}"
                + ("; an error of the program, in no figure" if run.crashed else "")
                for run in self.incomplete
            )

    @property
    def _flown_by(self) -> str:
        """Two digests under one version are two programs."""
        (most, count), *others = self.sources.items()
        if not others:
            return f"{count} runs, flown by sources {most}"
        mixed = ", ".join(f"{digest} ({runs})" for digest, runs in others)
        return f"{count} runs flown by sources {most}; {sum(runs for _, runs in others)} runs by others: {mixed}"

    def _head(self, first: str) -> tuple[str, ...]:
        flown = (first, "arm", "runs", "passed", "heading error", "distance", "closest", "not completed")
        head = (*flown, "found after", "false alarms")
        if self.reference is None:
            return head
        return (*head, f"against {self.reference}", f"passed where {self.reference} did")


def _row(name: str, cell: Cell, below: str) -> tuple[str, ...]:
    """below: what is said where the arm falls short of the reference."""
    row = (
        name,
        cell.arm,
        f"{cell.passed.n}",
        share(cell.passed),
        _spread(cell.heading_error_deg, "°"),
        _spread(cell.distance_to_target_m, " m"),
        metres(cell.min_separation_m),
        f"{cell.incomplete}" + (f", and {cell.crashed} crashed" if cell.crashed else ""),
        _found(cell),
        f"{cell.false_alarms}",
    )
    if cell.passed_where_reference_did is None:
        return row
    return (
        *row,
        difference(cell.against_reference) + (f", {below}" if cell.below_reference else ""),
        f"{share(cell.passed_where_reference_did)} of {cell.passed_where_reference_did.n}",
    )


def share(found: Share) -> str:
    """And its interval."""
    if found.n == 0:
        return "–"
    return f"{100 * found.rate:.0f} % [{100 * found.low:.0f}, {100 * found.high:.0f}]"


def metres(value: float | None) -> str:
    """Or a dash."""
    return "–" if value is None else f"{value:.2f} m"


def _spread(spread: Spread | None, unit: str) -> str:
    if spread is None:
        return "–"
    return f"{spread.mean:.2f}{spread.plus_minus}{unit}"


def _found(cell: Cell) -> str:
    if cell.detected is None:
        return "–"
    lost = "most not found" if cell.detected.count else "not found"
    median = lost if cell.detection_s is None else f"{cell.detection_s:.1f} s"
    if cell.slowest_s is not None and cell.slowest_s != cell.detection_s:
        median += f", at most {cell.slowest_s:.1f} s"
    return f"{median} ({cell.detected.count}/{cell.detected.n})"


def difference(found: PairedDifference | None) -> str:
    """In points, and its interval; a dash where there is no pair."""
    if found is None:
        return "–"
    mean, low, high = (f"{100 * rate:+.0f}".replace("-", "−") for rate in (found.difference, found.low, found.high))
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
