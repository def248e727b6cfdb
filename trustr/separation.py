"""Keeping apart: a push that grows linearly as two robots come closer than a radius."""

from __future__ import annotations

import numpy as np

from trustr.network import Array, Graph


def separation(graph: Graph, position_ne: Array, *, radius: float, gain: float) -> Array:
    """Velocity that opens gaps smaller than `radius`, (N, 2) m/s.

    Each pair closer than the radius [m] is pushed apart along its line by gain [1/s] × (radius − distance); trust plays
    no part. Two robots in exactly one place get no direction, and no push.
    """
    close = (graph.distance < radius) & (graph.receiver != graph.sender) & (graph.distance > 0.0)
    push = np.zeros_like(position_ne)
    if close.any():
        receiver, distance = graph.receiver[close], graph.distance[close]
        away = (position_ne[receiver] - position_ne[graph.sender[close]]) / distance[:, None]
        np.add.at(push, receiver, gain * (radius - distance)[:, None] * away)
    return push
