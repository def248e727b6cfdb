"""Flights side by side, from their recordings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich import box
from rich.table import Table
from rich.text import Text

from gcs.recording.reader import Flown, UnreadableRecording, read, shown
from gcs.scoring import Score, score
from gcs.summary import trust_of
from gcs.words import controller_name, ending, faults, robots

FORMATS = (".png", ".pdf", ".svg")


class UnwritablePicture(OSError):
    """A picture that cannot be written, in one sentence."""


def compare(recordings: Sequence[Path], *, picture: Path, console: Any) -> None:
    """Print a table and draw a picture. Raises UnreadableRecording or UnwritablePicture."""
    if not recordings:
        raise UnreadableRecording("compare: name at least one recording, or the folder of a run")
    if picture.suffix not in FORMATS:
        raise UnwritablePicture(f"--out {picture}: must end in {', '.join(FORMATS)}")
    flights = [read(shown(path)) for path in recordings]
    console.print(_table(flights))
    for flight in flights:
        console.print(f"recording  {flight.path.resolve()}", highlight=False, soft_wrap=True, markup=False)
    _draw(flights, picture)
    console.print(f"picture    {picture.resolve()}", highlight=False, soft_wrap=True, markup=False)


def _table(flights: Sequence[Flown]) -> Table:
    title = Text(flights[0].scenario.title, style="bold")
    table = Table(title=title, title_justify="left", box=box.SIMPLE)
    table.add_column("")
    for flight in flights:
        table.add_column(controller_name(flight.scenario), justify="right")
    scores = [None if flight.track is None else score(flight.track, flight.scenario) for flight in flights]
    expect = flights[0].scenario.expect
    rows = (
        (f"heading error, at most {expect.heading_error_deg:g}°", "heading_error_deg", "{:.1f}°"),
        (f"distance to target, at most {expect.distance_to_target_m:g} m", "distance_to_target_m", "{:.1f} m"),
        (f"closest two robots, at least {expect.min_separation_m:g} m", "min_separation_m", "{:.1f} m"),
    )
    for words, name, form in rows:
        table.add_row(words, *("–" if s is None else form.format(getattr(s, name)) for s in scores))
    table.add_row("what goes wrong", *(Text(", ".join(faults(flight.scenario)) or "nothing") for flight in flights))
    table.add_row("distrusted after", *map(_found, flights, scores))
    left = [_left_behind(flight) for flight in flights]
    if any(left):
        table.add_row("left behind", *(robots(systems) if systems else "nobody" for systems in left))
    table.add_row("mission", *map(_verdict, flights, scores))
    return table


def _found(flight: Flown, result: Score | None) -> str:
    """Who was rightly distrusted, how soon, and how many wrongly."""
    if result is None or trust_of(flight.scenario) is None:
        return "–"
    if flight.track is None or not flight.track.faults_known:
        return "no truth was told"
    found = [f"robot {system}: {seconds:.1f} s" for system, seconds in result.detected.items()]
    wrongly = [f"{result.false_alarms} wrongly"] if result.false_alarms else []
    return ", ".join(found + wrongly) or "nobody"


def _left_behind(flight: Flown) -> tuple[int, ...]:
    return flight.track.parts[-1].left_behind if flight.track is not None and flight.track.parts else ()


def _verdict(flight: Flown, result: Score | None) -> Text:
    ended = ending(flight.problem, None if result is None else result.passed)
    return Text(str(ended), style="green" if ended.good else "red")


def _draw(flights: Sequence[Flown], picture: Path) -> None:
    from gcs.picture import Panel, draw_side_by_side

    panels = [
        Panel(controller_name(flight.scenario), flight.track, flight.scenario, flight.problem)
        for flight in flights
        if flight.track is not None
    ]
    if not panels:
        raise UnreadableRecording("compare: no recording has a mission to draw")
    try:
        draw_side_by_side(panels, picture, heading=flights[0].scenario.title)
    except OSError as error:
        raise UnwritablePicture(f"--out {picture}: cannot be written: {error.strerror or error}") from None
