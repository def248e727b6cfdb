"""The .tlog of MAVProxy, QGroundControl and Mission Planner: each frame behind eight bytes of time.

Page: https://ardupilot.org/dev/docs/mavlink-basics.html ("telemetry log"); µs since 1970, big-endian. A frame vouches
for itself by its CRC. Nothing vouches for a time: one that strays from those of its neighbours is taken for damage.
"""

from __future__ import annotations

import re
import struct
from collections import Counter
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from fastcrc import crc16
from pymavlink.dialects.v20 import ardupilotmega as dialect

from wire.frames import CRC, HEADER_1, HEADER_2, MAGIC_1, MAGIC_2, SIGNATURE, SIGNED

_TIME = struct.Struct(">Q")
LAST_TIME_US = 1 << 52
"""The year 2112: a later time is none."""
ASTRAY_US = 1_000_000
"""How far a time may lie outside those of its neighbours: links of one log deliver out of order, by less."""


class Entry(NamedTuple):
    """One frame of a log."""

    time_us: int
    """Since 1970."""
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

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._kept = 0

    @property
    def skipped(self) -> int:
        """Bytes that belonged to no entry, once all of them were taken."""
        return len(self._data) - self._kept

    def __iter__(self) -> Iterator[Entry]:
        """From the beginning."""
        self._kept = 0
        for entry in _borne_out(self._entries()):
            self._kept += _TIME.size + len(entry.raw)
            yield entry

    def _entries(self) -> Iterator[Entry]:
        at: int | None = 0
        while at is not None:
            found = _candidate(self._data, at)
            if found is not None and self._believed(found):
                yield found.entry
                at += _TIME.size + len(found.entry.raw)
            else:
                at = _next_magic(self._data, at + 1)

    def _believed(self, found: _Candidate) -> bool:
        extra = _CRC_EXTRA.get(found.message)
        return found.extra == (self._unknown.get(found.message, -1) if extra is None else extra)

    @cached_property
    def _unknown(self) -> dict[int, int]:
        """Message id → CRC_EXTRA, of messages beyond our dialect that this log bears out."""
        told: Counter[tuple[int, int]] = Counter()
        at: int | None = 0
        while at is not None:
            found = _candidate(self._data, at)
            if found is None:
                at = _next_magic(self._data, at + 1)
                continue
            if found.message not in _CRC_EXTRA:
                told[found.message, found.extra] += 1
            at += _TIME.size + len(found.entry.raw)
        return {message: extra for (message, extra), times in reversed(told.most_common()) if times > 1}


class _Candidate(NamedTuple):
    """What may be an entry: its CRC is right if its message has this CRC_EXTRA."""

    entry: Entry
    message: int
    extra: int


_CRC_EXTRA = {number: kind.crc_extra for number, kind in dialect.mavlink_map.items()}
_checksum = crc16.mcrf4xx
_LAST_STEP = {_checksum(bytes([byte]), 0): byte for byte in range(256)}
"""What the last byte of a message adds to its checksum → that byte."""


def _candidate(data: bytes, at: int) -> _Candidate | None:
    """The entry that may begin there, whole."""
    start = at + _TIME.size
    if len(data) < start + HEADER_1 + CRC or (time_us := _TIME.unpack_from(data, at)[0]) >= LAST_TIME_US:
        return None
    tail = CRC
    if data[start] == MAGIC_2 and len(data) >= start + HEADER_2 and not data[start + 2] & ~SIGNED:
        stop = start + HEADER_2 + data[start + 1]
        tail += SIGNATURE * (data[start + 2] & SIGNED)
        message = data[start + 7] | data[start + 8] << 8 | data[start + 9] << 16
    elif data[start] == MAGIC_1:
        stop = start + HEADER_1 + data[start + 1]
        message = data[start + 5]
    else:
        return None
    if len(data) < stop + tail:
        return None
    before = _checksum(data[start + 1 : stop])
    last = _LAST_STEP.get((data[stop] | data[stop + 1] << 8) ^ before >> 8)
    if last is None:
        return None
    return _Candidate(Entry(time_us, data[start : stop + tail]), message, last ^ before & 0xFF)


_MAGIC = re.compile(bytes([ord("["), MAGIC_2, MAGIC_1, ord("]")]))


def _next_magic(data: bytes, at: int) -> int | None:
    """Where, from there on, an entry may begin."""
    found = _MAGIC.search(data, at + _TIME.size)
    return None if found is None else found.start() - _TIME.size


def _borne_out(entries: Iterator[Entry]) -> Iterator[Entry]:
    """Without those whose time lies outside the times before and behind it: a clock that is set goes on from there."""
    before, entry = None, next(entries, None)
    for behind in entries:
        assert entry is not None
        if before is None or not _astray(entry.time_us, before.time_us, behind.time_us):
            yield entry
            before = entry
        entry = behind
    if entry is not None:
        yield entry


def _astray(time_us: int, before_us: int, behind_us: int) -> bool:
    first, last = sorted((before_us, behind_us))
    return not first - ASTRAY_US <= time_us <= last + ASTRAY_US
