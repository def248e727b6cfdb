"""How each vehicle looks to a viewer: its colour is trust, its label says what else is worth knowing."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gcs.gate import LOST_NS
from gcs.loop import Tick
from gcs.scoring import DISTRUSTED
from gcs.track import Parts
from gcs.trust_colour import trust_colour

SHADES = 20
"""Steps of trust: what changes by less looks as before."""
WORDS = "leads", "distrusted", "left behind", "silent", "not ours"


class Look(NamedTuple):
    """How one vehicle is to be drawn."""

    colour: tuple[float, float, float]
    """Red, green, blue."""
    label: str
    ringed: bool
    """Left behind or distrusted."""
    faded: bool
    """Silent."""


def looks(tick: Tick, parts: Parts, *, asks_for_trust: bool) -> list[Look]:
    """Of all vehicles. asks_for_trust: of the rule that flies them; where it does not, nobody is distrusted."""
    swarm = tick.swarm
    trust = tick.diagnosis.trust if asks_for_trust else np.full(len(swarm.ids), np.nan)
    colours = trust_colour(np.round(trust * SHADES) / SHADES).tolist()
    told = (
        [system in parts.leaders for system in swarm.ids],
        (trust < DISTRUSTED).tolist(),
        [system in parts.left_behind for system in swarm.ids],
        (tick.time_ns - swarm.position_ns > LOST_NS).tolist(),
        tick.state.released.tolist(),
    )
    return [
        Look(tuple(colour), _label(system, flags), ringed=flags[1] or flags[2], faded=flags[3])
        for system, colour, *flags in zip(swarm.ids, colours, *told, strict=True)
    ]


def _label(system: int, flags: list[bool]) -> str:
    words = [word for word, so in zip(WORDS, flags, strict=True) if so]
    return f"{system}: {', '.join(words)}" if words else str(system)
