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
from gcs.video.trust_bars import TrustBars
from gcs.video.view import HEIGHT, Box
from gcs.words import controller_name

TITLE_WIDTH, TELLING_WIDTH = 44, 42
"""Letters in a line."""
LINE_PX = 16.0
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
        self._title = wrap(history.scenario.title, width=TITLE_WIDTH, max_lines=2, placeholder=" …")
        top = HEIGHT - 150.0
        self._bars = TrustBars(history, insight, Box(self._left, 0.0, self._right, top))
        self._happenings = [
            h for h in history.happenings if h.tick >= begins and (insight.trusting or h.kind is not Kind.DISTRUST)
        ]
        self._verdict = list(_verdict(history))
        self._rule = VERDICT_PX + 18.0 * len(self._verdict)

    def ground(self) -> Iterator[Artist]:
        """What never changes."""
        box = self._box
        yield boxes([(box.left, box.bottom, box.right, box.top)], "#ffffff")
        yield lines([[(box.left, box.bottom), (box.left, box.top)]], RULE, 1.0)
        for row, line in enumerate(self._title):
            yield words(self._left, HEIGHT - 34.0 - 17.0 * row, line, size=13)
        down = HEIGHT - 34.0 - 17.0 * len(self._title)
        yield words(self._left, down - 3.0, controller_name(self._history.scenario), size=13, weight="bold")
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
        mission_s, up = self._history.mission_s[tick], HEIGHT - 122.0
        if math.isnan(mission_s):
            yield words(self._left, up, self._history.phase[tick], size=20, weight="bold")
            return
        yield words(self._left, up, f"{min(mission_s, self._read_out_s):.1f} s", size=26, weight="bold")
        yield words(self._left + 104.0, up + 11.0, f"of {self._read_out_s:.1f} s", size=12, colour=PALE)
        yield words(self._left + 104.0, up - 4.0, self._history.task[tick], size=13)

    def _telling(self, tick: int, *, bottom: float) -> Iterator[Artist]:
        """The latest that happened, newest first, as much as there is room for."""
        up = self._bars.bottom - 30.0
        yield words(self._left, up, "what happened", size=12, colour=PALE)
        newest = True
        for happening in reversed([h for h in self._happenings if h.tick <= tick]):
            told = wrap(happening.words, width=TELLING_WIDTH, max_lines=3, placeholder=" …")
            if up - 4.0 - LINE_PX * len(told) < bottom:
                return
            colour = FAILED if happening.kind in (Kind.FAULT, Kind.PROBLEM) else DARK if newest else PALE
            yield words(self._left + 44.0, up - 4.0 - LINE_PX, _when(happening), size=12, colour=PALE, ha="right")
            for line in told:
                up -= LINE_PX
                yield words(self._left + 54.0, up - 4.0, line, size=12, colour=colour)
            up -= 4.0
            newest = False

    def _ended(self, tick: int) -> bool:
        """Whether the verdict is out: at the read-out, or where the flight's last mission tick has passed."""
        later = np.isfinite(self._history.mission_s[tick + 1 :]).any()
        return bool(self._history.mission_s[tick] >= self._read_out_s - 1e-9 or not later)

    def _judged(self) -> Iterator[Artist]:
        yield lines([[(self._left, self._rule), (self._right, self._rule)]], RULE, 1.0)
        (head, colour), *reasons = self._verdict
        yield words(self._left, self._rule - 28.0, head, size=20, weight="bold", colour=colour)
        for row, (line, shade) in enumerate(reasons, start=1):
            yield words(self._left, self._rule - 34.0 - 18.0 * row, line, colour=shade)


def _when(happening: Happening) -> str:
    return "–" if math.isnan(happening.mission_s) else f"{happening.mission_s:.1f} s"


def _verdict(history: History) -> Iterator[tuple[str, str]]:
    """Lines and their colours, the first large."""
    if history.problem is not None:
        yield "NOT COMPLETED", FAILED
        for line in wrap(history.problem, width=TITLE_WIDTH, max_lines=2, placeholder=" …"):
            yield line, DARK
        return
    result = None if history.track is None else score(history.track, history.scenario)
    if result is None:
        yield "NO SCORE", FAILED
        yield "it ended before its read-out", DARK
        return
    expect = history.scenario.expect
    yield ("PASSED", PASSED) if result.passed else ("FAILED", FAILED)
    yield f"heading off by {result.heading_error_deg:.1f}° (allowed {expect.heading_error_deg:g}°)", DARK
    yield f"{result.distance_to_target_m:.1f} m from the target (allowed {expect.distance_to_target_m:g} m)", DARK
    if result.min_separation_m < expect.min_separation_m:
        yield f"as close as {result.min_separation_m:.2f} m (allowed {expect.min_separation_m:g} m)", DARK
