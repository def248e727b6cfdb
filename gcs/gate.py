"""The last function before a set-point leaves: whatever decided, this is what may fly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trustr.leader import capped

Array = npt.NDArray[np.float64]

PASSED, SLOWED, REFUSED = 0, 1, 2
"""Verdicts: as asked; limited in speed or acceleration; no number, so the vehicle is asked to stop."""


@dataclass(frozen=True, slots=True)
class Limits:
    """What a set-point may ask for at most."""

    speed: float
    """m/s, horizontal and vertical each."""
    acceleration: float
    """m/s², of one set-point against the one before."""


def admit(asked_ned: Array, before_ned: Array, limits: Limits, *, dt: float) -> tuple[Array, npt.NDArray[np.int8]]:
    """What is sent of what was asked, (N, 3) m/s, and a verdict for each vehicle, (N,).

    before_ned: (N, 3) m/s, the set-points sent last;  dt: s between the two.
    A set-point that is not finite becomes zero velocity. Speed is clamped before acceleration, and a clamped
    acceleration ends between two allowed velocities, so both bounds hold at once.
    """
    finite = np.asarray(np.isfinite(asked_ned).all(axis=1))
    wanted = np.where(finite[:, None], asked_ned, 0.0)
    wanted = _shorten(wanted, limits.speed)
    change = wanted - before_ned
    sent = before_ned + _shorten(change, limits.acceleration * dt)
    slowed = np.abs(sent - asked_ned).max(axis=1) > 1e-9
    verdict = np.where(finite, np.where(slowed, SLOWED, PASSED), REFUSED).astype(np.int8)
    return sent, verdict


def _shorten(vectors: Array, most: float) -> Array:
    """Vectors (N, 3) with their horizontal and vertical parts no longer than `most`."""
    shorter = np.empty_like(vectors)
    shorter[:, :2] = capped(vectors[:, :2], most)
    shorter[:, 2] = np.minimum(np.maximum(vectors[:, 2], -most), most)
    return shorter
