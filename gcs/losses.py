"""Vehicles that a flight has lost, and how that is said."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gcs.flight_state import Phase
from gcs.telemetry import Flags, Swarm

DOWN_BELOW = 0.25
"""Of the altitude to be held: a vehicle lower than that in a mission has come down."""


def down(swarm: Swarm, altitude_m: float) -> Flags:
    """(N,) who is near the ground; False where nothing is known."""
    return np.asarray(-swarm.position_ned[:, 2] < DOWN_BELOW * altitude_m)


def how(swarm: Swarm, row: int, *, silent: bool, altitude_m: float) -> str:
    """What became of a vehicle that no longer flies with us."""
    if silent:
        return "fell silent"
    return "came down" if down(swarm, altitude_m)[row] else "left the ground station's control"


def fell_silent(swarm: Swarm, silent: Flags, phase: Phase) -> str:
    """The sentence for vehicles (N,) that are not heard any more."""
    return f"{vehicles([swarm.ids[row] for row in np.flatnonzero(silent)])} fell silent while {phase.value}"


def vehicles(systems: Sequence[int]) -> str:
    """In words: vehicle 5; vehicles 4, 5."""
    return f"{'vehicle' if len(systems) == 1 else 'vehicles'} {', '.join(map(str, systems))}"


def in_use(swarm: Swarm) -> tuple[str, ...]:
    """Sentences for vehicles whose rotors turn before we asked for it: somebody else has them."""
    return tuple(
        f"vehicle {swarm.ids[row]} is armed already: whoever flies it lands it first"
        for row in np.flatnonzero(swarm.armed)
    )
