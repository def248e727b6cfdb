"""What people said: in a sentence or two, and as marks on the chart of trust, round of a robot, square of all."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import groupby

import numpy as np

from gcs.events import Rating
from gcs.recording import sentences
from gcs.report.axes import Frame
from gcs.report.svg import TEXT, element, hover, words
from gcs.report.telling import FEW, Sentence, Strand, counted, crowd, listed
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


def in_words(told: Told) -> Iterator[Strand]:
    """Who said what, one by one if it is little."""
    said = _timed(told)
    if not said:
        return
    spared = counted(len(said), "rating")
    if len(said) <= FEW:
        by_rater = groupby(sorted(said, key=lambda one: one[0].rater), key=lambda one: one[0].rater)
        given = [(rater, list(of_one)) for rater, of_one in by_rater]
        sentences = (
            Sentence(of_one[0][1], f"{rater} gave {listed([_given(*one) for one in of_one])}.")
            for rater, of_one in given
        )
        yield Strand(tuple(sentences), spared=spared)
        return
    first_s, raters = min(at_s for _, at_s in said), sorted({rating.rater for rating, _ in said})
    who = raters[0] if len(raters) == 1 else f"{len(raters)} people"
    everything = f"From {first_s:.1f} s on {who} gave {len(said)} ratings{_worst([rating for rating, _ in said])}."
    yield Strand.one(first_s, everything, spared=spared)


def _given(rating: Rating, at_s: float) -> str:
    whom = "the swarm" if rating.vehicle is None else f"robot {rating.vehicle}"
    return f"{rating.rating} of 5 to {whom} at {at_s:.1f} s"


def _worst(said: Sequence[Rating]) -> str:
    """Of robots, who came off worst on average, or that all came off alike."""
    means = {
        system: float(np.mean([rating.rating for rating in said if rating.vehicle == system]))
        for system in sorted({rating.vehicle for rating in said if rating.vehicle is not None})
    }
    if not means:
        return ""
    least = min(means.values())
    worst = [system for system, mean in means.items() if mean < least + 1e-9]
    if 1 < len(worst) == len(means):
        return f"; {crowd(worst)} came off alike, {least:.1f} of 5 on average"
    return f"; {crowd(worst)} came off worst, {least:.1f} of 5 on average"
