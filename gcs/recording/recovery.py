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
    journal: Path | None
    journal_skipped: int
    """Bytes of the journal that are damaged."""
    added: int
    """Frames that only the journal had."""
    dropped: int
    """Messages that the disk did not take when they were recorded."""
    messages: int
    """In all."""
    begin_ns: int
    end_ns: int
    """Times of the first and last message."""
    lacking: Sequence[str]
    """What is lost of the whole: its scenario, its metadata."""

    @property
    def needless(self) -> bool:
        """Whether the recording was one file, whole, and lacked nothing."""
        return len(self.parts) == 1 and self.parts[0].whole and not (self.added or self.lacking)

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
            "lost": ", ".join(self.lacking),
            "words": "; ".join(words for _name, words in self.lines()),
        }

    def lines(self) -> Iterator[tuple[str, str]]:
        """What it is about, and a sentence."""
        for part in self.parts:
            for words in self._found(part):
                yield part.path.name, words
        if self.journal is not None:
            skipped = f"; {_count(self.journal_skipped, 'byte')} of it are damaged" if self.journal_skipped else ""
            yield self.journal.name, f"{_count(self.added, 'frame')} added that the recording lacks{skipped}"
        if self.dropped:
            yield (
                "lost",
                f"{_count(self.dropped, 'message')} that the disk did not take; frames of them are in the journal",
            )
        for words in self.lacking:
            yield "lost", words

    def _found(self, part: Part) -> Iterator[str]:
        if part.whole:
            yield f"whole: {_count(part.messages, 'message')}"
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
