"""The map: where the swarm was sent, where each robot went, and where they were as results were read."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from gcs.report.axes import WIDTH, Scale, round_values, svg
from gcs.report.robots import Drawn, Section
from gcs.report.svg import LETTER, TEXT, element, hover, path, words
from gcs.report.told import Told
from gcs.words import robots
from scenarios import offsets_ne

Array = npt.NDArray[np.float64]

MARGIN = 4.0
"""m round everything that is drawn."""
LEFT, FOOT, TOP, EDGE = 30.0, 30.0, 4.0, 6.0
"""Units beside the ground: for figures, below it, above it, at its right."""
TALLEST, LOWEST = 460.0, 170.0
"""Units of ground in height."""


class Ground:
    """Places in metres to units, north up, as far north as east."""

    def __init__(self, low_ne: Array, high_ne: Array) -> None:
        """From the south-west to the north-east corner of what must be shown; there may be more."""
        width = WIDTH - LEFT - EDGE
        north, east = np.maximum(high_ne - low_ne, 1.0)
        metre = min(width / east, TALLEST / north)
        height = max(metre * north, LOWEST)
        middle, half = (low_ne + high_ne) / 2, np.array([height, width]) / metre / 2
        (south, west), (north, east) = middle - half, middle + half
        self.east = Scale(float(west), float(east), LEFT, LEFT + width)
        self.north = Scale(float(south), float(north), TOP + height, TOP)
        self.height = TOP + height + FOOT

    def at(self, place_ne: Array) -> tuple[float, float]:
        """Across and down of one place."""
        return float(self.east(place_ne[1])), float(self.north(place_ne[0]))

    def way(self, places_ne: Array, class_: str, title: str = "") -> str:
        """A line through places (T, 2)."""
        return path(self.east(places_ne[:, 1]), self.north(places_ne[:, 0]), class_, title)

    def grid(self) -> list[str]:
        """Lines and figures every so many metres, the same both ways."""
        parts = []
        step = float(np.diff(round_values(self.east.low, self.east.high, 6))[0])
        for value in _multiples(self.east, step):
            x = float(self.east(value))
            parts.append(element("line", x1=x, x2=x, y1=self.north.end, y2=self.north.start, class_="grid"))
            parts.append(words(x, self.north.start + TEXT + 2, f"{value:g}", "tick x", anchor="middle"))
        for value in _multiples(self.north, step):
            y = float(self.north(value))
            parts.append(element("line", x1=self.east.start, x2=self.east.end, y1=y, y2=y, class_="grid"))
            parts.append(words(self.east.start - 4, y + 0.35 * TEXT, f"{value:g}", "tick y", anchor="end"))
        middle = (self.east.start + self.east.end) / 2
        parts.append(words(middle, self.height - 2.0, "metres east, north is up", "quiet", anchor="middle"))
        return parts


def _multiples(scale: Scale, step: float) -> list[float]:
    first, last = np.ceil(scale.low / step), np.floor(scale.high / step)
    return [float(number * step) for number in np.arange(first, last + 1)]


def courses(flights: Sequence[Told]) -> Section:
    """Every flight's map, on one scale."""
    ground = _ground(flights)
    charts = tuple(_course(told, ground) for told in flights)
    return Section(
        "map",
        "Where they went",
        "The black line is the mean of the healthy robots, formation taken off: it should lie on the dashed plan and end "
        "at the last star. Robots are drawn where they were as results were read.",
        (
            ("plan", "planned"),
            ("cut", "interrupted by an emergency call"),
            ("mean", "mean of the healthy robots"),
            ("virtual", "virtual leader"),
            ("robot healthy", "healthy robot, with a triangle if it leads"),
            ("robot failed", "failed robot"),
            ("robot doubted", "healthy, but distrusted"),
        ),
        charts,
    )


def _ground(flights: Sequence[Told]) -> Ground:
    """What holds every plan and every way."""
    places = [np.zeros((1, 2))]
    for told in flights:
        rows = told.mission if told.mission.size else told.all_rows
        flown = told.history.position[rows, :, :2].reshape(-1, 2)
        places.append(flown[np.isfinite(flown).all(axis=1)])
        for segment in told.plan.segments:
            places += [segment.start_ne[None], segment.planned_end_ne[None]]
    every = np.concatenate(places)
    return Ground(every.min(axis=0) - MARGIN, every.max(axis=0) + MARGIN)


def _course(told: Told, ground: Ground) -> Drawn:
    rows = told.mission if told.mission.size else told.all_rows
    position = told.history.position[rows, :, :2]
    parts = [*ground.grid(), *_plan(told, ground)]
    if np.isfinite(position).any():
        parts += _ways(told, ground, position)
    said = _in_words(told)
    return Drawn(svg(parts, ground.height, title="Map", description=said), said)


def _ways(told: Told, ground: Ground, position: Array) -> list[str]:
    order = sorted(range(told.count), key=lambda row: ("healthy", "doubted", "failed").index(told.looks[row]))
    crowd = " crowd" if told.crowded else ""
    parts = [
        ground.way(position[:, row], f"robot {told.looks[row]}{crowd}", f"robot {told.history.ids[row]}") for row in order
    ]
    if told.mission.size:
        place = position - offsets_ne(told.history.scenario)
        mean = place[:, told.scored].mean(axis=1)
        parts.append(ground.way(told.history.virtual_ne[told.mission], "virtual", "virtual leader"))
        parts.append(ground.way(mean, "mean", "mean of the healthy robots"))
        x, y = ground.at(mean[-1])
        parts.append(element("path", d=f"M{x:.1f},{y - 5:.1f}l5,5l-5,5l-5,-5Z", class_="end"))
    return parts + [mark for row in order for mark in _robot(told, ground, row, position[-1, row])]


def _robot(told: Told, ground: Ground, row: int, place: Array) -> list[str]:
    """Where one robot was last, by its part: a cross has failed, a triangle leads; hollow if it was left behind."""
    if not np.isfinite(place).all():
        return []
    x, y = ground.at(place)
    system, look, parts = told.history.ids[row], told.looks[row], told.parts_at_the_end()
    leads, left = system in parts.leaders, system in parts.left_behind
    said = f"{robots([system])}: {look}{', leads' if leads else ''}{', left behind' if left else ''}"
    class_ = f"place {look}{' left' if left else ''}"
    if look == "failed":
        shape = f"M{x - 4:.1f},{y - 4:.1f}l8,8m0,-8l-8,8"
    elif leads:
        shape = f"M{x:.1f},{y - 5:.1f}l4.6,8h-9.2Z"
    else:
        shape = f"M{x - 3:.1f},{y:.1f}a3,3 0 1 0 6,0a3,3 0 1 0 -6,0Z"
    marks = [element("path", hover(said), d=shape, class_=class_)]
    if not told.crowded or look != "healthy":
        marks.append(words(x + 6, y - 3, str(system), f"name {look}"))
    return marks


def _plan(told: Told, ground: Ground) -> list[str]:
    """Legs, what an emergency call cut off, and a star at every target."""
    parts = []
    for segment in told.plan.segments:
        parts.append(ground.way(np.array([segment.end_ne, segment.planned_end_ne]), "cut"))
        parts.append(ground.way(np.array([segment.start_ne, segment.end_ne]), "plan"))
    for number, segment in enumerate(told.plan.segments, start=1):
        last = number == len(told.plan.segments)
        x, y = ground.at(segment.planned_end_ne)
        parts.append(element("path", hover(f"target {number}: {segment.task}"), d=_star(x, y), class_=f"target {'last' if last else 'passed'}"))
        parts.append(_task(ground, x, y, segment.task))
    return parts


LONGEST_TASK = 26
"""Letters of a task on the map."""


def _task(ground: Ground, x: float, y: float, task: str) -> str:
    """Its name beside a target, on the side where there is room for it."""
    said = task if len(task) <= LONGEST_TASK else task[: LONGEST_TASK - 1] + "…"
    width = LETTER * len(said)
    left = max(ground.east.start + 2, min(x - width / 2, ground.east.end - width))
    above = y - 12 if y - 12 - TEXT > ground.north.end else y + 10 + TEXT
    return words(left, above, said, "task")


def _star(x: float, y: float) -> str:
    """Five points."""
    angle = np.arange(10) * np.pi / 5
    radius = np.where(np.arange(10) % 2 == 0, 8.0, 3.4)
    return "M" + "L".join(f"{x + r * np.sin(a):.1f},{y - r * np.cos(a):.1f}" for a, r in zip(angle, radius, strict=True)) + "Z"


def _in_words(told: Told) -> str:
    if not told.mission.size:
        return "The mission never began."
    heading = told.plan.segments[-1].task
    if told.score is None:
        return f"Sent to {heading!r}; the flight ended before its read-out."
    return f"Sent to “{heading}”; the healthy robots' mean ended {told.score.distance_to_target_m:.1f} m from it."
