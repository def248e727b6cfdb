"""`gcs log import`: another ground station's .tlog as MCAP, for the same commands as a flight of ours."""

from __future__ import annotations

import hashlib
from mmap import mmap
from pathlib import Path
from typing import Any

from gcs.console import say
from gcs.guard import DONE
from gcs.output import check_free, whole
from gcs.recording import decoded
from gcs.recording.channels import Channels, raw_channel
from gcs.recording.contents import frame_of, mapped
from gcs.recording.mcap_file import MAGIC, McapFile
from gcs.recording.reader import UnreadableRecording
from gcs.recording.tlog import Entries, Entry
from wire.frames import sender_of

IMPORTED = "imported"
"""Name of the metadata record that says where the frames came from; such a recording has no scenario."""

CLOCKS_WERE_SET_US = 315_532_800_000_000
"""1980, where GPS time begins: a clock before it was never set."""
BACK_US, AHEAD_US = 1_000_000, 3_600_000_000
"""Links of one log deliver out of order by less than the one, and no flight is silent for as long as the other."""


def import_tlog(path: Path, *, out: Path | None, console: Any) -> int:
    """Write raw frames by sender, and decoded beside them. Exit code. Raises UnreadableRecording and Unwritable."""
    out = path.with_suffix(".mcap") if out is None else out
    check_free(out)
    data = mapped(path)
    if data[: len(MAGIC)] == MAGIC:
        raise UnreadableRecording(f"{path}: an MCAP file already: there is nothing to import")
    log, clock = Entries(data), Clock()
    with whole(out) as unfinished, McapFile(unfinished) as file:
        senders = _Senders(Channels(file))
        for entry in log:
            clock.take(entry.time_us)
            senders.add(entry)
        if not senders.frames:
            raise UnreadableRecording(f"{path}: no .tlog: there is no MAVLink frame behind a time in it")
        file.metadata(IMPORTED, _origin(path, data, senders.frames, log.skipped))
    problems = clock.problems()
    if log.mended:
        problems.append(f"{log.mended} of its times cannot be: their frames are put at the time of the one before")
    if log.skipped > len(data) / 2:
        problems.append("most of it is no frame behind a time: is it a .tlog?")
    for problem in problems:
        say(f"gcs: {path}: {problem}")
    skipped = f"; {log.skipped} of {len(data)} bytes were none" if log.skipped else ""
    line = f"{out.resolve()}: {senders.frames} frames of {senders.count} senders{skipped}"
    console.print(line, highlight=False, soft_wrap=True, markup=False)
    return DONE


def _origin(path: Path, data: bytes | mmap, frames: int, skipped: int) -> dict[str, str]:
    return {
        "file": path.name,
        "bytes": str(len(data)),
        "sha256": hashlib.sha256(data).hexdigest(),
        "frames": str(frames),
        "skipped_bytes": str(skipped),
    }


class _Senders:
    """Raw and decoded topics of whoever is in a log."""

    def __init__(self, channels: Channels) -> None:
        self._channels = channels
        self._heard = set[tuple[int, int]]()
        self.frames = 0

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self._heard)

    def add(self, entry: Entry) -> None:
        """A frame at its time. Raises OSError."""
        time_ns, raw = entry.time_us * 1000, entry.raw
        sender = sender_of(raw)
        self._heard.add(sender)
        self._channels.add(raw_channel(*sender), time_ns, raw)
        self.frames += 1
        frame = frame_of(time_ns, raw)
        said = None if frame is None else decoded.message(frame)
        if said is not None:
            self._channels.add(*said)


class Clock:
    """Watches the times of a log, and says what is strange about them."""

    def __init__(self) -> None:
        self._first_us: int | None = None
        self._last_us = 0
        self._back_us: list[int] = []
        self._ahead_us: list[int] = []

    def take(self, time_us: int) -> None:
        """The time of the next frame, since 1970."""
        if self._first_us is None:
            self._first_us = self._last_us = time_us
        step_us = time_us - self._last_us
        if step_us < -BACK_US:
            self._back_us.append(-step_us)
        elif step_us > AHEAD_US:
            self._ahead_us.append(step_us)
        self._last_us = time_us

    def problems(self) -> list[str]:
        """A sentence each."""
        said = []
        if self._first_us is not None and self._first_us < CLOCKS_WERE_SET_US:
            said.append("its clock begins before 1980: it was not set")
        for steps, words in ((self._back_us, "goes back"), (self._ahead_us, "jumps ahead")):
            if steps:
                times = "once" if len(steps) == 1 else f"{len(steps)} times"
                said.append(f"its clock {words} {times}, by up to {max(steps) / 1e6:.0f} s: frames keep their order")
        return said
