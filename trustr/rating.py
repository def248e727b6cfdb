"""Five-level ratings: as trust, and as evidence of a fault that ages out.

The study's scale is ordinal, 1 "completely distrust" to 5 "completely trust"; eq. 13 needs trust in [0, 1]. Evidence is
in log odds of being faulty: positive speaks against a robot.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from trustr.network import Array

LOWEST, HIGHEST = 1.0, 5.0
GIVEN_FAULTY = np.array([0.41, 0.32, 0.20, 0.06, 0.01])
GIVEN_REPAIRED = np.array([0.02, 0.09, 0.24, 0.32, 0.33])
"""P(rating 1…5) in the faulty and in the repaired condition. Source: fitted to the study's means of scenario 1, 1.94
and 3.83; being normal distributions of SD 1.2 rounded to the scale, they give its U (A = 0.89) too."""
MOST_AT_ONCE = 1.5
"""What one rating may say at most: a single 5 for a faulty robot would be e^3.5 to 1, and people slip."""
CAP = 2.9
"""What all ratings together may say: a robot whose own evidence is as good as it gets (−4), or of which nothing is
known yet (−2.94), cannot be talked below trust 0.5, nor one whose evidence is as bad as it gets (+6) be talked back."""
_EVIDENCE = np.clip(np.log(GIVEN_FAULTY / GIVEN_REPAIRED), -MOST_AT_ONCE, MOST_AT_ONCE)


def trust_from_rating(rating: Array | float) -> Array:
    """Trust in [0, 1] of a rating, or of a mean of ratings, in [1, 5]: the ends of the scale are the ends of trust.

    (rating / 5 would give complete distrust a trust of 0.2, and lets the failed robot through: `docs/reproduction.md`.)
    """
    return np.asarray((np.asarray(rating, dtype=np.float64) - LOWEST) / (HIGHEST - LOWEST))


def study_trust(faulty: npt.NDArray[np.bool_], *, faulty_rating: float, others_rating: float) -> Array:
    """Trust of all robots (N,) from the user study's mean ratings of failed robots and of repaired swarms."""
    return np.where(faulty, trust_from_rating(faulty_rating), trust_from_rating(others_rating))


def evidence(rating: npt.NDArray[np.integer] | int) -> Array:
    """What ratings 1…5 say: ln P(r | faulty) / P(r | repaired), clipped to ±MOST_AT_ONCE."""
    return np.asarray(_EVIDENCE[np.asarray(rating) - 1])


def told(gathered: Array, suspicion: Array, rating: int, row: int | None, *, cap: float = CAP) -> Array:
    """Add one rating to what ratings have said so far.

    gathered:  (N,) log odds, each within ±cap;  suspicion: (N,) in [0, 1], how probable it is that each robot is faulty
    row:       whom it rates; None is the swarm as a whole. A good rating of the swarm speaks for every robot alike. A
               bad one says that somebody fails, not who: it is shared out in proportion to suspicion
    cap:       log odds, what all ratings together may say for or against a robot
    """
    says = float(evidence(rating))
    if row is not None:
        share = np.arange(len(gathered)) == row
    elif says > 0.0:
        total = suspicion.sum()
        share = suspicion / total if total > 0.0 else np.full(len(gathered), 1.0 / len(gathered))
    else:
        share = np.ones(len(gathered))
    return np.asarray(np.clip(gathered + says * share, -cap, cap))


def aged(gathered: Array, *, dt: float, age_out_s: float) -> Array:
    """What is left, dt seconds later, of what ratings have said (N,): it falls to 1/e in age_out_s."""
    return gathered * math.exp(-dt / age_out_s)
