"""What a recording leaves on the disk: its files' names, and the records about the whole in them."""

from __future__ import annotations

import glob
from pathlib import Path

SCENARIO = "scenario.json"
"""The attachment that holds the scenario flown."""
METADATA, SUMMARY = "trustr", "summary"
"""Names of the metadata records: what was flown, and what came of it."""
FAULTS, MADE, PLANNED = "faults", "made", "planned"
"""Key of METADATA: whether we made the scenario's faults ourselves, or vehicles behind a link are to bring them along;
older recordings do not say.
"""
PART, DROPPED = "part", "dropped_messages"
"""Keys of METADATA: which of the recording's files this is, from 1, and how many messages no file before it holds."""


class RecordingError(OSError):
    """A recording that cannot be written, in one sentence."""


def part(recording: Path, number: int) -> Path:
    """The file in which a recording goes on after the disk took no more of it: run.part2.mcap, and so on."""
    return recording if number == 1 else recording.with_suffix(f".part{number}{recording.suffix}")


def further_parts(recording: Path) -> list[Path]:
    """Those of part 2 and on that are there, in their order."""
    found = recording.parent.glob(f"{glob.escape(recording.stem)}.part*{recording.suffix}")
    numbers = ((path.stem.removeprefix(f"{recording.stem}.part"), path) for path in found)
    return [path for _, path in sorted((int(number), path) for number, path in numbers if number.isdecimal())]


def journal(recording: Path) -> Path:
    """The log of all frames beside it, in flights with real links."""
    return recording.with_suffix(".tlog")
