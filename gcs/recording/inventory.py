"""What is in a file: a recording of ours, torn or whole, another program's MCAP, or a .tlog."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import orjson
from mcap.records import Attachment, Channel, Message, Metadata, Schema
from pydantic import ValidationError

from gcs.messages import GROUND_SYSTEM
from gcs.recording import files
from gcs.recording.contents import RAW, frame_of, records
from gcs.recording.files import METADATA, SCENARIO, SUMMARY
from gcs.recording.layouts import layout
from gcs.recording.reader import UnreadableRecording
from gcs.recording.salvage import Damage, raw_topic, salvage
from gcs.recording.tlog import Entries
from scenarios import Scenario
from wire.frames import MAGIC_2

SOFTWARE = ("trustr", "python", "jsbsim", "pymavlink", "numpy", "mcap")
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
    """None where there is none, or none that this version understands."""
    metadata: Mapping[str, Mapping[str, str]]
    """Record → values."""

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
        told: dict[str, Any] = orjson.loads(self.metadata[SUMMARY]["json"]) if SUMMARY in self.metadata else {}
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
        senders = {one.sort.topic.split("/")[2].split("_")[0] for one in self.listed if one.sort.encoding == RAW}
        return len(senders - {str(GROUND_SYSTEM)})

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
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UnreadableRecording(f"{path}: cannot be read: {error.strerror or error}") from None
    found = _of_log(path, data) if path.suffix == files.journal(path).suffix else _of_mcap(path, data)
    if not found.listed:
        raise UnreadableRecording(f"{path}: holds no message")
    return found


def _of_mcap(path: Path, data: bytes) -> Inventory:
    """By a reader that believes the file; by what can be salvaged where that fails."""
    try:
        every = list(records(path))
    except UnreadableRecording:
        left = salvage(data)
        if not left.counts:
            raise
        told = (
            (Sort(topic, encoding, "" if schema is None else schema.name), time_ns, content)
            for topic, encoding, schema, time_ns, content in left.messages()
        )
        return _listed(path, data, told, left.attachments, left.metadata, ended=left.ended, damage=left.damage)
    attachments = [record for record in every if isinstance(record, Attachment)]
    metadata = [record for record in every if isinstance(record, Metadata)]
    return _listed(path, data, _sorted(every), attachments, metadata)


Told = tuple[Sort, int, bytes]
"""What a message is, its time in ns since 1970, and what it says."""


def _sorted(every: Iterable[Any]) -> Iterator[Told]:
    kinds, sorts = {0: ""}, dict[int, Sort]()
    for record in every:
        match record:
            case Message():
                yield sorts[record.channel_id], record.log_time, record.data
            case Schema():
                kinds[record.id] = record.name
            case Channel():
                sorts[record.id] = Sort(record.topic, record.message_encoding, kinds[record.schema_id])


def _of_log(path: Path, data: bytes) -> Inventory:
    log = Entries(data)
    told = [(_sort_of(raw), time_us * 1000, raw) for time_us, raw in log]
    damage = [Damage(0, log.skipped, None, None)] if log.skipped else []
    return _listed(path, data, told, damage=damage)


def _sort_of(raw: bytes) -> Sort:
    """Of a frame."""
    system, component = raw[5:7] if raw[0] == MAGIC_2 else raw[3:5]
    frame = frame_of(0, raw)
    known = None if frame is None else layout(frame.message)
    return Sort(raw_topic(system, component), RAW, "unknown" if known is None else known.name)


def _listed(
    path: Path,
    data: bytes,
    told: Iterable[Told],
    attachments: Iterable[Attachment] = (),
    metadata: Iterable[Metadata] = (),
    *,
    ended: bool = True,
    damage: Sequence[Damage] = (),
) -> Inventory:
    lengths, times = defaultdict[Sort, list[int]](list), list[int]()
    for sort, time_ns, content in told:
        lengths[sort].append(len(content))
        times.append(time_ns)
    return Inventory(
        path=path,
        bytes=len(data),
        begin_ns=min(times, default=0),
        end_ns=max(times, default=0),
        listed=[Listed(sort, len(each), sum(each)) for sort, each in sorted(lengths.items())],
        ended=ended,
        damage=damage,
        scenario=_scenario(attachments),
        metadata={record.name: record.metadata for record in metadata},
    )


def _scenario(attachments: Iterable[Attachment]) -> Scenario | None:
    for attachment in attachments:
        if attachment.name == SCENARIO:
            with suppress(ValidationError):
                return Scenario.model_validate_json(attachment.data)
    return None
