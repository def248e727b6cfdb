"""One colour for trust, wherever it is shown: deep red of none, by amber, to blue of all; grey where nobody asks."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

STOPS = np.array([0.0, 0.5, 1.0])
"""Trust."""
COLOURS = np.array([[0.698, 0.094, 0.169], [0.882, 0.620, 0.180], [0.129, 0.400, 0.675]])
"""Red, green and blue at the stops, 0 … 1: apart for people who see no red or no green, and by lightness at the ends.

The ends are those of ColorBrewer's RdBu, which it calls safe for the colour-blind.
"""
UNASKED = np.array([0.45, 0.47, 0.50])


def trust_colour(trust: npt.ArrayLike) -> Array:
    """(…, 3) red, green, blue in 0 … 1 of trusts (…); grey of NaN."""
    asked = np.asarray(trust, dtype=np.float64)
    known = np.nan_to_num(asked)
    channels = np.stack([np.interp(known, STOPS, COLOURS[:, channel]) for channel in range(3)], axis=-1)
    return np.where(np.isnan(asked)[..., None], UNASKED, channels)
