"""What is kept of a mission for its score and its picture: who was where, who was trusted, who led."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gcs.flight import Flight
from gcs.gate import LOST_NS
from gcs.loop import Tick
from gcs.truth import Truth

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """A mission, tick by tick, from its start to the read-out: T ticks, N vehicles."""

    time_s: Array
    """(T,) since mission start."""
    position: Array
    """(T, N, 3) m: north, east of the swarm's origin, height above home; NaN of a vehicle that telemetry has lost."""
    trust: Array
    """(T, N) in [0, 1]."""
    virtual_ne: Array
    """(T, 2) m: the virtual leader."""
    measured: bool
    """True where positions are telemetry, because no simulation told the truth."""
    parts: tuple[Parts, ...] = ()
    """At mission start, and whenever they changed; none where nothing tells."""
    faults_known: bool = True
    """Whether the scenario's faults are known to act: a simulation tells its truth, or we made them ourselves."""

    @staticmethod
    def of(
        points: Sequence[Point], *, read_out_s: float, parts: Sequence[Parts] = (), faults_made: bool = False
    ) -> Track | None:
        """A track of points in the order of time, as far as the first at the read-out; None of no points.

        faults_made: whether we made the scenario's faults ourselves, whatever the vehicles tell.
        """
        before = sum(point.time_s < read_out_s - 1e-9 for point in points)
        points = points[: before + 1]
        if not points:
            return None
        return Track(
            time_s=np.array([point.time_s for point in points]),
            position=np.array([point.position for point in points]),
            trust=np.array([point.trust for point in points]),
            virtual_ne=np.array([point.virtual_ne for point in points]),
            measured=(measured := any(point.measured for point in points)),
            faults_known=faults_made or not measured,
            parts=tuple(part for part in parts if part.time_s <= points[-1].time_s),
        )


@dataclass(frozen=True, slots=True)
class Parts:
    """Who has which part in the swarm, by system ids, from a time on."""

    time_s: float
    """Since mission start."""
    leaders: tuple[int, ...]
    left_behind: tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Point:
    """One tick of a track."""

    time_s: float
    position: Array
    """(N, 3)"""
    trust: Array
    """(N,)"""
    virtual_ne: Array
    """(2,)"""
    measured: bool


class Tracker:
    """A `Record` that keeps the track in memory."""

    def __init__(self, flight: Flight, truth: Truth, *, faults_made: bool = False) -> None:
        """faults_made: whether we make the scenario's faults ourselves, whatever the vehicles tell."""
        self._truth, self._faults_made = truth, faults_made
        self._read_out_s = flight.plan.read_out_s
        self._points: list[Point] = []
        self._parts: list[Parts] = []

    def tick(self, tick: Tick) -> None:
        """Keep this tick, if it belongs to the mission."""
        point = point_of(tick, self._truth)
        if point is not None:
            self._points.append(point)
            self._keep_parts(tick)

    @property
    def track(self) -> Track | None:
        """All that was kept; None where the mission never began."""
        return Track.of(self._points, read_out_s=self._read_out_s, parts=self._parts, faults_made=self._faults_made)

    def _keep_parts(self, tick: Tick) -> None:
        parts = parts_of(tick)
        if parts is not None and (not self._parts or changed(self._parts[-1], parts)):
            self._parts.append(parts)


def point_of(tick: Tick, truth: Truth) -> Point | None:
    """Where everyone is at a tick; None before the mission."""
    diagnosis, frame = tick.diagnosis, tick.state.frame
    if diagnosis.virtual is None or frame is None:
        return None
    if truth.known:
        position = truth.position(frame, tick.swarm)
    else:
        position = np.column_stack([diagnosis.position_ne, -tick.swarm.position_ned[:, 2]])
        position[tick.time_ns - tick.swarm.position_ns > LOST_NS] = np.nan  # where it was, and nobody knows where it is
    return Point(
        diagnosis.mission_s,
        position,
        diagnosis.trust,
        diagnosis.virtual.position_ne,
        measured=not truth.known,
    )


def parts_of(tick: Tick) -> Parts | None:
    """Who has which part at a tick; None before the mission."""
    memory, ids = tick.state.memory, tick.swarm.ids
    if memory is None:
        return None
    leaders = tuple(ids[row] for row in memory.roles.leaders.tolist())
    left = tuple(system for system, so in zip(ids, memory.roles.left.tolist(), strict=True) if so)
    return Parts(tick.diagnosis.mission_s, leaders, left)


def changed(before: Parts, after: Parts) -> bool:
    """Whether anybody's part is another."""
    return (before.leaders, before.left_behind) != (after.leaders, after.left_behind)
