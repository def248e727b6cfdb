"""Who hears whom, how well (eq. 13), and with what weight (eq. 17).

The graph is kept as a list of edges (receiver ← sender), each robot's edge to itself included, so that six robots and a
thousand run through the same lines.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

DENSE_BELOW = 50
"""Robots: up to here all pairs at once beat the tree (tests/benchmarks/controller.py)."""


@dataclass(frozen=True, slots=True, eq=False)
class Graph:
    """Directed edges among `count` robots. Edge k carries what robot sender[k] says to robot receiver[k]."""

    count: int
    """Number of robots, N."""
    receiver: npt.NDArray[np.intp]
    """(E,) row indices."""
    sender: npt.NDArray[np.intp]
    """(E,) column indices; every robot has one edge to itself."""
    distance: Array
    """(E,) m, horizontal."""

    def sum_by_receiver(self, values: Array) -> Array:
        """Sum (E,) edge values over what each robot hears: (N,)."""
        sums: Array = np.bincount(self.receiver, weights=values, minlength=self.count).astype(np.float64, copy=False)
        return sums

    def sorted_by_receiver(self, values: Array) -> tuple[Array, npt.NDArray[np.intp]]:
        """What the robots say, values (N,), as each of them hears it: ascending, one receiver after the other, (E,).

        The second is where each receiver's part begins, and where the last one's ends, (N + 1,).
        """
        by_rank = np.argsort(values)
        rank = np.empty_like(by_rank)
        rank[by_rank] = np.arange(self.count)
        order = np.sort(self.receiver * self.count + rank[self.sender])  # integers sort ten times as fast as pairs
        begins = np.zeros(self.count + 1, np.intp)
        np.cumsum(np.bincount(self.receiver, minlength=self.count), out=begins[1:])
        return values[by_rank[order % self.count]], begins

    def middle_by_receiver(self, values: Array) -> tuple[Array, Array]:
        """The middle two of what each robot hears, values (N,): (N,) each, and the same of an odd number."""
        ordered, begins = self.sorted_by_receiver(values)
        among = np.diff(begins)
        return ordered[begins[:-1] + (among - 1) // 2], ordered[begins[:-1] + among // 2]

    def without(self, senders: npt.NDArray[np.bool_]) -> Graph:
        """The same, with these robots (N,) speaking to themselves only."""
        if not senders.any():
            return self
        kept = ~senders[self.sender] | (self.sender == self.receiver)
        return Graph(self.count, self.receiver[kept], self.sender[kept], self.distance[kept])

    def dense(self, values: Array) -> Array:
        """Edge values as an (N, N) matrix, row i is what robot i hears; 0 where there is no edge."""
        matrix = np.zeros((self.count, self.count))
        matrix[self.receiver, self.sender] = values
        return matrix


def neighbours(position_ne: Array, heard: npt.NDArray[np.bool_], *, range_m: float) -> Graph:
    """The communication graph E = {(i, j) | j ∈ N_i} of the paper, N_i = {j : ‖x_i − x_j‖ < R}, self edges added.

    position_ne: (N, 2) m;  heard: (N,) False for robots whose data are stale: they neither speak nor listen, and are
    left with their edge to themselves;  range_m: R.
    """
    count = len(position_ne)
    position = np.where(heard[:, None], position_ne, np.inf) if not heard.all() else position_ne
    if count <= DENSE_BELOW:
        with np.errstate(invalid="ignore"):  # inf − inf of two silent robots is NaN, and NaN is not below R
            north = np.subtract.outer(position[:, 0], position[:, 0])
            east = np.subtract.outer(position[:, 1], position[:, 1])
            distance = np.hypot(north, east)
        near = distance < range_m
        np.fill_diagonal(near, True)
        receiver, sender = np.nonzero(near)
        length = np.where(receiver == sender, 0.0, distance[receiver, sender])
        return Graph(count, receiver, sender, length)
    return _neighbours_by_tree(position, np.flatnonzero(heard), range_m)


def _neighbours_by_tree(position: Array, heard: npt.NDArray[np.intp], range_m: float) -> Graph:
    from scipy.spatial import cKDTree  # a third of a second to import, for swarms that need it

    pairs = cKDTree(position[heard]).query_pairs(range_m, output_type="ndarray")
    first, second = heard[pairs[:, 0]], heard[pairs[:, 1]]
    north, east = (position[first, axis] - position[second, axis] for axis in range(2))
    distance = np.hypot(north, east)
    near = distance < range_m  # the tree's bound is inclusive, the paper's is not
    first, second, distance = first[near], second[near], distance[near]
    itself = np.arange(len(position))
    return Graph(
        len(position),
        np.concatenate([itself, first, second]),
        np.concatenate([itself, second, first]),
        np.concatenate([np.zeros(len(position)), distance, distance]),
    )


def communication_quality(
    graph: Graph,
    trust: Array,
    *,
    range_m: float,
    best_range_m: float,
    decay: float,
    eta: float,
    threshold: float,
    weights: Literal["sender", "literal"],
) -> Array:
    """Quality f_ij of what i hears from j, eq. 13: ½ (g_i + g_j) η E(d_ij), (E,) in [0, 1].

    trust: (N,) g in [0, 1];  range_m, best_range_m, decay: R, ρ, γ with 0 < ρ < R.
    weights: with "sender", η is `eta` for senders with trust below `threshold` and 1 for the others. With "literal" η
    is one constant as the paper prints it; it then cancels in eq. 17, where f_ii carries it too.
    """
    mean_trust = 0.5 * (trust[graph.receiver] + trust[graph.sender])
    beyond = np.maximum(graph.distance - best_range_m, 0.0)
    fade = np.exp(-decay * beyond / (range_m - best_range_m))
    if weights == "literal":
        return mean_trust * fade * eta
    return mean_trust * fade * np.where(trust[graph.sender] < threshold, eta, 1.0)


def normalised(graph: Graph, quality: Array) -> Array:
    """Weights w_k = f̂_k / Σ f̂ over {i} ∪ N_i, eq. 17: (E,) ≥ 0, each robot's summing to 1.

    A robot all of whose qualities are zero, its own included, keeps its own velocity: weight 1 on itself.
    """
    total = graph.sum_by_receiver(quality)
    lost = total <= 0.0
    if lost.any():
        itself = graph.receiver == graph.sender
        quality = np.where(itself & lost[graph.receiver], 1.0, quality)
        total = np.where(lost, 1.0, total)
    weights: Array = quality / total[graph.receiver]
    return weights
