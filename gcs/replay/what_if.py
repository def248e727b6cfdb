"""`gcs replay` with a changed scenario: what it would have commanded, told to a person or a program."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rich import box
from rich.table import Table

from gcs.choices import Choices
from gcs.console import say, write
from gcs.guard import DONE
from gcs.replay.again import chosen
from gcs.replay.commanded import WhatIf, compared
from gcs.replay.pages import Pages, when
from gcs.summary import trust_of
from gcs.words import faults
from scenarios import Scenario

NO_ANSWER = "The telemetry is of the flight as it was flown, and does not answer; `gcs run RECORDING` flies it."
OF_THE_WORLD = (
    "What was changed is of the simulated world, or of what a flight is judged by: no decision asks for it, and the "
    "telemetry shows nothing of it."
)


def what_if(path: Path, choices: Choices, *, as_json: bool, console: Any) -> int:
    """Say what would have been commanded. A difference is an answer, and no failure: 0."""
    pages = Pages.of(path)
    scenario = chosen(pages, choices) or pages.told.scenario
    answer = compared(pages, scenario)
    for caveat in _caveats(pages, scenario, answer):
        say(caveat)
    notes = [OF_THE_WORLD, NO_ANSWER] if answer.only_the_world_changed else [NO_ANSWER]
    if as_json:
        write(answer.json())
        for note in notes:
            say(note)
    else:
        trusted = any(trust_of(one) is not None for one in (pages.told.scenario, scenario))
        _show(pages, answer, notes, trusted=trusted, console=console)
    return DONE


def _caveats(pages: Pages, scenario: Scenario, answer: WhatIf) -> Iterator[str]:
    """What the answer does not say of itself."""
    if pages.beyond:
        yield (
            f"the recording lacks frames from tick {pages.gaps[0].first} on: "
            f"{answer.ticks_beyond_gaps} ticks that it has behind them are left out"
        )
    if pages.lacking is not None:
        yield pages.lacking
    track = pages.told.track
    if trust_of(scenario) == "truth" and (track is None or track.measured):
        known = ", ".join(faults(scenario)) or "it has none, so everybody is trusted"
        yield f"nothing told the truth of this flight; trust is from the faults of its scenario: {known}"


def _show(pages: Pages, answer: WhatIf, notes: list[str], *, trusted: bool, console: Any) -> None:
    lines = [_headline(answer)]
    if answer.other_frames_differ:
        lines.append(f"{answer.other_frames_differ} frames besides, commands and requests, would have been others")
    if answer.problem is not None:
        either = " either" if answer.problem == pages.told.problem else ""
        lines.append(f"the flight would not have been completed{either}: {answer.problem}")
    for line in lines:
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    if answer.differ:
        console.print(_table(answer, trusted=trusted))
    for note in notes:
        console.print(note, highlight=False, markup=False, soft_wrap=True)


def _headline(answer: WhatIf) -> str:
    if answer.first_tick is None:
        return f"all {answer.setpoints} set-points would have been the same"
    others = f"{answer.differ} of {answer.setpoints} set-points would have been others"
    return f"{others}, from tick {answer.first_tick} on{when(answer.first_s)}"


def _table(answer: WhatIf, *, trusted: bool) -> Table:
    table = Table("robot", box=box.SIMPLE)
    for heading in ("set-points", "others", "RMS", "largest", "at", *TRUST[: 2 * trusted]):
        table.add_column(heading, justify="right")
    for vehicle in answer.vehicles:
        cells = (
            str(vehicle.setpoints),
            str(vehicle.differ),
            _speed(vehicle.rms_m_s),
            _speed(vehicle.largest_m_s),
            _time(vehicle.largest_s if vehicle.largest_m_s else None),
            _time(vehicle.distrusted_s),
            _time(vehicle.would_be_distrusted_s),
        )
        table.add_row(str(vehicle.vehicle), *cells[: len(cells) - 2 + 2 * trusted])
    table.caption = "RMS over the mission; times are since mission start"
    table.caption_justify = "left"
    return table


TRUST = ("distrusted from", "would be from")


def _speed(value: float | None) -> str:
    if value is None:
        return "–"
    return "< 0.001 m/s" if 0.0 < value < 0.001 else f"{value:.3f} m/s"


def _time(value: float | None) -> str:
    return "–" if value is None else f"{value:.1f} s"
