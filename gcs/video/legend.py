"""What the signs of an explained film mean, below its map."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist

from gcs.trust_colour import trust_colour
from gcs.video.glyphs import cross, ring
from gcs.video.ink import DARK, FAILED, PALE, boxes, lines, shapes, words
from gcs.video.insight import GHOST, LINK_OPACITY, Insight

LEFT, UP = 26.0, 26.0
STEPS, STEP_PX = 24, 3.0
"""Of the ramp of colours."""
SIZE = 12


def legend(insight: Insight) -> Iterator[Artist]:
    """One line."""
    left = LEFT
    if insight.trusting:
        yield words(left, UP, "trust  0", size=SIZE, colour=PALE)
        left += 52.0
        edges = left + STEP_PX * np.arange(STEPS)
        ramp = [(edge, UP - 1.0, edge + STEP_PX, UP + 10.0) for edge in edges]
        yield boxes(ramp, trust_colour((np.arange(STEPS) + 0.5) / STEPS))
        left += STEP_PX * STEPS + 5.0
        yield words(left, UP, "1", size=SIZE, colour=PALE)
        left += 30.0
    link = [(*trust_colour(1.0), LINK_OPACITY)]
    signs: tuple[tuple[str, float, Artist], ...] = (
        ("faulty, in truth", 0.0, shapes([ring(_at(left, 0.0), 7.0)], "none", FAILED, 2.2)),
        ("leads", 132.0, shapes([ring(_at(left, 132.0), 6.0)], "none", DARK, 1.5)),
        ("where the swarm should be", 204.0, shapes([cross(_at(left, 204.0))], "none", GHOST, 2.0)),
        ("neighbours, as wide as each is heeded", 424.0, lines([[_at(left, 400.0), _at(left, 424.0)]], link, 3.0)),
    )
    for told, further, sign in signs:
        yield sign
        yield words(left + further + 14.0, UP, told, size=SIZE, colour=PALE)


def _at(left: float, further: float) -> npt.NDArray[np.float64]:
    """The middle of a sign."""
    return np.array([left + further, UP + 4.5])
