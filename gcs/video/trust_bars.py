"""A bar of trust for each robot, in as many columns as it takes; of very many, those that were ever trusted least."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist

from gcs.recording.history import History
from gcs.scoring import DISTRUSTED
from gcs.video.ink import DARK, PALE, boxes, lines, words
from gcs.video.insight import Insight
from gcs.video.view import Box

ROWS, COLUMNS = 12, 4
ROW_PX = 21.0
HEADING_PX = 22.0
NUMBER_PX, VALUE_PX, GAP_PX = 26.0, 36.0, 12.0
"""Of a column: left of its bars, right of them, and between two columns."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where one robot's bar is, in pixels."""

    row: int
    """Of the history's arrays."""
    left: float
    right: float
    bottom: float


class TrustBars:
    """Bars below a heading; the box's top is where it begins."""

    def __init__(self, history: History, insight: Insight, box: Box) -> None:
        self._history, self._insight, self._box = history, insight, box
        rows = _least_trusted(history, ROWS * COLUMNS) if insight.trusting else []
        self._columns = math.ceil(len(rows) / ROWS)
        self._places = list(self._placed(rows))
        down = HEADING_PX + ROW_PX * min(len(rows), ROWS)
        self.bottom = box.top - down
        """Where what follows may begin."""

    def ground(self) -> Iterator[Artist]:
        """Heading, numbers and empty bars."""
        up = self._box.top - 14.0
        if not self._places:
            yield words(self._box.left, up, "this rule asks for no trust", colour=PALE)
            return
        count = len(self._history.ids)
        of_many = "" if count == len(self._places) else f": of {count} robots, those ever trusted least"
        yield words(self._box.left, up, f"trust{of_many}", colour=PALE)
        for place in self._places:
            number = str(self._history.ids[place.row])
            yield words(place.left - 8.0, place.bottom + 1.5, number, ha="right")
        yield boxes([(p.left, p.bottom, p.right, p.bottom + 12.0) for p in self._places], "#eff0ec")

    def show(self, tick: int) -> Iterator[Artist]:
        """Bars as long as trust."""
        trust = np.nan_to_num(self._history.trust[tick], nan=1.0)
        if not self._places:
            return
        bars = [(p.left, p.bottom, p.left + trust[p.row] * (p.right - p.left), p.bottom + 12.0) for p in self._places]
        yield boxes(bars, self._insight.colours(tick)[[p.row for p in self._places]])
        halves = [p.left + DISTRUSTED * (p.right - p.left) for p in self._places]
        marks = [[(x, p.bottom), (x, p.bottom + 12.0)] for x, p in zip(halves, self._places, strict=True)]
        yield lines(marks, "#ffffff", 1.0)
        if self._columns <= 2:
            for place in self._places:
                yield words(place.right + 6.0, place.bottom + 1.5, f"{trust[place.row]:.2f}", colour=DARK)

    def _placed(self, rows: list[int]) -> Iterator[Place]:
        width = (self._box.right - self._box.left + GAP_PX) / max(self._columns, 1) - GAP_PX
        value = VALUE_PX if self._columns <= 2 else 0.0
        for place, row in enumerate(rows):
            column, down = divmod(place, ROWS)
            left = self._box.left + column * (width + GAP_PX)
            bottom = self._box.top - HEADING_PX - ROW_PX * (down + 1)
            yield Place(row, left + NUMBER_PX, left + width - value, bottom)


def _least_trusted(history: History, most: int) -> list[int]:
    """Rows of so many robots, in the order of their ids."""
    ever = np.nan_to_num(history.trust, nan=1.0).min(axis=0)
    return sorted(np.argsort(ever, kind="stable")[:most].tolist())
