"""The .tlog of MAVProxy, QGroundControl and Mission Planner: each frame behind eight bytes of time.

Page: https://ardupilot.org/dev/docs/mavlink-basics.html ("telemetry log"); µs since 1970, big-endian. A frame vouches
for itself by its CRC, but for its signature. Nothing vouches for a time: see `strays`.
"""

from __future__ import annotations

import re
import struct
from collections import Counter
from collections.abc import Iterator
from functools import cached_property
from mmap import mmap
from pathlib import Path
from typing import NamedTuple

from fastcrc import crc16
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs.recording.strays import ANY_LOG, LAST_TIME_US, Habits, mended
from wire.frames import CRC, HEADER_1, HEADER_2, MAGIC_1, MAGIC_2, SIGNATURE, SIGNED

_TIME = struct.Struct(">Q")


class Entry(NamedTuple):
    """One frame of a log."""

    time_us: int
    """Since 1970; of one that strayed, that of the frame before."""
    raw: bytes
    """The whole frame, signature included."""


def packed(time_ns: int, frame: bytes) -> bytes:
    """One entry as it is on the disk. time_ns: since 1970; what is below a µs is cut off."""
    return _TIME.pack(time_ns // 1000) + frame


def entries(path: Path) -> Entries:
    """Every whole entry of a log, in its order; damage is stepped over. Raises OSError."""
    return Entries(path.read_bytes())


class Entries:
    """The whole entries of a log's bytes, in their order, and how many bytes were none.

    A frame of a message that our dialect lacks is believed once another of the same message bears it out: both must
    come to the same CRC_EXTRA, which every definition of a message has of its own
    (https://mavlink.io/en/guide/serialization.html).
    """

    def __init__(self, data: bytes | mmap, habits: Habits = ANY_LOG) -> None:
        """habits: of whoever wrote it."""
        self._data, self._habits = data, habits
        self._kept = 0
        self.mended = 0
        """Times that strayed, once all were taken."""

    @property
    def skipped(self) -> int:
        """Bytes that belonged to no entry, once all of them were taken."""
        return len(self._data) - self._kept

    def __iter__(self) -> Iterator[Entry]:
        """From the beginning."""
        self._kept = self.mended = 0
        for entry, time_us in mended(self._entries(), self._habits):
            self._kept += _TIME.size + len(entry.raw)
            self.mended += time_us != entry.time_us
            yield Entry(time_us, entry.raw)

    def _entries(self) -> Iterator[Entry]:
        at: int | None = 0
        due = 0
        """Where the next entry begins, if what the one before says of its length is true."""
        while at is not None:
            shape = _shape(self._data, at)
            entry = self._entry(at, shape, timed=at != due)
            if shape is not None and entry is not None and (at == due or self._goes_on(shape.end)):
                yield entry
                at = due = shape.end
            else:
                due = shape.end if shape is not None and at == due else due
                at = _next_magic(self._data, at + 1)

    def _goes_on(self, at: int) -> bool:
        """Whether an entry or the end of the log is there: behind damage, eight bytes alone may be anything."""
        return at == len(self._data) or self._entry_at(at) is not None

    def _entry_at(self, at: int) -> Entry | None:
        return self._entry(at, _shape(self._data, at), timed=True)

    def _entry(self, at: int, shape: _Shape | None, *, timed: bool) -> Entry | None:
        """The entry of this shape that begins there, if its CRC is right. timed: if its time is one, too."""
        if shape is None or ((time_us := _TIME.unpack_from(self._data, at)[0]) >= LAST_TIME_US and timed):
            return None
        extra = _CRC_EXTRA.get(shape.message)
        if extra is None:
            extra = self._unknown.get(shape.message)
        right = extra is not None and extra == _implied_extra(self._data, at, shape)
        return Entry(time_us, self._data[at + _TIME.size : shape.end]) if right else None

    @cached_property
    def _unknown(self) -> dict[int, int]:
        """Message id → CRC_EXTRA, of messages beyond our dialect that this log bears out."""
        told: Counter[tuple[int, int]] = Counter()
        at: int | None = 0
        while at is not None:
            shape = _shape(self._data, at)
            extra = None if shape is None else _implied_extra(self._data, at, shape)
            if shape is None or extra is None:
                at = _next_magic(self._data, at + 1)
                continue
            if shape.message not in _CRC_EXTRA:
                told[shape.message, extra] += 1
            at = shape.end
        return {message: extra for (message, extra), times in reversed(told.most_common()) if times > 1}


class _Shape(NamedTuple):
    """What the header of an entry claims."""

    message: int
    stop: int
    """Where the payload ends and the CRC begins."""
    end: int
    """Of the entry."""


_CRC_EXTRA = {number: kind.crc_extra for number, kind in dialect.mavlink_map.items()}
_checksum = crc16.mcrf4xx
_LAST_STEP = {_checksum(bytes([byte]), 0): byte for byte in range(256)}
"""What the last byte of a message adds to its checksum → that byte."""


def _shape(data: bytes | mmap, at: int) -> _Shape | None:
    """Of the entry that may begin there, if all its bytes are there."""
    start = at + _TIME.size
    header = data[start : start + HEADER_2]
    if len(header) == HEADER_2 and header[0] == MAGIC_2 and not header[2] & ~SIGNED:
        stop = start + HEADER_2 + header[1]
        end = stop + CRC + SIGNATURE * (header[2] & SIGNED)
        message = header[7] | header[8] << 8 | header[9] << 16
    elif len(header) >= HEADER_1 and header[0] == MAGIC_1:
        stop = start + HEADER_1 + header[1]
        end, message = stop + CRC, header[5]
    else:
        return None
    return _Shape(message, stop, end) if end <= len(data) else None


def _implied_extra(data: bytes | mmap, at: int, shape: _Shape) -> int | None:
    """The CRC_EXTRA with which this CRC is right; of most wrong ones there is none."""
    before = _checksum(data[at + _TIME.size + 1 : shape.stop])
    last = _LAST_STEP.get((data[shape.stop] | data[shape.stop + 1] << 8) ^ before >> 8)
    return None if last is None else last ^ before & 0xFF


_MAGIC = re.compile(bytes([ord("["), MAGIC_2, MAGIC_1, ord("]")]))


def _next_magic(data: bytes | mmap, at: int) -> int | None:
    """Where, from there on, an entry may begin."""
    found = _MAGIC.search(data, at + _TIME.size)
    return None if found is None else found.start() - _TIME.size
