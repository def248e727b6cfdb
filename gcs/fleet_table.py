"""A table of vehicles on a terminal, live and replayed: its cells, and the columns that a narrow one goes without."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from rich.table import Table
from rich.text import Text

from gcs.flight import STALE_NS
from gcs.scoring import DISTRUSTED
from gcs.track import Parts
from wire.modes import mode_name

LEFT = ("UAV", "role", "mode")
"""Columns whose cells stand at their left."""


def fleet_table(columns: Mapping[str, Sequence[Text]], *, width: int, least_needed: Sequence[str]) -> Table:
    """Heading → cells, a row for each vehicle; without those of the least needed, the first first, that do not fit."""
    kept = dict(columns)
    for heading in least_needed:
        if sum(_width(*column) for column in kept.items()) > width:
            del kept[heading]
    table = Table(box=None, padding=(0, 1), header_style="dim")
    for heading in kept:
        table.add_column(heading, justify="left" if heading in LEFT else "right", no_wrap=True)
    for row in zip(*kept.values(), strict=True):
        table.add_row(*row)
    return table


def _width(heading: str, cells: Sequence[Text]) -> int:
    """Of a column on the screen, with the space around it."""
    return max([len(heading), *(cell.cell_len for cell in cells)]) + 2


def part(system: int, parts: Parts, *, released: bool = False) -> Text:
    """Who has which part in the swarm; released: whether it is not ours to command."""
    if released:
        return Text("not ours", style="red")
    if system in parts.left_behind:
        return Text("left behind", style="yellow")
    return Text("leader" if system in parts.leaders else "follower")


def mode(armed: bool, autopilot: int, custom_mode: int) -> Text:
    """By our name."""
    return Text(mode_name(autopilot, custom_mode)) if armed else Text("disarmed", style="dim")


def number(value: float, unit: str) -> Text:
    """To a tenth; NaN is a dash."""
    return Text("–" if math.isnan(value) else f"{value:z.1f} {unit}")


def share(value: float) -> Text:
    """In per cent; NaN is a dash."""
    return Text("–" if math.isnan(value) else f"{value:.0%}")


def age_s(now_ns: int, heard_ns: int) -> float:
    """How old telemetry is that arrived then; NaN of a vehicle that was never heard."""
    return (now_ns - heard_ns) / 1e9 if heard_ns > 0 else math.nan


def age(seconds: float) -> Text:
    """Of telemetry, red where it is stale; NaN of a vehicle that was never heard."""
    if math.isnan(seconds):
        return Text("not heard", style="yellow")
    return Text(f"{seconds:.2f} s", style="red" if seconds > STALE_NS / 1e9 else "")


def trust_bar(trust: float) -> Text:
    """Green, or red of a vehicle that is distrusted."""
    return Text(f"{'█' * round(trust * 5):·>5} {trust:.2f}", style="red" if trust < DISTRUSTED else "green")
