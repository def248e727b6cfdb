"""Whom a telemetry report is about, and at what moment."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from fdm.modes import Pilot, Situation
from fdm.personality import Personality
from fdm.vehicle import Geodetic, Vehicle
from scenarios.models import Noise

EPOCH_US = 1_577_836_800_000_000
"""2020-01-01T00:00Z: when every simulated vehicle boots, in microseconds since 1970."""


@dataclass(frozen=True, slots=True)
class Craft:
    """One vehicle, by what does not change in flight."""

    vehicle: Vehicle
    system: int
    home: Geodetic
    """The pad."""
    personality: Personality
    origin_ne: tuple[float, float] = (0.0, 0.0)
    """m from the pad to the origin of its estimator, on the pad's level."""
    noise: Noise = field(default_factory=Noise)
    """Of its measurements: what it may honestly claim."""

    def is_ready(self, now: Situation) -> bool:
        """Whether its sensors have settled."""
        return now.time_s >= self.personality.machine.READY_AFTER


class Moment(NamedTuple):
    """What it does now."""

    pilot: Pilot
    now: Situation
    measured: tuple[float, ...]
    """(n, e, d, vn, ve, vd), m and m/s from the pad."""

    @property
    def boot_ms(self) -> int:
        """Its own clock."""
        return round(self.now.time_s * 1e3)

    @property
    def boot_us(self) -> int:
        """Its own clock, finer."""
        return round(self.now.time_s * 1e6)


Report = Callable[[Craft, Moment], Any]
"""Makes a pymavlink message."""
