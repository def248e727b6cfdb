"""Models of a person who watches a swarm and rates it: from who is faulty when, to who is rated how and when.

A model takes a time grid (T,), who is faulty at each of its times (T, N), and the randomness it needs. It looks up
every `every_s` and rates what could be noticed `reaction_s` earlier, starting from the belief that all are healthy. It
watches robots, not what a controller makes of them: a swarm that has a faulty robot is rated as the study's faulty one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numpy.random import Generator

from trustr.network import Array
from trustr.rating import GIVEN_FAULTY, GIVEN_REPAIRED, HIGHEST, LOWEST

Bools = npt.NDArray[np.bool_]

WORST, BEST = int(LOWEST), int(HIGHEST)
DISTRUST, TRUST = 2, 4
"""What the study's participants gave most: the words of its Table I."""
NAMED, AREA = 0.14, 0.46
"""Participants who identified the failed robot (11 % and 17 %), and who only identified the part of the swarm around it
(51 % and 41 %), means of both scenarios. Source: the study's results."""


class Given(NamedTuple):
    """One rating."""

    time_s: float
    row: int | None
    """None is the swarm as a whole."""
    rating: int


Rater = Callable[[Array, Bools, Generator], list[Given]]


def true(
    time_s: Array, faulty: Bools, _rng: Generator, *, every_s: float = 3.0, reaction_s: float = 1.0
) -> list[Given]:
    """Always right: 1 for the faulty, 5 for the healthy."""
    return [
        Given(when, row, WORST if fails else BEST)
        for when, noticed in _glances(time_s, faulty, every_s=every_s, reaction_s=reaction_s)
        for row, fails in enumerate(noticed)
    ]


slow = partial(true, every_s=10.0, reaction_s=8.0)
"""Always right, but late and seldom."""


def study(
    time_s: Array, faulty: Bools, rng: Generator, *, every_s: float = 5.0, reaction_s: float = 2.0
) -> list[Given]:
    """Knows who is who, and rates as the study's participants did: exactly what `rating.evidence` takes people for."""
    return [
        Given(when, row, _drawn(fails, rng))
        for when, noticed in _glances(time_s, faulty, every_s=every_s, reaction_s=reaction_s)
        for row, fails in enumerate(noticed)
    ]


def heterogeneous(
    time_s: Array,
    faulty: Bools,
    rng: Generator,
    *,
    every_s: float = 5.0,
    reaction_s: float = 2.0,
    spread: float = 1.2,
    faulty_centre: float = 1.76,
    repaired_centre: float = 3.94,
    slip: float = 0.5,
) -> list[Given]:
    """As `study`, with a leniency of one's own: two such people may use different ends of the scale.

    A rating is a normal number rounded to the scale. spread: its SD over all people and ratings, of which `slip` is one
    person's own from rating to rating;  centres: of the faulty and of the repaired.
    Source: these figures give means and U of the study's scenario 1: 1.94, 3.83, A = .89.
    """
    leniency = rng.normal(0.0, math.sqrt(spread**2 - slip**2))
    given = []
    for when, noticed in _glances(time_s, faulty, every_s=every_s, reaction_s=reaction_s):
        centre = np.where(noticed, faulty_centre, repaired_centre)
        felt = np.clip(np.rint(centre + leniency + rng.normal(0.0, slip, len(noticed))), LOWEST, HIGHEST)
        given += [Given(when, row, int(rating)) for row, rating in enumerate(felt)]
    return given


more_heterogeneous = partial(heterogeneous, spread=3.7, faulty_centre=0.91, repaired_centre=5.86)
"""The same for scenario 2, whose people agree less: 2.18, 4.08, A = .79."""


def realistic(
    time_s: Array,
    faulty: Bools,
    rng: Generator,
    *,
    every_s: float = 5.0,
    reaction_s: float = 2.0,
    named: float = NAMED,
    area: float = AREA,
) -> list[Given]:
    """Sees that something is wrong, and seldom who it is, as the study's participants.

    The swarm is rated as in the study. With a bad rating goes the same rating of whoever is thought to be behind it:
    with probability `named` a faulty robot, with `area` nobody in particular, else any robot. One stays with one's
    culprit until something changes.
    """
    given, seen, culprit = list[Given](), None, None
    for when, noticed in _glances(time_s, faulty, every_s=every_s, reaction_s=reaction_s):
        if seen is None or (noticed != seen).any():
            seen, culprit = noticed, _culprit(noticed, rng, named=named, area=area)
        rating = _drawn(bool(noticed.any()), rng)
        given.append(Given(when, None, rating))
        if culprit is not None and rating <= DISTRUST:
            given.append(Given(when, culprit, rating))
    return given


def lazy(
    time_s: Array, faulty: Bools, _rng: Generator, *, every_s: float = 12.0, reaction_s: float = 3.0
) -> list[Given]:
    """Right, but seldom, and only about the swarm as a whole."""
    return [
        Given(when, None, DISTRUST if noticed.any() else TRUST)
        for when, noticed in _glances(time_s, faulty, every_s=every_s, reaction_s=reaction_s)
    ]


def adversarial(time_s: Array, faulty: Bools, _rng: Generator) -> list[Given]:
    """Knows all at once and says the opposite, at every time of the grid: 5 for the faulty, 1 for the healthy."""
    return [
        Given(float(when), row, BEST if fails else WORST)
        for when, now in zip(time_s, faulty, strict=True)
        for row, fails in enumerate(now)
    ]


MODELS: dict[str, Rater] = {
    "true": true,
    "study": study,
    "heterogeneous": heterogeneous,
    "more-heterogeneous": more_heterogeneous,
    "realistic": realistic,
    "slow": slow,
    "lazy": lazy,
    "adversarial": adversarial,
}
"""Everyone, by name."""


def _glances(time_s: Array, faulty: Bools, *, every_s: float, reaction_s: float) -> Iterator[tuple[float, Bools]]:
    """When one looks up, and whom (N,) one has by then noticed to be faulty."""
    for number in range(1, math.floor(time_s[-1] / every_s + 1e-9) + 1):
        when = number * every_s
        index = int(np.searchsorted(time_s, when - reaction_s + 1e-9, side="right")) - 1
        yield when, faulty[index] if index >= 0 else np.zeros_like(faulty[0])


def _drawn(fails: bool, rng: Generator) -> int:
    return int(rng.choice(5, p=GIVEN_FAULTY if fails else GIVEN_REPAIRED)) + 1


def _culprit(noticed: Bools, rng: Generator, *, named: float, area: float) -> int | None:
    draw = rng.random()
    if draw < named:
        return int(rng.choice(np.flatnonzero(noticed))) if noticed.any() else None
    return None if draw < named + area else int(rng.integers(len(noticed)))
