"""The side of the picture: what is flown, the mission's clock, each robot's trust, what just happened, the verdict."""

from __future__ import annotations

import math
from collections.abc import Iterator
from textwrap import wrap

import numpy as np
from matplotlib.artist import Artist

from gcs.mission import plan
from gcs.recording.happenings import Happening, Kind
from gcs.recording.history import History
from gcs.scoring import score
from gcs.video.ink import DARK, FAILED, PALE, RULE, boxes, lines, words
from gcs.video.insight import Insight
from gcs.video.motion import AFTER_S
from gcs.video.trust_bars import TrustBars
from gcs.video.view import HEIGHT, Box
from gcs.words import controller_name, ending, measured

TITLE_WIDTH, NAME_WIDTH, TELLING_WIDTH = 44, 36, 33
"""Letters in a line."""
SIZE, LINE_PX = 14, 18.0
TITLE_UP, CLOCK_UP, BARS_UP = HEIGHT - 34.0, HEIGHT - 142.0, HEIGHT - 168.0
"""Where each begins."""
CLOCK_WIDE = 116.0
PASSED = "#1b6e53"
VERDICT_PX = 36.0
"""Of its heading, and the space below it."""


class Panel:
    """A column of words and bars, for a history."""

    def __init__(self, history: History, insight: Insight, begins: int, box: Box) -> None:
        """begins: the film's first tick; what happened before is not told."""
        self._history, self._box = history, box
        self._left, self._right = box.left + 20.0, box.right - 20.0
        self._read_out_s = plan(history.scenario).read_out_s
        self._title = _wrapped(history.scenario.title, TITLE_WIDTH)
        self._bars = TrustBars(history, insight, Box(self._left, box.bottom, self._right, BARS_UP))
        self._happenings = [happening for happening in history.happenings if happening.tick >= begins]
        self._ends = _ends(history, self._read_out_s)
        self._verdict = list(_verdict(history))
        self._rule = VERDICT_PX + 18.0 * len(self._verdict)

    def ground(self) -> Iterator[Artist]:
        """What never changes."""
        box = self._box
        yield boxes([(box.left, box.bottom, box.right, box.top)], "#ffffff")
        yield lines([[(box.left, box.bottom), (box.left, box.top)]], RULE, 1.0)
        for row, line in enumerate(self._title):
            yield words(self._left, TITLE_UP - LINE_PX * row, line)
        under = TITLE_UP - LINE_PX * len(self._title) - 4.0
        for row, line in enumerate(_wrapped(controller_name(self._history.scenario), NAME_WIDTH)):
            yield words(self._left, under - LINE_PX * row, line, size=SIZE, weight="bold")
        yield from self._bars.ground()

    def gauges(self, tick: int) -> Iterator[Artist]:
        """What changes with every tick: clock and trust."""
        yield from self._clock(tick)
        yield from self._bars.show(tick)

    def news(self, tick: int) -> tuple[int, bool]:
        """What `told` depends on: how much has happened, and whether the verdict is out."""
        return sum(happening.tick <= tick for happening in self._happenings), self._ended(tick)

    def told(self, tick: int) -> Iterator[Artist]:
        """What changes now and then: happenings, and in the end the verdict."""
        ended = self._ended(tick)
        if ended:
            yield from self._judged()
        yield from self._telling(tick, bottom=self._rule + 16.0 if ended else 24.0)

    def _clock(self, tick: int) -> Iterator[Artist]:
        mission_s = self._history.mission_s[tick]
        if math.isnan(mission_s):
            yield words(self._left, CLOCK_UP, self._history.phase[tick], size=22, weight="bold")
            return
        yield words(self._left, CLOCK_UP, f"{min(mission_s, self._read_out_s):.1f} s", size=28, weight="bold")
        beside = self._left + CLOCK_WIDE
        yield words(beside, CLOCK_UP + 13.0, f"of {self._read_out_s:.1f} s", colour=PALE)
        yield words(beside, CLOCK_UP - 4.0, self._history.task[tick], size=SIZE)

    def _telling(self, tick: int, *, bottom: float) -> Iterator[Artist]:
        """The latest that happened, newest first, as much as there is room for."""
        up = self._bars.bottom - 30.0
        yield words(self._left, up, "what happened", colour=PALE)
        newest = True
        for happening in reversed([h for h in self._happenings if h.tick <= tick]):
            told = _wrapped(happening.words, TELLING_WIDTH, lines=3)
            if up - 4.0 - LINE_PX * len(told) < bottom:
                return
            colour = FAILED if happening.kind in (Kind.FAULT, Kind.PROBLEM) else DARK if newest else PALE
            yield words(self._left + 46.0, up - 6.0 - LINE_PX, _when(happening), colour=PALE, ha="right")
            for line in told:
                up -= LINE_PX
                yield words(self._left + 56.0, up - 6.0, line, colour=colour)
            up -= 4.0
            newest = False

    def _ended(self, tick: int) -> bool:
        """Whether the verdict is out."""
        return tick >= self._ends

    def _judged(self) -> Iterator[Artist]:
        yield lines([[(self._left, self._rule), (self._right, self._rule)]], RULE, 1.0)
        (head, colour), *reasons = self._verdict
        yield words(self._left, self._rule - 28.0, head, size=20, weight="bold", colour=colour)
        for row, (line, shade) in enumerate(reasons, start=1):
            yield words(self._left, self._rule - 34.0 - 18.0 * row, line, colour=shade)


def _wrapped(text: str, width: int, *, lines: int = 2) -> list[str]:
    return wrap(text, width=width, max_lines=lines, placeholder=" …")


def _ends(history: History, read_out_s: float) -> int:
    """The tick at which a verdict is given: of the read-out, or shortly before the flight's end without one."""
    read_out = np.flatnonzero(history.mission_s >= read_out_s - 1e-9)
    if read_out.size:
        return int(read_out[0])
    flown = np.flatnonzero(np.isfinite(history.mission_s))
    last_ns = history.time_ns[flown[-1]] if flown.size else history.time_ns[-1] - round(AFTER_S * 1e9)
    return int(np.searchsorted(history.time_ns, last_ns))


def _when(happening: Happening) -> str:
    return "–" if math.isnan(happening.mission_s) else f"{happening.mission_s:.1f} s"


def _verdict(history: History) -> Iterator[tuple[str, str]]:
    """Lines and their colours, the first large."""
    result = None if history.track is None else score(history.track, history.scenario)
    ended = ending(history.problem, None if result is None else result.passed)
    yield ended.word.upper(), PASSED if ended.good else FAILED
    for line in _wrapped(ended.why, TITLE_WIDTH):
        yield line, DARK
    if result is not None and history.problem is None:
        for line in measured(result, history.scenario):
            yield line, DARK
