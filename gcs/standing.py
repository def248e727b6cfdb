"""How a flight stands, as it tells whoever asks: its phase, and where each vehicle is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from gcs.loop import Tick
from gcs.telemetry import NEVER
from wire.modes import mode_name


@dataclass(frozen=True, slots=True)
class Vehicle:
    """One of the flight's vehicles; None where it was not told."""

    heard: bool
    armed: bool
    mode: str
    height_m: float | None
    """Above home."""
    speed_m_s: float | None
    released: bool
    """In other hands."""

    def __str__(self) -> str:
        """In a few words."""
        place = "height unknown" if self.height_m is None else f"{self.height_m:.1f} m up"
        return f"{self.mode}, {place}{', in other hands' if self.released else ''}"


@dataclass(frozen=True, slots=True)
class Standing:
    """A flight at one tick."""

    phase: str = "not begun"
    vehicles: Mapping[int, Vehicle] = field(default_factory=dict)
    """By system id."""

    @staticmethod
    def at(tick: Tick) -> Standing:
        """As a tick left it."""
        swarm, released = tick.swarm, tick.state.released
        return Standing(
            tick.diagnosis.phase.value,
            {
                system: Vehicle(
                    heard=bool(swarm.heartbeat_ns[row] != NEVER),
                    armed=bool(swarm.armed[row]),
                    mode=mode_name(int(swarm.autopilot[row]), int(swarm.custom_mode[row])),
                    height_m=_number(-swarm.position_ned[row, 2]),
                    speed_m_s=_number(float(np.linalg.norm(swarm.velocity_ned[row]))),
                    released=bool(released[row]),
                )
                for row, system in enumerate(swarm.ids)
            },
        )

    @staticmethod
    def read(told: Mapping[str, Any]) -> Standing:
        """What `told` says. Raises ValueError where it says something else."""
        try:
            vehicles = {int(system): Vehicle(**one) for system, one in told["vehicles"].items()}
            return Standing(str(told["phase"]), vehicles)
        except (KeyError, TypeError, AttributeError) as error:
            raise ValueError(f"not how a flight stands: {error}") from None

    def told(self) -> dict[str, object]:
        """As it is written."""
        return {"phase": self.phase, "vehicles": {str(system): asdict(one) for system, one in self.vehicles.items()}}

    @property
    def armed(self) -> dict[int, Vehicle]:
        """Who has its rotors running."""
        return {system: one for system, one in self.vehicles.items() if one.armed}

    @property
    def ours(self) -> dict[int, Vehicle]:
        """Who has its rotors running, and is the flight's."""
        return {system: one for system, one in self.armed.items() if not one.released}


def _number(value: float) -> float | None:
    return None if math.isnan(value) else round(float(value), 2)
