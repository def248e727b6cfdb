"""Five-level ratings as trust."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trustr.rating import study_trust, trust_from_rating


@pytest.mark.parametrize(("rating", "trust"), [(1, 0.0), (2, 0.25), (3, 0.5), (4, 0.75), (5, 1.0)])
def test_the_scale_maps_evenly_onto_zero_to_one(rating, trust):
    assert trust_from_rating(rating) == trust


@pytest.mark.parametrize(("mean", "trust"), [(1.94, 0.235), (3.83, 0.7075), (2.18, 0.295), (4.08, 0.77)])
def test_means_of_the_study(mean, trust):
    assert trust_from_rating(mean) == pytest.approx(trust)


@given(st.floats(1, 5), st.floats(1, 5))
def test_the_mean_of_ratings_is_rated_as_the_mean_of_trusts(one, other):
    together = trust_from_rating((one + other) / 2)
    assert together == pytest.approx(trust_from_rating(np.array([one, other])).mean())


def test_failed_robots_get_one_mean_and_all_others_the_other():
    trust = study_trust(np.array([False, True, False]), faulty_rating=2.18, others_rating=4.08)
    assert trust == pytest.approx([0.77, 0.295, 0.77])
