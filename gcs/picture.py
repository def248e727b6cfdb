"""The trajectory picture: where the swarm was sent, where each robot went, whom it trusted, and who led it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from textwrap import wrap
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import numpy.typing as npt
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from gcs.mission import Plan, plan
from gcs.scoring import DISTRUSTED, Score, score, scored_robots, struck
from gcs.summary import trust_of
from gcs.track import Parts, Track
from gcs.words import controller_name, ending, faults, measured, robots
from scenarios import Scenario, offsets_ne

HEALTHY = ("#1f4e8c", "#2a7fba", "#3aa6a0", "#5b8def", "#6a7fb5", "#2c9c6a")
FAILED = "#d62728"
PLANNED = "#555555"
ABANDONED = "#b8b8b8"
FAULT, AIR = "#fdeeee", "#ecf1f7"
"""Behind trust: while a fault acts that somebody is blamed for, and one that nobody is."""
LABEL = {"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.75}
DPI = 120
mpl.rcParams["text.parse_math"] = False  # a title or a task may hold a dollar sign
PANEL_WIDTH, TRUST_HEIGHT, FRAME_HEIGHT = 5.8, 1.6, 3.2
"""Inches: of a panel, of its trust, and of all titles, labels and the legend together."""
TITLE = 64
"""Characters in a line of a panel's title."""


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """One flight of a picture."""

    title: str
    track: Track
    scenario: Scenario
    problem: str | None = None
    """Why the flight could not be completed."""

    def failed(self, row: int) -> bool:
        """Whether a fault of this robot's acted before the read-out, as far as is known."""
        return row + 1 in struck(self.track, self.scenario)


def draw(track: Track, scenario: Scenario, path: Path, *, problem: str | None = None) -> None:
    """One flight, as trajectory.png."""
    draw_side_by_side([Panel(controller_name(scenario), track, scenario, problem)], path, heading=scenario.title)


def draw_side_by_side(panels: Sequence[Panel], path: Path, *, heading: str) -> None:
    """Several flights on one scale: paths above, trust below."""
    window = _window(panels)
    (west, east), (south, north) = window
    map_height = min(max(PANEL_WIDTH * (north - south) / (east - west), 3.0), 8.0)
    figure, axes = plt.subplots(
        2,
        len(panels),
        figsize=(max(8.0, (PANEL_WIDTH + 0.7) * len(panels)), map_height + TRUST_HEIGHT + FRAME_HEIGHT),
        height_ratios=(map_height, TRUST_HEIGHT),
        squeeze=False,
        layout="constrained",
    )
    figure.suptitle("\n".join(wrap(heading, width=70 * len(panels))), fontsize=13, fontweight="bold")
    for column, panel in enumerate(panels):
        _map(axes[0, column], panel, window)
        _trust(axes[1, column], panel, first=column == 0)
    legend = _legend(panels)
    figure.legend(handles=legend, loc="outside lower center", ncols=4, frameon=False, fontsize=9, columnspacing=1.4)
    figure.savefig(path, dpi=DPI)
    plt.close(figure)


Flags = npt.NDArray[np.bool_]
Window = tuple[tuple[float, float], tuple[float, float]]
"""(west, east), (south, north) [m]."""
MARGIN = 6.5
"""m round everything that is drawn."""


def _window(panels: Sequence[Panel]) -> Window:
    """What holds every path and target of all panels."""
    places = [panel.track.position[..., :2].reshape(-1, 2) for panel in panels]
    for panel in panels:
        for segment in plan(panel.scenario).segments:
            places += [segment.start_ne[None], segment.planned_end_ne[None]]
    every = np.concatenate(places)
    (south, west), (north, east) = np.nanmin(every, axis=0) - MARGIN, np.nanmax(every, axis=0) + MARGIN
    return (west, east), (south, north)


def _map(axes: Any, panel: Panel, window: Window) -> None:
    track, scenario = panel.track, panel.scenario
    axes.set_xlim(window[0])
    axes.set_ylim(window[1])
    _draw_plan(axes, plan(scenario))
    parts = _parts(track, scenario)
    for row in range(scenario.swarm.count):
        _draw_robot(axes, row, track, _colour(row, panel), parts)
    scored = scored_robots(scenario, known=track.faults_known)
    mean = _mean(track.position[:, scored, :2] - offsets_ne(scenario)[scored])
    axes.plot(mean[:, 1], mean[:, 0], color="black", lw=2.4, zorder=4)
    axes.plot(mean[-1, 1], mean[-1, 0], "D", color="black", ms=5, mec="white", zorder=7.5)
    wrong = wrap(" and ".join(faults(scenario)) or "nothing goes wrong", width=TITLE)
    axes.set_title("\n".join([panel.title, *wrong, _verdict(score(track, scenario), panel)]), fontsize=11)
    axes.set_aspect("equal")
    axes.set_xlabel("east [m]")
    axes.set_ylabel("north [m]")
    axes.grid(color="#e6e6e6", lw=0.8)


def _draw_robot(axes: Any, row: int, track: Track, colour: str, parts: tuple[Parts, ...]) -> None:
    """One robot's way: thin from where it was left behind, with a triangle at the end if it leads then."""
    north, east = track.position[:, row, 0], track.position[:, row, 1]
    heard = np.flatnonzero(np.isfinite(east))
    if not heard.size:
        return
    last, failed = int(heard[-1]), colour == FAILED
    left = _left_behind(row, track, parts)
    for among, style in ((~left, "-"), (left, ":")):
        line = _where(among, east), _where(among, north)
        axes.plot(*line, color=colour, lw=2.0 if failed else 1.3, ls=style, zorder=3)
    for since in np.flatnonzero(left[1:] & ~left[:-1]):
        axes.plot(east[since], north[since], "o", color=colour, ms=9, mfc="none", mew=1.6, zorder=5)
    axes.plot(east[0], north[0], ".", color=colour, ms=5, zorder=3)
    end, size = ("X", 10) if failed else ("^", 8) if row + 1 in parts[-1].leaders else ("o", 6)
    axes.plot(east[last], north[last], end, color=colour, ms=size, mec="white", zorder=7)
    axes.annotate(
        str(row + 1),
        (east[last], north[last]),
        xytext=(7, 3),
        textcoords="offset points",
        fontsize=9,
        color=colour,
        fontweight="bold",
        bbox=LABEL,
        zorder=8,
    )


def _mean(place: Any) -> Any:
    """(T, N, 2) → (T, 2): of those whose place is known; NaN where nobody's is."""
    known = np.isfinite(place)
    counted = known.sum(axis=1)
    return np.where(counted, np.where(known, place, 0.0).sum(axis=1) / np.maximum(counted, 1), np.nan)


def _where(among: Flags, values: Any) -> Any:
    """Values (T,) with their neighbours on either side, and NaN elsewhere, so that the pieces of a line meet."""
    beside = among.copy()
    beside[1:] |= among[:-1] & ~among[1:]
    return np.where(beside, values, np.nan)


def _colour(row: int, panel: Panel) -> str:
    return FAILED if panel.failed(row) else HEALTHY[row % len(HEALTHY)]


def _parts(track: Track, scenario: Scenario) -> tuple[Parts, ...]:
    """As told, or as the scenario has them."""
    return track.parts or (Parts(0.0, scenario.swarm.leaders, ()),)


def _left_behind(row: int, track: Track, parts: tuple[Parts, ...]) -> Flags:
    """(T,) when this robot was left behind."""
    since = np.searchsorted([part.time_s for part in parts], track.time_s + 1e-9) - 1
    return np.array([row + 1 in part.left_behind for part in parts])[since]


def _draw_plan(axes: Any, path: Plan) -> None:
    """Planned legs, both targets, and the leg that an emergency cut short."""
    for number, segment in enumerate(path.segments, start=1):
        last = number == len(path.segments)
        goal = segment.planned_end_ne
        if not np.allclose(goal, segment.end_ne):
            axes.plot(*_line(segment.end_ne, goal), color=ABANDONED, lw=1.6, ls=":", zorder=1)
        axes.plot(*_line(segment.start_ne, segment.end_ne), color=PLANNED, lw=1.8, ls="--", zorder=2)
        axes.plot(goal[1], goal[0], "*", color="#e8a200" if last else ABANDONED, ms=19, mec="#7a5500", zorder=6)
        _label_target(axes, f"target {number}\n{segment.task}", goal, last=last)


def _label_target(axes: Any, words: str, goal: Any, *, last: bool) -> None:
    """Beside the star with a thin line to it; above it where the picture ends."""
    west, east = axes.get_xlim()
    at_the_edge = goal[1] > west + 0.7 * (east - west)
    beside = (46, 14) if last else (56, -24)
    axes.annotate(
        words,
        (goal[1], goal[0]),
        xytext=(0, 26) if at_the_edge else beside,
        textcoords="offset points",
        ha="center" if at_the_edge else "left",
        fontsize=9,
        bbox=LABEL,
        arrowprops={"arrowstyle": "-", "color": "#7a5500", "lw": 0.8},
        zorder=7,
    )


def _line(start: Any, end: Any) -> tuple[list[float], list[float]]:
    return [start[1], end[1]], [start[0], end[0]]


def _verdict(result: Score | None, panel: Panel) -> str:
    ended = ending(panel.problem, None if result is None else result.passed)
    word = ended.word if ended.good else ended.word.upper()
    why = ended.why
    if result is not None and not why:
        why = ", ".join(measured(result, panel.scenario))
    return "\n".join(wrap(f"{word}: {why}", width=TITLE))


def _trust(axes: Any, panel: Panel, *, first: bool) -> None:
    track, scenario = panel.track, panel.scenario
    path = plan(scenario)
    _draw_faults(axes, panel)
    if trust_of(scenario) is None:
        axes.text(
            0.97, 0.75, "this rule asks for no trust",
            ha="right", va="center", transform=axes.transAxes, color=PLANNED,
        )  # fmt: skip
    else:
        axes.axhline(DISTRUSTED, color=ABANDONED, lw=1, ls=":")
        for row in range(scenario.swarm.count):
            colour = _colour(row, panel)
            axes.plot(track.time_s, track.trust[:, row], color=colour, lw=2.2 if colour == FAILED else 1.2)
    if path.hand_over_s > 0:
        _mark(axes, path.hand_over_s, 0.30, "emergency call" if scenario.event else "next leg", PLANNED)
    for time_s, height, words in _turns(_parts(track, scenario)):
        _mark(axes, time_s, height, words, FAILED)
    axes.set_xlim(0.0, path.read_out_s)
    axes.set_ylim(-0.08, 1.08)
    axes.set_yticks((0.0, 0.5, 1.0))
    axes.set_xlabel("time since mission start [s]")
    if first:
        axes.set_ylabel("trust, 0 to 1")
    axes.grid(color="#e6e6e6", lw=0.8)


def _draw_faults(axes: Any, panel: Panel) -> None:
    """Bands while something goes wrong."""
    times = panel.track.time_s
    for fault in panel.scenario.fault if panel.track.faults_known else ():
        acts = np.array([fault.active(time_s) for time_s in times.tolist()])
        colour = AIR if fault.blamed is None else FAULT
        axes.fill_between(times, -0.08, 1.08, where=acts, step="post", color=colour, lw=0, zorder=0)


def _mark(axes: Any, time_s: float, height: float, words: str, colour: str) -> None:
    axes.axvline(time_s, color=colour, lw=1, ls="--")
    axes.annotate(
        words, (time_s, height), xytext=(4, 0), textcoords="offset points", fontsize=8, color=colour, va="center",
        bbox=LABEL,
    )  # fmt: skip


def _turns(parts: Sequence[Parts]) -> Iterator[tuple[float, float, str]]:
    """When parts changed, at which height to say it, and how."""
    for before, now in pairwise(parts):
        for old, new in zip(before.leaders, now.leaders, strict=True):
            if old != new:
                yield now.time_s, 0.80, f"{new} leads for {old}"
        for height, verb, more, fewer in ((0.62, "left behind", now, before), (0.44, "taken back", before, now)):
            whom = sorted(set(more.left_behind) - set(fewer.left_behind))
            if whom:
                yield now.time_s, height, f"{', '.join(map(str, whom))} {verb}"


def _legend(panels: Sequence[Panel]) -> list[Line2D | Patch]:
    faulty = sorted({system for panel in panels for system in struck(panel.track, panel.scenario)})
    left = any(part.left_behind for panel in panels for part in panel.track.parts)
    nobodys = any(fault.blamed is None for panel in panels for fault in panel.scenario.fault)
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=PLANNED, ls="--", lw=1.8, label="planned path"),
        Line2D([], [], color="black", lw=2.4, label="mean of the healthy robots"),
        Line2D([], [], color=HEALTHY[1], marker="o", mec="white", label="healthy robots"),
        Line2D([], [], color=HEALTHY[1], marker="^", mec="white", ms=8, lw=0, label="leaders at the end"),
    ]
    if faulty:
        names = f"failed {robots(faulty)}"
        handles.append(Line2D([], [], color=FAILED, marker="X", mec="white", ms=9, lw=2, label=names))
        handles.append(Patch(color=FAULT, label="a fault acts"))
    if nobodys:
        handles.append(Patch(color=AIR, label="it blows on everyone"))
    if left:
        handles.append(Line2D([], [], color=FAILED, ls=":", marker="o", mfc="none", ms=8, label="left behind"))
    return handles
