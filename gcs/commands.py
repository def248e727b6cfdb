"""What the ground station asks of a vehicle, in SI and before it is MAVLink."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple


@dataclass(frozen=True, slots=True)
class Beat:
    """A heartbeat of the ground station: its loop is alive."""


@dataclass(frozen=True, slots=True)
class RequestStream:
    """Send this message regularly."""

    message: int
    interval_s: float


@dataclass(frozen=True, slots=True)
class RequestMessage:
    """Send this message once."""

    message: int


@dataclass(frozen=True, slots=True)
class RequestParameter:
    """Tell the value of a parameter."""

    name: str
    """At most 16 characters."""


@dataclass(frozen=True, slots=True)
class Arm:
    """Start the rotors."""


@dataclass(frozen=True, slots=True)
class Kill:
    """Stop the rotors at once, in the air too: the vehicle falls."""


@dataclass(frozen=True, slots=True)
class TakeOff:
    """Climb straight up, as PX4 reads it."""

    altitude_m: float
    """Above mean sea level."""


@dataclass(frozen=True, slots=True)
class TakeOffAboveHome:
    """Climb straight up, as ArduPilot reads the same message."""

    height_m: float
    """Above home."""


@dataclass(frozen=True, slots=True)
class ChangeMode:
    """Fly in another mode, as DO_SET_MODE numbers it."""

    main: int
    sub: int


@dataclass(frozen=True, slots=True)
class Land:
    """Come down where you are."""


class SetVelocity(NamedTuple):
    """A velocity set-point: a tuple, because there is one for every vehicle and tick."""

    north: float
    east: float
    down: float
    """m/s."""
    yaw: float
    """rad."""


Command = (
    Beat
    | RequestStream
    | RequestMessage
    | RequestParameter
    | Arm
    | Kill
    | TakeOff
    | TakeOffAboveHome
    | ChangeMode
    | Land
    | SetVelocity
)
