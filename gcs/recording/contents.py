"""What is in a recording, record by record: of a flight of ours, or of another ground station's log."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mcap.reader import SeekingReader
from mcap.stream_reader import StreamReader

from gcs.recording.reader import RECORD_SIZE_LIMIT, readable
from wire.frames import Frame, Framer

RAW = "mavlink"
"""Encoding of the topics of raw frames."""


def records(path: Path) -> Iterator[Any]:
    """Every record of the mcap library's, in the file's order. Raises UnreadableRecording."""
    with readable(path), path.open("rb") as stream:
        yield from StreamReader(stream, validate_crcs=True, record_size_limit=RECORD_SIZE_LIMIT).records


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
