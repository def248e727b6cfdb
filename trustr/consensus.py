"""Update rules by name: what velocity a robot takes over from those it hears.

A rule maps what was heard to an `Agreement`. The paper's two are weighted means; `docs/your-own-rule.md` shows how to
fly one of your own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from trustr.network import Array, Graph, communication_quality, normalised

if TYPE_CHECKING:
    from trustr.controller import Settings


@dataclass(frozen=True, slots=True, eq=False)
class Heard:
    """What a rule may go by."""

    graph: Graph
    """Who hears whom; each robot hears itself."""
    velocity_ne: Array
    """(N, 2) m/s, measured; zero for robots that nobody hears."""
    trust: Array
    """(N,) in [0, 1]."""
    time_s: float
    """Since mission start."""
    first_ne: Array
    """(N, 2) m/s: the velocities at the mission's first tick."""
    standing: Array
    """(N,) s: ∫ (trust − ½) dt since mission start; who has more trust than doubt behind it is above 0."""


@dataclass(frozen=True, slots=True, eq=False)
class Agreement:
    """What a rule makes of it."""

    velocity_ne: Array
    """(N, 2) m/s for each robot to take over."""
    weights: Array
    """(E,) how much each edge counted, each robot's summing to 1; a rule that picks by axis gives the mean of the two."""


Rule = Callable[[Heard, "Settings"], Agreement]


def average(heard: Heard, _settings: Settings) -> Agreement:
    """Eq. 1: every robot heard, and the robot itself, counts the same: 1 / (|N_i| + 1)."""
    return agreed(heard, normalised(heard.graph, np.ones(len(heard.graph.sender))))


def trust_r(heard: Heard, settings: Settings) -> Agreement:
    """Eq. 12 with the weights of eq. 17 and the communication quality of eq. 13."""
    quality = communication_quality(
        heard.graph,
        heard.trust,
        range_m=settings.range_m,
        best_range_m=settings.best_range_m,
        decay=settings.decay,
        eta=settings.eta,
        threshold=settings.threshold,
        weights=settings.weights,
    )
    return agreed(heard, normalised(heard.graph, quality))


RULES: Mapping[str, Rule] = MappingProxyType({"average": average, "trust-r": trust_r})


def agreed(heard: Heard, weights: Array) -> Agreement:
    """What weights (E,) come to, as a weighted mean of the velocities heard."""
    return Agreement(weighted_mean(heard.graph, weights, heard.velocity_ne), weights)


def weighted_mean(graph: Graph, weights: Array, vectors_ne: Array) -> Array:
    """Eq. 12: u_i = Σ_k w_k v_k over k ∈ {i} ∪ N_i, (N, 2), from vectors (N, 2)."""
    mean = np.empty_like(vectors_ne)
    for axis in range(2):
        mean[:, axis] = graph.sum_by_receiver(weights * vectors_ne[graph.sender, axis])
    return mean
