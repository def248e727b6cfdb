"""The map under the robots: a grid, the path and targets known so far; and for those who may know, names and scale."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.path import Path

from gcs.mission import Plan
from gcs.video.glyphs import ring
from gcs.video.ink import DARK, PALE, lines, shapes, words
from gcs.video.view import View

Array = npt.NDArray[np.float64]

GRID_M = 5.0
GRID, PATH, TARGET, TARGET_EDGE = "#e9eae5", "#9aa0a8", "#ffffff", "#5b626c"
SCALE_M = 10.0
TARGET_PX, DOT_PX = 11.0, 2.5
BESIDE_PX = 64.0
"""From a target to its name."""
PAST_THE_MIDDLE = 0.6
"""Of the box: a target further right has its name on its left."""


def course(view: View, plan: Plan | None, calls: int) -> Iterator[Artist]:
    """Path and targets as they are known after so many emergency calls."""
    if plan is None:
        return
    past, ahead = plan.legs(calls)
    flown = [view.pixels([segment.start_ne, segment.end_ne]) for segment in (*past, *ahead)]
    yield lines(flown, PATH, 2.0, linestyles=[(0, (5, 4))])
    for segment in past:
        if not np.allclose(segment.end_ne, segment.planned_end_ne):
            yield lines([view.pixels([segment.end_ne, segment.planned_end_ne])], PATH, 1.2, linestyles=[(0, (1, 4))])
    yield shapes([_target(view.pixels(s.planned_end_ne)) for s in (*past, *ahead)], TARGET, TARGET_EDGE, 2.0)


def names(view: View, plan: Plan | None, calls: int) -> Iterator[Artist]:
    """What each target is that is known after so many emergency calls."""
    if plan is not None:
        past, ahead = plan.legs(calls)
        for number, segment in enumerate((*past, *ahead), start=1):
            yield from _name(view, segment.planned_end_ne, number, segment.task)


def scale(view: View) -> Iterator[Artist]:
    """How long ten metres are, and where north is."""
    right, top = view.box.right - 26.0, view.box.top - 24.0
    yield lines([[(right, top - 42), (right, top - 4)]], DARK, 2.0)
    yield shapes([Path(np.array([(right, top), (right - 6, top - 14), (right + 6, top - 14)]))], DARK)
    yield words(right, top - 58, "N", size=13, ha="center", weight="bold")
    up = view.box.bottom + 54.0  # above the legend
    left = right - SCALE_M * view.scale
    yield lines([[(left, up + 5), (left, up), (right, up), (right, up + 5)]], DARK, 2.0)
    yield words(0.5 * (left + right), up + 9, f"{SCALE_M:g} m", size=12, ha="center")


def _name(view: View, place_ne: Array, number: int, task: str) -> Iterator[Artist]:
    """What a target is, beside the swarm that will stand on it."""
    box = view.box
    right, up = view.pixels(place_ne)
    to_the_left = right > box.left + PAST_THE_MIDDLE * (box.right - box.left)
    sign, side = (-1.0, "right") if to_the_left else (1.0, "left")
    yield lines([[(right + sign * TARGET_PX, up), (right + sign * (BESIDE_PX - 6.0), up)]], TARGET_EDGE, 1.0)
    yield words(right + sign * BESIDE_PX, up + 4.0, f"target {number}", size=12, colour=PALE, ha=side)
    yield words(right + sign * BESIDE_PX, up - 12.0, task, size=13, ha=side, weight="bold")


def grid(view: View) -> Artist:
    """A square every GRID_M."""
    south, west, north, east = view.edges_ne
    norths, easts = (
        np.arange(np.ceil(a / GRID_M), np.floor(b / GRID_M) + 1) * GRID_M for a, b in ((south, north), (west, east))
    )
    across = [view.pixels([(n, west), (n, east)]) for n in norths]
    along = [view.pixels([(south, e), (north, e)]) for e in easts]
    return lines([*across, *along], GRID, 1.0)


def _target(middle: Array) -> Path:
    """A ring with a dot."""
    return Path.make_compound_path(ring(middle, TARGET_PX), ring(middle, DOT_PX))
