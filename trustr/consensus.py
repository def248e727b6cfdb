"""Update rules by name: what velocity a robot takes over from those it hears.

A rule maps (graph, trust, settings) to one weight an edge; all of them are weighted means.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from trustr.network import Array, Graph, communication_quality, normalised

if TYPE_CHECKING:
    from trustr.controller import Settings

Rule = Callable[[Graph, Array, "Settings"], Array]
"""(graph, trust (N,), settings) → weights (E,), rows summing to 1."""


def average(graph: Graph, _trust: Array, _settings: Settings) -> Array:
    """Eq. 1: every robot heard, and the robot itself, counts the same: 1 / (|N_i| + 1)."""
    return normalised(graph, np.ones(len(graph.sender)))


def trust_r(graph: Graph, trust: Array, settings: Settings) -> Array:
    """Eq. 12 with the weights of eq. 17 and the communication quality of eq. 13."""
    quality = communication_quality(
        graph,
        trust,
        range_m=settings.range_m,
        best_range_m=settings.best_range_m,
        decay=settings.decay,
        eta=settings.eta,
        threshold=settings.threshold,
        weights=settings.weights,
    )
    return normalised(graph, quality)


RULES: Mapping[str, Rule] = MappingProxyType({"average": average, "trust-r": trust_r})


def weighted_mean(graph: Graph, weights: Array, velocity_ne: Array) -> Array:
    """Eq. 12: u_i = Σ_k w_k v_k over k ∈ {i} ∪ N_i, (N, 2) m/s, from measured velocities (N, 2) m/s."""
    mean = np.empty_like(velocity_ne)
    for axis in range(2):
        mean[:, axis] = graph.sum_by_receiver(weights * velocity_ne[graph.sender, axis])
    return mean
