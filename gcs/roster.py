"""Everybody who is heard, without having been told whom to expect: each vehicle is a swarm of one."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from gcs.routes import ALIVE_NS
from gcs.telemetry import NEVER, Swarm, observe
from wire.frames import Frame
from wire.ids import AUTOPILOT


@dataclass(slots=True)
class Roster:
    """Vehicles by system id, in the order in which they were first heard."""

    swarms: dict[int, Swarm] = field(default_factory=dict)
    """Each with one row, of a vehicle whose heartbeat has come."""

    def take(self, frames: Iterable[Frame]) -> None:
        """Fold in what came."""
        by_system: dict[int, list[Frame]] = {}
        for frame in frames:
            if frame.component == AUTOPILOT:
                by_system.setdefault(frame.system, []).append(frame)
        for system, its in by_system.items():
            swarm = observe(self.swarms.get(system) or Swarm.of((system,)), its)
            if swarm.heartbeat_ns[0] != NEVER:
                self.swarms[system] = swarm

    def alive(self, system: int, now_ns: int) -> bool:
        """Whether a vehicle is heard still."""
        swarm = self.swarms.get(system)
        return swarm is not None and bool(now_ns - swarm.heartbeat_ns[0] <= ALIVE_NS)


def listed(systems: Iterable[object]) -> str:
    """For a sentence."""
    return ", ".join(map(str, systems))
