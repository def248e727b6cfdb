"""`gcs log info`: what is in a recording or a .tlog, and whether it is whole, for a person or as JSON."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import orjson
from rich import box
from rich.table import Table
from rich.text import Text

from gcs.console import write
from gcs.recording.files import METADATA, recovering
from gcs.recording.inventory import Inventory, Listed, inventory
from gcs.recording.reader import CUT_SHORT, located
from gcs.recording.recovery import RECOVERED
from gcs.summary import trust_of
from gcs.words import controller_name, ending, faults

WIDEST = 500
"""Columns of a terminal, at most: to see what a table would like."""


def show(path: Path, *, as_json: bool, console: Any) -> int:
    """Say what is in a file, or in the recording of a run's folder. Exit code. Raises UnreadableRecording."""
    found = inventory(located(path))
    if as_json:
        write(orjson.dumps(_json(found)))
        return 0
    head = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    head.add_column(no_wrap=True, style="dim")
    head.add_column(overflow="fold")
    if found.scenario is not None:
        head.title, head.title_style, head.title_justify = Text(found.scenario.title), "bold", "left"
    for name, words in _lines(found):
        head.add_row(name, Text(words))
    console.print(head)
    console.print(_fitting(found, console))
    return 0


def _lines(found: Inventory) -> Iterator[tuple[str, str]]:
    yield "file", f"{found.path.resolve()}, {_size(found.bytes)}"
    yield "state", _state(found)
    yield "vehicles", str(found.vehicles)
    about, scenario = found.metadata.get(METADATA, {}), found.scenario
    if "started" in about:
        yield "flown", about["started"]
    yield "lasts", f"{found.duration_s:.1f} s, {found.messages} messages"
    if scenario is not None:
        yield "scenario", about.get("scenario", "")
        yield "controller", controller_name(scenario)
        yield "goes wrong", " and ".join(faults(scenario)) or "nothing"
        yield "outcome", _outcome(found)
    if about.get("seed"):
        yield "seed", about["seed"]
    if found.versions:
        yield "versions", ", ".join(f"{name} {number}" for name, number in found.versions.items())
    if RECOVERED in found.metadata:
        yield "recovered", found.metadata[RECOVERED].get("words", "")
    for part in found.parts:
        yield "goes on in", f"{part.name}, {_size(part.stat().st_size)}"
    if found.journal is not None:
        yield "journal", f"{found.journal.name}, {_size(found.journal.stat().st_size)}"
    if found.bytes_per_vehicle_minute is not None:
        beside = "" if found.journal is None and not found.parts else ", what lies beside this file not counted"
        yield "costs", f"{_size(found.bytes_per_vehicle_minute)} for a vehicle's minute{beside}"


def _state(found: Inventory) -> str:
    if found.whole:
        return f"whole, as far as this file goes: {recovering(found.path)} joins all" if found.parts else "whole"
    lost = sum(damage.length for damage in found.damage)
    what = "damaged" if found.ended else "torn: it ends without its summary"
    unreadable = f", {lost} bytes cannot be read" if lost else ""
    return f"{what}{unreadable}: {recovering(found.path)} rebuilds it"


def _outcome(found: Inventory) -> str:
    summary = found.summary
    scored = summary.get("heading_error_deg") is not None
    return str(ending(summary.get("problem", CUT_SHORT), summary["passed"] if scored else None))


def _size(size: float) -> str:
    return f"{size / 1e6:.2f} MB" if size >= 1e6 else f"{size / 1e3:.1f} kB"


def _fitting(found: Inventory, console: Any) -> Table:
    """The topics; without what their messages are, if there is no room for it and topics tell rows apart."""
    topics = _topics(found)
    wide = console.measure(topics, options=console.options.update(width=WIDEST)).maximum > console.width
    names = [name for name, _of, _group in _grouped(found.listed)]
    return _topics(found, kinds=False) if wide and len(set(names)) == len(names) else topics


def _topics(found: Inventory, *, kinds: bool = True) -> Table:
    """A row for each topic; those that differ only in the vehicle share one. kinds: with what its messages are."""
    table = Table(box=box.SIMPLE_HEAD)
    table.add_column("topic", overflow="fold")
    if kinds:
        table.add_column("what", overflow="fold")
    for heading in ("messages", "Hz", "kB"):
        table.add_column(heading, justify="right", no_wrap=True)
    for name, of, group in _grouped(found.listed):
        messages, size = sum(one.messages for one in group), sum(one.bytes for one in group)
        rate = f"{messages / len(group) / found.duration_s:.1f}" if found.duration_s else "–"
        what = [Text(of)] if kinds else []
        table.add_row(Text(name), *what, str(messages), rate, f"{size / 1e3:.1f}")
    return table


_VEHICLE = re.compile(r"^(/mavlink/|/uav/)(\d+)")


def _grouped(listed: Sequence[Listed]) -> Iterator[tuple[str, str, Sequence[Listed]]]:
    """Topics of several vehicles under one name, and what is in them."""
    groups = defaultdict[tuple[str, str], list[Listed]](list)
    for one in listed:
        groups[_VEHICLE.sub(r"\1*", one.sort.topic), one.sort.kind or one.sort.encoding].append(one)
    for (name, of), group in groups.items():
        systems = sorted(int(match[2]) for one in group if (match := _VEHICLE.match(one.sort.topic)))
        yield name.replace("*", _span(systems), 1) if systems else name, of, group


def _span(numbers: Sequence[int]) -> str:
    """1; 1,3; 1…6."""
    if len(numbers) > 2 and numbers[-1] - numbers[0] == len(numbers) - 1:
        return f"{numbers[0]}…{numbers[-1]}"
    return ",".join(map(str, numbers))


def _json(found: Inventory) -> dict[str, Any]:
    about, scenario = found.metadata.get(METADATA, {}), found.scenario
    return {
        "file": str(found.path.resolve()),
        "bytes": found.bytes,
        "whole": found.whole,
        "ended": found.ended,
        "damage": [{"at_byte": damage.at, "bytes": damage.length} for damage in found.damage],
        "title": None if scenario is None else scenario.title,
        "scenario": about.get("scenario"),
        "started": about.get("started"),
        "begin_ns": found.begin_ns,
        "duration_s": found.duration_s,
        "vehicles": found.vehicles,
        "controller": None if scenario is None else scenario.control.rule,
        "trust": None if scenario is None else trust_of(scenario),
        "seed": int(about["seed"]) if about.get("seed", "").isdecimal() else None,
        "versions": found.versions,
        "passed": found.summary.get("passed"),
        "problem": found.summary.get("problem", None if scenario is None else CUT_SHORT),
        "recovered": found.metadata.get(RECOVERED),
        "parts": [str(part.resolve()) for part in found.parts],
        "journal": None if found.journal is None else str(found.journal.resolve()),
        "bytes_per_vehicle_minute": found.bytes_per_vehicle_minute,
        "messages": found.messages,
        "topics": [
            {
                "topic": one.sort.topic,
                "encoding": one.sort.encoding,
                "of": one.sort.kind,
                "messages": one.messages,
                "rate_hz": one.messages / found.duration_s if found.duration_s else None,
                "bytes": one.bytes,
            }
            for one in found.listed
        ],
    }
