"""Charts as SVG text: elements, lines thinned out without losing a spike, labels that make way for each other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

TEXT = 11.0
"""Height of a letter's line, in units of a chart: the pixels of a phone."""
LETTER = 0.54 * TEXT
"""Width of a letter, on average."""
TOLERANCE = 0.12
"""Units by which a thinned line may miss what it was drawn from."""
COLUMN = 0.5
"""Units of width in which a long line keeps its first, least, most and last point, before it is thinned further."""


def element(name: str, content: str = "", /, **attributes: object) -> str:
    """One element; underscores in the names of attributes are hyphens, numbers are rounded, None is left out."""
    told = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{_value(value)}"'
        for key, value in attributes.items()
        if value is not None
    )
    return f"<{name}{told}>{content}</{name}>" if content else f"<{name}{told}/>"


def words(x: float, y: float, said: str, class_: str = "", *, anchor: str = "start") -> str:
    """A line of text, escaped, its base line at y."""
    return element(
        "text", escape(said), x=x, y=y, class_=class_ or None, text_anchor=None if anchor == "start" else anchor
    )


def hover(said: str) -> str:
    """What a mark says when one rests on it, and to who cannot see it."""
    return element("title", escape(said))


def path(x: Array, y: Array, class_: str, title: str = "", **attributes: object) -> str:
    """A line through points (T,) and (T,) in units of the chart, broken where either is NaN; "" of no points."""
    drawn = "".join("M" + "L".join(f"{_number(a)},{_number(b)}" for a, b in piece.tolist()) for piece in _pieces(x, y))
    if not drawn:
        return ""
    return element("path", hover(title) if title else "", class_=class_, d=drawn, **attributes)


def area(x: Array, low: Array, high: Array, class_: str, title: str = "") -> str:
    """What lies between two lines over the same places, broken where one is NaN."""
    known = np.isfinite(x) & np.isfinite(low) & np.isfinite(high)
    drawn = ""
    for run in _runs(known):
        there, back = thinned(x[run], high[run]), thinned(x[run], low[run])[::-1]
        drawn += "M" + "L".join(f"{_number(a)},{_number(b)}" for a, b in np.vstack([there, back]).tolist()) + "Z"
    return element("path", hover(title) if title else "", class_=class_, d=drawn) if drawn else ""


def thinned(x: Array, y: Array) -> Array:
    """(K, 2) of the points that draw the same line within TOLERANCE; first and last, least and most are kept.

    By Douglas and Peucker: a point goes if it is close to the chord between two that stay.
    """
    points = _fewer(np.column_stack([x, y]))
    keep = np.zeros(len(points), bool)
    keep[[0, -1, int(points[:, 1].argmin()), int(points[:, 1].argmax())]] = True
    spans = [
        (int(a), int(b))
        for a, b in zip(*(np.flatnonzero(keep)[part] for part in (slice(-1), slice(1, None))), strict=True)
    ]
    while spans:
        first, last = spans.pop()
        if last - first < 2:
            continue
        off = _off_the_chord(points[first + 1 : last], points[first], points[last])
        worst = int(off.argmax())
        if off[worst] > TOLERANCE:
            middle = first + 1 + worst
            keep[middle] = True
            spans += [(first, middle), (middle, last)]
    return points[keep]


def _off_the_chord(points: Array, start: Array, end: Array) -> Array:
    """Distance of points from the stretch between two others."""
    along = end - start
    length = float(along @ along)
    share = np.clip((points - start) @ along / length, 0.0, 1.0) if length > 0.0 else np.zeros(len(points))
    return np.asarray(np.hypot(*(points - start - share[:, None] * along).T))


def _fewer(points: Array) -> Array:
    """Of each column that a long line runs through, its first, least, most and last point."""
    column = np.floor(points[:, 0] / COLUMN)
    begins = np.flatnonzero(np.diff(column, prepend=np.nan) != 0)
    if len(points) < 8 * len(begins):
        return points
    kept = {
        index
        for begin, end in zip(begins, [*begins[1:], len(points)], strict=True)
        for index in (
            begin,
            begin + int(points[begin:end, 1].argmin()),
            begin + int(points[begin:end, 1].argmax()),
            end - 1,
        )
    }
    return points[sorted(kept)]


def _pieces(x: Array, y: Array) -> Iterator[Array]:
    for run in _runs(np.isfinite(x) & np.isfinite(y)):
        yield thinned(x[run], y[run])


def _runs(among: npt.NDArray[np.bool_]) -> list[slice]:
    """Where it is true without a break."""
    edges = np.flatnonzero(np.diff(among, prepend=False, append=False))
    return [slice(int(begin), int(end)) for begin, end in edges.reshape(-1, 2)]


@dataclass(frozen=True, slots=True)
class Label:
    """A word that wants to stand at a place along a line."""

    at: float
    """Units."""
    said: str
    class_: str = ""


def apart(wanted: Sequence[float], *, least: float, low: float, high: float) -> list[float]:
    """Places as near to those wanted as room allows: in the same order, `least` apart, from low to high.

    Where there is no room for all, they run on beyond high.
    """
    order = np.argsort(wanted, kind="stable")
    placed = np.empty(len(wanted))
    reached = low - least
    for rank in order:
        placed[rank] = reached = max(wanted[rank], reached + least)
    reached = high + least
    for rank in order[::-1]:
        if placed[rank] <= reached - least:
            break
        placed[rank] = reached = reached - least
    if len(order) and placed[order[0]] < low:
        for step, rank in enumerate(order):
            placed[rank] = low + step * least
    return placed.tolist()


def in_lanes(labels: Sequence[Label], *, low: float, high: float) -> list[tuple[int, float]]:
    """(lane, left edge) of each label: as near to its place as it stays inside, in the first lane free there."""
    taken: list[list[tuple[float, float]]] = []
    placed = [(0, low)] * len(labels)
    for index in sorted(range(len(labels)), key=lambda index: labels[index].at):
        width = LETTER * len(labels[index].said) + 4.0
        left = max(low, min(labels[index].at - width / 2, high - width))
        free = (all(left >= end or left + width <= begin for begin, end in lane) for lane in taken)
        number = next((number for number, is_free in enumerate(free) if is_free), len(taken))
        if number == len(taken):
            taken.append([])
        taken[number].append((left, left + width))
        placed[index] = number, left
    return placed


def _value(value: object) -> str:
    return _number(value) if isinstance(value, float) else escape(str(value))


def _number(value: float) -> str:
    """One place behind the point, and none where it is whole: a tenth of a pixel or two."""
    told = f"{value:.1f}".removesuffix(".0")
    return "0" if told == "-0" else told
