"""What can be trusted of the bytes of an MCAP file that is torn or damaged.

One flipped bit costs one chunk, and nothing that is wrong comes out of it: see `pieces`. The summary has a CRC of its
own. Whatever else a file holds tells nothing that is not rebuilt.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from io import BytesIO
from mmap import mmap
from typing import NamedTuple

from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Attachment, Chunk, Footer, Metadata, Schema
from mcap.records import Channel as ChannelRecord

from gcs.recording.channels import Channel, Message, raw_channel
from gcs.recording.contents import frame_of
from gcs.recording.mcap_file import MAGIC
from gcs.recording.pieces import MESSAGE, RECORD, content_at, content_of, pieces, spans, stream_of
from gcs.recording.seal import is_sealed

_INDEX, _ENTRY = struct.Struct("<HI"), struct.Struct("<QQ")
"""How the index of a chunk's messages begins: channel, and the length of its entries; time and place of each."""
_NO_CRC = bytes(4)
"""At the end of the data, where nobody reckoned one."""
_FOOTER_BYTES = 29


@dataclass(frozen=True, slots=True)
class Damage:
    """A stretch of the file that tells nothing."""

    at: int
    """Bytes before it."""
    length: int
    """Bytes."""
    after_ns: int | None
    """Time of the last message before it; None where there is none."""
    before_ns: int | None
    """Time of the first message behind it; None where there is none."""


@dataclass(eq=False)
class Salvaged:
    """What is left of a file."""

    data: bytes | mmap = b""
    """All its bytes."""
    ended: bool = False
    """Whether it has its summary, whole."""
    damage: list[Damage] = field(default_factory=list)
    attachments: list[Attachment] = field(default_factory=list)
    metadata: list[Metadata] = field(default_factory=list)
    """None that is known to be damaged."""
    chunks: list[tuple[int, int]] = field(default_factory=list)
    """Where those begin and end whose content is right."""
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, ChannelRecord] = field(default_factory=dict)
    counts: Counter[int] = field(default_factory=Counter)
    """Channel → messages."""

    @property
    def whole(self) -> bool:
        """Whether nothing is missing."""
        return self.ended and not self.damage

    @property
    def unsealed(self) -> list[str]:
        """Names of metadata that nothing vouches for: they came without a CRC."""
        return [record.name for record in self.metadata if is_sealed(record.name, record.metadata) is None]

    @property
    def unnamed(self) -> int:
        """Messages that are whole, but what they belong to is lost."""
        return self.counts.total() - sum(self.counts[number] for number in self._named())

    def messages(self) -> Iterator[Message]:
        """All messages whose topic is known, in the file's order; each is certainly what was recorded."""
        named = self._named()
        for number, time_ns, data in self._messages(named):
            yield Message(named[number], time_ns, data)

    def _messages(self, channels: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        for place in self.chunks if channels else ():
            content = content_at(self.data, *place)
            for opcode, start, stop in spans(content):
                if opcode == Opcode.MESSAGE:
                    number, _sequence, time_ns, _publish_ns = MESSAGE.unpack_from(content, start)
                    if number in channels:
                        yield number, time_ns, content[start + MESSAGE.size : stop]

    def _named(self) -> Mapping[int, Channel]:
        """What is known of each channel."""
        named = {}
        for number, told in self.channels.items():
            schema = self.schemas.get(told.schema_id)
            if schema is not None:
                kind = schema.name, schema.encoding, schema.data
                named[number] = Channel(told.topic, told.message_encoding, *kind)
            elif told.schema_id == 0:
                named[number] = Channel(told.topic, told.message_encoding)
        return named | dict(self._told_by_frames(named))

    def _told_by_frames(self, named: Collection[int]) -> Iterator[tuple[int, Channel]]:
        """Channels without a name of which every message is a whole frame of one sender."""
        senders: defaultdict[int, set[tuple[int, int] | None]] = defaultdict(set)
        for number, time_ns, data in self._messages(self.counts.keys() - named):
            frame = frame_of(time_ns, data)
            senders[number].add(None if frame is None else (frame.system, frame.component))
        for number, found in senders.items():
            sender = found.pop()
            if sender is not None and not found:
                yield number, raw_channel(*sender)


def salvage(data: bytes | mmap) -> Salvaged:
    """Everything in a file that can be trusted."""
    left = Salvaged(data)
    _take_summary(left, data)
    told = _Messages((), None, None)
    last_ns: int | None = None
    reached = 0
    holes: list[Damage] = []
    """Behind the last chunk."""
    for start, stop, record in pieces(data):
        holes += _unexplained(data, reached, start, told, last_ns)
        reached = stop
        if isinstance(record, Chunk):
            left.chunks.append((start, stop))
            told = _take(left, record)
            if not _as_written(record, data[start:stop], told):
                holes.append(Damage(start, stop - start - len(record.data), last_ns, None))
            left.damage += (replace(hole, before_ns=told.first_ns) for hole in holes)
            holes, last_ns = [], told.last_ns or last_ns
        elif isinstance(record, Attachment):
            left.attachments.append(record)
        else:
            left.metadata.append(record)
    left.damage += [*holes, *_unexplained(data, reached, len(data), told, last_ns)]
    return left


class _Messages(NamedTuple):
    """What the indexes behind a chunk must tell of it."""

    places: Collection[tuple[int, int, int]]
    """Channel, time and place in the chunk of each message."""
    first_ns: int | None
    """Time of the first; None of a chunk without any."""
    last_ns: int | None


def _take(left: Salvaged, chunk: Chunk) -> _Messages:
    places = []
    content = content_of(chunk)
    for opcode, start, stop in spans(content):
        if opcode == Opcode.MESSAGE:
            number, _sequence, time_ns, _publish_ns = MESSAGE.unpack_from(content, start)
            left.counts[number] += 1
            places.append((number, time_ns, start - RECORD.size))
        else:
            _define(left, opcode, content[start:stop])
    return _Messages(frozenset(places), *((places[0][1], places[-1][1]) if places else (None, None)))


def _as_written(chunk: Chunk, record: bytes, told: _Messages) -> bool:
    """Whether what no CRC covers of a chunk is right, too: whoever believes it would be misled."""
    builder = RecordBuilder()
    chunk.write(builder)
    times = [time_ns for _, time_ns, _ in told.places] or [0]
    same: bool = builder.end() == record  # type: ignore[no-untyped-call]
    return same and (chunk.message_start_time, chunk.message_end_time) == (min(times), max(times))


def _define(left: Salvaged, opcode: int, body: bytes) -> None:
    stream = ReadDataStream(BytesIO(body))
    if opcode == Opcode.SCHEMA:
        schema: Schema = Schema.read(stream)
        left.schemas[schema.id] = schema
    elif opcode == Opcode.CHANNEL:
        channel: ChannelRecord = ChannelRecord.read(stream)
        left.channels[channel.id] = channel


def _take_summary(left: Salvaged, data: bytes | mmap) -> None:
    """Whether the file ended, and the schemas and channels that its summary repeats."""
    end = len(data) - len(MAGIC)
    at = end - _FOOTER_BYTES
    if at < len(MAGIC) or data[end:] != MAGIC or RECORD.unpack_from(data, at) != (Opcode.FOOTER, _FOOTER_BYTES - 9):
        return
    footer: Footer = Footer.read(stream_of(data[at:end]))
    right = zlib.crc32(data[footer.summary_start : end - 4]) == footer.summary_crc
    left.ended = right or footer.summary_crc == 0
    if right:
        summary = data[footer.summary_start : at]
        for opcode, start, stop in spans(summary):
            _define(left, opcode, summary[start:stop])


def _unexplained(data: bytes | mmap, start: int, stop: int, told: _Messages, after_ns: int | None) -> Iterator[Damage]:
    """What lies between two pieces, from the first byte on that is not as it should be there.

    told: what the chunk before them holds.
    """
    at = start
    if start == 0 and data[: len(MAGIC)] == MAGIC:
        at = len(MAGIC)
    while at < stop:
        opcode, length = RECORD.unpack_from(data, at) if at + RECORD.size <= stop else (0, 0)
        body = data[at + RECORD.size : min(at + RECORD.size + length, stop)]
        if opcode == Opcode.DATA_END and stop == len(data):
            if body not in (_NO_CRC, zlib.crc32(memoryview(data)[:at]).to_bytes(4, "little")):
                yield Damage(at, RECORD.size + length, after_ns, None)
            return  # the summary has a CRC of its own, and is rebuilt
        header = opcode == Opcode.HEADER and at == len(MAGIC)
        if len(body) < length or not (header or (opcode == Opcode.MESSAGE_INDEX and _indexes(body, told))):
            yield Damage(at, stop - at, after_ns, None)
            return
        at += RECORD.size + length


def _indexes(body: bytes, told: _Messages) -> bool:
    """Whether an index tells where messages of the chunk before it are."""
    if len(body) < _INDEX.size or (len(body) - _INDEX.size) % _ENTRY.size:
        return False
    channel, length = _INDEX.unpack_from(body)
    entries = _ENTRY.iter_unpack(body[_INDEX.size :])
    return length == len(body) - _INDEX.size and all((channel, *entry) in told.places for entry in entries)
