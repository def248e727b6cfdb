"""A flight's journal, run.tlog: every frame on its own, as it came and before it goes.

What a killed process leaves of it is whole but for the frame being written; any MAVLink tool reads it.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from gcs.loop import Clock, Link
from gcs.recording.files import RecordingError
from gcs.recording.tlog import packed
from gcs.words import missing
from wire.frames import Frame

SURE_NS = 1_000_000_000
"""So long it must miss nothing before it is said to go on: on a disk that fills up, short frames still fit at times."""


class Journal:
    """One file, not buffered. Whatever the disk does, whoever notes a frame is not stopped."""

    def __init__(self, path: Path, say: Callable[[str], None]) -> None:
        """say: what to do with a sentence about frames that are missing. Raises RecordingError."""
        self._path, self._say = path, say
        self._end = 0
        """Of the last whole entry."""
        self._torn = False
        """Whether half an entry may stand behind it."""
        self._failing = False
        self._missed_ns = 0
        """When the last frame came that is missing."""
        self._why: str | None = None
        self.missing = 0
        """Frames that the disk did not take."""
        try:
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o666)
        except OSError as error:
            raise RecordingError(f"{path}: the journal cannot be written: {error.strerror or error}") from None

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with suppress(OSError):  # what could not be written has been told
            os.close(self._file)

    @property
    def problem(self) -> str | None:
        """Why frames are missing, if any are."""
        return None if self._why is None else f"{self._path}: {missing(self.missing, 'frame')}: {self._why}"

    def arrived(self, frame: Frame) -> None:
        """One that came, under its time of arrival."""
        self.note(frame.time_ns, frame.raw)

    def note(self, time_ns: int, frame: bytes) -> None:
        """One frame, in one write. time_ns: since 1970."""
        try:
            self._write(packed(time_ns, frame))
        except OSError as error:
            self._missed_ns = time_ns
            self._missed(error)
        else:
            if self._failing and time_ns - self._missed_ns >= SURE_NS:
                self._failing = False
                self._say(f"gcs: {self._path}: the journal goes on; {missing(self.missing, 'frame')}")

    def _write(self, entry: bytes) -> None:
        """All of it, or none. Raises OSError."""
        if self._torn:
            self._cut()
        if os.write(self._file, entry) < len(entry):
            self._torn = True
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        self._end += len(entry)

    def _cut(self) -> None:
        os.ftruncate(self._file, self._end)
        self._torn = False

    def _missed(self, error: OSError) -> None:
        self.missing += 1
        if self._torn:
            with suppress(OSError):  # or before the next frame
                self._cut()
        if not self._failing:
            self._failing = True
            self._why = error.strerror or str(error)
            self._say(f"gcs: {self._path}: the journal misses frames: {self._why}; the flight goes on")


class Journaled:
    """A link whose frames stand in the journal before they leave. Those that come are noted where they arrive."""

    def __init__(self, link: Link, clock: Clock, journal: Journal) -> None:
        self._link, self._clock, self._journal = link, clock, journal

    def receive(self) -> list[Frame]:
        """As they come."""
        return self._link.receive()

    def send(self, system: int, frame: bytes) -> None:
        """Noted, then sent, whether or not it could be noted."""
        try:
            self._journal.note(self._clock.now(), frame)
        finally:
            self._link.send(system, frame)

    @property
    def rejected(self) -> int:
        """What the link refused."""
        return self._link.rejected
