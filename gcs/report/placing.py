"""Where words on a map find room: beside what they name, where they cover least."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from gcs.report.svg import LETTER, TEXT

Array = npt.NDArray[np.float64]
Box = tuple[float, float, float, float]
"""Left, top, right, bottom, units."""
Place = tuple[float, float, str]
"""Across, base line, and which end of a text stands there: SVG's text-anchor."""

BESIDE = 12.0
"""Units from a thing to the words beside it."""
HEAVY = 1000
"""Points of lines that a mark or another word counts for."""
FAR = 1.0
"""Points of lines that a unit of distance counts for."""
OUTSIDE = 10**6
"""Worse than to cover all that is drawn."""


class Room:
    """What is drawn already: points of lines, which words may cover at need, and boxes, which they should not."""

    def __init__(self, within: Box, lines: Array) -> None:
        """lines: (K, 2) units."""
        self._within, self._lines = within, lines
        self._boxes: list[Box] = []

    def take(self, box: Box) -> None:
        """Nothing else is to stand there."""
        self._boxes.append(box)

    def place(self, said: str, at: tuple[float, float], places: Sequence[Place], *, over_lines: bool = False) -> Place:
        """The first of the places that cover least and are not far from what they name, which is then taken.

        at: across and down of what is named;  over_lines: lines do not matter.
        """

        def cost(place: Place) -> float:
            box = box_of(said, place)
            return self._covered(box, over_lines=over_lines) + FAR * _distance(at, box)

        best = min(places, key=cost)
        self.take(box_of(said, best))
        return best

    def _covered(self, box: Box, *, over_lines: bool) -> int:
        left, top, right, bottom = box
        west, north, east, south = self._within
        outside = left < west or right > east or top < north or bottom > south
        heavy = sum(overlap(box, other) for other in self._boxes)
        light = 0
        if not over_lines:
            light = int(((self._lines > (left, top)) & (self._lines < (right, bottom))).all(axis=1).sum())
        return OUTSIDE * outside + HEAVY * heavy + light


def box_of(said: str, place: Place) -> Box:
    """What words take, with a little air."""
    across, base, anchor = place
    width = LETTER * len(said)
    left = across - width * {"start": 0.0, "middle": 0.5, "end": 1.0}[anchor]
    return left - 2.0, base - TEXT, left + width + 2.0, base + 4.0


def _distance(at: tuple[float, float], box: Box) -> float:
    """From a point to the nearest edge, 0 inside."""
    (x, y), (left, top, right, bottom) = at, box
    return math.hypot(max(left - x, 0.0, x - right), max(top - y, 0.0, y - bottom))


def overlap(one: Box, other: Box) -> bool:
    """Whether they share more than an edge."""
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


def around(x: float, y: float, crowd: Box | None = None) -> Iterator[Place]:
    """Beside, above and below a mark, then ever farther, then outside a crowd that it stands in."""
    for base in (y + 4.0, y - 12.0, y + 19.0, y - 24.0, y + 31.0):
        yield x + BESIDE, base, "start"
        yield x - BESIDE, base, "end"
        if base != y + 4.0:
            yield x, base, "middle"
    if crowd is not None:
        left, top, right, bottom = crowd
        for base in (top - 6.0, bottom + TEXT + 2.0):
            yield x, base, "middle"
            yield left, base, "start"
            yield right, base, "end"
        yield right + 4.0, y + 4.0, "start"
        yield left - 4.0, y + 4.0, "end"


def about(at: Array, away: Array) -> Iterator[Place]:
    """For a number round a mark, `away` first: (2,) a direction, of length 1."""
    for reach in (BESIDE, 1.5 * BESIDE, 2.5 * BESIDE):
        for turn in np.radians((0, 45, -45, 90, -90, 135, -135, 180)):
            (cos, sin), (across, down) = (np.cos(turn), np.sin(turn)), away
            x, y = at + reach * np.array([cos * across - sin * down, sin * across + cos * down])
            yield float(x), float(y) + 0.35 * TEXT, "middle"
