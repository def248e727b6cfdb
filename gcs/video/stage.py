"""Draws picture after picture fast: the ground once, what changes at a tick when it does, what moves every time."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from gcs.video.view import HEIGHT, WIDTH

PAPER = "#fbfbf9"
POINTS_AN_INCH = 72
"""So that sizes in points, as artists have them, are pixels."""


class Stage:
    """One canvas. All coordinates are pixels from its lower left corner, and so are line widths and letters."""

    def __init__(self, ground: Iterable[Artist]) -> None:
        """ground: what never changes, the lowest first."""
        size = WIDTH / POINTS_AN_INCH, HEIGHT / POINTS_AN_INCH
        self._figure = Figure(figsize=size, dpi=POINTS_AN_INCH, facecolor=PAPER)
        canvas: Any = FigureCanvasAgg(self._figure)
        canvas.draw()
        self._canvas = canvas
        self._draw(ground)
        self._sheets = [self._copy()]

    def lay(self, depth: int, artists: Iterable[Artist]) -> None:
        """Draw what stays until something else is laid so deep, or deeper: 1 is on the ground, 2 on that."""
        del self._sheets[depth:]
        self._canvas.restore_region(self._sheets[-1])
        self._draw(artists)
        self._sheets.append(self._copy())

    def picture(self, artists: Iterable[Artist]) -> memoryview:
        """Everything, with these on top: HEIGHT × WIDTH × 4 bytes, good until the next one."""
        self._canvas.restore_region(self._sheets[-1])
        self._draw(artists)
        return memoryview(self._canvas.buffer_rgba())

    def _draw(self, artists: Iterable[Artist]) -> None:
        renderer = self._canvas.get_renderer()
        for artist in artists:
            if artist.get_figure() is None:
                artist.set_figure(self._figure)
            artist.draw(renderer)

    def _copy(self) -> Any:
        return self._canvas.copy_from_bbox(self._figure.bbox)
