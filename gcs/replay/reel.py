"""The messages of a recording between two times, in either direction, read as far as they are asked for."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType

from mcap.reader import SeekingReader
from mcap.records import Channel, Schema
from mcap.records import Message as Record

from gcs.recording.reader import RECORD_SIZE_LIMIT, readable
from gcs.replay.outputs import Played
from gcs.replay.player import Span

Read = tuple[Schema | None, Channel, Record]


class Reel:
    """Turns forwards and backwards: span after span is read on from where the last one ended, chunk by chunk."""

    def __init__(self, path: Path) -> None:
        """path: of an MCAP file with an index. Raises UnreadableRecording."""
        self._path = path
        with readable(path), ExitStack() as opened:
            stream = opened.enter_context(path.open("rb"))
            self._reader = SeekingReader(stream, validate_crcs=True, record_size_limit=RECORD_SIZE_LIMIT)
            self._open = opened.pop_all()
        self._coming: Iterator[Read] = iter(())
        self._next: Played | None = None
        self._at_ns: int | None = None
        """Where the last span ended; None before the first."""
        self._backwards = False

    def __enter__(self) -> Reel:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._open.close()

    def play(self, span: Span) -> list[Played]:
        """What lies there, in the order of playing. Raises UnreadableRecording where the file is damaged there."""
        if span.begin_ns == span.end_ns:
            return []
        with readable(self._path):
            return list(self._played(span, backwards=span.end_ns < span.begin_ns))

    def _played(self, span: Span, *, backwards: bool) -> Iterator[Played]:
        if (span.begin_ns, backwards) != (self._at_ns, self._backwards):
            self._turn(span.begin_ns, backwards=backwards)
        while (message := self._next) is not None:
            if message.time_ns < span.end_ns if backwards else message.time_ns >= span.end_ns:
                break
            yield message
            self._next = self._read()
        self._at_ns = span.end_ns

    def _turn(self, at_ns: int, *, backwards: bool) -> None:
        """To another place, or in the other direction."""
        if backwards:
            self._coming = self._reader.iter_messages(ending_before=at_ns, reverse=True)
        else:
            self._coming = self._reader.iter_messages(starting_at=at_ns)
        self._at_ns, self._backwards = None, backwards
        self._next = self._read()

    def _read(self) -> Played | None:
        read = next(self._coming, None)
        if read is None:
            return None
        schema, channel, record = read
        of_schema = ("", "", b"") if schema is None else (schema.name, schema.encoding, schema.data)
        return Played(record.log_time, channel.topic, channel.message_encoding, *of_schema, record.data)
