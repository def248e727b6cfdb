"""Charts of what a flight is judged by: heading, distance to the target, separation."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from gcs.mission import Plan
from gcs.report.axes import Frame, framed
from gcs.report.robots import Drawn, Section, key, line, mean_key, names, swarm
from gcs.report.series import closest_pair, distance_to_target, off_course_deg
from gcs.report.svg import Label, element
from gcs.report.told import Told
from gcs.scoring import AIRBORNE, CONTACT, separation
from gcs.words import robots
from scenarios import offsets_ne

Array = npt.NDArray[np.float64]

MOST_LEGS = 4
"""Whose beginnings are all marked; of more, only the last and those that were called."""
ALLOWED = ("limit", "allowed")


def heading(flights: Sequence[Told]) -> Section:
    """How far off the leg the swarm flies."""
    courses = [_measured(told, off_course_deg) for told in flights]
    top = max(
        max(3.0 * told.history.scenario.expect.heading_error_deg, 1.3 * _last(mean))
        for told, (_, mean) in zip(flights, courses, strict=True)
    )
    drawn = []
    for told, (each, mean) in zip(flights, courses, strict=True):
        allowed = told.history.scenario.expect.heading_error_deg
        words = "The mission never began."
        if told.mission.size:
            words = "The flight ended before its read-out."
        if told.score is not None:
            words = (
                f"{told.score.heading_error_deg:.1f}° at the read-out, allowed {allowed:g}°; "
                f"with every robot counted {told.score.swarm_heading_error_deg:.1f}°."
            )
        drawn.append(
            _judged(told, flights, each, mean, (0.0, min(top, 180.0)), allowed, "degrees", "Heading error", words)
        )
    return Section(
        "heading",
        "Heading error",
        "The angle between the leg and the way flown since the leg began. Just after a turn it leaves the chart, for "
        "the swarm still swings round; what counts is the dot, where the line of the mean ends.",
        (_mean(flights), *key(flights), ALLOWED),
        tuple(drawn),
    )


def distance(flights: Sequence[Told]) -> Section:
    """How far from the target the swarm is."""
    ways = [_measured(told, distance_to_target) for told in flights]
    top = max([1.0, *(float(np.nanmax(each, initial=0.0)) for each, _ in ways)])
    drawn = []
    for told, (each, mean) in zip(flights, ways, strict=True):
        allowed = told.history.scenario.expect.distance_to_target_m
        words = "The mission never began."
        if told.mission.size:
            words = f"The flight ended before its read-out, {_last(mean):.1f} m from its target."
        if told.score is not None:
            words = f"{told.score.distance_to_target_m:.1f} m at the read-out, allowed {allowed:g} m."
        drawn.append(
            _judged(told, flights, each, mean, (0.0, 1.05 * top), allowed, "metres", "Distance to target", words)
        )
    return Section(
        "distance",
        "Distance to the target",
        f"From the target of the leg being flown to the {mean_key(flights)[1]}. It jumps when a new target is given; a "
        "swarm on its way falls in a straight line and ends below the dashed one.",
        (_mean(flights), *key(flights), ALLOWED),
        tuple(drawn),
    )


def closeness(flights: Sequence[Told]) -> Section:
    """How close robots came to each other."""
    gaps = [separation(told.position[told.mission]) if told.mission.size else np.empty(0) for told in flights]
    finite = [gap[np.isfinite(gap)] for gap in gaps]
    top = max(2.0 * CONTACT, *(1.1 * float(gap.max(initial=0.0)) for gap in finite))
    drawn = []
    for told, gap in zip(flights, gaps, strict=True):
        gap = np.where(np.isfinite(gap), gap, np.nan)
        frame = mission_frame(told, flights, (0.0, top), "metres")
        parts = [
            _level(frame, told.history.scenario.expect.min_separation_m, "limit"),
            _level(frame, CONTACT, "contact"),
            line(frame, told, told.mission, gap, "mean"),
        ]
        words = _closest(told, gap)
        svg = framed(frame, parts, title="Closest two robots", description=words, unit="metres", marks=marks(told))
        drawn.append(Drawn(svg if np.isfinite(gap).any() else "", words))
    return Section(
        "separation",
        "Separation",
        "The distance between the two robots in the air that are closest to each other, whoever they are.",
        (("mean", "closest two robots"), ALLOWED, ("contact", f"rotors touch, {CONTACT:g} m")),
        tuple(drawn),
    )


def _mean(flights: Sequence[Told]) -> tuple[str, str]:
    class_, called = mean_key(flights)
    return class_, f"{called}: what is judged"


def mission_frame(
    told: Told, flights: Sequence[Told], value: tuple[float, float], unit: str, *, strips: int = 0
) -> Frame:
    """From mission start to the last read-out of all flights."""
    longest = max(other.plan.read_out_s for other in flights)
    return Frame.of((0.0, longest), value, marks=marks(told), unit=unit, strips=strips)


def marks(told: Told) -> list[Label]:
    """When legs begin, and when results are read."""
    segments, scenario = told.plan.segments, told.history.scenario
    calls = {round(event.at_length_m / scenario.mission.cruise_m_s, 6) for event in scenario.event}
    begins = [(segment.begins_s, round(segment.begins_s, 6) in calls) for segment in segments[1:]]
    few = len(segments) <= MOST_LEGS
    found = [
        Label(at, "emergency call" if called else "next leg")
        for at, called in begins
        if few or called or at == told.plan.hand_over_s
    ]
    return [*found, Label(told.plan.read_out_s, "read-out")]


def _measured(told: Told, measure: Callable[[Array, Array, Plan], Array]) -> tuple[Array, Array]:
    """A measure of each robot (T, N) and of the mean of those that are judged (T,), over the mission."""
    rows = told.mission
    place = told.position[rows, :, :2] - offsets_ne(told.history.scenario)
    mean = place[:, told.scored].mean(axis=1, keepdims=True)
    time_s = told.history.mission_s[rows]
    return measure(time_s, place, told.plan), measure(time_s, mean, told.plan)[:, 0]


def _judged(
    told: Told,
    flights: Sequence[Told],
    each: Array,
    mean: Array,
    value: tuple[float, float],
    allowed: float,
    unit: str,
    title: str,
    words: str,
) -> Drawn:
    if not np.isfinite(mean).any():
        return Drawn("", words)
    frame = mission_frame(told, flights, value, unit)
    last = int(np.flatnonzero(np.isfinite(mean))[-1])
    x, y = float(frame.time(told.since_s[told.mission[last]])), float(frame.value.within(mean[last]))
    parts = [
        _level(frame, allowed, "limit"),
        *swarm(frame, told, told.mission, each),
        line(frame, told, told.mission, mean, "mean", title=told.mean),
        element("circle", cx=x, cy=y, r=3.5, class_="end"),
    ]
    svg = framed(
        frame, parts, title=title, description=words, unit=unit, marks=marks(told), names=names(frame, told, each)
    )
    return Drawn(svg, words)


def _level(frame: Frame, value: float, class_: str) -> str:
    y = float(frame.value.within(value))
    return element("line", x1=frame.time.start, x2=frame.time.end, y1=y, y2=y, class_=class_)


def _last(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(known[-1]) if known.size else 0.0


def _closest(told: Told, gap: Array) -> str:
    if told.count == 1:
        return "One robot alone keeps its distance."
    if not told.mission.size:
        return "The mission never began."
    if not np.isfinite(gap).any():
        return "No two robots were in the air at a time."
    at = int(np.nanargmin(gap))
    position = told.position[told.mission[at]]
    airborne = np.where(position[:, 2:] < AIRBORNE, np.nan, position)
    first, second = (told.history.ids[index] for index in closest_pair(airborne))
    allowed = told.history.scenario.expect.min_separation_m
    return (
        f"Robots {first} and {second} came closest, {gap[at]:.2f} m at "
        f"{told.since_s[told.mission[at]]:.1f} s; allowed {allowed:g} m{_unseen(told)}."
    )


def _unseen(told: Told) -> str:
    """Who was left out of it for a while."""
    if not told.history.measured:
        return ""
    mute = [told.history.ids[row] for row in np.flatnonzero(told.silent[told.mission].any(axis=0))]
    where = "it was" if len(mute) == 1 else "they were"
    return f". While silent, {robots(mute)} did not count: nobody knows where {where}" if mute else ""
