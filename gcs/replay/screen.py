"""A replay on a terminal: when it is, where that lies in the recording, every vehicle, what happened, and the keys."""

from __future__ import annotations

import datetime as dt
import math
import re
from collections.abc import Callable, Iterator, Sequence
from itertools import groupby

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from gcs.fleet_table import age, fleet_table, mode, number, part, share, trust_bar
from gcs.flight_state import Phase
from gcs.recording.history import Happening
from gcs.replay.bar import MARKS, bar, marks, so_far
from gcs.replay.controls import HELP, Controls
from gcs.replay.player import Player
from gcs.replay.timeline import Timeline
from gcs.replay.view import Vehicle, View
from gcs.scoring import DISTRUSTED
from gcs.unblocked import Unblocked

REFRESH_NS = 100_000_000
"""Real time between two pictures."""
COLUMNS = ("UAV", "role", "mode", "north", "east", "height", "speed", "set-point", "battery", "age", "trust")
OF_FRAMES = ("UAV", "mode", "north", "east", "height", "speed", "battery", "age")
"""Without what only flights of ours tell."""
LEAST_NEEDED = ("battery", "speed", "role", "set-point", "age", "east", "north")
"""Columns that a narrow terminal goes without, the first first."""
WIDE = 100
"""Characters from which trust is drawn, and not only written."""
ROOMY, WORDS = 9, 3
"""Lines round the vehicles' and the happenings', where there is room for all, and those that the latter have then."""
LOW, BARRED = 16, 8
"""Lines below which what happened gives way to vehicles, and below which the bar does."""
NEWS_NS = 2_000_000_000
"""What happened so short a (recorded) time ago stands out."""
_VEHICLE = re.compile(r"vehicle (\d+): (.*)")


class Screen:
    """The whole terminal, for as long as it is entered."""

    def __init__(self, console: Console, timeline: Timeline, view: Callable[[int], View], title: str) -> None:
        """view: position [ns] → what there is to see."""
        self._console, self._timeline, self._view, self._title = console, timeline, view, title
        self._live = Live(console=console, screen=True, auto_refresh=False)
        self._shown_ns = -REFRESH_NS
        self._shown: tuple[Controls, tuple[int, int]] | None = None
        """What the picture on the terminal was drawn from."""

    def enter(self) -> None:
        """Take the terminal, and draw at once."""
        self._shown_ns, self._shown = -REFRESH_NS, None
        self._live.start()

    def leave(self) -> None:
        """Give it back as it was."""
        self._live.stop()

    def show(self, controls: Controls, now_ns: int, *, at_once: bool = False) -> None:
        """If it is time, if anything is another than it was, and if the terminal took the last picture."""
        file = self._console.file
        if isinstance(file, Unblocked) and file.behind:
            return
        shown = controls, self._console.size
        if shown != self._shown and (at_once or now_ns - self._shown_ns >= REFRESH_NS):
            self._shown_ns, self._shown = now_ns, shown
            self._live.update(self._picture(controls), refresh=True)

    def _picture(self, controls: Controls) -> Group:
        width, height = self._console.size
        view = self._view(controls.player.position_ns)
        return picture(controls, self._timeline, view, title=self._title, width=width, height=height)


def picture(controls: Controls, timeline: Timeline, view: View, *, title: str, width: int, height: int) -> Group:
    """As many lines as the terminal has, none longer than it is wide.

    The keys have one always; in a low terminal vehicles come before what happened, and that before empty lines.
    """
    roomy = height >= ROOMY + len(view.vehicles) + WORDS
    above = _above(controls.player, timeline, view, title, width, roomy=roomy, barred=height >= BARRED)
    room = max(height - len(above) - 2 - roomy, 0)
    vehicles = _chosen(view.vehicles, max(room - (WORDS if height >= LOW else 0), 0))
    table: list[RenderableType] = [_table(vehicles, of_flight=timeline.flight is not None, width=width)]
    more = len(view.vehicles) - len(vehicles)
    if more and room:
        table.append(Text(f"and {more} more, for which this terminal has no line", style="dim italic"))
    room -= len(vehicles) + len(table) - 1
    news = list(_news(so_far(timeline.happenings, controls.player.position_ns), controls.player.position_ns, timeline))
    news = news[max(len(news) - room, 0) :]
    lines = [*above, *table, *[Text()] * roomy, *news, *[Text()] * (room - len(news)), _bottom(controls, width)]
    for text in lines:
        if isinstance(text, Text):
            text.no_wrap, text.overflow = True, "ellipsis"
    return Group(*lines)


def _above(
    player: Player, timeline: Timeline, view: View, title: str, width: int, *, roomy: bool, barred: bool
) -> list[RenderableType]:
    """The lines above the vehicles. roomy: whether there is room for all;  barred: for the bar at least."""
    state = _between(_state(timeline, player, view), _motion(player), width)
    if not barred:
        return [state]
    first, last = (f"{timeline.seconds(at_ns):.1f} s" for at_ns in (timeline.start_ns, timeline.end_ns))
    line = max(width - len(first) - len(last) - 2, 1)
    bars = [
        Text.assemble(first, " ", bar(timeline, player.position_ns, line), " ", last),
        Text.assemble(" " * (len(first) + 1), marks(timeline, line)),
    ]
    if not roomy:
        return [state, *bars]
    head = _between(Text(title, style="bold"), Text(_utc(player.position_ns), style="dim"), width)
    return [head, state, Text(), *bars, Text()]


def _between(left: Text, right: Text, width: int) -> Text:
    """Both in one line, at its ends; what the left has too much is cut off."""
    left.truncate(max(width - right.cell_len - 2, 0), overflow="ellipsis", pad=True)
    return Text.assemble(left, "  ", right)


def _utc(time_ns: int) -> str:
    whole_s, rest_ns = divmod(time_ns, 1_000_000_000)
    moment = dt.datetime.fromtimestamp(whole_s, dt.UTC)
    return f"{moment:%Y-%m-%d %H:%M:%S}.{rest_ns // 10_000_000:02d} UTC"


def _state(timeline: Timeline, player: Player, view: View) -> Text:
    """Seconds, phase and task, and who is not heard."""
    text = Text(f"{timeline.seconds(player.position_ns):z.1f} s {timeline.since}   ")
    text.append(view.phase, style="cyan")
    if view.task and view.phase == Phase.MISSION.value:
        text.append(f" · {view.task}")
    silent = [
        silence.vehicle for silence in timeline.silences if silence.begin_ns < player.position_ns <= silence.end_ns
    ]
    if None in silent:
        text.append("   nobody is heard", style="yellow")
    elif silent:
        text.append(f"   silent: {', '.join(map(str, silent))}", style="yellow")
    return text


def _motion(player: Player) -> Text:
    arrow = "◀" if player.reverse else "▶"
    return Text.assemble(("paused ", "yellow") if player.paused else "", (f"{arrow} {float(player.speed):g}×", "bold"))


def _chosen(vehicles: Sequence[Vehicle], room: int) -> tuple[Vehicle, ...]:
    """As many as there is room for, those that something is wrong with before others, by their ids."""
    if len(vehicles) <= room:
        return tuple(vehicles)
    first = sorted(vehicles, key=lambda vehicle: (not _troubled(vehicle), vehicle.system))
    return tuple(sorted(first[: max(room - 1, 0)], key=lambda vehicle: vehicle.system))


def _troubled(vehicle: Vehicle) -> bool:
    silent = age(vehicle.age_s).style != ""
    return vehicle.trust < DISTRUSTED or vehicle.system in vehicle.part.left_behind or silent


def _table(vehicles: Sequence[Vehicle], *, of_flight: bool, width: int) -> Table:
    headings = COLUMNS if of_flight else OF_FRAMES
    cells = [_cells(vehicle, drawn=width >= WIDE) for vehicle in vehicles]
    columns = {heading: [row[heading] for row in cells] for heading in headings}
    return fleet_table(columns, width=width, least_needed=LEAST_NEEDED)


def _cells(vehicle: Vehicle, *, drawn: bool) -> dict[str, Text]:
    north, east, height = vehicle.place
    trust = trust_bar(vehicle.trust) if not math.isnan(vehicle.trust) else Text("–")
    return {
        "UAV": Text(str(vehicle.system), style="bold red" if vehicle.trust < DISTRUSTED else ""),
        "role": part(vehicle.system, vehicle.part),
        "mode": mode(vehicle.armed, vehicle.autopilot, vehicle.custom_mode),
        "north": number(north, "m"),
        "east": number(east, "m"),
        "height": number(height, "m"),
        "speed": number(vehicle.speed, "m/s"),
        "set-point": _setpoint(*vehicle.setpoint_ne),
        "battery": share(vehicle.battery),
        "age": age(vehicle.age_s),
        "trust": trust if drawn else trust[-4:],
    }


def _setpoint(north_m_s: float, east_m_s: float) -> Text:
    """Speed and course."""
    if math.isnan(north_m_s):
        return Text("–")
    course_deg = round(math.degrees(math.atan2(east_m_s, north_m_s))) % 360
    return Text(f"{math.hypot(north_m_s, east_m_s):.1f} m/s {course_deg:03d}°")


def _news(happened: Sequence[Happening], position_ns: int, timeline: Timeline) -> Iterator[Text]:
    """In the order of time; what several vehicles said at once is one line."""
    for (time_ns, kind, said), several in groupby(happened, lambda one: (one.time_ns, one.kind, _said(one))):
        whom = [happening.vehicle for happening in several if happening.vehicle is not None]
        words = f"vehicle{'s' * (len(whom) > 1)} {_ranges(whom)}: {said[1]}" if said[0] else said[1]
        fresh = position_ns - time_ns <= NEWS_NS
        letter, style = MARKS[kind]
        when = f" {timeline.seconds(time_ns):7.1f} s  "
        yield Text.assemble((letter, style), (when, "" if fresh else "dim"), (words, "" if fresh else "dim"))


def _ranges(ids: Sequence[int]) -> str:
    """System ids in words: 1–3, 5."""
    runs: list[list[int]] = []
    for system in sorted(set(ids)):
        if runs and system == runs[-1][-1] + 1:
            runs[-1].append(system)
        else:
            runs.append([system])
    return ", ".join(str(run[0]) if len(run) == 1 else f"{run[0]}–{run[-1]}" for run in runs)


def _said(happening: Happening) -> tuple[bool, str]:
    """Whether an autopilot said it, and what."""
    match = _VEHICLE.fullmatch(happening.words)
    return (False, happening.words) if match is None else (True, match[2])


def _bottom(controls: Controls, width: int) -> Text:
    if controls.typed is not None:
        return Text.assemble(
            ("go to ", "bold"), controls.typed, ("▏", "blink"), ("   seconds (12.5, 1:05) or words of an event", "dim")
        )
    if controls.note:
        return Text(controls.note, style="yellow")
    text = Text()
    for key, what in HELP:
        more = Text.assemble("  " * bool(text), (key, "bold"), " ", (what, "dim"))
        if text.cell_len + more.cell_len > width:
            break
        text.append_text(more)
    return text
