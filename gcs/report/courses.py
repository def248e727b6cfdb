"""The map: where the swarm was sent, where each robot went, and where they were as results were read."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from gcs.report.axes import WIDTH, Scale, figure, round_values, svg
from gcs.report.placing import Box, Room, about, around
from gcs.report.robots import Drawn, Section, key, mean_key
from gcs.report.svg import TEXT, element, hover, path, words
from gcs.report.told import Rows, Told
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

    @property
    def box(self) -> Box:
        """Left, top, right and bottom."""
        return self.east.start + 2.0, self.north.end, self.east.end, self.north.start

    def round_(self, places_ne: Array) -> Box | None:
        """The box round marks at places (N, 2); None of none that are known."""
        known = places_ne[np.isfinite(places_ne).all(axis=1)]
        if not known.size:
            return None
        (left, bottom), (right, top) = (
            (float(self.east(east)), float(self.north(north))) for north, east in (known.min(axis=0), known.max(axis=0))
        )
        return left - 6.0, top - 6.0, right + 6.0, bottom + 6.0

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
            parts.append(words(x, self.north.start + TEXT + 2, figure(value), "tick x", anchor="middle"))
        for value in _multiples(self.north, step):
            y = float(self.north(value))
            parts.append(element("line", x1=self.east.start, x2=self.east.end, y1=y, y2=y, class_="grid"))
            parts.append(words(self.east.start - 4, y + 0.35 * TEXT, figure(value), "tick y", anchor="end"))
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
        f"The thick line is the {mean_key(flights)[1]}, formation taken off: it should lie on the dashed plan and "
        "end at the last star. Robots are drawn where they were as results were read: leaders as triangles, failed "
        "ones as crosses, those left behind hollow.",
        (
            ("plan", "planned"),
            *(
                (("cut", "broken off by an emergency call"),)
                if any(told.history.scenario.event for told in flights)
                else ()
            ),
            mean_key(flights),
            ("virtual", "virtual leader"),
            *key(flights),
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
    position = told.position[rows, :, :2]
    known = position[np.isfinite(position).all(axis=-1)]
    room = Room(ground.box, np.column_stack([ground.east(known[:, 1]), ground.north(known[:, 0])]))
    plan = _plan(told, ground, room)
    ways = _ways(told, ground, room, rows) if known.size else []
    said = _in_words(told)
    parts = [*ground.grid(), *plan, *ways, *_tasks(told, ground, room)]
    return Drawn(svg(parts, ground.height, title="Map", description=said), said)


def _ways(told: Told, ground: Ground, room: Room, rows: Rows) -> list[str]:
    """Lines of robots, of what led them and of their mean; where they were last on top."""
    order = sorted(range(told.count), key=lambda row: ("healthy", "doubted", "failed").index(told.looks[row]))
    crowd = " crowd" if told.crowded else ""
    parts = [
        ground.way(told.position[rows, row, :2], f"robot {told.looks[row]}{crowd}", robots([told.history.ids[row]]))
        for row in order
    ]
    end = []
    if told.mission.size:
        place = told.position[rows, :, :2] - offsets_ne(told.history.scenario)
        mean = place[:, told.scored].mean(axis=1)
        parts.append(ground.way(told.history.virtual_ne[rows], "virtual", "virtual leader"))
        parts.append(ground.way(mean, "mean", told.mean))
        if np.isfinite(mean[-1]).all():
            x, y = ground.at(mean[-1])
            room.take((x - 5.0, y - 5.0, x + 5.0, y + 5.0))
            end = [element("path", hover(told.mean), d=f"M{x:.1f},{y - 5:.1f}l5,5l-5,5l-5,-5Z", class_="end")]
    last = told.history.position[rows[-1], :, :2]
    seen = [row for row in order if np.isfinite(last[row]).all()]
    for row in seen:
        x, y = ground.at(last[row])
        room.take((x - 5.0, y - 6.0, x + 5.0, y + 5.0))
    marks = [_robot(told, ground, row, last[row], silent=bool(told.silent[rows[-1], row])) for row in seen]
    return [*parts, *end, *_numbers(told, ground, room, last, seen), *marks]


def _robot(told: Told, ground: Ground, row: int, place: Array, *, silent: bool) -> str:
    """Where one robot was last known, by its part: a cross has failed, a triangle leads; hollow if left behind."""
    x, y = ground.at(place)
    system, look, parts = told.history.ids[row], told.looks[row], told.parts_at_the_end()
    leads, left = system in parts.leaders, system in parts.left_behind
    if look == "failed":
        shape = f"M{x - 4:.1f},{y - 4:.1f}l8,8m0,-8l-8,8"
    elif leads:
        shape = f"M{x:.1f},{y - 5:.1f}l4.6,8h-9.2Z"
    else:
        shape = f"M{x - 3:.1f},{y:.1f}a3,3 0 1 0 6,0a3,3 0 1 0 -6,0Z"
    said = f"{robots([system])}: {look}{', leads' if leads else ''}{', left behind' if left else ''}"
    said += ", silent: here it was heard last" if silent else ""
    return element("path", hover(said), d=shape, class_=f"place {look}{' left' if left else ''}")


def _numbers(told: Told, ground: Ground, room: Room, last: Array, seen: Sequence[int]) -> list[str]:
    """Beside each robot, away from the others' middle; in a crowd only of those that matter."""
    middle = np.array([ground.at(last[row]) for row in seen]).mean(axis=0) if seen else np.zeros(2)
    parts = []
    for row in seen:
        if told.crowded and told.looks[row] == "healthy":
            continue
        there, said = ground.at(last[row]), str(told.history.ids[row])
        at = np.array(there)
        away = (at - middle) / max(float(np.hypot(*(at - middle))), 1e-9)
        places = list(about(at, away if np.hypot(*away) > 0.5 else np.array([1.0, 0.0])))
        x, y, anchor = room.place(said, there, places, over_lines=True)
        parts.append(words(x, y, said, f"name {told.looks[row]}", anchor=anchor))
    return parts


def _plan(told: Told, ground: Ground, room: Room) -> list[str]:
    """Legs, what an emergency call cut off, and a star at every target."""
    parts, stars = [], []
    segments = told.plan.segments
    for number, segment in enumerate(segments, start=1):
        parts.append(ground.way(np.array([segment.end_ne, segment.planned_end_ne]), "cut"))
        parts.append(ground.way(np.array([segment.start_ne, segment.end_ne]), "plan"))
        x, y = ground.at(segment.planned_end_ne)
        room.take((x - 8.0, y - 8.0, x + 8.0, y + 8.0))
        class_ = f"target {'last' if number == len(segments) else 'passed'}"
        stars.append(element("path", hover(f"target {number}: {segment.task}"), d=_star(x, y), class_=class_))
    return parts + stars


LONGEST_TASK = 26
"""Letters of a task on the map."""
MOST_TASKS = 6
"""Named on the map; of more, only the last."""


def _tasks(told: Told, ground: Ground, room: Room) -> list[str]:
    """What is to be done at the targets, the last first: it stands where the robots do."""
    segments = told.plan.segments
    crowd = ground.round_(told.history.position[told.mission[-1], :, :2]) if told.mission.size else None
    parts = []
    for segment in reversed(segments if len(segments) <= MOST_TASKS else segments[-1:]):
        task = segment.task
        said = task if len(task) <= LONGEST_TASK else task[: LONGEST_TASK - 1] + "…"
        there = ground.at(segment.planned_end_ne)
        places = list(around(*there, crowd if segment is segments[-1] else None))
        x, y, anchor = room.place(said, there, places)
        parts.append(words(x, y, said, "task", anchor=anchor))
    return parts


def _star(x: float, y: float) -> str:
    """Five points."""
    angle = np.arange(10) * np.pi / 5
    radius = np.where(np.arange(10) % 2 == 0, 8.0, 3.4)
    points = zip(x + radius * np.sin(angle), y - radius * np.cos(angle), strict=True)
    return "M" + "L".join(f"{across:.1f},{down:.1f}" for across, down in points) + "Z"


def _in_words(told: Told) -> str:
    if not told.mission.size:
        return "The mission never began."
    sent = f"Sent to “{told.plan.segments[-1].task}”"
    if told.score is None:
        return f"{sent}; the flight ended before its read-out."
    return f"{sent}; {told.mean} ended {told.score.distance_to_target_m:.1f} m from it."
