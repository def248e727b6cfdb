"""Vehicles that a flight has lost, and how that is said."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from gcs.flight_state import Phase
from gcs.telemetry import Flags, Swarm

Array = npt.NDArray[np.float64]

KEEP_CLEAR_NS, FLIES_ON_NS = 10_000_000_000, 500_000_000
"""So long the others keep apart from a vehicle that is not heard any more, and so long it flies as it last did."""
DOWN_BELOW = 0.25
"""Of the altitude to be held: a vehicle lower than that in a mission has come down."""


def down(swarm: Swarm, altitude_m: float) -> Flags:
    """(N,) who is near the ground; False where nothing is known."""
    return np.asarray(-swarm.position_ned[:, 2] < DOWN_BELOW * altitude_m)


def beside_ne(swarm: Swarm, position_ne: Array, heard: Flags, now_ns: int, *, altitude_m: float) -> Array | None:
    """(N, 2) m where those are believed to be who take no part any more, (N,) not heard, and still fly; NaN for others.

    A silent vehicle flies on until it misses its set-points, then it stops. None where there is nobody.
    """
    age_ns = now_ns - swarm.position_ns
    astray = ~heard & swarm.armed & ~down(swarm, altitude_m) & (age_ns <= KEEP_CLEAR_NS)
    if not astray.any():
        return None
    on_s = np.minimum(age_ns, FLIES_ON_NS)[:, None] / 1e9
    return np.where(astray[:, None], position_ne + swarm.velocity_ned[:, :2] * on_s, np.nan)


def how(swarm: Swarm, row: int, *, silent: bool, mute: bool, altitude_m: float) -> str:
    """What became of a vehicle that no longer flies with us."""
    if silent or mute:
        return "fell silent" if silent else "does not tell its mode any more"
    return "came down" if down(swarm, altitude_m)[row] else "left the ground station's control"


def fell_silent(swarm: Swarm, silent: Flags, phase: Phase) -> str:
    """The sentence for vehicles (N,) that are not heard any more, or whose mode is not."""
    return f"{named(swarm, silent)} fell silent while {phase.value}"


def not_down(swarm: Swarm, up: Flags, silent: Flags, *, within_s: float) -> str:
    """The sentence for vehicles (N,) that were not seen to land, some of which are not heard any more."""
    told = ((up & silent, "fell silent before landing"), (up & ~silent, f"did not land within {within_s:g} s"))
    return "; ".join(f"{named(swarm, who)} {how}" for who, how in told if who.any())


def named(swarm: Swarm, who: Flags) -> str:
    """These vehicles (N,) in words."""
    return vehicles([swarm.ids[row] for row in np.flatnonzero(who)])


def vehicles(systems: Sequence[int]) -> str:
    """In words: vehicle 5; vehicles 4, 5."""
    return f"{'vehicle' if len(systems) == 1 else 'vehicles'} {', '.join(map(str, systems))}"


def in_use(swarm: Swarm) -> tuple[str, ...]:
    """Sentences for vehicles whose rotors turn before we asked for it: somebody else has them."""
    return tuple(
        f"vehicle {swarm.ids[row]} is armed already: whoever flies it lands it first"
        for row in np.flatnonzero(swarm.armed)
    )
