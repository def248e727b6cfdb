"""What an eye sees of a flight: where the robots are, which way they point, and the path that was planned.

A film for people in a study is drawn from this alone: what is not in here cannot show.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gcs.mission import Plan, plan
from gcs.recording.history import History

Array = npt.NDArray[np.float64]

BEFORE_S, AFTER_S = 2.0, 3.0
"""Recorded seconds that a film shows before mission start, and after the read-out."""


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """T ticks of the whole flight, N robots."""

    time_s: Array
    """(T,) since the first tick."""
    place_ne: Array
    """(T, N, 2) m from the swarm's origin; NaN where nothing was told."""
    yaw: Array
    """(T, N) rad, clockwise from north, without jumps of a whole turn."""
    plan: Plan | None
    """None of flights without a mission."""
    begins_s: float
    """Of the film, as time_s."""
    ends_s: float
    starts_s: float
    """When the mission starts, as time_s; NaN where it never did."""

    @staticmethod
    def of(history: History) -> Motion:
        """All that moves in a flight."""
        time_s = (history.time_ns - history.time_ns[0]) / 1e9
        flown = np.flatnonzero(np.isfinite(history.mission_s))
        path = plan(history.scenario) if flown.size else None
        begins_s, ends_s, start_s = 0.0, float(time_s[-1]), math.nan
        if path is not None:
            start_s = float(time_s[flown[0]] - history.mission_s[flown[0]])
            read_out_s = start_s + min(path.read_out_s, float(history.mission_s[flown[-1]]))
            begins_s, ends_s = max(begins_s, start_s - BEFORE_S), min(ends_s, read_out_s + AFTER_S)
        place_ne, yaw = history.position[..., :2], _turning(history.attitude_rpy[..., 2])
        return Motion(time_s, place_ne, yaw, path, begins_s, ends_s, start_s)

    def calls_by(self, time_s: float) -> int:
        """How many emergency calls have come."""
        return 0 if self.plan is None else self.plan.calls_by(time_s - self.starts_s)

    def tick_at(self, time_s: float) -> int:
        """The last tick that is not later."""
        return max(int(np.searchsorted(self.time_s, time_s + 1e-9, side="right")) - 1, 0)

    def at(self, time_s: float) -> tuple[Array, Array]:
        """Places (N, 2) and yaws (N,) at a time, between two ticks on the straight line that joins them."""
        before = self.tick_at(time_s)
        after = min(before + 1, len(self.time_s) - 1)
        span_s = self.time_s[after] - self.time_s[before]
        share = 0.0 if span_s <= 0.0 else min(max((time_s - self.time_s[before]) / span_s, 0.0), 1.0)
        return _between(self.place_ne, before, after, share), _between(self.yaw, before, after, share)

    def ticks(self, from_s: float, to_s: float) -> slice:
        """Those of a span."""
        first, last = np.searchsorted(self.time_s, (from_s - 1e-9, to_s + 1e-9))
        return slice(int(first), int(last))

    def frames(self, *, speed: float, rate: float) -> Array:
        """(F,) when each picture of the film is taken, so many recorded seconds a second of film."""
        count = max(math.floor((self.ends_s - self.begins_s) / speed * rate + 1e-6), 1)
        return self.begins_s + np.arange(count, dtype=np.float64) * (speed / rate)


def _between(values: Array, before: int, after: int, share: float) -> Array:
    if share == 0.0:  # also where nothing is told at the later one
        return np.asarray(values[before])
    return np.asarray(values[before] + share * (values[after] - values[before]))


def _turning(yaw: Array) -> Array:
    """(T, N) without jumps of a whole turn; robots that have not told point north."""
    return np.unwrap(np.nan_to_num(yaw), axis=0).astype(np.float64)
