"""How an autopilot is brought into the air, under our control, and down again.

One step at a time: each function looks at what telemetry says of one vehicle and names the one thing to ask of it
next, or nothing when it is there. Whoever calls asks again until it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gcs import messages
from gcs.commands import Arm, ChangeMode, Command, Land, RequestMessage, RequestStream, TakeOff
from gcs.telemetry import Flags, Swarm
from wire.modes import PX4_MODES

SLOW_S: tuple[tuple[int, float], ...] = (
    (messages.ATTITUDE, 1.0),
    (messages.SYS_STATUS, 1.0),
    (messages.EXTENDED_SYS_STATE, -1e-6),
    (messages.BATTERY_STATUS, -1e-6),
    (messages.GLOBAL_POSITION_INT, -1e-6),
)
"""Message id and interval of what is shown and recorded now and then; −1 µs turns off what nobody reads."""

AT_HEIGHT = 0.3
"""m: off the height asked for."""


@dataclass(frozen=True, slots=True)
class Px4:
    """PX4: arm, take off to an altitude above sea level, stream set-points, then OFFBOARD.

    https://docs.px4.io/main/en/flight_modes/offboard.html
    """

    height_m: float
    """Above each vehicle's home."""
    position_s: float
    """How often each vehicle tells its position and velocity."""

    def subscribe(self) -> tuple[Command, ...]:
        """What to ask of a vehicle when it is first heard."""
        streams = ((messages.LOCAL_POSITION_NED, self.position_s), *SLOW_S)
        return (*(RequestStream(*stream) for stream in streams), RequestMessage(messages.GPS_GLOBAL_ORIGIN))

    def known(self, swarm: Swarm, row: int) -> bool:
        """All that must be known before arming has been told."""
        told = np.isfinite(swarm.position_ned[row]).all() and np.isfinite(swarm.origin[row]).all()
        return bool(told and swarm.ready[row])

    def next_to_fly(self, swarm: Swarm, row: int) -> Command | None:
        """Towards hovering at height."""
        if not swarm.armed[row]:
            return Arm()
        if not self._at_height(swarm, row) and swarm.custom_mode[row] != PX4_MODES["takeoff"].custom_mode:
            return TakeOff(float(swarm.origin[row, 2]) + self.height_m)
        return None

    def hovering(self, swarm: Swarm, row: int) -> bool:
        """At height, and take-off is over."""
        climbing = swarm.custom_mode[row] == PX4_MODES["takeoff"].custom_mode
        return bool(swarm.armed[row] and not climbing and self._at_height(swarm, row))

    def next_to_obey(self, swarm: Swarm, row: int) -> Command | None:
        """Towards flying our set-points, which must already be coming."""
        offboard = PX4_MODES["offboard"]
        return None if self.obeying(swarm)[row] else ChangeMode(offboard.main, offboard.sub)

    def obeying(self, swarm: Swarm) -> Flags:
        """(N,) who flies our set-points."""
        return np.asarray(swarm.custom_mode == PX4_MODES["offboard"].custom_mode)

    def next_to_land(self, swarm: Swarm, row: int) -> Command | None:
        """Towards standing on the ground with rotors off."""
        landing = swarm.custom_mode[row] == PX4_MODES["land"].custom_mode
        return None if landing or not swarm.armed[row] else Land()

    def _at_height(self, swarm: Swarm, row: int) -> bool:
        return bool(abs(-swarm.position_ned[row, 2] - self.height_m) < AT_HEIGHT)
