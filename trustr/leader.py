"""The virtual leader (γ-robot) and the navigational feedback of eq. 11.

Leaders, and only they, know where the virtual leader is; the others follow through the consensus.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trustr.network import Array


@dataclass(frozen=True, slots=True, eq=False)
class VirtualLeader:
    """Where the mission wants the formation's mean to be, and how it moves there."""

    position_ne: Array
    """(2,) m."""
    velocity_ne: Array
    """(2,) m/s."""
    acceleration_ne: Array
    """(2,) m/s²; zero in the paper's profile, whose virtual leader changes velocity at once."""


def navigational_feedback(
    place_ne: Array,
    velocity_ne: Array,
    virtual: VirtualLeader,
    *,
    c1: float,
    c2: float,
    cap: float,
    lead_s: float = 0.0,
) -> Array:
    """u^γ of eq. 11 for each of L leaders, (L, 2) m/s; what answers errors is never longer than `cap`.

    u^γ = −c1 (x_i − x_γ + δx) − c2 (v_i − v_γ + δu) + lead_s a_γ

    place_ne: (L, 2) m, x_i + δx with the formation's offset taken off;  velocity_ne: (L, 2) m/s, v_i + δu.
    Measured of the leader itself, both hold all accumulated error already (δx = δu = 0); taken over the robots it
    trusts, δx and δu are the shift of the swarm against the leader. c1 in 1/s, c2 without unit.
    lead_s: feed-forward of the virtual leader's acceleration [s], our addition; the paper has none. Consensus over N
    robots that answer in τ seconds accelerates their mean velocity by (L/N) u^γ / τ, so τ N / L gives it a_γ.
    """
    wanted = -c1 * (place_ne - virtual.position_ne) - c2 * (velocity_ne - virtual.velocity_ne)
    return capped(wanted, cap) + lead_s * virtual.acceleration_ne


def capped(vectors_ne: Array, most: float) -> Array:
    """Vectors (M, 2), those longer than `most` shortened to it."""
    length = np.hypot(vectors_ne[:, 0], vectors_ne[:, 1])
    return np.asarray(vectors_ne * np.minimum(1.0, most / np.maximum(length, 1e-12))[:, None])
