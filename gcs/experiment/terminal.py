"""What an experiment shows on a terminal: a table for each suite, its conditions pooled, all in the same columns."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table
from rich.text import Text

from gcs.experiment.cells import Cell
from gcs.experiment.results import Results, difference, metres, share

DOWN = "▼"
GAP, NARROWEST = 2, 10
"""Characters: between columns, and of an arm's name at least, before figures have to wrap."""

Row = tuple[str, ...]


def show(results: Results, console: Console) -> None:
    """Those columns that a terminal has room for."""
    console.print(Text(results.title, style="bold"))
    if results.asked.part is not None:
        console.print(Text(f"A part of it: {results.asked.part}"))
    head = _head(results.reference)
    rows = [(cell.suite, _row(cell)[: len(head)]) for cell in results.suites]
    widths = _widths([head, *(row for _, row in rows)], console.width)
    for suite in dict.fromkeys(suite for suite, _ in rows):
        console.print(Text(f"\n{suite}", style="bold"))
        table = Table(box=None, padding=(0, GAP, 0, 0), pad_edge=False, header_style="dim")
        for name, width in zip(head, widths, strict=True):
            table.add_column(Text(name), width=width, overflow="fold")
        for where, row in rows:
            if where == suite:
                table.add_row(*map(Text, row))
        console.print(table)
    if any(cell.below_reference for cell in results.suites):
        console.print(Text(f"\n{DOWN}: {results.below}"))


def _head(reference: str | None) -> Row:
    head = ("arm", "passed", "heading", "distance", "closest", "found", "after")
    return head if reference is None else (*head, f"against {reference}")


def _row(cell: Cell) -> Row:
    heading, distance, found = cell.heading_error_deg, cell.distance_to_target_m, cell.detected
    return (
        cell.arm,
        share(cell.passed),
        "–" if heading is None else f"{heading.mean:.2f}°",
        metres(None if distance is None else distance.mean),
        metres(cell.min_separation_m),
        "–" if found is None else f"{found.count}/{found.n}",
        "–" if cell.detection_s is None else f"{cell.detection_s:.1f} s",
        difference(cell.against_reference) + (f" {DOWN}" if cell.below_reference else ""),
    )


def _widths(rows: Sequence[Row], room: int) -> Sequence[int | None]:
    """Of all tables' columns alike, the names wrapped where they must be; none where even that is too wide."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    names = min(widths[0], room - sum(widths[1:]) - GAP * len(widths[1:]))
    return [names, *widths[1:]] if names >= min(NARROWEST, widths[0]) else [None] * len(widths)
