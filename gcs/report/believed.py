"""Charts of what was believed: trust, beside the truth and what people said, and how much each robot was heeded."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from gcs.events import Rating
from gcs.recording import sentences
from gcs.report.axes import STRIP, Frame, framed
from gcs.report.judged import marks, mission_frame
from gcs.report.robots import Drawn, Section, key, names, swarm
from gcs.report.series import heeded
from gcs.report.svg import TEXT, element, hover, words
from gcs.report.told import Told
from gcs.scoring import DISTRUSTED
from gcs.words import robots

Array = npt.NDArray[np.float64]

MOST_STRIPS = 6
"""Of faults, under a plot; more are drawn in the last."""
MOST_FIGURES = 24
"""Ratings up to which each shows its value."""
EVERYONE = "all"


def trust(flights: Sequence[Told]) -> Section:
    """What the ground station believed of each robot, and what was true."""
    strips = max(min(MOST_STRIPS, len(_struck(told))) for told in flights)
    return Section(
        "trust",
        "Trust",
        "A line falls below the dashed one when its robot is distrusted. The bars under the plot are the truth, which "
        "nobody in the air knew: while a fault acts on the robot of that number. Trust is right where a line is low "
        "above its robot's bar, and nowhere else.",
        (*key(flights), ("limit", "distrusted below"), *_truth_key(flights), *_rating_key(flights)),
        tuple(_trust(told, flights, strips) for told in flights),
    )


def weights(flights: Sequence[Told]) -> Section:
    """How much the swarm heeds each robot."""
    shares = [heeded(told.history.weights[told.mission], told.scored) for told in flights]
    top = max([0.1, *(1.1 * float(np.nanmax(share, initial=0.0)) for share in shares)])
    return Section(
        "weights",
        "Who is heeded",
        "The mean weight that healthy robots give to each robot as they choose their velocity. Averaged control heeds "
        "all alike; a controller that protects the swarm takes the failed robot's line to the bottom.",
        (*key(flights), ("limit", "an equal share")),
        tuple(_weights(told, flights, share, top) for told, share in zip(flights, shares, strict=True)),
    )


def _trust(told: Told, flights: Sequence[Told], strips: int) -> Drawn:
    said = _trust_in_words(told)
    if not told.mission.size:
        return Drawn("", said)
    frame = mission_frame(told, flights, (0.0, 1.0), "trust", strips=strips)
    parts = _strips(told, frame)
    beside = []
    if told.trust_source is not None:
        value = told.history.trust[told.mission]
        y = float(frame.value(DISTRUSTED))
        parts.append(element("line", x1=frame.time.start, x2=frame.time.end, y1=y, y2=y, class_="limit"))
        parts += [*swarm(frame, told, told.mission, value), *_ratings(told, frame)]
        beside = names(frame, told, value)
    else:
        middle = (frame.time.start + frame.time.end) / 2, (frame.value.start + frame.value.end) / 2
        parts.append(words(*middle, "not asked for", "quiet", anchor="middle"))
    svg = framed(
        frame,
        parts,
        title="Trust",
        description=said,
        unit="trust",
        of_value=((0.0, "0"), (0.5, "0.5"), (1.0, "1")),
        marks=marks(told),
        names=beside,
    )
    return Drawn(svg, said)


def _trust_in_words(told: Told) -> str:
    if not told.mission.size:
        return "The mission never began."
    if told.trust_source is None:
        return "This rule asks for no trust: it heeds the failed like the healthy."
    doubted = [system for system, look in zip(told.history.ids, told.looks, strict=True) if look == "doubted"]
    found = {} if told.score is None else told.score.detected
    said = [f"Robot {system} was distrusted {after_s:.1f} s after its fault began" for system, after_s in found.items()]
    if doubted:
        said.append(f"{robots(doubted)} without a fault")
    elif found:
        said.append("nobody without a fault")
    return f"{'; '.join(said)}." if said else "Nobody was distrusted."


def _struck(told: Told) -> list[int | None]:
    """Whom faults struck, in the order in which they are drawn; None is everyone."""
    return sorted({span.vehicle for span in told.history.faults}, key=lambda system: (system is None, system))


def _strips(told: Told, frame: Frame) -> list[str]:
    """The truth, a strip for each robot."""
    parts = []
    ends_s = float(told.since_s[told.mission[-1]])
    for index, system in enumerate(struck := _struck(told)):
        strip = min(index, MOST_STRIPS - 1)
        y = frame.value.start + (strip + 0.75) * STRIP
        if index == strip:
            more = strip == MOST_STRIPS - 1 and len(struck) > MOST_STRIPS
            name = f"+{len(struck) - strip}" if more else EVERYONE if system is None else str(system)
            parts.append(words(frame.time.start - 5, y + 0.75 * TEXT, name, "tick y failed", anchor="end"))
        for span in told.history.faults:
            if span.vehicle == system:
                begin, end = (float(frame.time.within(min(at, ends_s))) for at in (span.from_s, span.to_s))
                class_ = "air bar" if system is None else "fault bar"
                parts.append(
                    element(
                        "rect",
                        hover(span.words),
                        x=begin,
                        y=y,
                        width=max(end - begin, 1.0),
                        height=STRIP - 4.0,
                        class_=class_,
                    )
                )
    return parts


def _ratings(told: Told, frame: Frame) -> list[str]:
    """What people said, at 0 for 1 of 5 to 1 for 5 of 5: round of a robot, square of the swarm."""
    said = [rating for rating in told.history.ratings if rating.time_s is not None]
    figures = len(said) <= MOST_FIGURES
    return [
        _rating(told, frame, rating, rating.time_s, figures=figures) for rating in said if rating.time_s is not None
    ]


def _rating(told: Told, frame: Frame, rating: Rating, time_s: float, *, figures: bool) -> str:
    x, y = float(frame.time.within(time_s)), float(frame.value((rating.rating - 1) / 4))
    size = 7.0 if figures else 3.0
    if rating.vehicle is None:
        mark = element("rect", x=x - size, y=y - size, width=2 * size, height=2 * size, class_="rating swarm")
    else:
        look = told.looks[told.history.ids.index(rating.vehicle)]
        mark = element("circle", cx=x, cy=y, r=size, class_=f"rating {look}")
    value = words(x, y + 0.35 * TEXT, str(rating.rating), "value", anchor="middle") if figures else ""
    return element("g", hover(sentences.rating(rating)) + mark + value)


def _truth_key(flights: Sequence[Told]) -> Iterator[tuple[str, str]]:
    struck = {span.vehicle for told in flights for span in told.history.faults}
    if struck - {None}:
        yield "fault bar", "truth: a fault acts"
    if None in struck:
        yield "air bar", "truth: it blows on everyone"


def _rating_key(flights: Sequence[Told]) -> tuple[tuple[str, str], ...]:
    if not any(told.history.ratings for told in flights):
        return ()
    return (("rating healthy", "a person's rating, 1 to 5, of a robot"), ("rating swarm", "of the swarm"))


def _weights(told: Told, flights: Sequence[Told], share: Array, top: float) -> Drawn:
    if not np.isfinite(share).any():
        return Drawn("", "No control law ran.")
    frame = mission_frame(told, flights, (0.0, top), "weight")
    y = float(frame.value(1.0 / told.count))
    parts = [
        element("line", x1=frame.time.start, x2=frame.time.end, y1=y, y2=y, class_="limit"),
        *swarm(frame, told, told.mission, share),
    ]
    said = _weights_in_words(told, share)
    svg = framed(
        frame,
        parts,
        title="Weights",
        description=said,
        unit="weight",
        marks=marks(told),
        names=names(frame, told, share),
    )
    return Drawn(svg, said)


def _weights_in_words(told: Told, share: Array) -> str:
    mean = np.nanmean(share[np.isfinite(share).all(axis=1)], axis=0)
    failed = [row for row, look in enumerate(told.looks) if look == "failed"]
    shown = failed or [int(mean.argmin()), int(mean.argmax())]
    said = ", ".join(f"robot {told.history.ids[row]}: {mean[row]:.1%}" for row in dict.fromkeys(shown[:6]))
    return f"Over the mission, of all that is heeded: {said}; an equal share is {1 / told.count:.1%}."
