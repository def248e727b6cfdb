"""What a replay knows of a recording before it plays: from when to when, ticks, events, who spoke and who was silent.

Flights of ours, and what was imported from another ground station's log: frames alone, without ticks or mission.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from mcap.reader import SeekingReader

from gcs.choices import BadUsageError
from gcs.recording import history as flights
from gcs.recording.channels import raw_sender
from gcs.recording.files import SCENARIO
from gcs.recording.history import Happening, History, Kind
from gcs.recording.reader import RECORD_SIZE_LIMIT, UnreadableRecording, located, readable
from gcs.replay.index import Silence, silences, times
from gcs.replay.senders import Senders, senders
from wire.ids import AUTOPILOT

STEP_NS = 100_000_000
"""Between two steps through a recording without ticks."""
READ_S = 0.05
"""Times are shown to a tenth of a second: what is shown can be asked for."""
_SECONDS = re.compile(r"(-?)(?:(\d+):(?=[0-5]?\d(?:\.|$)))?(\d+(?:\.\d*)?)")


class NoSuchPlace(BadUsageError):
    """Where somebody wants to go, and the recording has nothing of the kind."""

    def __init__(self, short: str, more: str = "") -> None:
        """short: what fits in a line of a screen;  more: the rest of the sentence."""
        super().__init__(short + more)
        self.short = short


@dataclass(frozen=True)
class Timeline:
    """A recording, from afar."""

    path: Path
    start_ns: int
    """Its first message."""
    end_ns: int
    """Behind its last one."""
    flight: History | None
    """None of what was imported."""
    senders: Senders
    silences: tuple[Silence, ...]

    @cached_property
    def mission_ns(self) -> int | None:
        """Mission start; None where there is no mission."""
        rows = [] if self.flight is None else np.flatnonzero(np.isfinite(self.flight.mission_s)).tolist()
        if self.flight is None or not rows:
            return None
        return int(self.flight.time_ns[rows[0]]) - round(float(self.flight.mission_s[rows[0]]) * 1e9)

    @property
    def origin_ns(self) -> int:
        """From when seconds are counted."""
        return self.start_ns if self.mission_ns is None else self.mission_ns

    @property
    def since(self) -> str:
        """The same in words."""
        return "since the first message" if self.mission_ns is None else "since mission start"

    @cached_property
    def ticks(self) -> tuple[int, ...]:
        """When each tick was decided, ns; every STEP_NS where there are none."""
        if self.flight is None:
            return tuple(range(self.start_ns, self.end_ns, STEP_NS))
        return tuple(self.flight.time_ns.tolist())

    @property
    def happenings(self) -> tuple[Happening, ...]:
        """What happened, in the order of time."""
        return () if self.flight is None else self.flight.happenings

    @cached_property
    def events(self) -> tuple[int, ...]:
        """When something happened, ns, ascending, each moment once."""
        return tuple(sorted({happening.time_ns for happening in self.happenings}))

    def seconds(self, time_ns: int) -> float:
        """Since the origin."""
        return (time_ns - self.origin_ns) / 1e9

    def place(self, asked: str, option: str = "") -> int:
        """The position [ns] that somebody asks for: seconds (12.5, 1:05), or words of an event.

        Raises NoSuchPlace, in a sentence that begins with the option, if any.
        """
        asked, option = asked.strip(), option and f"{option} "
        match = _SECONDS.fullmatch(asked)
        if match is not None:
            sign, minutes, seconds = match.groups()
            since_s = (float(seconds) + 60 * int(minutes or 0)) * (-1 if sign else 1)
            first, last = (self.seconds(at) for at in (self.start_ns, self.end_ns))
            if not first - READ_S <= since_s <= last + READ_S:
                raise NoSuchPlace(f"{option}{asked}: the recording goes from {first:.1f} s to {last:.1f} s")
            return self.origin_ns + round(since_s * 1e9)
        for happening in self.happenings:
            if asked and asked.casefold() in happening.words.casefold():
                return happening.time_ns + 1
        told = [happening.words for happening in self.happenings if happening.kind is not Kind.WORD]
        short = f"{option}{asked}: neither seconds (12.5, 1:05) nor words of an event"
        raise NoSuchPlace(short, f"; there are: {_listed(told)}")


def _listed(words: Iterable[str]) -> str:
    return "; ".join(dict.fromkeys(words)) or "none"


def load(path: Path) -> Timeline:
    """Of a recording, or of the one in a run's folder. Raises UnreadableRecording."""
    path = located(path)
    with readable(path), path.open("rb") as stream:
        reader = SeekingReader(stream, validate_crcs=True, record_size_limit=RECORD_SIZE_LIMIT)
        summary = reader.get_summary()
        if summary is None or not summary.chunk_indexes:
            raise UnreadableRecording(f"{path}: holds no message that could be found by its time")
        ours = any(attachment.name == SCENARIO for attachment in summary.attachment_indexes)
        heard = times(stream, summary)
        spoke = senders(reader, heard)
    autopilots = {name[0]: heard[topic] for topic in heard if (name := raw_sender(topic)) and name[1] == AUTOPILOT}
    return Timeline(
        path=path,
        start_ns=min(chunk.message_start_time for chunk in summary.chunk_indexes),
        end_ns=max(chunk.message_end_time for chunk in summary.chunk_indexes) + 1,
        flight=flights.load(path) if ours else None,
        senders=spoke,
        silences=silences({system: autopilots[system] for system in spoke.vehicles if system in autopilots}),
    )
