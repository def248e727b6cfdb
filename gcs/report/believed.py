"""Charts of what was believed: trust, beside the truth and what people said, and how much each robot was heeded."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from gcs.report.axes import STRIP, Frame, framed
from gcs.report.distrust import Distrust, distrusts
from gcs.report.judged import marks, mission_frame
from gcs.report.rated import few, rating_key, ratings
from gcs.report.robots import Drawn, Section, judged, key, names, swarm
from gcs.report.series import heeded
from gcs.report.svg import TEXT, element, hover, words
from gcs.report.telling import capital, some
from gcs.report.told import Told
from gcs.scoring import DISTRUSTED

Array = npt.NDArray[np.float64]

MOST_STRIPS = 6
"""Of faults, under a plot; more are drawn in the last."""
EVERYONE = "all"


def trust(flights: Sequence[Told]) -> Section:
    """What the ground station believed of each robot, and what was true."""
    strips = max(min(MOST_STRIPS, len(_struck(told))) for told in flights)
    return Section(
        "trust",
        "Trust",
        f"A line falls below the dashed one when its robot is distrusted.{_of_bars(flights)}",
        (*key(flights), ("limit", "distrusted below"), *_truth_key(flights), *rating_key(flights)),
        tuple(_trust(told, flights, strips) for told in flights),
    )


def _of_bars(flights: Sequence[Told]) -> str:
    """What the bars under the plot are, where there are any."""
    if not any(told.history.acted for told in flights):
        return ""
    knew = "which nobody in the air knew"
    if any(told.trust_source == "truth" for told in flights):
        knew = "which trust from truth is told, and nobody else in the air knew"
    what = f"the truth, {knew}"
    if any(told.planned for told in flights):
        what = "faults as the scenario has them, whether or not the vehicles fly them"
    return (
        f" The bars under the plot are {what}: while a fault acts on the robot of that number. Trust is right where a "
        "line is low above its robot's bar, and nowhere else."
    )


def weights(flights: Sequence[Told]) -> Section:
    """How much the swarm heeds each robot."""
    shares = [heeded(told.history.weights[told.mission], told.scored) for told in flights]
    top = max([0.1, *(1.1 * float(np.nanmax(share, initial=0.0)) for share in shares)])
    return Section(
        "weights",
        "Who is heeded",
        f"The mean weight that {judged(flights)} give to each robot as they choose their velocity. Averaged control "
        "heeds all alike; a controller that protects the swarm takes the failed robot's line to the bottom.",
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
        lines = swarm(frame, told, told.mission, value)
        parts += [*lines, *ratings(told, frame)] if few(told) else [*ratings(told, frame), *lines]
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
        return "This rule asks for no trust."
    about = distrusts(told)
    if not told.faults_known:
        fell = [f"in robot {one.system} at {one.wrongly_s:.1f} s" for one in about]
        what = f"Trust fell below one half {some(fell)}" if fell else "Nobody was distrusted"
        return f"{what}; whether anything was wrong, nobody told."
    found, wronged = [one for one in about if one.found], [one for one in about if one.wronged]
    said = [f"robot {one.system} was distrusted {one.delay_s:.1f} s after its fault began" for one in found]
    said += [f"robot {one.system} failed and was trusted" for one in about if one.missed]
    said += [f"robot {one.system} was distrusted at {one.wrongly_s:.1f} s {_without(one)}" for one in wronged]
    if not wronged:
        said.append("nobody else was" if found else "nobody was distrusted")
    by = "by the scenario " if told.planned and told.onsets else ""
    return capital(f"{by}{some(said, most=MOST_SAID, between='; ')}.")


MOST_SAID = 6
"""Robots that a caption tells of."""


def _without(one: Distrust) -> str:
    return "before it had a fault" if math.isfinite(one.onset_s) else "without a fault"


def _struck(told: Told) -> list[int | None]:
    """Whom faults struck, in the order in which they are drawn; None is everyone."""
    return sorted({span.vehicle for span in told.history.acted}, key=lambda system: (system is None, system))


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
        for span in told.history.acted:
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


def _truth_key(flights: Sequence[Told]) -> Iterator[tuple[str, str]]:
    struck = {span.vehicle for told in flights for span in told.history.acted}
    whose = "scenario" if any(told.planned for told in flights) else "truth"
    if struck - {None}:
        yield "fault bar", f"{whose}: a fault acts"
    if None in struck:
        yield "air bar", f"{whose}: it blows on everyone"


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
