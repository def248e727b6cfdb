"""runs.jsonl: every finished run, one line each, written as it comes. What is there is not flown again."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path
from types import TracebackType

from gcs.experiment.run import RunResult
from gcs.recording.files import RecordingError

JOURNAL = "runs.jsonl"
BEGINNING = b'{"key":"'
"""Of every line: half of one, which is all that may be cut off, is told by it."""


class UnusableJournal(RecordingError):
    """A file of runs that cannot be gone on with, in one sentence."""


class Journal:
    """Reads what earlier calls left, then appends; one process at a time."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / JOURNAL
        self.runs: dict[str, RunResult] = {}
        """By key."""

    def __enter__(self) -> Journal:
        try:
            self._stream = self.path.open("a+b", buffering=0)
        except OSError as error:
            raise UnusableJournal(f"{self.path}: cannot be written: {error.strerror or error}") from None
        try:
            fcntl.flock(self._stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._stream.close()
            raise UnusableJournal(f"{self.path}: another experiment is writing there") from None
        try:
            self._read()
        except BaseException:
            self._stream.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stream.close()

    def add(self, run: RunResult) -> None:
        """Keep a run, at once; but not one that crashed, which tells nothing and is to be flown again."""
        if run.crashed:
            return
        try:
            self._stream.write(run.line())
        except OSError as error:
            raise UnusableJournal(f"{self.path}: cannot be written: {error.strerror or error}") from None
        self.runs[run.key] = run

    def _read(self) -> None:
        self._stream.seek(0)
        content = self._stream.read()
        *whole, half = content.split(b"\n")
        for number, line in enumerate(whole, start=1):
            try:
                run = RunResult.of_line(line)
            except (ValueError, TypeError, KeyError, AttributeError):
                raise self._no_run(number, line) from None
            self.runs[run.key] = run
        if not half.startswith(BEGINNING[: len(half)]):
            raise self._no_run(len(whole) + 1, half)
        if half:  # a process was killed while it wrote
            os.ftruncate(self._stream.fileno(), len(content) - len(half))

    def _no_run(self, number: int, line: bytes) -> UnusableJournal:
        shown = line[:60].decode(errors="replace")
        return UnusableJournal(f"{self.path}, line {number}: is no run of this version: {shown!r}")
