"""The files of one recording: run.mcap, and wherever it goes on after the disk took no more of it.

        a write fails: the torn chunk is cut off            a write succeeds
written ────────────────────────────────────────► stopped ──────────────────► written, in the next part
                                                  │     ▲
                                                  └─────┘ tried again every second
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from gcs.recording.channels import Channel, Channels
from gcs.recording.files import DROPPED, METADATA, PART, SCENARIO, RecordingError, part
from gcs.recording.mcap_file import McapFile
from gcs.recording.seal import sealed
from gcs.words import missing

AGAIN_NS = 1_000_000_000
"""Between two attempts to go on."""
ENOUGH = 1 << 20
"""Bytes that must be free to go on, so that it does not stop again at once."""


@dataclass(frozen=True, slots=True)
class About:
    """What every file of the recording begins with."""

    scenario: bytes
    """JSON."""
    metadata: dict[str, str]
    start_ns: int


class Rotation:
    """Messages of one flight; whatever the disk does, whoever adds some is not stopped."""

    def __init__(self, path: Path, about: About, say: Callable[[str], None]) -> None:
        """say: what to do with a sentence about a recording that stops, or goes on. Raises RecordingError."""
        self._path, self._about, self._say = path, about, say
        self._file: McapFile | None = None
        """None while the disk takes nothing."""
        self._channels: Channels
        """Of this part."""
        self._number = 0
        """Of the last part that the disk took messages of, or that it began with."""
        self._attempted = False
        """Whether the file is the part behind that, of which the disk took none yet."""
        self._ended: list[McapFile] = []
        """Parts that still lack their summary."""
        self._tried_ns = about.start_ns
        self._why: str | None = None
        self.dropped = 0
        """Messages that are in no file."""
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._open()
        except OSError as error:
            raise RecordingError(f"{path}: the recording cannot be written: {error.strerror or error}") from None
        self._number = 1

    @property
    def problem(self) -> str | None:
        """Why messages are missing, if any are, and where it goes on."""
        if self._why is None:
            return None
        on = f"; it goes on in {part(self._path, self._number).name}" if self._number > 1 else ""
        return f"{self._path}: the recording stopped: {self._why}; {missing(self.dropped, 'message')}{on}"

    def add(self, messages: Iterable[tuple[Channel, int, bytes]]) -> None:
        """In their order, each with its time, ns since 1970; lost, and counted, while the disk takes nothing."""
        file = self._file
        if file is None:
            self.dropped += sum(1 for _ in messages)
            return
        number = self._channels.number
        numbered = [(number(channel), time_ns, data) for channel, time_ns, data in messages]
        try:
            file.extend(numbered)
        except OSError as error:
            self._stop(file, error)

    def metadata(self, name: str, values: dict[str, str]) -> None:
        """Words about the whole, in the part being written."""
        self._attempt(lambda file: file.metadata(name, sealed(name, values)))

    def flush(self, time_ns: int) -> None:
        """Every message so far, to the disk; or see whether it can go on."""
        if self._file is None and time_ns - self._tried_ns >= AGAIN_NS:
            self._tried_ns = time_ns
            with suppress(OSError):
                if shutil.disk_usage(self._path.parent).free >= ENOUGH:
                    self._open()
                    self._attempted = True
            return
        self._attempt(McapFile.flush)

    def finish(self) -> None:
        """Write the summaries, of earlier parts too, where there is room, and close."""
        self._attempt(McapFile.finish)
        self._finish_ended()
        self.close()

    def close(self) -> None:
        """Leave everything as it is on the disk."""
        for file in (*self._ended, *filter(None, [self._file])):
            file.close()
        self._file, self._ended = None, []

    def _open(self) -> None:
        """Begin the next part, in nobody's place. Raises OSError."""
        path = part(self._path, self._number + 1)
        path.touch(exist_ok=False)
        file = None
        try:
            file = McapFile(path)
            words = {PART: str(self._number + 1), DROPPED: str(self.dropped)}
            file.metadata(METADATA, sealed(METADATA, self._about.metadata | words))
            file.attach(self._about.start_ns, SCENARIO, "application/json", self._about.scenario)
        except OSError:
            _discard(file, path)
            raise
        self._file, self._channels = file, Channels(file)

    def _attempt(self, write: Callable[[McapFile], None]) -> None:
        if self._file is None:
            return
        try:
            write(self._file)
        except OSError as error:
            self._stop(self._file, error)
            return
        if self._attempted:
            self._attempted = False
            self._number += 1
            now = part(self._path, self._number)
            self._say(f"gcs: {now}: the recording goes on; {missing(self.dropped, 'message')}")
            self._finish_ended()

    def _stop(self, file: McapFile, error: OSError) -> None:
        """Of an attempt that failed nothing is said, and nothing is left."""
        self._file = None
        self.dropped += file.dropped
        if self._attempted:
            self._attempted = False
            _discard(file, part(self._path, self._number + 1))
            return
        self._ended.append(file)
        self._why = error.strerror or str(error)
        self._say(
            f"gcs: {part(self._path, self._number)}: the recording stopped: {self._why}; "
            "the flight goes on without it, until the disk takes it again"
        )

    def _finish_ended(self) -> None:
        waiting = []
        for file in self._ended:
            try:
                file.finish()
            except OSError:
                waiting.append(file)
        self._ended = waiting


def _discard(file: McapFile | None, path: Path) -> None:
    if file is not None:
        file.close()
    with suppress(OSError):
        path.unlink()
