"""All pictures of a film, one after another: explained to whoever may know everything, or blind."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from gcs.recording.history import History
from gcs.video.encoder import Encoder
from gcs.video.flock import Flock
from gcs.video.ground import course, grid, names, scale
from gcs.video.insight import Insight
from gcs.video.legend import legend
from gcs.video.motion import Motion
from gcs.video.panel import Panel
from gcs.video.stage import Stage
from gcs.video.view import HEIGHT, RATE, WIDTH, Box, View

Array = npt.NDArray[np.float64]

PANEL_PX = 350
ANY_ROBOT = np.array([0.20, 0.24, 0.30])
"""The colour of every robot of a blind film."""


def film(history: History, path: Path, program: str, *, blind: bool, speed: float, console: Any) -> None:
    """Write one. program: encodes;  speed: recorded seconds a second of film. Raises OSError."""
    motion = Motion.of(history)
    times_s = motion.frames(speed=speed, rate=RATE)
    pictures = unexplained(motion, times_s) if blind else explained(history, motion, times_s)
    told = f"{len(times_s)} pictures, {len(times_s) / RATE:.0f} s of film"
    if not console.is_terminal:
        console.print(told, highlight=False)
    columns = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn()
    bar = Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
    with Encoder(path, program) as encoder, bar:
        for picture in bar.track(pictures, total=len(times_s), description=told):
            encoder.add(picture)


def unexplained(motion: Motion, times_s: Array) -> Iterator[memoryview]:
    """Motion and nothing else, one picture at a time; each is good until the next."""
    view = View.planned(motion, Box(0, 0, WIDTH, HEIGHT))
    flock, stage = Flock(motion, view), Stage([grid(view)])
    colours = np.tile(ANY_ROBOT, (motion.place_ne.shape[1], 1))
    calls = None
    for time_s in times_s.tolist():
        if calls != motion.calls_by(time_s):
            calls = motion.calls_by(time_s)
            stage.lay(1, course(view, motion.plan, calls))
        yield stage.picture(flock.show(time_s, colours))


def explained(history: History, motion: Motion, times_s: Array) -> Iterator[memoryview]:
    """The same with what the flight knew, and what is known of it."""
    view = View.of(motion, Box(0, 0, WIDTH - PANEL_PX, HEIGHT))
    flock = Flock(motion, view)
    insight = Insight(history, flock, view)
    panel = Panel(history, insight, motion.tick_at(motion.begins_s), Box(WIDTH - PANEL_PX, 0, WIDTH, HEIGHT))
    stage = Stage([grid(view), *scale(view), *legend(insight), *panel.ground()])
    calls = news = at = None
    for time_s in times_s.tolist():
        tick = motion.tick_at(time_s)
        if calls != motion.calls_by(time_s):
            calls, news, at = motion.calls_by(time_s), None, None
            stage.lay(1, [*course(view, motion.plan, calls), *names(view, motion.plan, calls)])
        if news != panel.news(tick):
            news, at = panel.news(tick), None
            stage.lay(2, panel.told(tick))
        if at != tick:
            at = tick
            stage.lay(3, panel.gauges(tick))
        yield stage.picture(_moving(flock, insight, time_s, tick))


def _moving(flock: Flock, insight: Insight, time_s: float, tick: int) -> Iterator[Artist]:
    yield from insight.links(time_s, tick)
    yield from flock.show(time_s, insight.colours(tick))
    yield from insight.marks(time_s, tick)
