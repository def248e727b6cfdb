"""From the ground to the picture: metres north and east become pixels, on one scale, with the whole mission in view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gcs.video.motion import Motion

Array = npt.NDArray[np.float64]

WIDTH, HEIGHT, RATE = 1280, 720, 30
"""Of every film: pixels, and pictures a second."""
MARGIN = 62.0
"""Pixels round everything that is flown."""
LEAST_M = 12.0
"""A flight that goes nowhere is not looked at more closely than this."""


@dataclass(frozen=True, slots=True)
class Box:
    """A part of the picture, in pixels from its lower left corner."""

    left: float
    bottom: float
    right: float
    top: float


@dataclass(frozen=True, slots=True)
class View:
    """The ground as seen from above, north upwards."""

    box: Box
    """Where in the picture."""
    scale: float
    """Pixels a metre."""
    centre_ne: tuple[float, float]
    """m: what is in the middle of the box."""

    @staticmethod
    def of(motion: Motion, box: Box) -> View:
        """What holds every robot while the film goes on, and the planned path."""
        flown = motion.place_ne[motion.ticks(motion.begins_s, motion.ends_s)].reshape(-1, 2)
        places = [flown[np.isfinite(flown).all(axis=1)]]
        for segment in motion.plan.segments if motion.plan is not None else ():
            places += [segment.start_ne[None], segment.planned_end_ne[None]]
        every = np.concatenate(places)
        every = every if len(every) else np.zeros((1, 2))
        low, high = every.min(axis=0), every.max(axis=0)
        north_m, east_m = np.maximum(high - low, LEAST_M)
        scale = min(
            (box.right - box.left - 2 * MARGIN) / east_m,
            (box.top - box.bottom - 2 * MARGIN) / north_m,
        )
        north, east = 0.5 * (low + high)
        return View(box, float(scale), (float(north), float(east)))

    def pixels(self, place_ne: npt.ArrayLike) -> Array:
        """(…, 2) rightwards and upwards, of (…, 2) m north and east."""
        place = np.asarray(place_ne, dtype=np.float64)
        right = 0.5 * (self.box.left + self.box.right) + self.scale * (place[..., 1] - self.centre_ne[1])
        up = 0.5 * (self.box.bottom + self.box.top) + self.scale * (place[..., 0] - self.centre_ne[0])
        return np.stack([right, up], axis=-1)

    @property
    def edges_ne(self) -> tuple[float, float, float, float]:
        """South, west, north and east edges of the box, in metres."""
        half_ne = (
            0.5 * (self.box.top - self.box.bottom) / self.scale,
            0.5 * (self.box.right - self.box.left) / self.scale,
        )
        (north, east), (up, right) = self.centre_ne, half_ne
        return north - up, east - right, north + up, east + right
