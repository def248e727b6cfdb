"""Lines of a swarm over time: one a robot, or of a crowd a band, with those beside it that failed or were doubted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gcs.report.axes import Frame
from gcs.report.svg import Label, area, path
from gcs.report.told import Rows, Told
from gcs.words import robots

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """One chart of one flight."""

    svg: str
    """"" where there is nothing to draw."""
    words: str
    """What it shows, in figures."""


@dataclass(frozen=True, slots=True)
class Section:
    """The same chart of every flight, on one scale."""

    id_: str
    title: str
    look_for: str
    """What to look for."""
    legend: tuple[tuple[str, str], ...]
    """How a thing is drawn, and what it is."""
    charts: tuple[Drawn, ...]
    """In the order of the flights."""

    @property
    def drawn(self) -> bool:
        """Whether there is anything but words."""
        return any(chart.svg for chart in self.charts)


def key(flights: Sequence[Told]) -> tuple[tuple[str, str], ...]:
    """How robots are drawn, as far as there are such."""
    found = {look for told in flights for look in told.looks}
    known = all(told.faults_known for told in flights)
    every = "each healthy robot" if known else "each robot"
    all_ = "all healthy robots" if known else "all robots"
    failed = "failed robot, by the scenario" if any(told.planned for told in flights) else "failed robot"
    drawn = (
        ("healthy", "robot healthy", every),
        ("failed", "robot failed", failed),
        ("doubted", "robot doubted", "healthy, but distrusted" if known else "distrusted"),
    )
    if any(told.crowded for told in flights):
        drawn = (("healthy", "band bar", f"{all_} lie within, the line is their median"), *drawn[1:])
    return tuple((class_, words) for look, class_, words in drawn if look in found)


def judged(flights: Sequence[Told]) -> str:
    """How those are called that flights are judged by, if it is the same in all."""
    called = {told.judged for told in flights}
    return called.pop() if len(called) == 1 else "those that are judged"


def mean_key(flights: Sequence[Told]) -> tuple[str, str]:
    """How their mean is drawn."""
    called = {told.mean for told in flights}
    of = called.pop() if len(called) == 1 else f"the mean of {judged(flights)}"
    return "mean", of.removeprefix("the ")


def swarm(frame: Frame, told: Told, rows: Rows, values: Array) -> list[str]:
    """Values (len(rows), N) of every robot over these rows; those that matter most on top."""
    order = sorted(range(told.count), key=lambda row: ("healthy", "doubted", "failed").index(told.looks[row]))
    crowd = [row for row in order if told.looks[row] == "healthy"] if told.crowded else []
    drawn = _band(frame, told, rows, values[:, crowd]) if crowd else []
    for row in order:
        if row not in crowd:
            class_, title = f"robot {told.looks[row]}", robots([told.history.ids[row]])
            drawn.append(line(frame, told, rows, values[:, row], class_, title=title))
    return drawn


def line(frame: Frame, told: Told, rows: Rows, values: Array, class_: str, *, title: str = "") -> str:
    """One line over these rows, broken where ticks are missing."""
    time, drawn = _broken(told, rows, told.since_s[rows]), _broken(told, rows, values)
    return path(frame.time(time), frame.value(_shown(frame, drawn)), class_, title)


def _shown(frame: Frame, values: Array) -> Array:
    """Values as far as they lie inside the plot: a line that leaves it ends at its edge."""
    inside = (values >= frame.value.low) & (values <= frame.value.high)
    beside = inside.copy()
    beside[1:] |= inside[:-1]
    beside[:-1] |= inside[1:]
    return np.where(beside, np.clip(values, frame.value.low, frame.value.high), np.nan)


def names(frame: Frame, told: Told, values: Array) -> list[Label]:
    """Of the robots that failed or were doubted, at their last values. values: (T, N)."""
    found = []
    for row, look in enumerate(told.looks):
        known = np.flatnonzero(np.isfinite(values[:, row]))
        if look != "healthy" and known.size:
            last = float(values[known[-1], row])
            beyond = " ↑" if last > frame.value.high else ""
            found.append(Label(last, f"{told.history.ids[row]}{beyond}", look))
    return found


def _band(frame: Frame, told: Told, rows: Rows, values: Array) -> list[str]:
    """From the least to the most of many robots, and their median."""
    known = np.isfinite(values).any(axis=1)
    least, middle, most = (np.full(len(values), np.nan) for _ in range(3))
    least[known], most[known] = np.nanmin(values[known], axis=1), np.nanmax(values[known], axis=1)
    middle[known] = np.nanmedian(values[known], axis=1)
    time, low, high = (_broken(told, rows, part) for part in (told.since_s[rows], least, most))
    band = area(frame.time(time), frame.value.within(low), frame.value.within(high), "band")
    return [band, line(frame, told, rows, middle, "robot healthy", title="median")]


def _broken(told: Told, rows: Rows, values: Array) -> Array:
    return np.insert(values, told.breaks(rows), np.nan)
