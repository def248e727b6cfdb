"""Payloads of the messages that fly many times a second, packed by hand.

pymavlink takes 15–20 µs a message for what `struct` does in one (docs/speed.md). Field order is the wire's: larger
types first. Tests hold every one to pymavlink's bytes. Page: https://mavlink.io/en/messages/common.html
"""

from __future__ import annotations

import math
import struct
from typing import NamedTuple

LOCAL_POSITION_NED = 32
SET_POSITION_TARGET_LOCAL_NED = 84
SIM_STATE = 108

IGNORE_LEVEL_VELOCITY, FORCE, IGNORE_YAW, IGNORE_YAW_RATE = 0x0018, 0x0200, 0x0400, 0x0800
"""Bits of type_mask: vx and vy do not count; what is set is a force; yaw, and its rate, do not count."""
VELOCITY_ONLY, POSITION_ONLY = 0x0DC7, 0x0DF8
"""type_mask: what else there is, ignore."""
STANDS_STILL = 1e-9
"""m/s: a horizontal set-point above it asks a vehicle to move."""

_LOCAL_POSITION = struct.Struct("<I6f")
_SET_POSITION_TARGET = struct.Struct("<I11fHBBB")
_SIM_STATE = struct.Struct("<21f2i")


class LocalPosition(NamedTuple):
    """LOCAL_POSITION_NED: position [m] and velocity [m/s] in the vehicle's own NED frame."""

    time_boot_ms: int
    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float


class PositionTarget(NamedTuple):
    """SET_POSITION_TARGET_LOCAL_NED: m, m/s, m/s², rad and rad/s; `type_mask` says which fields count."""

    time_boot_ms: int
    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    afx: float
    afy: float
    afz: float
    yaw: float
    yaw_rate: float
    type_mask: int
    target_system: int
    target_component: int
    coordinate_frame: int

    @property
    def moves_sideways(self) -> bool:
        """Whether its velocity is more than up and down."""
        return math.hypot(self.vx, self.vy) > STANDS_STILL


class SimState(NamedTuple):
    """SIM_STATE: the truth of a simulated vehicle, in SI, radians and degrees (the two last in 1e-7 degrees)."""

    q1: float
    q2: float
    q3: float
    q4: float
    roll: float
    pitch: float
    yaw: float
    xacc: float
    yacc: float
    zacc: float
    xgyro: float
    ygyro: float
    zgyro: float
    lat: float
    lon: float
    alt: float
    std_dev_horz: float
    std_dev_vert: float
    vn: float
    ve: float
    vd: float
    lat_int: int
    lon_int: int


def pack_local_position(message: LocalPosition) -> bytes:
    """Full-length payload of message 32."""
    return _LOCAL_POSITION.pack(*message)


def unpack_local_position(payload: bytes) -> LocalPosition:
    """From a payload that may have lost trailing zeros; bytes of later extensions are ignored."""
    return LocalPosition(*_LOCAL_POSITION.unpack(payload[:28].ljust(28, b"\0")))


def pack_position_target(message: PositionTarget) -> bytes:
    """Full-length payload of message 84."""
    return _SET_POSITION_TARGET.pack(*message)


def unpack_position_target(payload: bytes) -> PositionTarget:
    """From a payload that may have lost trailing zeros."""
    return PositionTarget(*_SET_POSITION_TARGET.unpack(payload[:53].ljust(53, b"\0")))


def pack_sim_state(message: SimState) -> bytes:
    """Full-length payload of message 108."""
    return _SIM_STATE.pack(*message)


def unpack_sim_state(payload: bytes) -> SimState:
    """From a payload that may have lost trailing zeros."""
    return SimState(*_SIM_STATE.unpack(payload[:92].ljust(92, b"\0")))
