"""The ticks of a recording, as far as they can be decided again, and what it lacks."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import NamedTuple

import orjson

from gcs.recording.files import further_parts, recovering
from gcs.recording.reader import (
    CUT_SHORT,
    SENT,
    Flown,
    Message,
    RecordedTick,
    UnreadableRecording,
    located,
    opened,
    paged,
    read,
)


class LostTicks(NamedTuple):
    """Ticks, both included, of which a damaged recording lost everything or some of the frames that they consumed."""

    first: int
    last: int


@dataclass(frozen=True, slots=True)
class Pages:
    """A recording, as far as it can be decided again: to its first gap, for what follows depends on what is lost."""

    told: Flown
    ticks: Sequence[RecordedTick]
    """Without any gap."""
    beyond: Sequence[RecordedTick]
    """Those behind the first gap."""
    gaps: tuple[LostTicks, ...]
    unfinished: int
    """Frames that were sent in a tick that the recording does not tell of: it ends in the middle of it."""
    parts: tuple[Path, ...]
    """Files beside it in which the same recording goes on."""
    mission_ns: int | None
    """When the mission started; None where there is none."""

    @staticmethod
    def of(path: Path) -> Pages:
        """Of a recording, or the one in a run's folder. Raises UnreadableRecording."""
        path, noted = located(path), _Noted()
        told = read(path)
        with opened(path) as recording:
            pages = list(paged(noted.all(recording.messages)))
        if not pages:
            raise UnreadableRecording(f"{path}: holds no tick to decide again")
        known = len(list(takewhile(lambda at: at[1].whole and at[1].number == at[0], enumerate(pages))))
        return Pages(
            told,
            pages[:known],
            pages[known:],
            _gaps(pages),
            unfinished=noted.sent - sum(len(page.sent) for page in pages),
            parts=tuple(further_parts(path)),
            mission_ns=noted.mission_ns,
        )

    @property
    def cut_short(self) -> bool:
        """Whether the recording ends before the flight did, as far as its files are known."""
        return self.told.problem == CUT_SHORT

    @property
    def lacking(self) -> str | None:
        """What is not in this file, in words; None where nothing is known to be missing behind its end."""
        if self.parts:
            where = ", ".join(part.name for part in self.parts)
            return f"the recording goes on in {where}; {recovering(self.told.path)} joins all"
        return f"{CUT_SHORT}: what was sent then is not in it" if self.cut_short else None

    def mission_s(self, time_ns: int) -> float | None:
        """Since mission start, negative before it; None where there is no mission."""
        return None if self.mission_ns is None else round((time_ns - self.mission_ns) / 1e9, 6)


def when(mission_s: float | None) -> str:
    """The end of a sentence: when in the mission; "" where there is none."""
    if mission_s is None:
        return ""
    return f", {abs(mission_s):.1f} s {'before' if mission_s < 0.0 else 'after'} mission start"


class _Noted:
    """What is noted of messages while they pass."""

    def __init__(self) -> None:
        self.sent = 0
        """Frames that we sent."""
        self.mission_ns: int | None = None

    def all(self, messages: Iterable[Message]) -> Iterator[Message]:
        """As they come."""
        for message in messages:
            if message.topic == SENT:
                self.sent += 1
            elif message.topic == "/mission" and self.mission_ns is None:
                self.mission_ns = message.time_ns - round(orjson.loads(message.data)["mission_s"] * 1e9)
            yield message


def _gaps(pages: Sequence[RecordedTick]) -> tuple[LostTicks, ...]:
    """In the order of ticks; those that touch are one."""
    there, end = {page.number for page in pages if page.whole}, pages[-1].number + 1
    lacking = [number for number in range(end) if number not in there]
    firsts = [number for number in lacking if number == 0 or number - 1 in there]
    lasts = [number for number in lacking if number + 1 in there or number + 1 == end]
    return tuple(map(LostTicks, firsts, lasts))
