"""A chunk of an MCAP file while it fills, and as it is on the disk. Format: https://mcap.dev/spec#chunk-op0x06."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable
from typing import Any

import lz4.frame
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode

_MESSAGE = struct.Struct("<BQHIQQ")
"""Opcode, length of what follows, channel, sequence, log time, publish time."""
_OPCODE, _HEAD = int(Opcode.MESSAGE), 22
"""Of a message, and the bytes of its length that are not its payload."""


class Filling:
    """Schemas, channels and messages that are not on the disk yet."""

    def __init__(self) -> None:
        self.size = 0
        """Bytes."""
        self._pieces: list[bytes] = []
        self._indexes: dict[int, list[int]] = {}
        """Channel → log time and place in the chunk of each message, one behind the other."""

    @property
    def counts(self) -> dict[int, int]:
        """Channel → how many messages of it."""
        return {channel: len(entries) // 2 for channel, entries in self._indexes.items()}

    def define(self, *those: Any) -> None:
        """Schemas and channels, ahead of the first message that needs them."""
        data = packed(*those)
        self._pieces.append(data)
        self.size += len(data)

    def extend(self, messages: Iterable[tuple[int, int, bytes]]) -> None:
        """Each is (channel, time, payload). One that is none raises; those before it stay, it leaves nothing."""
        pieces, indexes, size = self._pieces, self._indexes, self.size
        try:
            for channel, time_ns, data in messages:
                head = _MESSAGE.pack(_OPCODE, _HEAD + len(data), channel, 0, time_ns, time_ns)
                index = indexes.get(channel)
                if index is None:
                    index = indexes[channel] = []
                index += (time_ns, size)
                pieces += (head, data)
                size += _MESSAGE.size + len(data)
        finally:
            self.size = size

    def packed(self, start: int) -> tuple[bytes, records.ChunkIndex]:
        """Itself and the indexes of its messages, as they are on the disk from `start` on, and what tells of them."""
        content = b"".join(self._pieces)
        times = [time_ns for entries in self._indexes.values() for time_ns in entries[::2]]
        chunk = records.Chunk(
            compression="lz4",
            data=lz4.frame.compress(content),
            message_start_time=min(times),
            message_end_time=max(times),
            uncompressed_crc=zlib.crc32(content),
            uncompressed_size=len(content),
        )
        data = packed(chunk)
        pieces, places, end = [data], {}, start + len(data)
        for channel, entries in self._indexes.items():
            places[channel] = end
            pieces.append(_message_index(channel, entries))
            end += len(pieces[-1])
        index = records.ChunkIndex(
            chunk_start_offset=start,
            chunk_length=len(data),
            compression=chunk.compression,
            compressed_size=len(chunk.data),
            uncompressed_size=chunk.uncompressed_size,
            message_start_time=chunk.message_start_time,
            message_end_time=chunk.message_end_time,
            message_index_offsets=places,
            message_index_length=end - start - len(data),
        )
        return b"".join(pieces), index


def packed(*of: Any) -> bytes:
    """Records as the mcap library packs them."""
    builder = RecordBuilder()
    for record in of:
        record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]


def _message_index(channel: int, entries: list[int]) -> bytes:
    length = 8 * len(entries)
    return struct.pack(f"<BQHI{len(entries)}Q", Opcode.MESSAGE_INDEX, 6 + length, channel, length, *entries)
