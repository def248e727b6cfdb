"""Artists whose coordinates, widths and letters are pixels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.collections import LineCollection, PathCollection, PolyCollection
from matplotlib.path import Path
from matplotlib.text import Text
from matplotlib.transforms import IdentityTransform

Array = npt.NDArray[np.float64]

DARK, PALE, RULE = "#22272e", "#626a75", "#d9dbd6"
"""Of words, of words that matter less, and of lines between them."""
FAILED = "#b2182b"
"""Of what went wrong, as trust_colour paints no trust."""
Colours = Any
"""One for all, or one for each: anything that matplotlib takes."""


def lines(segments: Sequence[Any], colours: Colours, widths: Any, **style: Any) -> LineCollection:
    """One line of (P, 2) px for each of the segments."""
    return LineCollection(
        segments,
        colors=colours,
        linewidths=widths,
        capstyle="butt",
        joinstyle="round",
        transform=IdentityTransform(),
        **style,
    )


def shapes(paths: Sequence[Path], colours: Colours, edges: Colours = "none", width: float = 0.0) -> PathCollection:
    """Filled outlines."""
    return PathCollection(paths, facecolors=colours, edgecolors=edges, linewidths=width, transform=IdentityTransform())


def boxes(corners: npt.ArrayLike, colours: Colours, edges: Colours = "none", width: float = 1.0) -> PolyCollection:
    """Rectangles, (K, 4) px: left, bottom, right, top."""
    left, bottom, right, top = np.atleast_2d(corners).astype(np.float64).T
    outline = np.stack([left, bottom, right, bottom, right, top, left, top], axis=-1).reshape(-1, 4, 2)
    return PolyCollection(
        list(outline), facecolors=colours, edgecolors=edges, linewidths=width, transform=IdentityTransform()
    )  # fmt: skip


def words(left: float, bottom: float, text: str, *, size: float = 13.0, colour: Any = DARK, **style: Any) -> Text:
    """Text as it stands, whatever signs are in it; bottom is that of its letters."""
    return Text(
        left, bottom, text,
        fontsize=size, color=colour, family="DejaVu Sans", parse_math=False, transform=IdentityTransform(), **style,
    )  # fmt: skip
