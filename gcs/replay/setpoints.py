"""Frames that we sent, as bytes: which are set-points, and what is in them."""

from __future__ import annotations

from wire.frames import HEADER_2
from wire.payloads import SET_POSITION_TARGET_LOCAL_NED, unpack_position_target

_MESSAGE = SET_POSITION_TARGET_LOCAL_NED.to_bytes(3, "little")
_LENGTH, _NAMED = 1, 7
"""Where a MAVLink 2 frame has the length of its payload, and its message id. Ours are of MAVLink 2."""


def is_setpoint(frame: bytes) -> bool:
    """Whether it is a set-point."""
    return frame[_NAMED:HEADER_2] == _MESSAGE


def content(frame: bytes) -> bytes:
    """Message id and payload: the same in two frames that say the same, whatever was sent before them."""
    return frame[_NAMED : HEADER_2 + frame[_LENGTH]]


def velocity_of(payload: bytes) -> tuple[float, float, float]:
    """m/s: north, east, down of a set-point."""
    target = unpack_position_target(payload)
    return target.vx, target.vy, target.vz
