"""How each vehicle looks to a viewer: its colour is trust, its label says what else is worth knowing."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from gcs.gate import LOST_NS
from gcs.loop import Tick
from gcs.scoring import DISTRUSTED
from gcs.track import Parts
from gcs.trust_colour import trust_colour

Array = npt.NDArray[np.float64]

SHADES, UNASKED = 20, -1.0
"""Steps of trust: what changes by less looks as before; and the one that stands for a trust that nobody asked for."""
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


def shades(trust: Array) -> list[tuple[float, float, float]]:
    """Red, green, blue of each vehicle, of trusts (N,)."""
    return list(map(_shade, np.nan_to_num(np.round(trust * SHADES), nan=UNASKED).tolist()))


@cache
def _shade(step: float) -> tuple[float, float, float]:
    red, green, blue = trust_colour(np.nan if step == UNASKED else step / SHADES).tolist()
    return red, green, blue


def looks(tick: Tick, parts: Parts, trust: Array) -> list[Look]:
    """Of all vehicles. trust: (N,); NaN where the rule that flies them asks for none, and then nobody is distrusted."""
    swarm = tick.swarm
    told = (
        [system in parts.leaders for system in swarm.ids],
        (trust < DISTRUSTED).tolist(),
        [system in parts.left_behind for system in swarm.ids],
        (tick.time_ns - swarm.position_ns > LOST_NS).tolist(),
        tick.state.released.tolist(),
    )
    return [
        Look(colour, _label(system, flags), ringed=flags[1] or flags[2], faded=flags[3])
        for system, colour, *flags in zip(swarm.ids, shades(trust), *told, strict=True)
    ]


def _label(system: int, flags: list[bool]) -> str:
    words = [word for word, so in zip(WORDS, flags, strict=True) if so]
    return f"{system}: {', '.join(words)}" if words else str(system)
