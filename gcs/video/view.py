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
ASTRAY_M = 20.0
"""Round the planned path of a blind film: the paper's worst flights keep within it."""
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
        places = np.concatenate([flown[np.isfinite(flown).all(axis=1)], _planned(motion)])
        return View._round(places, box, margin_px=MARGIN)

    @staticmethod
    def planned(motion: Motion, box: Box) -> View:
        """What holds the planned path and ASTRAY_M round it: the same for all flights of one plan, whoever flew it."""
        if motion.plan is None:
            return View.of(motion, box)
        return View._round(np.concatenate([_planned(motion) + apart for apart in (-ASTRAY_M, ASTRAY_M)]), box)

    @staticmethod
    def _round(places_ne: Array, box: Box, *, margin_px: float = 0.0) -> View:
        """What holds these places (P, 2) m."""
        every = places_ne if len(places_ne) else np.zeros((1, 2))
        low, high = every.min(axis=0), every.max(axis=0)
        north_m, east_m = np.maximum(high - low, LEAST_M)
        scale = min(
            (box.right - box.left - 2 * margin_px) / east_m,
            (box.top - box.bottom - 2 * margin_px) / north_m,
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


def _planned(motion: Motion) -> Array:
    """(P, 2) m: where legs begin and would have ended."""
    segments = () if motion.plan is None else motion.plan.segments
    return np.array([place for leg in segments for place in (leg.start_ne, leg.planned_end_ne)]).reshape(-1, 2)
