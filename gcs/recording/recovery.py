"""What recovering a recording found, lost and added: in words, as JSON, and as metadata of what was rebuilt."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gcs.recording.salvage import Damage

RECOVERED = "recovered"
"""The metadata record in which a rebuilt recording tells all this."""


@dataclass(frozen=True, slots=True)
class Part:
    """One file of a recording, as it was found."""

    path: Path
    ended: bool
    """Whether it has its summary, whole."""
    messages: int
    """Those that are certainly what was recorded."""
    unnamed: int
    """Those that are whole as well, but what they belong to is lost."""
    unvouched: int
    """Those that no CRC vouches for, in another program's file."""
    damage: Sequence[Damage]
    unsealed: Sequence[str]
    """Names of metadata that nothing vouches for."""

    @property
    def whole(self) -> bool:
        """Whether nothing of it is missing."""
        return self.ended and not self.damage


@dataclass(frozen=True, slots=True)
class Recovery:
    """A recording rebuilt."""

    out: Path | None
    """Where it is; None where there was nothing to rebuild."""
    parts: Sequence[Part]
    messages: int
    """In all."""
    begin_ns: int
    end_ns: int
    """Times of the first and last message."""
    left_out: Sequence[tuple[Path, str]] = ()
    """Files beside it that were not used, and why."""
    journal: Path | None = None
    journal_skipped: int = 0
    """Bytes of the journal that are damaged."""
    journal_mended: int = 0
    """Frames of the journal whose time is."""
    added: int = 0
    """Frames that only the journal had."""
    dropped: int = 0
    """Messages that the disk did not take when they were recorded."""
    missing: Sequence[int] = ()
    """Parts that are not there, though a later one is."""
    lacking: Sequence[str] = ()
    """What is lost of the whole: its scenario, its metadata."""

    @property
    def needless(self) -> bool:
        """Whether the recording was one file, whole, whoever wrote it, and its journal adds nothing."""
        (only, *others) = self.parts
        return only.whole and not (others or self.added or self.missing)

    @property
    def damaged_bytes(self) -> int:
        """Of all parts."""
        return sum(damage.length for part in self.parts for damage in part.damage)

    @property
    def lost_s(self) -> float:
        """Of our own topics: between the messages that are left on both sides of damage, and behind the last."""
        return sum(
            ((damage.before_ns or self.end_ns) - (damage.after_ns or self.begin_ns)) / 1e9
            for part in self.parts
            for damage in part.damage
        )

    def json(self) -> dict[str, Any]:
        """One object, for --json."""
        return {
            "recovered": None if self.out is None else str(self.out.resolve()),
            "messages": self.messages,
            "duration_s": (self.end_ns - self.begin_ns) / 1e9,
            "frames_added": self.added,
            "journal": None if self.journal is None else str(self.journal.resolve()),
            "journal_bytes_skipped": self.journal_skipped,
            "bytes_lost": self.damaged_bytes,
            "places_damaged": sum(len(part.damage) for part in self.parts),
            "seconds_lost": self.lost_s,
            "messages_without_topic": sum(part.unnamed for part in self.parts),
            "messages_dropped": self.dropped,
            "parts_missing": list(self.missing),
            "left_out": {str(path.resolve()): why for path, why in self.left_out},
            "journal_times_mended": self.journal_mended,
            "lost": list(self.lacking),
            "parts": [self._part(part) for part in self.parts],
        }

    def _part(self, part: Part) -> dict[str, Any]:
        return {
            "file": str(part.path.resolve()),
            "ended": part.ended,
            "messages": part.messages,
            "messages_without_topic": part.unnamed,
            "damage": [
                {
                    "at_byte": damage.at,
                    "bytes": damage.length,
                    "from_s": self._seconds(damage.after_ns),
                    "to_s": self._seconds(damage.before_ns),
                }
                for damage in part.damage
            ],
            "unchecked_metadata": list(part.unsealed),
        }

    def _seconds(self, time_ns: int | None) -> float | None:
        """Since the first message."""
        return None if time_ns is None else (time_ns - self.begin_ns) / 1e9

    def metadata(self) -> dict[str, str]:
        """For the rebuilt recording itself."""
        return {
            "files": ", ".join(part.path.name for part in self.parts),
            "journal": "" if self.journal is None else self.journal.name,
            "frames_added": str(self.added),
            "bytes_lost": str(self.damaged_bytes),
            "seconds_lost": f"{self.lost_s:.3f}",
            "messages_without_topic": str(sum(part.unnamed for part in self.parts)),
            "messages_dropped": str(self.dropped),
            "parts_missing": ", ".join(map(str, self.missing)),
            "lost": ", ".join(self.lacking),
            "words": "; ".join(f"{name}: {words}" for name, words in self.lines()),
        }

    def lines(self) -> Iterator[tuple[str, str]]:
        """What it is about, and a sentence."""
        for part in self.parts:
            for words in self._found(part):
                yield part.path.name, words
        if self.journal is not None:
            yield self.journal.name, "; ".join(self._taken())
        for path, why in self.left_out:
            yield path.name, f"left out: {why}"
        for number in self.missing:
            yield "lost", f"part {number} of the recording: it is not there"
        if self.dropped:
            made_up = f"; its journal made up for {_count(self.added, 'frame')} of all" if self.added else ""
            yield "lost", f"{_count(self.dropped, 'message')} that the disk did not take{made_up}"
        for words in self.lacking:
            yield "lost", words

    def _taken(self) -> Iterator[str]:
        yield f"{_count(self.added, 'frame')} added that the recording lacks"
        if self.journal_skipped:
            yield f"{_count(self.journal_skipped, 'byte')} of it are damaged"
        if self.journal_mended:
            yield f"{_count(self.journal_mended, 'frame')} put at the time of the one before, for its own cannot be"

    def _found(self, part: Part) -> Iterator[str]:
        if part.whole:
            vouched = f"; no CRC vouches for {part.unvouched} of them" if part.unvouched else ""
            yield f"whole: {_count(part.messages, 'message')}{vouched}"
        elif part.ended:
            yield f"damaged: {_count(part.messages, 'message')} are left"
        else:
            yield f"torn: it ends without its summary; {_count(part.messages, 'message')} are left"
        for damage in part.damage:
            yield f"{_count(damage.length, 'byte')} cannot be read {self._between(damage)}"
        if part.unnamed:
            yield f"{_count(part.unnamed, 'message')} lost with the name of their topic"
        if part.unsealed and not part.whole:
            yield f"metadata not checked, for it came without a CRC: {', '.join(part.unsealed)}"

    def _between(self, damage: Damage) -> str:
        after, before = self._seconds(damage.after_ns), self._seconds(damage.before_ns)
        if after is None:
            return "before the first message"
        return f"behind {after:.1f} s" if before is None else f"between {after:.1f} s and {before:.1f} s"


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
