"""What no eye sees: who is trusted and heeded, who leads, what is wrong with whom, and where the swarm should be."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.path import Path
from matplotlib.textpath import TextPath

from gcs.recording.history import History
from gcs.summary import trust_of
from gcs.trust_colour import trust_colour
from gcs.video.flock import Flock
from gcs.video.glyphs import cross, ring
from gcs.video.ink import DARK, FAILED, lines, shapes
from gcs.video.view import View

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

LINK_OPACITY, LINK_PX, LEAST_PX = 0.32, 14.0, 0.3
"""A link of weight 1 is so wide; thinner ones than the last are not drawn."""
LABEL_PX, LEADER_PX, RING_PX = 12.0, 1.5, 2.2
FURTHER = 1.3
"""The ring of a faulty robot is outside that of a leader."""
GHOST = "#22272e"


class Insight:
    """What is drawn over the robots, and their colours."""

    def __init__(self, history: History, flock: Flock, view: View) -> None:
        self._history, self._flock, self._view = history, flock, view
        self._labels = [_label(system) for system in history.ids]
        self.trusting = trust_of(history.scenario) is not None
        """Whether the rule asks for trust at all."""

    def colours(self, tick: int) -> Array:
        """(N, 3): each robot's trust; where nobody asks for it, whether something is wrong with it."""
        trust = self._history.trust[tick] if self.trusting else np.where(self.faulty(tick), 0.0, 1.0)
        return trust_colour(np.where(np.isnan(trust), 1.0, trust))

    def faulty(self, tick: int) -> Flags:
        """(N,) whom a fault acts on."""
        mission_s = self._history.mission_s[tick]
        acting = {fault.vehicle for fault in self._history.faults if fault.from_s <= mission_s < fault.to_s}
        return np.array([system in acting for system in self._history.ids])

    def leaders(self, tick: int) -> Flags:
        """(N,) who leads."""
        part = next((p for p in reversed(self._history.parts) if p.time_s <= self._history.mission_s[tick]), None)
        return np.isin(self._history.ids, self._history.scenario.swarm.leaders if part is None else part.leaders)

    def links(self, time_s: float, tick: int) -> Iterator[Artist]:
        """Between neighbours: the half on a robot's side is as wide as the other heeds it."""
        heeded = np.nan_to_num(self._history.weights[tick].T) * LINK_PX
        np.fill_diagonal(heeded, 0.0)
        whom, by = np.nonzero(heeded >= LEAST_PX)
        if whom.size:
            here = self._flock.middles(time_s)
            halves = np.stack([here[whom], 0.5 * (here[whom] + here[by])], axis=1)
            paint = np.column_stack([self.colours(tick)[whom], np.full(len(whom), LINK_OPACITY)])
            yield lines(list(halves), paint, heeded[whom, by])

    def marks(self, time_s: float, tick: int) -> Iterator[Artist]:
        """Rings of leaders and of the faulty, numbers, and the virtual leader."""
        here = self._flock.middles(time_s)
        radius = 2.15 * self._flock.arm
        for among, colour, width, reach in (
            (self.leaders(tick), DARK, LEADER_PX, 1.0),
            (self.faulty(tick), FAILED, RING_PX, FURTHER),
        ):
            if among.any():
                yield shapes([ring(middle, reach * radius) for middle in here[among]], "none", colour, width)
        outside = np.where(self.faulty(tick), FURTHER, 1.0)[:, None]
        beside = here + outside * np.array([0.9 * radius, -0.9 * radius - 0.5 * LABEL_PX])
        yield shapes([Path(p.vertices + at, p.codes) for p, at in zip(self._labels, beside, strict=True)], DARK)
        ghost = self._history.virtual_ne[tick]
        if not math.isnan(ghost[0]):
            yield shapes([cross(self._view.pixels(ghost))], "none", GHOST, 2.0)


def _label(system: int) -> Path:
    path = TextPath((0.0, 0.0), str(system), size=LABEL_PX, usetex=False)
    return Path(path.vertices, path.codes)
