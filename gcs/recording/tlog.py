"""The .tlog of MAVProxy, QGroundControl and Mission Planner: each frame behind eight bytes of time.

Page: https://ardupilot.org/dev/docs/mavlink-basics.html ("telemetry log"); µs since 1970, big-endian.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

_TIME = struct.Struct(">Q")


class Entry(NamedTuple):
    """One frame of a log."""

    time_us: int
    """Since 1970."""
    raw: bytes
    """The whole frame, signature included."""


def packed(time_ns: int, frame: bytes) -> bytes:
    """One entry as it is on the disk. time_ns: since 1970; what is below a µs is cut off."""
    return _TIME.pack(time_ns // 1000) + frame


def entries(path: Path) -> Iterator[Entry]:
    """Every whole entry of a log, in its order."""
    raise NotImplementedError(path)
