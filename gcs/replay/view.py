"""What there is to see of a flight at one position: its phase, and each vehicle as the ground station knew it."""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import dataclass

from gcs.fleet_table import age_s
from gcs.recording.channels import raw_sender
from gcs.recording.history import History
from gcs.replay.player import Span
from gcs.replay.reel import Reel
from gcs.replay.timeline import Timeline
from gcs.telemetry import Swarm, observe
from gcs.track import Parts
from wire.frames import Framer

MEMORY_NS = 5_000_000_000
"""Recorded time: what was not said again for so long is not shown, where no tick says how the vehicles are."""
NOBODY = Parts(0.0, (), ())


@dataclass(frozen=True, slots=True)
class Vehicle:
    """One vehicle at one time; NaN of what was not told."""

    system: int
    part: Parts
    """Who leads and who is left behind."""
    armed: bool
    autopilot: int
    """MAV_AUTOPILOT."""
    custom_mode: int
    place: tuple[float, float, float]
    """m: north, east, height, by telemetry."""
    speed: float
    """m/s over ground."""
    setpoint_ne: tuple[float, float]
    """m/s that it was sent."""
    battery: float
    """0 … 1."""
    age_s: float
    """Of its telemetry."""
    trust: float
    """0 … 1."""


@dataclass(frozen=True, slots=True)
class View:
    """The flight at one time."""

    phase: str
    """"" where nothing tells."""
    task: str
    vehicles: tuple[Vehicle, ...]


class OfTicks:
    """Views of a flight of ours: by the last tick that has been seen."""

    def __init__(self, flight: History) -> None:
        self._flight = flight
        self._time_ns = flight.time_ns.tolist()

    def __call__(self, position_ns: int) -> View:
        """Before the first tick nothing is known."""
        flight, row = self._flight, bisect_left(self._time_ns, position_ns) - 1
        if row < 0:
            return View("", "", ())
        since_s = (position_ns - 1 - self._time_ns[row]) / 1e9
        parts = [NOBODY, *(part for part in flight.parts if part.time_s <= flight.mission_s[row] + 1e-9)]
        vehicles = (_of_tick(flight, row, column, parts[-1], since_s) for column in range(len(flight.ids)))
        return View(flight.phase[row], flight.task[row], tuple(vehicles))


def _of_tick(flight: History, row: int, column: int, part: Parts, since_s: float) -> Vehicle:
    north, east, height = flight.reported[row, column].tolist()
    setpoint_north, setpoint_east = flight.sent_ned[row, column, :2].tolist()
    return Vehicle(
        system=flight.ids[column],
        part=part,
        armed=bool(flight.armed[row, column]),
        autopilot=int(flight.autopilot[column]),
        custom_mode=int(flight.custom_mode[row, column]),
        place=(north, east, height),
        speed=math.hypot(*flight.velocity_ned[row, column, :2]),
        setpoint_ne=(setpoint_north, setpoint_east),
        battery=float(flight.battery[row, column]),
        age_s=float(flight.age_s[row, column]) + since_s,
        trust=float(flight.trust[row, column]),
    )


class OfFrames:
    """The same of a recording that holds frames alone: what they tell is put together while it is played."""

    def __init__(self, reel: Reel, ids: tuple[int, ...]) -> None:
        """reel: one of its own;  ids: of the vehicles."""
        self._reel = reel
        self._framer = Framer()
        self._nothing = self._swarm = Swarm.of(ids)
        self._at_ns: int | None = None

    def __call__(self, position_ns: int) -> View:
        """From where it was, if that is not long ago; else from MEMORY_NS before."""
        if self._at_ns is None or not 0 <= position_ns - self._at_ns <= MEMORY_NS:
            self._swarm, self._at_ns = self._nothing, position_ns - MEMORY_NS
        played = self._reel.play(Span(self._at_ns, position_ns))
        frames = [f for m in played if raw_sender(m.topic) for f in self._framer.frames(m.time_ns, m.data)]
        self._swarm, self._at_ns = observe(self._swarm, frames), position_ns
        return View("", "", tuple(_of_swarm(self._swarm, row, position_ns) for row in range(len(self._swarm.ids))))


def _of_swarm(swarm: Swarm, row: int, now_ns: int) -> Vehicle:
    north, east, down = swarm.position_ned[row].tolist()
    return Vehicle(
        system=swarm.ids[row],
        part=NOBODY,
        armed=bool(swarm.armed[row]),
        autopilot=int(swarm.autopilot[row]),
        custom_mode=int(swarm.custom_mode[row]),
        place=(north, east, -down),
        speed=math.hypot(*swarm.velocity_ned[row, :2]),
        setpoint_ne=(math.nan, math.nan),
        battery=float(swarm.battery[row]),
        age_s=age_s(now_ns, int(swarm.position_ns[row])),
        trust=math.nan,
    )


def seer(timeline: Timeline, reel: Reel) -> OfFrames | OfTicks:
    """What shows this recording; reel: one of its own."""
    return OfFrames(reel, timeline.senders.vehicles) if timeline.flight is None else OfTicks(timeline.flight)
