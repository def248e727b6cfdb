"""A recording in a line of characters: how far it is played, where nobody was heard, and what happened when."""

from __future__ import annotations

from collections.abc import Sequence

from rich.text import Text

from gcs.recording.history import Happening, Kind
from gcs.replay.timeline import Timeline

MARKS = {
    Kind.PROBLEM: ("!", "bold red"),
    Kind.DISTRUST: ("D", "bold red"),
    Kind.FAULT: ("F", "magenta"),
    Kind.LINK: ("L", "yellow"),
    Kind.HANDS: ("H", "yellow"),
    Kind.ROLES: ("R", "yellow"),
    Kind.RATING: ("r", "blue"),
    Kind.PHASE: ("P", "cyan"),
    Kind.WORD: ("w", "dim"),
}
"""A letter and a style for each kind, the most telling first: that one is seen where several happened at once."""


def bar(timeline: Timeline, position_ns: int, width: int) -> Text:
    """Played ━, yet to come ─, ╌ while a vehicle was silent and blank while everybody was; ● is now."""
    cells = [("━", "cyan")] * width
    here = _cell(timeline, position_ns, width)
    cells[here:] = [("─", "dim")] * (width - here)
    for silence in sorted(timeline.silences, key=lambda silence: silence.vehicle is None):
        first, last = (_cell(timeline, at_ns, width) for at_ns in (silence.begin_ns, silence.end_ns))
        cells[first : last + 1] = [(" ", "") if silence.vehicle is None else ("╌", "yellow")] * (last + 1 - first)
    cells[here] = ("●", "bold")
    return Text.assemble(*cells)


def marks(timeline: Timeline, width: int) -> Text:
    """Below the bar: what happened, each kind by its letter."""
    cells = [(" ", "")] * width
    kinds = list(MARKS)
    for happening in sorted(timeline.happenings, key=lambda happening: -kinds.index(happening.kind)):
        cells[_cell(timeline, happening.time_ns, width)] = MARKS[happening.kind]
    return Text.assemble(*cells)


def _cell(timeline: Timeline, time_ns: int, width: int) -> int:
    return min((time_ns - timeline.start_ns) * width // (timeline.end_ns - timeline.start_ns), width - 1)


def so_far(happenings: Sequence[Happening], position_ns: int) -> list[Happening]:
    """What has happened by then."""
    return [happening for happening in happenings if happening.time_ns < position_ns]
