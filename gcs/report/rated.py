"""What people said, as marks on the chart of trust: 1 of 5 at 0, 5 of 5 at 1, round of a robot, square of all."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence

from gcs.events import Rating
from gcs.recording import sentences
from gcs.report.axes import Frame
from gcs.report.svg import TEXT, element, hover, words
from gcs.report.told import Told

MOST_FIGURES = 24
"""Ratings up to which each is drawn with its value, above the lines; more are small, and beneath them."""
LARGE, SMALL = 7.0, 3.0
"""Half the width of a mark, units."""
APART = 12.0
"""Units between small marks that look alike; whatever is said between them is only counted."""


def few(told: Told) -> bool:
    """Whether each shows its value."""
    return len(_timed(told)) <= MOST_FIGURES


def ratings(told: Told, frame: Frame) -> list[str]:
    """All of few; of many, one in a while for those that say the same of robots that are drawn the same."""
    said = _timed(told)
    if few(told):
        return [_mark(told, frame, rating, at_s, sentences.rating(rating), figure=True) for rating, at_s in said]
    return [_mark(told, frame, *first, words) for first, words in _sparse(told, frame, said)]


def rating_key(flights: Sequence[Told]) -> tuple[tuple[str, str], ...]:
    """How ratings are drawn, where there are such."""
    if not any(told.history.ratings for told in flights):
        return ()
    return (("rating healthy", "a person's rating, 1 to 5, of a robot"), ("rating swarm", "of the swarm"))


def _timed(told: Told) -> list[tuple[Rating, float]]:
    """Those that were given in flight, and when, in the order of time."""
    said = [(rating, rating.time_s) for rating in told.history.ratings if rating.time_s is not None]
    return sorted(said, key=lambda one: one[1])


def _sparse(
    told: Told, frame: Frame, said: Sequence[tuple[Rating, float]]
) -> Iterator[tuple[tuple[Rating, float], str]]:
    """The first of those that would be drawn over each other, and words for all of them."""
    alike = defaultdict[tuple[str, int], list[list[tuple[Rating, float]]]](list)
    for rating, at_s in said:
        heaps = alike[_class(told, rating), rating.rating]
        if heaps and float(frame.time(at_s) - frame.time(heaps[-1][0][1])) < APART:
            heaps[-1].append((rating, at_s))
        else:
            heaps.append([(rating, at_s)])
    for heaps in alike.values():
        for heap in heaps:
            more = f"; {len(heap) - 1} more of {heap[0][0].rating} up to {heap[-1][1]:.1f} s" if len(heap) > 1 else ""
            yield heap[0], f"{sentences.rating(heap[0][0])}{more}"


def _class(told: Told, rating: Rating) -> str:
    return "swarm" if rating.vehicle is None else told.looks[told.history.ids.index(rating.vehicle)]


def _mark(told: Told, frame: Frame, rating: Rating, at_s: float, said: str, *, figure: bool = False) -> str:
    x, y, size = float(frame.time.within(at_s)), float(frame.value((rating.rating - 1) / 4)), LARGE if figure else SMALL
    class_ = f"rating {_class(told, rating)}"
    if rating.vehicle is None:
        mark = element("rect", x=x - size, y=y - size, width=2 * size, height=2 * size, class_=class_)
    else:
        mark = element("circle", cx=x, cy=y, r=size, class_=class_)
    value = words(x, y + 0.35 * TEXT, str(rating.rating), "value", anchor="middle") if figure else ""
    return element("g", hover(said) + mark + value)
