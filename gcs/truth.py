"""The truth of simulated vehicles (SIM_STATE of component 200), for whoever records and scores, never for control."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from gcs import messages
from gcs.loop import Tick
from gcs.swarm_frame import SwarmFrame
from gcs.telemetry import Swarm
from wire.ids import TRUTH
from wire.payloads import unpack_sim_state

Array = npt.NDArray[np.float64]


class Truth:
    """The last true state that each vehicle told: a `Record` that comes before those which read it."""

    def __init__(self, ids: Sequence[int]) -> None:
        self._rows = {system: row for row, system in enumerate(ids)}
        self._geodetic = np.full((len(ids), 3), np.nan)
        self._silent = set(self._rows)
        self.velocity_ned = np.full((len(ids), 3), np.nan)
        """(N, 3) m/s."""

    def tick(self, tick: Tick) -> None:
        """Take in what this turn of the loop received."""
        for frame in tick.frames:
            if frame.component == TRUTH and frame.message == messages.SIM_STATE and frame.system in self._rows:
                state, row = unpack_sim_state(frame.payload), self._rows[frame.system]
                self._geodetic[row] = state.lat_int / 1e7, state.lon_int / 1e7, state.alt
                self.velocity_ned[row] = state.vn, state.ve, state.vd
                self._silent.discard(frame.system)

    @property
    def known(self) -> bool:
        """Whether every vehicle has told its truth: real ones never do."""
        return not self._silent

    def position(self, frame: SwarmFrame, swarm: Swarm) -> Array:
        """(N, 3) m: north, east of the swarm's origin, height above each vehicle's home."""
        position = np.empty_like(self._geodetic)
        position[:, :2] = frame.to_ne(self._geodetic[:, 0], self._geodetic[:, 1])
        position[:, 2] = self._geodetic[:, 2] - swarm.home_m
        return position
