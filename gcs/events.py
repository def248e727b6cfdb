"""What people do while a flight goes on: inputs of a tick, recorded with its number."""

from __future__ import annotations

import re
from dataclasses import dataclass

LAND = "land"
"""End the flight."""
HOLD = "hold"
"""End the mission, and stay where you are until somebody says land, or time.timeout_s has passed once more."""

_TAKE_BACK = re.compile(r"take back (\d+)")
_KILL = re.compile(r"kill (\d+)")


def take_back(system: int) -> str:
    """The word with which the operator takes a vehicle back that a pilot, or its autopilot, took from us."""
    return f"take back {system}"


def taken_back(event: Event) -> int | None:
    """The system id that an event takes back, if it is such a word."""
    match = _TAKE_BACK.fullmatch(event) if isinstance(event, str) else None
    return int(match[1]) if match else None


def kill(system: int) -> str:
    """The word with which the operator stops a vehicle's rotors at once, in the air too."""
    return f"kill {system}"


def killed(event: Event) -> int | None:
    """The system id that an event kills, if it is such a word."""
    match = _KILL.fullmatch(event) if isinstance(event, str) else None
    return int(match[1]) if match else None


@dataclass(frozen=True, slots=True)
class Rating:
    """How far one person trusts one vehicle, or the swarm as a whole."""

    rater: str
    vehicle: int | None
    """System id; None is the whole swarm."""
    rating: int
    """1 completely distrust … 5 completely trust."""
    time_s: float | None = None
    """Since mission start, when it counts; None is at once."""


Event = str | Rating
"""A word of the operator (LAND, HOLD, take_back, kill), or a rating."""
