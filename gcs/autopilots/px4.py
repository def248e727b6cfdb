"""PX4: hold, arm, take off to an altitude above sea level, stream set-points, then OFFBOARD.

https://docs.px4.io/main/en/flight_modes/offboard.html
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gcs import messages
from gcs.autopilots.protocol import at_height, in_modes, may_arm, missing
from gcs.commands import Arm, ChangeMode, Command, Land, RequestStream, TakeOff
from gcs.telemetry import Flags, Swarm
from wire.modes import PX4_MODES

SLOW_S: tuple[tuple[int, float], ...] = (
    (messages.ATTITUDE, 1.0),
    (messages.SYS_STATUS, 1.0),
    (messages.EXTENDED_SYS_STATE, 1.0),
)
"""Message id and interval of what is shown and recorded now and then."""
UNREAD = (
    messages.BATTERY_STATUS,
    messages.GLOBAL_POSITION_INT,
    messages.ATTITUDE_QUATERNION,
    messages.ATTITUDE_TARGET,
    messages.VFR_HUD,
)
"""Message ids of what PX4 streams unasked and nobody reads."""
OFF_S = -1e-6
"""An interval of −1 µs turns a stream off."""

_TAKEOFF, _HOLD, _OFFBOARD, _LAND = (PX4_MODES[name] for name in ("takeoff", "hold", "offboard", "land"))


@dataclass(frozen=True, slots=True)
class Px4:
    """PX4's order of things."""

    height_m: float
    """Above each vehicle's home."""
    position_s: float
    """How often each vehicle tells its position and velocity."""

    def streams(self) -> tuple[Command, ...]:
        """PX4 streams much by itself: some of it is turned off."""
        wanted = ((messages.LOCAL_POSITION_NED, self.position_s), *SLOW_S, *((message, OFF_S) for message in UNREAD))
        return tuple(RequestStream(*stream) for stream in wanted)

    def asked_once(self, swarm: Swarm, row: int) -> tuple[Command, ...]:
        """Nothing but what is asked of all."""
        return missing(swarm, row)

    def ready(self, swarm: Swarm) -> Flags:
        """(N,) SYS_STATUS says that the checks before arming pass."""
        return swarm.ready

    def next_to_fly(self, swarm: Swarm, row: int) -> Command | None:
        """Towards hovering at height. What it did before may be a mode in which PX4 does not arm, or flies off."""
        if not swarm.armed[row] and not may_arm(swarm, row):
            return None
        if not swarm.armed[row]:
            return Arm() if swarm.custom_mode[row] == _HOLD.custom_mode else ChangeMode(_HOLD.main, _HOLD.sub)
        taking_off = swarm.custom_mode[row] == _TAKEOFF.custom_mode
        if not taking_off and not at_height(swarm, row, self.height_m):
            return TakeOff(float(swarm.home_m[row]) + self.height_m)
        return None

    def hovering(self, swarm: Swarm, row: int) -> bool:
        """At height, and take-off is over."""
        climbing = swarm.custom_mode[row] == _TAKEOFF.custom_mode
        return bool(swarm.armed[row] and not climbing and at_height(swarm, row, self.height_m))

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
