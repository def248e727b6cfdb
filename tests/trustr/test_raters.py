"""Models of people who rate a swarm."""

import numpy as np
import pytest

from trustr import raters
from trustr.raters import MODELS, Given
from trustr.rating import GIVEN_FAULTY, GIVEN_REPAIRED

N, FAULTY, ONSET_S = 6, 4, 10.0
TIME_S = np.arange(0.0, 30.05, 0.1)
PEOPLE = 400


def watched(*, onset_s=ONSET_S, time_s=TIME_S):
    """Who is faulty when: one robot of six, from onset on."""
    faulty = np.zeros((len(time_s), N), bool)
    faulty[time_s >= onset_s - 1e-9, FAULTY] = True
    return time_s, faulty


def ratings(model, seed=1, **seen):
    return MODELS[model](*watched(**seen), np.random.default_rng(seed))


def crowd(model, **seen):
    """What many people of one model say together."""
    return [given for seed in range(PEOPLE) for given in ratings(model, seed, **seen)]


def shares(given):
    return np.bincount([rating for _, _, rating in given], minlength=6)[1:] / len(given)


@pytest.mark.parametrize("model", MODELS)
def test_everyone_keeps_to_the_scale_to_the_robots_there_are_and_to_the_order_of_time(model):
    given = ratings(model)
    assert given
    assert {rating for _, _, rating in given} <= {1, 2, 3, 4, 5}
    assert {row for _, row, _ in given} <= {None, *range(N)}
    times = [when for when, _, _ in given]
    assert times == sorted(times)
    assert 0.0 <= times[0] <= times[-1] <= TIME_S[-1]
    assert all(isinstance(rating, int) and isinstance(when, float) for when, _, rating in given)


@pytest.mark.parametrize("model", MODELS)
def test_the_same_seed_is_the_same_person(model):
    assert ratings(model, seed=3) == ratings(model, seed=3)


@pytest.mark.parametrize("model", ["study", "heterogeneous", "realistic"])
def test_another_seed_is_another_person(model):
    assert ratings(model, seed=3) != ratings(model, seed=4)


def test_a_true_rater_rates_everybody_every_three_seconds_and_needs_a_second_to_notice():
    given = ratings("true")
    assert len(given) == 10 * N
    assert {rating for _, row, rating in given if row != FAULTY} == {5}
    assert [rating for _, row, rating in given if row == FAULTY] == [5, 5, 5, 1, 1, 1, 1, 1, 1, 1]
    late = ratings("true", onset_s=8.5)
    assert [rating for when, row, rating in late if row == FAULTY and when == 9.0] == [5]


def test_a_slow_rater_notices_eight_seconds_later():
    of_the_faulty = [(when, rating) for when, row, rating in ratings("slow") if row == FAULTY]
    assert of_the_faulty == [(10.0, 5), (20.0, 1), (30.0, 1)]
    assert [rating for _, row, rating in ratings("slow", onset_s=12.5) if row == FAULTY] == [5, 5, 1]


def test_a_lazy_rater_speaks_of_the_swarm_only():
    assert ratings("lazy") == [Given(12.0, None, 4), Given(24.0, None, 2)]


def test_an_adversary_says_the_opposite_of_everybody_all_the_time():
    given = ratings("adversarial")
    assert len(given) == len(TIME_S) * N
    said = {(row == FAULTY and when >= ONSET_S - 1e-9, rating) for when, row, rating in given}
    assert said == {(True, 5), (False, 1)}


def test_people_of_the_study_draw_from_its_tables():
    given = crowd("study", onset_s=0.0)
    assert shares([g for g in given if g.row == FAULTY]) == pytest.approx(GIVEN_FAULTY, abs=0.04)
    assert shares([g for g in given if g.row != FAULTY]) == pytest.approx(GIVEN_REPAIRED, abs=0.02)


@pytest.mark.parametrize(
    ("model", "faulty_mean", "repaired_mean", "area"),
    [("heterogeneous", 1.94, 3.83, 2221 / 2500), ("more-heterogeneous", 2.18, 4.08, 1985 / 2500)],
)
def test_a_heterogeneous_crowd_has_the_studys_means_and_effect_size(model, faulty_mean, repaired_mean, area):
    given = crowd(model, onset_s=0.0)
    faulty = np.array([g.rating for g in given if g.row == FAULTY])
    repaired = np.array([g.rating for g in given if g.row == 0])
    assert faulty.mean() == pytest.approx(faulty_mean, abs=0.15)
    assert repaired.mean() == pytest.approx(repaired_mean, abs=0.15)
    better = np.subtract.outer(repaired, faulty)
    assert ((better > 0) + 0.5 * (better == 0)).mean() == pytest.approx(area, abs=0.03)


def test_one_person_of_a_heterogeneous_crowd_is_lenient_or_strict_throughout():
    means = [np.mean([g.rating for g in ratings("more-heterogeneous", seed)]) for seed in range(PEOPLE)]
    within = [np.std([g.rating for g in ratings("more-heterogeneous", seed) if g.row == 0]) for seed in range(50)]
    assert np.std(means) > 3 * np.mean(within)


def test_few_realistic_people_blame_the_failed_robot_and_nobody_changes_their_mind():
    blamed = [{g.row for g in ratings("realistic", seed, onset_s=0.0) if g.row is not None} for seed in range(PEOPLE)]
    assert max(map(len, blamed)) == 1
    by_luck = (1 - raters.NAMED - raters.AREA) / N
    assert np.mean([rows == {FAULTY} for rows in blamed]) == pytest.approx(raters.NAMED + by_luck, abs=0.05)
    assert np.mean([not rows for rows in blamed]) == pytest.approx(raters.AREA, abs=0.08)


def test_realistic_people_rate_the_swarm_as_the_study_did():
    given = [g for g in crowd("realistic", onset_s=0.0) if g.row is None]
    assert shares(given) == pytest.approx(GIVEN_FAULTY, abs=0.04)
    healthy = [g for g in crowd("realistic", onset_s=99.0) if g.row is None]
    assert shares(healthy) == pytest.approx(GIVEN_REPAIRED, abs=0.04)
