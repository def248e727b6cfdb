"""What people do while a flight goes on: inputs of a tick, recorded with its number."""

from __future__ import annotations

from dataclasses import dataclass

LAND = "land"
"""End the flight."""


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
"""A word of the operator (LAND), or a rating."""
