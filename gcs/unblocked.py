"""A stream that nobody waits for: a thread writes what is said, and what a stuck terminal does not take is dropped."""

from __future__ import annotations

import io
import os
import select
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from queue import SimpleQueue
from threading import Event, Thread
from typing import Literal, TextIO

MOST = 256
"""Messages that wait to be written; what is said then is dropped, and counted."""
PATIENCE_S = 1.0
"""In the end, a reader that takes nothing for so long is waited for no longer."""


class Unblocked(io.TextIOBase):
    """Stands in for a text stream that may block or break: to write to it does neither."""

    def __init__(self, stream: TextIO) -> None:
        """stream: one with a file descriptor."""
        self._stream = stream
        self._queue = SimpleQueue[bytes | Event | None]()
        self._said = self._taken = 0
        """Messages; each is counted by one thread alone."""
        self._dropped = self._told = 0
        self._bytes = 0
        Thread(target=self._write_out, daemon=True).start()

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """The stream's."""
        return self._stream.encoding

    @property
    def behind(self) -> bool:
        """Whether something that was said has not been taken yet."""
        return self._said > self._taken

    def isatty(self) -> bool:
        """As the stream."""
        return self._stream.isatty()

    def fileno(self) -> int:
        """The stream's."""
        return self._stream.fileno()

    def write(self, text: str) -> int:
        """Said at once, written when it is its turn."""
        if self._said - self._taken >= MOST:
            self._dropped += 1
        else:
            self._queue.put(text.encode(self.encoding, "replace"))
            self._said += 1
        return len(text)

    def drain(self) -> None:
        """Wait until all is written, as long as some of it is taken."""
        reached = Event()
        self._queue.put(reached)
        while True:
            before = self._bytes
            if reached.wait(PATIENCE_S) or self._bytes == before:
                return

    def end(self) -> None:
        """Wait for the rest, and end the thread."""
        self.drain()
        self._queue.put(None)

    def _write_out(self) -> None:
        while (item := self._queue.get()) is not None:
            if isinstance(item, Event):
                item.set()
                continue
            self._put(item)
            self._taken += 1
            if not self.behind and (lost := self._dropped - self._told):
                self._told += lost
                self._put(f"({lost} messages were not shown: nobody read them)\n".encode())

    def _put(self, data: bytes) -> None:
        with suppress(OSError):  # whoever read has gone
            while data:
                try:
                    count = os.write(self.fileno(), data)
                except BlockingIOError:  # others who have this terminal may have told it not to wait
                    select.select((), (self.fileno(),), ())
                    continue
                self._bytes += count
                data = data[count:]


@contextmanager
def unblocked(name: Literal["stdout", "stderr"]) -> Iterator[None]:
    """Wait for nobody who reads this stream of ours, while it lasts; a file is written to as ever."""
    before: TextIO = getattr(sys, name)
    if not _may_block(before):
        yield
        return
    stream = Unblocked(before)
    setattr(sys, name, stream)
    try:
        yield
    finally:
        setattr(sys, name, before)
        stream.end()


def _may_block(stream: TextIO) -> bool:
    try:
        return not stat.S_ISREG(os.fstat(stream.fileno()).st_mode)
    except (OSError, ValueError):
        return False
