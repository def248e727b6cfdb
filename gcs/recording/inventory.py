"""What is in a file: a recording of ours, torn or whole, another program's MCAP, or a .tlog."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import orjson
from mcap.records import Attachment, Channel, Message, Metadata, Schema
from pydantic import ValidationError

from gcs.messages import GROUND_SYSTEM
from gcs.recording import files
from gcs.recording.channels import RAW, raw_sender, raw_topic
from gcs.recording.contents import frame_of, mapped, records
from gcs.recording.files import METADATA, SCENARIO, SUMMARY
from gcs.recording.layouts import layout
from gcs.recording.reader import UnreadableRecording
from gcs.recording.salvage import Damage, Salvaged, salvage
from gcs.recording.tlog import Entries
from gcs.recording.topics import SCHEMA
from scenarios import Scenario
from wire.frames import sender_of

SOFTWARE = ("trustr", "sources", "python", "jsbsim", "pymavlink", "numpy", "mcap", "machine")
"""Whose versions a recording tells."""


class Sort(NamedTuple):
    """What one sort of messages is called."""

    topic: str
    """Frames of a .tlog are under the topic that a recording has for their sender."""
    encoding: str
    """mavlink, json, protobuf or what others use."""
    kind: str
    """Of a topic its schema, of a .tlog's frames the MAVLink message; "" where nothing says."""


@dataclass(frozen=True, slots=True)
class Listed:
    """All messages of one sort."""

    sort: Sort
    messages: int
    bytes: int
    """Of what they say, before it is compressed."""


@dataclass(frozen=True, slots=True)
class Inventory:
    """What is in a file."""

    path: Path
    bytes: int
    begin_ns: int
    end_ns: int
    """Times of the first and last message."""
    listed: Sequence[Listed]
    ended: bool
    """Whether its end is not torn off."""
    damage: Sequence[Damage]
    scenario: Scenario | None
    """None where there is none of ours, or none that this version understands."""
    metadata: Mapping[str, Mapping[str, str]]
    """Record → values; none of another program's file, whose records of these names are about something else."""

    @property
    def whole(self) -> bool:
        """Whether nothing is missing."""
        return self.ended and not self.damage

    @property
    def duration_s(self) -> float:
        """Between its first and last message."""
        return (self.end_ns - self.begin_ns) / 1e9

    @property
    def messages(self) -> int:
        """In all."""
        return sum(one.messages for one in self.listed)

    @property
    def summary(self) -> Mapping[str, Any]:
        """What the run reported; empty where the file ends before it."""
        told: dict[str, Any] = orjson.loads(self.metadata.get(SUMMARY, {}).get("json", "{}"))
        return told

    @property
    def versions(self) -> Mapping[str, str]:
        """Of the software that flew."""
        about = self.metadata.get(METADATA, {})
        return {name: about[name] for name in SOFTWARE if name in about}

    @property
    def vehicles(self) -> int:
        """How many: by the scenario, else by who speaks."""
        if self.scenario is not None:
            return self.scenario.swarm.count
        senders = {raw_sender(one.sort.topic) for one in self.listed if one.sort.encoding == RAW}
        return len({sender[0] for sender in senders if sender is not None} - {GROUND_SYSTEM})

    @property
    def bytes_per_vehicle_minute(self) -> float | None:
        """None where nobody flies, or no time passes."""
        minutes = self.vehicles * self.duration_s / 60
        return self.bytes / minutes if minutes else None

    @property
    def parts(self) -> Sequence[Path]:
        """Further files of the same recording."""
        return files.further_parts(self.path)

    @property
    def journal(self) -> Path | None:
        """The one beside it."""
        path = files.journal(self.path)
        return path if path != self.path and path.exists() else None


def inventory(path: Path) -> Inventory:
    """Read all of a file. Raises UnreadableRecording where it holds no message."""
    found = _of_log(path) if path.suffix == files.journal(path).suffix else _of_mcap(path)
    if not found.listed:
        raise UnreadableRecording(f"{path}: holds no message")
    return found


def _of_mcap(path: Path) -> Inventory:
    """By a reader that believes the file; by what can be salvaged where that fails."""
    try:
        counted = _Counted()
        for record in records(path):
            counted.take(record)
        return counted.inventory(path)
    except UnreadableRecording:
        left = salvage(mapped(path))
        if not left.counts:
            raise
        return _salvaged(path, left)


def _salvaged(path: Path, left: Salvaged) -> Inventory:
    counted = _Counted()
    for channel, time_ns, data in left.messages():
        counted.note(Sort(channel.topic, channel.encoding, channel.schema_name), time_ns, data)
    for record in (*left.attachments, *left.metadata):
        counted.take(record)
    return counted.inventory(path, ended=left.ended, damage=left.damage)


def _of_log(path: Path) -> Inventory:
    log, counted = Entries(mapped(path)), _Counted()
    for time_us, raw in log:
        counted.note(_sort_of(raw), time_us * 1000, raw)
    return counted.inventory(path, damage=[Damage(0, log.skipped, None, None)] if log.skipped else [])


def _sort_of(raw: bytes) -> Sort:
    """Of a frame."""
    frame = frame_of(0, raw)
    known = None if frame is None else layout(frame.message)
    return Sort(raw_topic(*sender_of(raw)), RAW, "unknown" if known is None else known.name)


class _Counted:
    """What is in a file, while its records go by."""

    def __init__(self) -> None:
        self._kinds, self._sorts = {0: ""}, dict[int, Sort]()
        self._listed = defaultdict[Sort, list[int]](lambda: [0, 0])
        """How many messages, and how many bytes."""
        self._begin_ns, self._end_ns = 1 << 64, 0
        self._scenario = b""
        self._metadata: dict[str, Mapping[str, str]] = {}

    def take(self, record: Any) -> None:
        """One of the mcap library's."""
        match record:
            case Message():
                self.note(self._sorts[record.channel_id], record.log_time, record.data)
            case Schema():
                self._kinds[record.id] = record.name
            case Channel():
                sort = Sort(record.topic, record.message_encoding, self._kinds[record.schema_id])
                self._sorts[record.id] = sort
            case Attachment(name=name) if name == SCENARIO:
                self._scenario = record.data
            case Metadata():
                self._metadata[record.name] = record.metadata

    def note(self, sort: Sort, time_ns: int, data: bytes) -> None:
        """One message."""
        so_far = self._listed[sort]
        so_far[0] += 1
        so_far[1] += len(data)
        self._begin_ns, self._end_ns = min(self._begin_ns, time_ns), max(self._end_ns, time_ns)

    def inventory(self, path: Path, *, ended: bool = True, damage: Sequence[Damage] = ()) -> Inventory:
        """Of all that went by."""
        ours = any(sort.kind.startswith(SCHEMA) for sort in self._listed)
        return Inventory(
            path=path,
            bytes=path.stat().st_size,
            begin_ns=self._begin_ns if self._listed else 0,
            end_ns=self._end_ns,
            listed=[Listed(sort, *so_far) for sort, so_far in sorted(self._listed.items())],
            ended=ended,
            damage=damage,
            scenario=_scenario(self._scenario) if ours else None,
            metadata=self._metadata if ours and METADATA in self._metadata else {},
        )


def _scenario(data: bytes) -> Scenario | None:
    with suppress(ValidationError):
        return Scenario.model_validate_json(data)
    return None
