"""An MCAP file as it is written: chunks that reach the disk whole, or are cut off again.

Format: https://mcap.dev/spec. What comes once or seldom is packed by the mcap library's own records. Messages and their
indexes are packed here: the library takes eight calls for each message, and cannot take back half a chunk.
"""

from __future__ import annotations

import struct
import zlib
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

import lz4.frame
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode

MAGIC = b"\x89MCAP0\r\n"
CHUNK_BYTES = 1 << 20
"""A chunk that holds as much is closed, however young: readers hold one in memory."""
TOLD_AGAIN_BYTES = 1 << 19
"""After so many a chunk repeats all schemas and channels: one that is damaged takes nobody's name along."""
_MESSAGE = struct.Struct("<BQHIQQ")
"""Opcode, length of what follows, channel, sequence, log time, publish time."""
_OPCODE, _HEAD = int(Opcode.MESSAGE), 22
"""Of a message, and the bytes of its length that are not its payload."""
_FOOTER, _FOOTER_LENGTH = struct.Struct("<BQQQ"), 20
"""What the summary's CRC covers of the footer: its opcode, its length and two places."""


class McapFile:
    """A file that at every moment ends in a whole record: what is on the disk can be read.

    Not buffered: what was flushed has left the process. When the disk takes no more, the torn record is cut off, its
    messages are dropped, and OSError is raised. What comes after that belongs in another file, because channels may be
    gone with the chunk; this one can still be finished, now or when there is room.
    """

    def __init__(self, path: Path, *, library: str = "trustr") -> None:
        """library: who wrote it, for its header. Raises OSError."""
        self._file = path.open("wb", buffering=0)
        self._end = 0
        """Of the last whole record on the disk."""
        self.dropped = 0
        """Messages that the disk did not take."""
        self._schemas: list[records.Schema] = []
        self._channels: list[records.Channel] = []
        self._counts: dict[int, int] = {}
        self._attachments: list[records.AttachmentIndex] = []
        self._metadata: list[records.MetadataIndex] = []
        self._chunks: list[records.ChunkIndex] = []
        self._told_at = 0
        """Where schemas and channels were last told, all of them."""
        self._begin()
        try:
            self._write(MAGIC + _packed(records.Header(profile="", library=library)))
        except OSError:
            self.close()
            raise

    def __enter__(self) -> McapFile:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Finished, unless something went wrong."""
        try:
            if error is None:
                self.finish()
        finally:
            self.close()

    def schema(self, name: str, encoding: str, data: bytes) -> int:
        """Its id, for channels."""
        schema = records.Schema(id=len(self._schemas) + 1, name=name, encoding=encoding, data=data)
        self._schemas.append(schema)
        self._append(_packed(schema))
        return schema.id

    def channel(self, topic: str, encoding: str, schema: int = 0) -> int:
        """Its id, for messages. schema: 0 where the encoding speaks for itself."""
        channel = records.Channel(
            id=len(self._channels) + 1, topic=topic, message_encoding=encoding, metadata={}, schema_id=schema
        )
        self._channels.append(channel)
        self._append(_packed(channel))
        return channel.id

    def add(self, channel: int, time_ns: int, data: bytes) -> None:
        """One message. Raises OSError where it fills the chunk, and the disk is full."""
        index = self._indexes.get(channel)
        if index is None:
            index = self._indexes[channel] = []
        index += (time_ns, self._size)
        self._pieces += (_MESSAGE.pack(_OPCODE, _HEAD + len(data), channel, 0, time_ns, time_ns), data)
        self._size += _MESSAGE.size + len(data)
        if self._size > CHUNK_BYTES:
            self.flush()

    def attach(self, time_ns: int, name: str, media_type: str, data: bytes) -> None:
        """A whole file, within this one. Raises OSError."""
        packed = _packed(
            records.Attachment(create_time=time_ns, log_time=time_ns, name=name, media_type=media_type, data=data)
        )
        index = records.AttachmentIndex(
            offset=self._end,
            length=len(packed),
            create_time=time_ns,
            log_time=time_ns,
            data_size=len(data),
            name=name,
            media_type=media_type,
        )
        self._write(packed)
        self._attachments.append(index)

    def metadata(self, name: str, values: dict[str, str]) -> None:
        """Words about the whole. Raises OSError."""
        packed = _packed(records.Metadata(name=name, metadata=values))
        index = records.MetadataIndex(offset=self._end, length=len(packed), name=name)
        self._write(packed)
        self._metadata.append(index)

    def flush(self) -> None:
        """Close the chunk: every message added so far leaves the process in one write. Raises OSError."""
        if not self._indexes:
            return
        chunk, index = self._chunk()
        counts = {channel: len(entries) // 2 for channel, entries in self._indexes.items()}
        try:
            self._write(chunk)
        except OSError:
            self.dropped += sum(counts.values())
            schemas, channels = self._defined
            del self._schemas[schemas:], self._channels[channels:]
            self._begin()
            raise
        self._chunks.append(index)
        for channel, count in counts.items():
            self._counts[channel] = self._counts.get(channel, 0) + count
        self._begin()

    def finish(self) -> None:
        """Write the summary and close. Raises OSError: then it may be tried again."""
        self.flush()
        data_end = _packed(records.DataEnd(data_section_crc=0))
        self._write(data_end + self._summary(self._end + len(data_end)) + MAGIC)
        self.close()

    def close(self) -> None:
        """As it is on the disk; without a summary, if it was not finished."""
        with suppress(OSError):  # what could not be written has been told
            self._file.close()

    def _begin(self) -> None:
        """An empty chunk."""
        self._pieces: list[bytes] = []
        self._size = 0
        self._indexes: dict[int, list[int]] = {}
        """Channel → log time and place in the chunk of each message, one behind the other."""
        self._defined = len(self._schemas), len(self._channels)
        """How many schemas and channels earlier chunks hold."""
        if self._end - self._told_at >= TOLD_AGAIN_BYTES:
            self._told_at = self._end
            self._append(_packed(*self._schemas, *self._channels))

    def _append(self, record: bytes) -> None:
        self._pieces.append(record)
        self._size += len(record)

    def _chunk(self) -> tuple[bytes, records.ChunkIndex]:
        """The chunk in progress with the indexes of its messages, as they are on the disk, and where that is."""
        content = b"".join(self._pieces)
        chunk = records.Chunk(
            compression="lz4",
            data=lz4.frame.compress(content),
            message_start_time=min(min(entries[::2]) for entries in self._indexes.values()),
            message_end_time=max(max(entries[::2]) for entries in self._indexes.values()),
            uncompressed_crc=zlib.crc32(content),
            uncompressed_size=len(content),
        )
        packed = _packed(chunk)
        indexes, places, place = [packed], {}, self._end + len(packed)
        for channel, entries in self._indexes.items():
            indexes.append(_message_index(channel, entries))
            places[channel] = place
            place += len(indexes[-1])
        index = records.ChunkIndex(
            chunk_start_offset=self._end,
            chunk_length=len(packed),
            compression=chunk.compression,
            compressed_size=len(chunk.data),
            uncompressed_size=chunk.uncompressed_size,
            message_start_time=chunk.message_start_time,
            message_end_time=chunk.message_end_time,
            message_index_offsets=places,
            message_index_length=place - self._end - len(packed),
        )
        return b"".join(indexes), index

    def _summary(self, start: int) -> bytes:
        """All that stands between the data and the closing magic. start: where in the file."""
        groups: tuple[tuple[Opcode, list[Any]], ...] = (
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.ATTACHMENT_INDEX, self._attachments),
            (Opcode.METADATA_INDEX, self._metadata),
        )
        summary, place, offsets = [], start, []
        for opcode, group in groups:
            packed = _packed(*group)
            if group:
                offsets.append(records.SummaryOffset(group_opcode=opcode, group_start=place, group_length=len(packed)))
            summary.append(packed)
            place += len(packed)
        data = b"".join(summary) + _packed(*offsets)
        crc = zlib.crc32(_FOOTER.pack(Opcode.FOOTER, _FOOTER_LENGTH, start, place), zlib.crc32(data))
        return data + _packed(records.Footer(summary_start=start, summary_offset_start=place, summary_crc=crc))

    def _statistics(self) -> records.Statistics:
        return records.Statistics(
            message_count=sum(self._counts.values()),
            channel_message_counts=self._counts,
            schema_count=len(self._schemas),
            channel_count=len(self._channels),
            chunk_count=len(self._chunks),
            attachment_count=len(self._attachments),
            metadata_count=len(self._metadata),
            message_start_time=min((chunk.message_start_time for chunk in self._chunks), default=0),
            message_end_time=max((chunk.message_end_time for chunk in self._chunks), default=0),
        )

    def _write(self, data: bytes) -> None:
        """All of it, or none. Raises OSError."""
        rest = memoryview(data)
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError:
            with suppress(OSError):  # of a disk that is gone there is nothing to be saved
                self._file.truncate(self._end)
                self._file.seek(self._end)
            raise
        self._end += len(data)


def _packed(*of: Any) -> bytes:
    """Records as the library packs them."""
    builder = RecordBuilder()
    for record in of:
        record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]


def _message_index(channel: int, entries: list[int]) -> bytes:
    length = 8 * len(entries)
    return struct.pack(f"<BQHI{len(entries)}Q", Opcode.MESSAGE_INDEX, 6 + length, channel, length, *entries)
