"""The flight on a terminal while it goes on: one line a vehicle, on stderr."""

from __future__ import annotations

import math
import time
from itertools import chain
from types import TracebackType

import numpy as np
from rich.console import Console, Group
from rich.live import Live
from rich.padding import Padding
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from gcs.fleet_table import age, age_s, fleet_table, mode, number, part, share, trust_bar
from gcs.flight import Flight
from gcs.flight_state import Phase
from gcs.loop import Tick
from gcs.recording import sentences
from gcs.track import Parts, parts_of
from gcs.unblocked import Unblocked

REFRESH_S = 0.1
"""Wall time between two pictures: a fast simulation is not slowed by its display."""
WAITING_S = 10.0
"""Between two words on whom we wait for."""
WARNING = 4
"""MAV_SEVERITY up to which a vehicle's words are shown."""
MOST_ROWS = 24
"""Vehicles with a line of their own."""
COLUMNS = ("UAV", "role", "mode", "north", "east", "height", "speed", "battery", "link age", "trust")
LEAST_NEEDED = ("battery", "role", "speed", "east", "north")
"""Columns that a narrow terminal goes without, the first first."""


class Display:
    """A `Record` that shows. Where stderr is no terminal, it says each change of phase in a line."""

    def __init__(self, flight: Flight, console: Console, *, title: str) -> None:
        self._flight = flight
        self._console = console
        self._title = title
        self._live = Live(console=console, transient=True, auto_refresh=False) if console.is_terminal else None
        self._shown = -math.inf
        self._phase: Phase | None = None
        self._at_first = Parts(0.0, flight.scenario.swarm.leaders, ())
        self._parts = self._at_first
        self._released = np.zeros(len(flight.ids), bool)

    def __enter__(self) -> Display:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live is not None:
            self._live.stop()

    def tick(self, tick: Tick) -> None:
        """Show this turn of the loop, if it is time."""
        phase = tick.diagnosis.phase
        for system, severity, text in tick.swarm.words:
            if severity <= WARNING:
                self._console.print(f"vehicle {system}: {text}", highlight=False, markup=False)
        for answer in tick.swarm.answers:
            if answer.refused:
                self._console.print(answer.words, highlight=False)
        parts = parts_of(tick) or self._at_first
        released = tick.state.released
        news = sentences.parts(self._parts, parts), sentences.hands(tick.swarm.ids, self._released, released)
        for _, words in chain(*news):
            self._console.print(f"{_clock(tick, self._flight)}  {words}", highlight=False)
        self._parts, self._released = parts, released
        if self._live is None:
            if phase is not self._phase:
                self._console.print(f"{_clock(tick, self._flight)}  {phase.value}", highlight=False)
            elif phase is Phase.JOIN and tick.number % self._flight.scenario.time.ticks(WAITING_S) == 0:
                waiting = "; ".join(self._flight.lacking(tick.swarm, tick.time_ns))
                self._console.print(f"{_clock(tick, self._flight)}  waiting for {waiting}", highlight=False)
        elif self._due(phase):
            self._shown = time.monotonic()
            self._live.update(self._screen(tick), refresh=True)
        self._phase = phase

    def _due(self, phase: Phase) -> bool:
        """Whether to draw; nothing new over a picture that is still on its way to the terminal."""
        file = self._console.file
        if isinstance(file, Unblocked) and file.behind:
            return False
        return time.monotonic() - self._shown >= REFRESH_S or phase is not self._phase

    def _screen(self, tick: Tick) -> Group:
        diagnosis = tick.diagnosis
        head = Text.assemble(
            (self._title, "bold"), f"   {_clock(tick, self._flight)}   ", (diagnosis.phase.value, "cyan")
        )
        if diagnosis.phase is Phase.MISSION:
            head.append(f" · {diagnosis.task}")
        flown = 0.0 if math.isnan(diagnosis.mission_s) else diagnosis.mission_s
        bar = ProgressBar(total=self._flight.plan.read_out_s, completed=flown, width=72)
        below = Text(
            ""
        )  # where a terminal shows ^C: behind a full line it would begin another, and leave this head behind
        return Group(head, Padding(bar, (0, 0, 1, 0)), self._table(tick), below)

    def _table(self, tick: Tick) -> Table:
        ids = tick.swarm.ids[:MOST_ROWS]
        cells = zip(*(self._cells(tick, row) for row in range(len(ids))), strict=True)
        columns = dict(zip(COLUMNS, cells, strict=True))
        table = fleet_table(columns, width=self._console.width, least_needed=LEAST_NEEDED)
        if len(tick.swarm.ids) > MOST_ROWS:
            table.caption = f"and {len(tick.swarm.ids) - MOST_ROWS} more"
        return table

    def _cells(self, tick: Tick, row: int) -> tuple[Text, ...]:
        """One vehicle, column by column."""
        swarm, diagnosis = tick.swarm, tick.diagnosis
        system = swarm.ids[row]
        north, east = diagnosis.position_ne[row]
        return (
            Text(str(system)),
            part(system, self._parts, released=bool(tick.state.released[row])),
            mode(bool(swarm.armed[row]), int(swarm.autopilot[row]), int(swarm.custom_mode[row])),
            number(north, "m"),
            number(east, "m"),
            number(-swarm.position_ned[row, 2], "m"),
            number(math.hypot(*swarm.velocity_ned[row, :2]), "m/s"),
            share(float(swarm.battery[row])),
            age(age_s(tick.time_ns, int(swarm.position_ns[row]))),
            trust_bar(float(diagnosis.trust[row])),
        )


def _clock(tick: Tick, flight: Flight) -> str:
    mission_s = tick.diagnosis.mission_s
    if math.isnan(mission_s):
        return f"{tick.number * flight.scenario.time.period_s:6.1f} s after start"
    if mission_s > flight.plan.read_out_s:
        return f"{mission_s:6.1f} s of mission"
    return f"{mission_s:6.1f} of {flight.plan.read_out_s:.1f} s"
