"""Keeping apart: a push that grows linearly as two robots come closer than a radius."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from trustr.network import Array, Graph


def separation(
    graph: Graph,
    position_ne: Array,
    *,
    radius: float,
    gain: float,
    shunned: npt.NDArray[np.bool_] | None = None,
    berth: float = 0.0,
    berth_gain: float = 0.0,
) -> Array:
    """Velocity that opens gaps smaller than `radius`, (N, 2) m/s.

    Each robot is pushed away from each other robot that is closer than the radius [m], along their line, by
    gain [1/s] × (radius − distance). Two robots in exactly one place get no direction, and no push.
    shunned: (N,) robots that others give a wide berth: from them, `berth` [m] and `berth_gain` [1/s] hold where they
    push harder. A robot that does not do what it is told does not make room either, so whoever can, must.
    """
    reach = max(radius, berth)
    close = (graph.distance < reach) & (graph.receiver != graph.sender) & (graph.distance > 0.0)
    push = np.zeros_like(position_ne)
    if close.any():
        receiver, sender, distance = graph.receiver[close], graph.sender[close], graph.distance[close]
        speed = gain * np.maximum(radius - distance, 0.0)
        if shunned is not None:
            speed = np.where(shunned[sender], np.maximum(speed, berth_gain * (berth - distance)), speed)
        away = (position_ne[receiver] - position_ne[sender]) / distance[:, None]
        np.add.at(push, receiver, speed[:, None] * away)
    return push
