"""Outlines in pixels: robots from above, with a nose that says where they point; rings and crosses."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from matplotlib.path import Path

Array = npt.NDArray[np.float64]

LEAST, MOST, NATURAL_M = 5.0, 10.0, 0.65
"""Pixels from the middle to a rotor's axis, and the metres that they would be on the map's scale."""
ROTOR, BODY, BEAM = 0.52, 0.36, 0.14
"""Radii, and half the width of a beam, in arms."""
NOSE = ((1.75, 0.0), (0.2, -0.32), (0.2, 0.32))
SIDES = 14
"""Of what looks like a circle."""
CROSS_PX = 7.0


def arm(scale: float) -> float:
    """Pixels from the middle of a robot to its rotors' axes, on a map of so many pixels a metre."""
    return min(max(NATURAL_M * scale, LEAST), MOST)


def quadrotors(middle: Array, yaw: Array, *, arm: float) -> list[Path]:
    """N outlines in pixels, at middles (N, 2) px, pointing to yaws (N,) rad clockwise from upwards."""
    ahead = np.column_stack([np.sin(yaw), np.cos(yaw)])
    right = np.column_stack([np.cos(yaw), -np.sin(yaw)])
    corners = arm * (OUTLINE[:, 0, None] * ahead[:, None] + OUTLINE[:, 1, None] * right[:, None])
    return [Path(vertices, CODES) for vertices in middle[:, None] + corners]


def ring(middle: Array, radius: float) -> Path:
    """A circle round a place (2,) px."""
    circle = Path.unit_circle()
    return Path(middle + radius * np.asarray(circle.vertices, np.float64), circle.codes)


def cross(middle: Array) -> Path:
    """Two strokes at a place (2,) px."""
    ends = CROSS_PX * np.array([(-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0)])
    return Path(middle + ends, [Path.MOVETO, Path.LINETO, Path.MOVETO, Path.LINETO])


def _circle(ahead: float, right: float, radius: float) -> Array:
    angle = np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)
    return np.column_stack([ahead + radius * np.sin(angle), right + radius * np.cos(angle)])


def _beam(ahead: float, right: float) -> Array:
    """From one rotor, through the middle, to the one opposite."""
    along, aside = np.array([ahead, right]), BEAM * np.array([right, -ahead])
    return np.array([along - aside, along + aside, -along + aside, -along - aside])


def _outline() -> tuple[Array, npt.NDArray[np.uint8]]:
    """(V, 2) ahead and to the right, in arms, all pieces the same way round; and what to do with each vertex."""
    half = 0.5**0.5
    front = (half, half), (half, -half)
    rotors = [_circle(sign * ahead, sign * right, ROTOR) for ahead, right in front for sign in (1.0, -1.0)]
    pieces = [*rotors, *(_beam(*axis) for axis in front), _circle(0.0, 0.0, BODY), np.array(NOSE)]
    closed = [np.concatenate([piece, piece[:1]]) for piece in pieces]
    codes = [[Path.MOVETO, *[Path.LINETO] * (len(piece) - 2), Path.CLOSEPOLY] for piece in closed]
    return np.concatenate(closed), np.concatenate(codes).astype(np.uint8)


OUTLINE, CODES = _outline()
