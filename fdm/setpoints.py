"""What a vehicle accepts of SET_POSITION_TARGET_LOCAL_NED: velocities in frames that its autopilot understands.

Whoever's set-points are being flown steers until silent for longer than the keep-alive; meanwhile another's are
ignored. While none are flown, the last to speak is the one. Of one sender, set-points that were overtaken on the way
are ignored.
"""

from __future__ import annotations

import math
from collections import Counter
from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as dialect

from fdm.modes import ON_TIME, Setpoint, Vector
from wire.payloads import FORCE, IGNORE_YAW, IGNORE_YAW_RATE, VELOCITY_ONLY, PositionTarget

VELOCITY_MASKS = frozenset(
    {VELOCITY_ONLY, VELOCITY_ONLY & ~IGNORE_YAW, VELOCITY_ONLY & ~IGNORE_YAW_RATE, VELOCITY_ONLY | FORCE}
)
"""type_mask of a velocity set-point: alone, with yaw, with yaw rate, alone as MAVProxy writes it."""
FASTEST = 1000.0
"""m/s: no vehicle flies faster, and what asks for more is no velocity."""
TURNED = frozenset({dialect.MAV_FRAME_BODY_NED, dialect.MAV_FRAME_BODY_OFFSET_NED})
"""Frames whose velocity is forward, right, down, and whose yaw counts from the vehicle's."""
CLOCK = 2**32
"""time_boot_ms begins again there."""

Sender = tuple[int, int]
"""(system, component)."""


class Steerer(NamedTuple):
    """Who was heard last."""

    sender: Sender
    time_s: float
    """When."""
    time_boot_ms: int
    """By the sender's own clock."""


class Verdict(NamedTuple):
    """What becomes of a message."""

    setpoint: Setpoint | None
    words: str = ""
    """For a person, once for every sender that is ignored."""


class Inlet:
    """The way in for set-points of one vehicle. frames: coordinate_frame that its autopilot understands."""

    def __init__(self, frames: frozenset[int]) -> None:
        self.refused: Counter[str] = Counter()
        """Reason → count: mask, frame, number, other sender, overtaken, mode."""
        self._frames = frames
        self._steerer: Steerer | None = None
        self._warned: set[Sender] = set()

    def admit(
        self, target: PositionTarget, sender: Sender, *, time_s: float, yaw: float, flown: bool, keep_alive_s: float
    ) -> Verdict:
        """The set-point in a message, or why there is none.

        yaw:   rad, the vehicle's
        flown: whether the vehicle flies set-points now: then they have an owner
        """
        reason = self._unfit(target)
        if reason:
            return self._refuse(reason)
        steerer = self._steerer
        if steerer is not None and time_s - steerer.time_s < keep_alive_s - ON_TIME:
            if steerer.sender == sender:
                if (target.time_boot_ms - steerer.time_boot_ms) % CLOCK >= CLOCK // 2:
                    return self._refuse("overtaken")
            elif flown:
                return self._refuse("other sender", self._warn(sender, steerer.sender))
        if steerer is None or steerer.sender != sender:
            self._warned.clear()
        self._steerer = Steerer(sender, time_s, target.time_boot_ms)
        return Verdict(_setpoint(target, time_s, yaw))

    def _unfit(self, target: PositionTarget) -> str:
        if target.type_mask not in VELOCITY_MASKS:
            return "mask"
        if target.coordinate_frame not in self._frames:
            return "frame"
        yaw = 0.0 if target.type_mask & IGNORE_YAW else target.yaw
        yaw_rate = 0.0 if target.type_mask & IGNORE_YAW_RATE else target.yaw_rate
        flies = math.hypot(target.vx, target.vy, target.vz) <= FASTEST  # no NaN is
        return "" if flies and math.isfinite(yaw) and math.isfinite(yaw_rate) else "number"

    def _refuse(self, reason: str, words: str = "") -> Verdict:
        self.refused[reason] += 1
        return Verdict(None, words)

    def _warn(self, sender: Sender, owner: Sender) -> str:
        if sender in self._warned:
            return ""
        self._warned.add(sender)
        return f"Set-points of {sender[0]}/{sender[1]} ignored: {owner[0]}/{owner[1]} steers"


def _setpoint(target: PositionTarget, time_s: float, heading: float) -> Setpoint:
    velocity = target.vx, target.vy, target.vz
    yaw = None if target.type_mask & IGNORE_YAW else target.yaw
    yaw_rate = 0.0 if target.type_mask & IGNORE_YAW_RATE else target.yaw_rate
    if target.coordinate_frame in TURNED:
        velocity = turned(velocity, heading)
        yaw = None if yaw is None else yaw + heading
    return Setpoint(time_s, velocity, yaw, yaw_rate)


def turned(velocity: Vector, yaw: float) -> Vector:
    """From forward-right-down to north-east-down, level."""
    forward, right, down = velocity
    return (
        forward * math.cos(yaw) - right * math.sin(yaw),
        forward * math.sin(yaw) + right * math.cos(yaw),
        down,
    )
