"""What is in a recording, record by record: of a flight of ours, or of another ground station's log."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any, NamedTuple

from mcap.reader import SeekingReader
from mcap.records import Header, Message
from mcap.stream_reader import StreamReader

from gcs.recording.channels import RAW
from gcs.recording.reader import RECORD_SIZE_LIMIT, UnreadableRecording, readable
from wire.frames import Frame, Framer

OURS = "trustr"
"""Who wrote a file, in the header of ours."""


def mapped(path: Path) -> bytes | mmap:
    """The bytes of a file, of which only those that are looked at take memory. Raises UnreadableRecording."""
    try:
        with path.open("rb") as file:
            return mmap(file.fileno(), 0, access=ACCESS_READ) if path.stat().st_size else b""
    except OSError as error:
        raise UnreadableRecording(f"{path}: cannot be read: {error.strerror or error}") from None


def records(path: Path) -> Iterator[Any]:
    """Every record of the mcap library's, in the file's order. Raises UnreadableRecording."""
    with readable(path), path.open("rb") as stream:
        yield from StreamReader(stream, validate_crcs=True, record_size_limit=RECORD_SIZE_LIMIT).records


class Foreign(NamedTuple):
    """What is in another program's file."""

    messages: int
    begin_ns: int
    end_ns: int
    """Times of the first and last message, since 1970."""


def foreign(path: Path) -> Foreign | None:
    """Of a file that another program wrote and that reads to its end without complaint; None of any other."""
    times = list[int]()
    with suppress(UnreadableRecording):
        for record in records(path):
            if isinstance(record, Header) and record.library == OURS:
                return None
            if isinstance(record, Message):
                times.append(record.log_time)
        return Foreign(len(times), min(times), max(times)) if times else None
    return None


def frames(path: Path) -> Iterator[tuple[int, bytes]]:
    """Every raw frame and its time in ns since 1970, in the order of time. Raises UnreadableRecording."""
    with readable(path), path.open("rb") as stream:
        reader = SeekingReader(stream, validate_crcs=True, record_size_limit=RECORD_SIZE_LIMIT)
        for _schema, channel, message in reader.iter_messages():
            if channel.message_encoding == RAW:
                yield message.log_time, message.data


def frame_of(time_ns: int, raw: bytes) -> Frame | None:
    """A recorded frame, taken apart; None of a message that our dialect lacks, whatever may be inside it."""
    found = _framer.frames(time_ns, raw)
    return found[0] if found and found[0].raw == raw else None


_framer = Framer()
