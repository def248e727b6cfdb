"""An MCAP file as it is written: chunks that reach the disk whole, or are cut off again.

Format: https://mcap.dev/spec. What comes once or seldom is packed by the mcap library's own records. Messages and their
indexes are packed here: the library takes eight calls for each message, and cannot take back half a chunk.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

from mcap import records
from mcap.opcode import Opcode

from gcs.recording.mcap_chunk import Filling, packed

MAGIC = b"\x89MCAP0\r\n"
CHUNK_BYTES = 1 << 20
"""A chunk that holds as much is closed, however young: readers hold one in memory."""
TOLD_AGAIN_BYTES = 1 << 19
"""After so many a chunk repeats all schemas and channels: one that is damaged takes nobody's name along."""
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
        self._torn = False
        """Whether half a record may stand behind it."""
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
        self._defined = 0, 0
        """How many schemas and channels are on the disk."""
        self._filling = Filling()
        try:
            self._write(MAGIC + packed(records.Header(profile="", library=library)))
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
        self._filling.define(schema)
        return schema.id

    def channel(self, topic: str, encoding: str, schema: int = 0) -> int:
        """Its id, for messages. schema: 0 where the encoding speaks for itself."""
        channel = records.Channel(
            id=len(self._channels) + 1, topic=topic, message_encoding=encoding, metadata={}, schema_id=schema
        )
        self._channels.append(channel)
        self._filling.define(channel)
        return channel.id

    def add(self, channel: int, time_ns: int, data: bytes) -> None:
        """One message. Raises OSError where it fills the chunk, and the disk is full."""
        self.extend(((channel, time_ns, data),))

    def extend(self, messages: Iterable[tuple[int, int, bytes]]) -> None:
        """Several, each (channel, time, payload), in one chunk. Raises OSError as `add` does."""
        self._filling.extend(messages)
        if self._filling.size > CHUNK_BYTES:
            self.flush()

    def attach(self, time_ns: int, name: str, media_type: str, data: bytes) -> None:
        """A whole file, within this one. Raises OSError."""
        record = packed(
            records.Attachment(create_time=time_ns, log_time=time_ns, name=name, media_type=media_type, data=data)
        )
        index = records.AttachmentIndex(
            offset=self._end,
            length=len(record),
            create_time=time_ns,
            log_time=time_ns,
            data_size=len(data),
            name=name,
            media_type=media_type,
        )
        self._write(record)
        self._attachments.append(index)

    def metadata(self, name: str, values: dict[str, str]) -> None:
        """Words about the whole. Raises OSError."""
        record = packed(records.Metadata(name=name, metadata=values))
        index = records.MetadataIndex(offset=self._end, length=len(record), name=name)
        self._write(record)
        self._metadata.append(index)

    def flush(self) -> None:
        """Close the chunk: every message added so far leaves the process in one write. Raises OSError."""
        counts = self._filling.counts
        if not counts:
            return
        filling, self._filling = self._filling, Filling()
        try:
            chunk, index = filling.packed(self._end)
            self._write(chunk)
        except Exception:
            self.dropped += sum(counts.values())
            schemas, channels = self._defined
            del self._schemas[schemas:], self._channels[channels:]
            raise
        self._chunks.append(index)
        self._defined = len(self._schemas), len(self._channels)
        for channel, count in counts.items():
            self._counts[channel] = self._counts.get(channel, 0) + count
        if self._end - self._told_at >= TOLD_AGAIN_BYTES:
            self._told_at = self._end
            self._filling.define(*self._schemas, *self._channels)

    def finish(self) -> None:
        """Write the summary and close. Raises OSError: then it may be tried again."""
        self.flush()
        data_end = packed(records.DataEnd(data_section_crc=0))
        self._write(data_end + self._summary(self._end + len(data_end)) + MAGIC)
        self.close()

    def close(self) -> None:
        """As it is on the disk; without a summary, if it was not finished."""
        with suppress(OSError):  # what could not be written has been told
            self._file.close()

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
        pieces, offsets, place = [], [], start
        for opcode, group in groups:
            pieces.append(packed(*group))
            length = len(pieces[-1])
            if group:
                offsets.append(records.SummaryOffset(group_opcode=opcode, group_start=place, group_length=length))
            place += length
        data = b"".join(pieces) + packed(*offsets)
        crc = zlib.crc32(_FOOTER.pack(Opcode.FOOTER, _FOOTER_LENGTH, start, place), zlib.crc32(data))
        return data + packed(records.Footer(summary_start=start, summary_offset_start=place, summary_crc=crc))

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
        if self._torn:
            self._cut()
        rest, self._torn = memoryview(data), True
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError:
            with suppress(OSError):  # or before the next record
                self._cut()
            raise
        self._end += len(data)
        self._torn = False

    def _cut(self) -> None:
        self._file.truncate(self._end)
        self._file.seek(self._end)
        self._torn = False
