"""What a recording leaves on the disk: its files' names, and the records about the whole in them."""

from __future__ import annotations

import glob
import re
import shlex
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


def further(recording: Path) -> list[tuple[int, Path]]:
    """Number and file of part 2 and on, of those that are there, in their order."""
    found = recording.parent.glob(f"{glob.escape(recording.stem)}.part*{recording.suffix}")
    numbers = ((path.stem.removeprefix(f"{recording.stem}.part"), path) for path in found)
    return sorted((int(number), path) for number, path in numbers if number.isdecimal())


def further_parts(recording: Path) -> list[Path]:
    """The same without their numbers."""
    return [path for _, path in further(recording)]


def whole_of(path: Path) -> Path | None:
    """The recording that a file is a further part of, by its name; None of any other."""
    named = re.fullmatch(r"(.+)\.part\d+", path.stem)
    return None if named is None else path.with_name(f"{named[1]}{path.suffix}")


def remainder(recording: Path) -> str | None:
    """That a file is not all of its recording, in one sentence; None where it is."""
    parts, whole = further_parts(recording), whole_of(recording)
    if parts:
        names = ", ".join(part.name for part in parts)
        return f"{recording}: goes on in {names}, of which nothing is shown; {recovering(recording)} joins all"
    if whole is not None and (whole.exists() or further_parts(whole)):
        return f"{recording}: a part of {whole.name}, and nothing else is shown; {recovering(whole)} joins all"
    return None


def journal(recording: Path) -> Path:
    """The log of all frames beside it, in flights with real links."""
    return recording.with_suffix(".tlog")


def recovering(recording: Path) -> str:
    """The command that rebuilds a recording, ready to be typed."""
    return shlex.join(["gcs", "log", "recover", str(recording)])


def importing(journal: Path) -> str:
    """The command that makes a recording of a journal, or of another ground station's log."""
    return shlex.join(["gcs", "log", "import", str(journal)])
