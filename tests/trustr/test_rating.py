"""Five-level ratings as trust, and as evidence that ages out."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from trustr.evidence import HIGHEST, LOWEST, PRIOR
from trustr.rating import CAP, GIVEN_FAULTY, GIVEN_REPAIRED, aged, evidence, study_trust, told, trust_from_rating

SCALE = np.arange(1, 6)
RATINGS = st.integers(1, 5)


@st.composite
def swarms(draw):
    """(what ratings have said so far, how suspicious each robot is, whom the next rating is of)."""
    n = draw(st.integers(1, 12))
    gathered = draw(hnp.arrays(float, n, elements=st.floats(-CAP, CAP)))
    suspicion = draw(hnp.arrays(float, n, elements=st.floats(0, 1)))
    return gathered, suspicion, draw(st.none() | st.integers(0, n - 1))


# --- as trust


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


# --- as evidence


@pytest.mark.parametrize(("table", "mean"), [(GIVEN_FAULTY, 1.94), (GIVEN_REPAIRED, 3.83)])
def test_the_tables_have_the_means_of_the_study(table, mean):
    assert table.sum() == pytest.approx(1.0)
    assert table @ SCALE == pytest.approx(mean, abs=0.03)


def test_the_tables_have_the_effect_size_of_the_study():
    better = np.subtract.outer(SCALE, SCALE)
    area = GIVEN_REPAIRED @ np.where(better > 0, 1.0, np.where(better == 0, 0.5, 0.0)) @ GIVEN_FAULTY
    assert area == pytest.approx(2221 / 2500, abs=0.01)


def test_what_each_rating_says():
    expected = [1.5, math.log(0.32 / 0.09), math.log(0.20 / 0.24), -1.5, -1.5]
    assert evidence(SCALE) == pytest.approx(expected)
    assert evidence(2) == pytest.approx(expected[1])


def test_a_rating_of_one_robot_is_nobody_elses_business():
    assert told(np.zeros(3), np.full(3, 0.5), 1, 1) == pytest.approx([0.0, 1.5, 0.0])


def test_praise_of_the_swarm_counts_for_each_robot_alike():
    assert told(np.zeros(3), np.array([0.9, 0.1, 0.0]), 5, None) == pytest.approx([-1.5, -1.5, -1.5])


def test_blame_of_the_swarm_is_shared_out_by_suspicion():
    assert told(np.zeros(3), np.array([0.6, 0.3, 0.1]), 1, None) == pytest.approx([0.9, 0.45, 0.15])


def test_blame_of_a_swarm_without_a_suspect_is_shared_out_evenly():
    assert told(np.zeros(4), np.zeros(4), 1, None) == pytest.approx([0.375] * 4)


def test_no_crowd_talks_a_perfect_robot_down_or_an_unknown_one_or_a_hopeless_one_up():
    down = up = np.zeros(1)
    for _ in range(100):
        down, up = told(down, np.ones(1), 1, 0), told(up, np.ones(1), 5, 0)
    assert LOWEST + down < PRIOR + down < 0.0 < HIGHEST + up


@given(swarms(), st.lists(RATINGS, min_size=1, max_size=20))
def test_ratings_stay_finite_and_within_the_cap(swarm, ratings):
    gathered, suspicion, row = swarm
    for rating in ratings:
        gathered = told(gathered, suspicion, rating, row)
    assert np.isfinite(gathered).all()
    assert (np.abs(gathered) <= CAP).all()


@given(swarms(), RATINGS, RATINGS)
def test_a_better_rating_never_speaks_more_against_a_robot(swarm, one, other):
    gathered, suspicion, row = swarm
    worse, better = (told(gathered, suspicion, rating, row) for rating in sorted((one, other)))
    assert (worse >= better).all()


@given(swarms(), RATINGS, st.randoms(use_true_random=False))
def test_the_order_of_robots_does_not_matter(swarm, rating, random):
    gathered, suspicion, row = swarm
    order = np.array(random.sample(range(len(gathered)), len(gathered)))
    moved = None if row is None else int(np.flatnonzero(order == row)[0])
    assert told(gathered[order], suspicion[order], rating, moved) == pytest.approx(
        told(gathered, suspicion, rating, row)[order]
    )


# --- ageing


def test_a_rating_is_worth_1_over_e_after_its_time():
    assert aged(np.array([1.5, -3.0]), dt=20.0, age_out_s=20.0) == pytest.approx(np.array([1.5, -3.0]) / math.e)


@given(hnp.arrays(float, 3, elements=st.floats(-CAP, CAP)), st.integers(1, 50))
def test_ageing_in_many_steps_is_ageing_in_one(gathered, steps):
    left = gathered
    for _ in range(steps):
        left = aged(left, dt=3.0 / steps, age_out_s=7.0)
    assert left == pytest.approx(aged(gathered, dt=3.0, age_out_s=7.0))


@given(hnp.arrays(float, 3, elements=st.floats(-CAP, CAP)))
def test_in_the_end_nothing_is_left(gathered):
    assert aged(gathered, dt=1e6, age_out_s=20.0) == pytest.approx(0.0)
