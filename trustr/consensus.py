"""Update rules by name: what velocity a robot takes over from those it hears.

A rule maps what was heard to an `Agreement`. The paper's two are weighted means of whole velocities; the baselines
beside them are resilient consensus as its own papers have it. `docs/your-own-rule.md` shows how to fly one of your own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
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
    """(E,) ≥ 0, how much each edge counted, each robot's summing to 1; of a rule that picks by axis, the two's mean."""


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


def median(heard: Heard, _settings: Settings) -> Agreement:
    """For each axis the median of what a robot hears, its own included; of an even number, the mean of the middle two.

    Robots that say one and the same share its weight, so that nothing hangs on their order.
    """
    return _by_axis(heard, _median_weights)


def w_msr(heard: Heard, _settings: Settings, *, faults: int) -> Agreement:
    """W-MSR with parameter F = `faults`, for each axis on its own, all that stays weighted alike.

    LeBlanc, Zhang, Koutsoukos & Sundaram, "Resilient asymptotic consensus in robust networks", IEEE JSAC 31(4), 2013,
    the W-MSR algorithm: of the values strictly larger than its own a robot removes the F largest, or all if there are
    fewer than F; of those strictly smaller likewise; its own stays. So used for flocks by Saldaña, Prorok, Sundaram,
    Campos & Kumar, "Resilient consensus for time-varying networks of dynamic agents", ACC 2017.
    Where several say the F-th largest, the mean is the same whichever goes; they share what weight is left to them.
    """
    return _by_axis(heard, partial(_w_msr_weights, faults=faults))


def confidence_decay(heard: Heard, settings: Settings) -> Agreement:
    """Back to what a robot began with, the less so the longer it could learn whom to trust.

    x_i(t+1) = λ_t x_i(0) + (1 − λ_t) Σ_j w_ij(t) x_j(t) with λ_t = c e^(−γt), and w_ij = 1 / (|N_i(t)| + 1) for the
    robot itself and its trusted neighbours N_i(t), those with β_ij(t) = Σ (α_ij − ½) ≥ 0: Ballotta & Yemini, "The role
    of confidence for trust-based resilient consensus", ACC 2024 (arXiv:2404.07838). There each robot has evidence of
    its own; here all share one vector of trust, and β is `Heard.standing`. λ_t counts in the robot's weight on itself.
    """
    graph, first = heard.graph, settings.confidence * np.exp(-settings.confidence_decay * heard.time_s)
    itself = graph.receiver == graph.sender
    trusted = normalised(graph, (itself | (heard.standing[graph.sender] >= 0.0)).astype(np.float64))
    mean = weighted_mean(graph, trusted, heard.velocity_ne)
    return Agreement(first * heard.first_ne + (1.0 - first) * mean, first * itself + (1.0 - first) * trusted)


RULES: Mapping[str, Rule] = MappingProxyType(
    {
        "average": average,
        "trust-r": trust_r,
        "median": median,
        "wmsr-1": partial(w_msr, faults=1),
        "wmsr-2": partial(w_msr, faults=2),
        "confidence-decay": confidence_decay,
    }
)


def agreed(heard: Heard, weights: Array) -> Agreement:
    """What weights (E,) come to, as a weighted mean of the velocities heard."""
    return Agreement(weighted_mean(heard.graph, weights, heard.velocity_ne), weights)


def weighted_mean(graph: Graph, weights: Array, vectors_ne: Array) -> Array:
    """Eq. 12: u_i = Σ_k w_k v_k over k ∈ {i} ∪ N_i, (N, 2), from vectors (N, 2)."""
    mean = np.empty_like(vectors_ne)
    for axis in range(2):
        mean[:, axis] = graph.sum_by_receiver(weights * vectors_ne[graph.sender, axis])
    return mean


def _by_axis(heard: Heard, weigh: Callable[[Graph, Array], Array]) -> Agreement:
    """A weighted mean whose weights come, for each axis anew, from what is said along it.

    weigh: (graph, said (N,)) → (E,). It is shown 2 N robots with one number each: north, then east, which do not hear
    each other. For six robots that takes half the time of one axis after the other.
    """
    graph, said = heard.graph, heard.velocity_ne.T.ravel()
    east = graph.count
    both = Graph(
        2 * graph.count,
        np.concatenate([graph.receiver, graph.receiver + east]),
        np.concatenate([graph.sender, graph.sender + east]),
        np.concatenate([graph.distance, graph.distance]),
    )
    weights = weigh(both, said)
    mean = both.sum_by_receiver(weights * said[both.sender])
    return Agreement(mean.reshape(2, -1).T, weights.reshape(2, -1).mean(0))


def _median_weights(graph: Graph, said: Array) -> Array:
    lower, upper = graph.middle_by_receiver(said)
    value = said[graph.sender]
    is_lower = (value == lower[graph.receiver]).astype(np.float64)
    is_upper = (value == upper[graph.receiver]).astype(np.float64)
    return 0.5 * (normalised(graph, is_lower) + normalised(graph, is_upper))


def _w_msr_weights(graph: Graph, said: Array, *, faults: int) -> Array:
    ordered, begins = graph.sorted_by_receiver(said)
    begin, end = begins[:-1], begins[1:]
    # the F-th largest and smallest heard, its own included, or its own: then fewer than F are beyond it, and all go
    largest = np.maximum(said, ordered[np.maximum(end - faults, begin)])
    smallest = np.minimum(said, ordered[np.minimum(begin + faults, end) - 1])
    kept = _kept_below(graph, said, largest, faults) * _kept_below(graph, -said, -smallest, faults)
    return normalised(graph, kept)


def _kept_below(graph: Graph, said: Array, bound: Array, faults: int) -> Array:
    """What is left of each edge (E,) in [0, 1] once the largest are removed down to a receiver's bound (N,).

    Those above it go. Those at it go in part, F less as many as are above it, unless it is the receiver's own value.
    """
    excess = said[graph.sender] - bound[graph.receiver]
    kept = (excess <= 0.0).astype(np.float64)
    at_bound = excess == 0.0
    above, at = graph.sum_by_receiver(1.0 - kept), graph.sum_by_receiver(at_bound.astype(np.float64))
    share = np.where(bound > said, 1.0 - (faults - above) / np.maximum(at, 1.0), 1.0)
    return np.where(at_bound, share[graph.receiver], kept)
