"""What is drawn over time: the score's own measures at every tick, and what the swarm and its links did meanwhile."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from gcs.mission import Plan, Segment
from gcs.recording.history import Links

Array = npt.NDArray[np.float64]

SHORTEST_CHORD = 1.0
"""m flown on a leg before it has a direction."""


def off_course_deg(time_s: Array, place_ne: Array, plan: Plan) -> Array:
    """(T, M) degrees between the leg being flown and the way from where each was as it began to where it is.

    time_s: (T,) since mission start;  place_ne: (T, M, 2) m, formation taken off. At the read-out of the last leg this
    is the score's heading error. NaN within SHORTEST_CHORD.
    """
    off = np.full(place_ne.shape[:2], np.nan)
    for rows, segment in _legs(time_s, plan):
        chord = place_ne[rows] - place_ne[rows.start]
        wanted = np.arctan2(segment.velocity_ne[1], segment.velocity_ne[0])
        turned = np.arctan2(chord[..., 1], chord[..., 0]) - wanted
        angle = np.abs(np.degrees(np.arctan2(np.sin(turned), np.cos(turned))))
        off[rows] = np.where(np.hypot(chord[..., 0], chord[..., 1]) >= SHORTEST_CHORD, angle, np.nan)
    return off


def distance_to_target(time_s: Array, place_ne: Array, plan: Plan) -> Array:
    """(T, M) m to the end of the leg being flown, as it was planned; arguments as above."""
    away = np.full(place_ne.shape[:2], np.nan)
    for rows, segment in _legs(time_s, plan):
        away[rows] = np.linalg.norm(place_ne[rows] - segment.planned_end_ne, axis=-1)
    return away


def heeded(weights: Array, by: npt.NDArray[np.bool_]) -> Array:
    """(T, N) how much each robot is heeded: the mean of the weights that some robots give it; 1/N is an equal share.

    weights: (T, N, N) as in the recording, NaN where no control law ran;  by: (N,) whose weights count.
    """
    return np.asarray(weights[:, by].mean(axis=1), np.float64)


def lost_share(links: Links) -> Array:
    """(L − 1, N) of the frames sent between two moments, the share that did not come; 0 where none was sent."""
    lost = np.maximum(np.diff(links.lost, axis=0), 0)
    due = lost + np.maximum(np.diff(links.received, axis=0), 0)
    return np.asarray(lost / np.maximum(due, 1))


def closest_pair(position: Array) -> tuple[int, int]:
    """Rows of the two robots that are closest to each other at one moment. position: (N, 3) m, N ≥ 2."""
    gap = np.linalg.norm(position[:, None] - position[None], axis=-1)
    gap[np.diag_indices(len(gap))] = np.inf
    first, second = np.unravel_index(int(np.nanargmin(gap)), gap.shape)
    return int(min(first, second)), int(max(first, second))


def _legs(time_s: Array, plan: Plan) -> Iterator[tuple[slice, Segment]]:
    """The rows of each leg that was begun, and the leg."""
    begins = [int(np.searchsorted(time_s, segment.begins_s - 1e-9)) for segment in plan.segments]
    for (begin, end), segment in zip(pairwise([*begins, len(time_s)]), plan.segments, strict=True):
        if begin < end:
            yield slice(begin, end), segment
