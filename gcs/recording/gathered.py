"""The files of one recording that are still there: which they are by what they tell, not by their names alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from gcs.recording import files
from gcs.recording.contents import mapped
from gcs.recording.files import DROPPED, METADATA, PART, SCENARIO
from gcs.recording.reader import UnreadableRecording
from gcs.recording.salvage import Salvaged, salvage
from gcs.recording.seal import SEAL


@dataclass(frozen=True, slots=True, eq=False)
class PartFile:
    """One file, and what is left of it."""

    path: Path
    named: int
    """Which part it is by its name, from 1."""
    left: Salvaged

    @property
    def about(self) -> Mapping[str, str]:
        """Its metadata; none where they are lost."""
        return next((record.metadata for record in self.left.metadata if record.name == METADATA), {})

    @property
    def number(self) -> int:
        """Which part it is, as it says itself."""
        told = self.about.get(PART, "")
        return int(told) if told.isdecimal() else self.named

    def is_of(self, other: PartFile) -> bool:
        """Whether they are of one flight, as far as both tell."""
        scenarios = [next((a.data for a in one.left.attachments if a.name == SCENARIO), None) for one in (self, other)]
        flights = [_flight(one.about) for one in (self, other)]
        return all(None in pair or {} in pair or pair[0] == pair[1] for pair in (scenarios, flights))


def _flight(about: Mapping[str, str]) -> dict[str, str]:
    """What every part of a recording tells alike: when it was flown above all."""
    return {key: value for key, value in about.items() if key not in (PART, DROPPED, SEAL)}


@dataclass(frozen=True, slots=True, eq=False)
class Gathered:
    """A recording's files."""

    parts: Sequence[PartFile]
    """In the order in which they were written."""
    missing: Sequence[int]
    """Parts before the last that are not there."""
    left_out: Sequence[tuple[Path, str]]
    """Files of such a name that are no part of it, and why."""


def gathered(recording: Path) -> Gathered:
    """Its first file and all in which it goes on, as far as they are there.

    Raises UnreadableRecording where there is none, or where a further part was named instead of the whole.
    """
    further = [PartFile(path, number, salvage(mapped(path))) for number, path in files.further(recording)]
    if further and not recording.exists():
        found = further
    else:
        named = PartFile(recording, 1, salvage(mapped(recording)))
        whole = files.whole_of(recording)
        if whole is not None and (PART in named.about or whole.exists()):
            raise UnreadableRecording(f"{recording}: a part of {whole.name}: {files.recovering(whole)} joins all")
        found = [named, *further]
    first = next((one for one in found if one.about), found[0])
    parts, left_out = dict[int, PartFile](), list[tuple[Path, str]]()
    for one in sorted(found, key=lambda one: (one.number, one.number != one.named)):
        if not one.is_of(first):
            left_out.append((one.path, "it is of another flight"))
        elif one.number in parts:
            left_out.append((one.path, f"it is part {one.number}, as {parts[one.number].path.name} is"))
        else:
            parts[one.number] = one
    return Gathered(list(parts.values()), sorted({*range(1, max(parts))} - parts.keys()), left_out)
