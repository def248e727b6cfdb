"""Who was distrusted when, and whether rightly: what the story, the table and the caption under trust all tell."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gcs.report.told import Told
from gcs.scoring import DISTRUSTED


@dataclass(frozen=True, slots=True)
class Distrust:
    """Of one robot, up to the read-out; seconds since mission start, NaN where it never came to that."""

    system: int
    onset_s: float
    """When the first of its faults began; infinite where it had none, or nobody knows."""
    wrongly_s: float
    """When its trust fell below one half with nothing wrong yet."""
    rightly_s: float
    """When its trust was below one half for the first time since its fault began."""
    trusted_again: bool
    """Whether its trust was back above one half as the mission ended."""

    @property
    def delay_s(self) -> float:
        """From the onset until it was found."""
        return round(self.rightly_s - self.onset_s, 6)

    @property
    def missed(self) -> bool:
        """Whether it failed, and was trusted from then on."""
        return math.isfinite(self.onset_s) and math.isnan(self.rightly_s)

    @property
    def found(self) -> bool:
        """Whether it failed, and was distrusted."""
        return not math.isnan(self.rightly_s)

    @property
    def wronged(self) -> bool:
        """Whether it was distrusted before anything was known to be wrong with it."""
        return not math.isnan(self.wrongly_s)


def distrusts(told: Told) -> tuple[Distrust, ...]:
    """Of robots that failed, that were distrusted, or both; none where the rule asks for no trust."""
    return tuple(_all(told)) if told.trust_source is not None and told.mission.size else ()


def _all(told: Told) -> Iterator[Distrust]:
    time_s, trust = told.history.mission_s[told.mission], told.history.trust[told.mission]
    for column, system in enumerate(told.history.ids):
        onset_s = told.onsets.get(system, math.inf)
        low, failed = trust[:, column] < DISTRUSTED, time_s >= onset_s - 1e-9
        if low.any() or system in told.onsets:
            yield Distrust(
                system,
                onset_s,
                wrongly_s=_first(time_s[low & ~failed]),
                rightly_s=_first(time_s[low & failed]),
                trusted_again=bool(low.any()) and not bool(low[np.isfinite(trust[:, column])][-1]),
            )


def _first(times_s: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
    return float(times_s[0]) if times_s.size else math.nan
