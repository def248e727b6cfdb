"""The robots and the ways they came, as an eye sees them: all alike but for the colours that somebody else gives."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist

from gcs.video.glyphs import arm, quadrotors
from gcs.video.ink import lines, shapes
from gcs.video.motion import Motion
from gcs.video.view import View

Array = npt.NDArray[np.float64]

TRAIL_S = 8.0
"""How long a way stays bright."""
TRAIL_PX, WAY_PX = 3.0, 1.2
EVERY = 2
"""Ticks in a piece of a trail."""
FRESH = 0.75
"""Opacity of a trail at the robot."""
WAY = "#b9bdc4"
"""Colour of the whole way since the film's beginning."""
EDGE, EDGE_PX = "#ffffff", 2.5
"""Round each robot."""


class Flock:
    """Robots that move."""

    def __init__(self, motion: Motion, view: View) -> None:
        self._motion = motion
        self._pixels = view.pixels(motion.place_ne)
        self._view = view
        self.arm = arm(view.scale)
        """Pixels from a robot's middle to its rotors' axes."""

    def middles(self, time_s: float) -> Array:
        """(N, 2) px."""
        return self._view.pixels(self._motion.at(time_s)[0])

    def show(self, time_s: float, colours: Array) -> Iterator[Artist]:
        """Ways, trails and robots, in colours (N, 3)."""
        place_ne, yaw = self._motion.at(time_s)
        here = self._view.pixels(place_ne)
        way = self._since(self._motion.begins_s, time_s, here)
        yield lines(list(way.swapaxes(0, 1)), WAY, WAY_PX)
        yield self._trails(time_s, here, colours)
        robots = quadrotors(here, yaw, arm=self.arm)
        yield shapes(robots, EDGE, EDGE, EDGE_PX)
        yield shapes(robots, colours)

    def _trails(self, time_s: float, here: Array, colours: Array) -> Artist:
        """The last of each way, the fainter the longer ago."""
        points = self._since(time_s - TRAIL_S, time_s, here)[::-EVERY][::-1]
        steps, robots = len(points) - 1, len(here)
        segments = np.stack([points[:-1], points[1:]], axis=2).reshape(-1, 2, 2)
        opacity = np.repeat(FRESH * np.arange(1, steps + 1) / max(steps, 1), robots)
        return lines(list(segments), np.column_stack([np.tile(colours, (steps, 1)), opacity]), TRAIL_PX)

    def _since(self, from_s: float, time_s: float, here: Array) -> Array:
        """(P, N, 2) px: the places at the ticks of a span, and where the robots are now."""
        return np.concatenate([self._pixels[self._motion.ticks(from_s, time_s)], here[None]])
