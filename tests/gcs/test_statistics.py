"""Intervals against values that others have published, and at their ends."""

from math import isnan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcs.statistics import PairedDifference, Share, Spread

GAIN = (1.2, 2.4, 1.3, 1.3, 0.0, 1.0, 1.8, 0.8, 4.6, 1.4)
"""Hours of sleep, the second drug's minus the first's: Student (1908), Biometrika 6; its interval is R's `t.test`."""


@pytest.fixture(scope="module")
def stats():
    """Imported where it is used: it takes a second, and every process that runs tests collects this file."""
    from scipy import stats

    return stats


@pytest.mark.parametrize(
    ("count", "n", "low", "high"),
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0000, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_wilsons_interval_is_that_of_newcombes_table(count, n, low, high):
    """R. G. Newcombe (1998), Statistics in Medicine 17, table I, method 3."""
    share = Share.of(count, n)
    assert (share.low, share.high) == pytest.approx((low, high), abs=5e-5)


def test_wilsons_interval_of_all_is_the_mirror_of_none():
    none, every = Share.of(0, 30), Share.of(30, 30)
    assert (none.low, every.high) == (0.0, 1.0)
    assert none.high == pytest.approx(1 - every.low)
    assert none.high == pytest.approx(0.1135, abs=5e-5)


@given(st.integers(1, 500).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_wilsons_interval_is_scipys_and_holds_its_rate(stats, case):
    count, n = case
    share = Share.of(count, n)
    other = stats.binomtest(count, n).proportion_ci(method="wilson")
    assert (share.low, share.high) == pytest.approx((other.low, other.high), abs=1e-9)
    assert 0 <= share.low <= share.rate <= share.high <= 1


def test_a_share_of_nothing_has_no_rate():
    share = Share.of(0, 0)
    assert isnan(share.rate)
    assert isnan(share.low)


def pairs(both, won, lost, neither):
    return [(True, True)] * both + [(True, False)] * won + [(False, True)] * lost + [(False, False)] * neither


def test_the_paired_interval_is_that_of_a_published_example():
    """Airways before and after a transplantation (Bentur et al. 2009), in table V of Fagerland et al. (2014)."""
    found = PairedDifference.of(pairs(1, 1, 7, 12))
    assert found.difference == pytest.approx(-0.286, abs=5e-4)
    assert (found.low, found.high) == pytest.approx((-0.508, -0.013), abs=5e-4)


def test_the_paired_interval_counts_one_more_pair_in_each_of_the_outcomes_that_disagree():
    """The same pairs by hand: (1 + 1) and (7 + 1) of 21 + 2."""
    won, lost = 2 / 23, 8 / 23
    half = 1.959964 * ((won + lost - (won - lost) ** 2) / 23) ** 0.5
    found = PairedDifference.of(pairs(1, 1, 7, 12))
    assert (found.low, found.high) == pytest.approx((won - lost - half, won - lost + half))


def test_two_that_never_disagree_in_thirty_pairs_still_have_an_interval():
    found = PairedDifference.of(pairs(30, 0, 0, 0))
    half = 1.959964 * (2 / 32 / 32) ** 0.5
    assert found.difference == 0
    assert (found.low, found.high) == pytest.approx((-half, half))
    assert half == pytest.approx(0.0866, abs=5e-5)


@given(st.integers(0, 60), st.integers(0, 60), st.integers(0, 60), st.integers(0, 60))
def test_the_paired_interval_turns_round_with_the_pair_and_does_not_see_where_both_agree(both, won, lost, neither):
    one, other = (
        PairedDifference.of(pairs(both, won, lost, neither)),
        PairedDifference.of(pairs(both, lost, won, neither)),
    )
    assert (one.low, one.high) == pytest.approx((-other.high, -other.low))
    assert -1 <= one.low <= one.high <= 1
    swapped = PairedDifference.of(pairs(neither, won, lost, both))
    assert (swapped.low, swapped.high) == (one.low, one.high)


def test_the_paired_interval_holds_its_level_at_thirty_pairs(stats):
    """Exactly, by the multinomial's sum, where the two disagree in a tenth of the pairs and neither is better."""
    n, disagree = 30, 0.1
    covered = 0.0
    for discordant in range(n + 1):
        weight = stats.binom.pmf(discordant, n, disagree)
        for won in range(discordant + 1):
            found = PairedDifference.of(pairs(n - discordant, won, discordant - won, 0))
            covered += weight * stats.binom.pmf(won, discordant, 0.5) * (found.low <= 0 <= found.high)
    assert covered >= 0.95


def test_the_means_interval_is_students():
    spread = Spread.of(GAIN)
    low, high = spread.mean - spread.ci95, spread.mean + spread.ci95
    assert (low, high) == pytest.approx((0.7001142, 2.4598858), abs=1e-6)


def test_a_spread_knows_its_tail_and_one_value_has_no_interval(stats):
    values = [1.0, 2.0, 4.0, 5.0]
    spread = Spread.of(values)
    low, high = stats.t.interval(0.95, 3, loc=3.0, scale=stats.sem(values))
    assert (spread.mean - spread.ci95, spread.mean + spread.ci95) == pytest.approx((low, high))
    assert spread.p90 == pytest.approx(4.7)  # a tenth from the end of three gaps
    assert isnan(Spread.of([1.0]).ci95)
