"""Intervals at 95 %: of a mean, of a share, and of the difference of two shares over the same seeds."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

Z = statistics.NormalDist().inv_cdf(0.975)


@dataclass(frozen=True, slots=True)
class Spread:
    """A figure over seeds."""

    mean: float
    ci95: float
    """Half the 95 % interval of the mean (Student's t)."""
    p90: float

    @property
    def plus_minus(self) -> str:
        """The interval behind the mean, in words; one seed has none."""
        return "" if math.isnan(self.ci95) else f" ± {self.ci95:.2f}"

    @staticmethod
    def of(values: Sequence[float]) -> Spread:
        """Of one value a seed."""
        from scipy.special import stdtrit  # scipy.stats, which has the same, takes a second to import

        n = len(values)
        if n == 1:
            return Spread(values[0], float("nan"), values[0])
        half = float(stdtrit(n - 1, 0.975)) * statistics.stdev(values) / n**0.5
        return Spread(statistics.fmean(values), half, float(np.percentile(values, 90)))


@dataclass(frozen=True, slots=True)
class Share:
    """How many of how many."""

    count: int
    n: int
    rate: float
    low: float
    """Of the 95 % interval (Wilson's score); so high."""
    high: float

    @staticmethod
    def of(count: int, n: int) -> Share:
        """Holds its level from few trials on and at 0 and n of n alike.

        Source: E. B. Wilson (1927), J. Am. Stat. Assoc. 22, 209–212; as recommended by R. G. Newcombe (1998),
        Statistics in Medicine 17, 857–872.
        """
        if n == 0:
            return Share(0, 0, math.nan, math.nan, math.nan)
        rate = count / n
        centre = (rate + Z * Z / (2 * n)) / (1 + Z * Z / n)
        half = Z * math.sqrt(rate * (1 - rate) / n + Z * Z / (4 * n * n)) / (1 + Z * Z / n)
        low = 0.0 if count == 0 else centre - half
        high = 1.0 if count == n else centre + half
        return Share(count, n, rate, low, high)


@dataclass(frozen=True, slots=True)
class PairedDifference:
    """How much more often one of two passes, over the same seeds."""

    pairs: int
    won: int
    """Pairs in which this one alone passed."""
    lost: int
    """Pairs in which the other alone passed."""
    difference: float
    """Of the pass rates, this one's minus the other's."""
    low: float
    """Of the 95 % interval; so high."""
    high: float

    @staticmethod
    def of(passes: Sequence[tuple[bool, bool]]) -> PairedDifference:
        """Of (this one passed, the other passed), one a seed.

        The adjusted Wald interval: one pair is added to each of the two outcomes in which they disagree, and so two to
        the number of pairs; it keeps a width where they never disagree. Pooled over conditions whose rates differ it is
        on the safe side: a binomial variance is at least the sum of its strata's.
        Source: D. G. Bonett, R. M. Price (2012), Journal of Educational and Behavioral Statistics 37, 479–488; as
        recommended by M. W. Fagerland, S. Lydersen, P. Laake (2014), Statistics in Medicine 33, 2850–2875.
        """
        n = len(passes)
        won, lost = sum(a and not b for a, b in passes), sum(b and not a for a, b in passes)
        p_won, p_lost = (won + 1) / (n + 2), (lost + 1) / (n + 2)
        centre = p_won - p_lost
        half = Z * math.sqrt((p_won + p_lost - centre * centre) / (n + 2))
        difference = (won - lost) / n if n else math.nan
        return PairedDifference(n, won, lost, difference, max(centre - half, -1.0), min(centre + half, 1.0))
