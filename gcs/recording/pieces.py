"""Records of an MCAP file that vouch for themselves, found among bytes that may be damaged.

No length is believed that nothing vouches for. Chunks are looked for by their shape, and taken if the CRC of what they
hold is right. Attachments have a CRC as well, and our metadata bring one along (`seal`). Format: https://mcap.dev/spec.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from io import BytesIO
from mmap import mmap

from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Attachment, Chunk, Metadata
from mcap.stream_reader import get_chunk_data_stream

from gcs.recording.reader import DAMAGE
from gcs.recording.seal import is_sealed

RECORD = struct.Struct("<BQ")
"""Opcode, and the length of what follows."""
MESSAGE = struct.Struct("<HIQQ")
"""Channel, sequence, log time and publish time; the payload follows."""
_SHAPE = re.compile(
    rb"\x06.{5}\0\0\0.{28}(?:\x03\0\0\0lz4|\x04\0\0\0zstd|\0\0\0\0)|[\x09\x0c].{5}\0\0\0",
    re.DOTALL,
)
"""How a chunk, an attachment or metadata begins: none is longer than 2⁴⁰ bytes."""


def pieces(data: bytes | mmap) -> Iterator[tuple[int, int, Chunk | Attachment | Metadata]]:
    """(begin, end, record) of all that something vouches for, and of metadata that came without a CRC."""
    at = 0
    while (shape := _SHAPE.search(data, at)) is not None:
        start = shape.start()
        opcode, length = RECORD.unpack_from(data, start)
        stop = start + RECORD.size + length
        record = None
        if stop <= len(data):
            with suppress(*DAMAGE):
                record = _PARSERS[opcode](data[start:stop])
        if record is None:
            at = start + 1
        else:
            yield start, stop, record
            at = stop


def _chunk(record: bytes) -> Chunk | None:
    chunk: Chunk = Chunk.read(stream_of(record))
    content = content_of(chunk)
    for opcode, start, stop in spans(content):
        if stop > len(content) or (opcode == Opcode.MESSAGE and stop - start < MESSAGE.size):
            return None
    right = zlib.crc32(content) == chunk.uncompressed_crc and len(content) == chunk.uncompressed_size
    return chunk if right else None


def _attachment(record: bytes) -> Attachment | None:
    attachment: Attachment = Attachment.read(stream_of(record))
    right = zlib.crc32(record[RECORD.size : -4]) == int.from_bytes(record[-4:], "little")
    return attachment if right else None


def _metadata(record: bytes) -> Metadata | None:
    """Without a CRC it must at least be, byte for byte, what it says."""
    metadata: Metadata = Metadata.read(stream_of(record))
    builder = RecordBuilder()
    metadata.write(builder)
    same = builder.end() == record  # type: ignore[no-untyped-call]
    named = metadata.name != "" and metadata.name.isprintable()
    return metadata if same and named and is_sealed(metadata.name, metadata.metadata) is not False else None


_PARSERS: dict[int, Callable[[bytes], Chunk | Attachment | Metadata | None]] = {
    Opcode.CHUNK: _chunk,
    Opcode.ATTACHMENT: _attachment,
    Opcode.METADATA: _metadata,
}


def stream_of(record: bytes) -> ReadDataStream:
    """A record without its opcode and length, for the mcap library to read."""
    return ReadDataStream(BytesIO(record[RECORD.size :]))


def content_at(data: bytes | mmap, start: int, stop: int) -> bytes:
    """What the chunk holds that is there. Raises DAMAGE."""
    return content_of(Chunk.read(stream_of(data[start:stop])))


def content_of(chunk: Chunk) -> bytes:
    """What a chunk holds, decompressed. Raises DAMAGE."""
    stream, length = get_chunk_data_stream(chunk)
    content: bytes = stream.read(length)
    return content


def spans(content: bytes) -> Iterator[tuple[int, int, int]]:
    """(opcode, begin, end) of the body of each record that stands there, one behind the other."""
    at = 0
    while at < len(content):
        opcode, length = RECORD.unpack_from(content, at)
        start = at + RECORD.size
        at = start + length
        yield opcode, start, at
