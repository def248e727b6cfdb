"""Five-level ratings ↔ trust.

The study's scale is ordinal, 1 "completely distrust" to 5 "completely trust"; eq. 13 needs trust in [0, 1].
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from trustr.network import Array

LOWEST, HIGHEST = 1.0, 5.0


def trust_from_rating(rating: Array | float) -> Array:
    """Trust in [0, 1] of a rating, or of a mean of ratings, in [1, 5]: the ends of the scale are the ends of trust.

    (rating / 5 would give complete distrust a trust of 0.2, and lets the failed robot through: `docs/reproduction.md`.)
    """
    return np.asarray((np.asarray(rating, dtype=np.float64) - LOWEST) / (HIGHEST - LOWEST))


def study_trust(faulty: npt.NDArray[np.bool_], *, faulty_rating: float, others_rating: float) -> Array:
    """Trust of all robots (N,) from the user study's mean ratings of failed robots and of repaired swarms."""
    return np.where(faulty, trust_from_rating(faulty_rating), trust_from_rating(others_rating))
