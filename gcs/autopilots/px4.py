"""PX4: hold, arm, take off to an altitude above sea level, stream set-points, then OFFBOARD.

https://docs.px4.io/main/en/flight_modes/offboard.html
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gcs import messages
from gcs.autopilots.protocol import SLOW_S, at_height, in_modes, may_arm, missing
from gcs.commands import Arm, ChangeMode, Command, Land, RequestStream, TakeOff
from gcs.telemetry import Flags, Swarm
from wire.modes import PX4_MODES

UNREAD = (
    messages.BATTERY_STATUS,
    messages.GLOBAL_POSITION_INT,
    messages.ATTITUDE_QUATERNION,
    messages.ATTITUDE_TARGET,
    messages.VFR_HUD,
    messages.HOME_POSITION,
    messages.GPS_GLOBAL_ORIGIN,
    messages.GPS_RAW_INT,
)
"""Message ids of what PX4 streams unasked and nobody reads, or not as a stream: the last three are asked for once."""
OFF_S = -1e-6
"""An interval of −1 µs turns a stream off."""

_TAKEOFF, _HOLD, _OFFBOARD, _LAND = (PX4_MODES[name] for name in ("takeoff", "hold", "offboard", "land"))


@dataclass(frozen=True, slots=True)
class Px4:
    """PX4's order of things."""

    height_m: float
    """Above each vehicle's home."""

    def streams(self) -> tuple[Command, ...]:
        """PX4 streams much by itself: some of it is turned off."""
        return tuple(RequestStream(*stream) for stream in (*SLOW_S, *((message, OFF_S) for message in UNREAD)))

    def asked_once(self, swarm: Swarm, row: int) -> tuple[Command, ...]:
        """Nothing but what is asked of all."""
        return missing(swarm, row)

    def ready(self, swarm: Swarm) -> Flags:
        """(N,) SYS_STATUS says that the checks before arming pass."""
        return swarm.ready

    def next_to_fly(self, swarm: Swarm, row: int) -> Command | None:
        """Towards hovering at height. What it did before may be a mode in which PX4 does not arm, or flies off."""
        holds = swarm.custom_mode[row] == _HOLD.custom_mode
        if may_arm(swarm, row):
            return Arm() if holds else ChangeMode(_HOLD.main, _HOLD.sub)
        if swarm.armed[row] and holds and not self.hovering(swarm)[row]:
            return TakeOff(float(swarm.home_m[row]) + self.height_m)
        return None

    def climbing(self, swarm: Swarm) -> Flags:
        """(N,) in the mode of that name, or hovering."""
        taking_off = swarm.custom_mode == _TAKEOFF.custom_mode
        return np.asarray(swarm.armed & taking_off | self.hovering(swarm))

    def hovering(self, swarm: Swarm) -> Flags:
        """(N,) at height, and take-off is over."""
        taking_off = swarm.custom_mode == _TAKEOFF.custom_mode
        return np.asarray(swarm.armed & ~taking_off & at_height(swarm, self.height_m))

    def next_to_obey(self, swarm: Swarm, row: int) -> Command | None:
        """Towards OFFBOARD, which PX4 refuses while no set-points come."""
        return None if self.obeying(swarm)[row] else ChangeMode(_OFFBOARD.main, _OFFBOARD.sub)

    def next_to_land(self, swarm: Swarm, row: int) -> Command | None:
        """Towards standing on the ground with rotors off."""
        return None if self.landing(swarm)[row] or not swarm.armed[row] else Land()

    def next_to_hold(self, swarm: Swarm, row: int) -> Command | None:
        """Towards AUTO.LOITER, which PX4 calls hold: it keeps place and height without a radio."""
        holding = swarm.custom_mode[row] == _HOLD.custom_mode
        return None if holding or not swarm.armed[row] else ChangeMode(_HOLD.main, _HOLD.sub)

    def obeying(self, swarm: Swarm) -> Flags:
        """(N,) in OFFBOARD, rotors running."""
        return np.asarray(swarm.armed & (swarm.custom_mode == _OFFBOARD.custom_mode))

    def ours(self, swarm: Swarm) -> Flags:
        """(N,) in take-off, hold, OFFBOARD or land."""
        return in_modes(swarm, *(mode.custom_mode for mode in (_TAKEOFF, _HOLD, _OFFBOARD, _LAND)))

    def landing(self, swarm: Swarm) -> Flags:
        """(N,) in land."""
        return np.asarray(swarm.custom_mode == _LAND.custom_mode)
