"""ArduCopter: GUIDED, arm, take off to a height above home; set-points are flown in GUIDED from then on.

https://ardupilot.org/dev/docs/copter-commands-in-guided-mode.html
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gcs import messages
from gcs.autopilots.protocol import ON_GROUND, SLOW_S, TAKING_OFF, UNKNOWN, at_height, in_modes, may_arm, missing
from gcs.commands import Arm, ChangeMode, Command, Land, RequestMessage, RequestStream, TakeOffAboveHome
from gcs.telemetry import Flags, Swarm
from wire.modes import ARDUCOPTER_MODES

ESTIMATES = 0x33F
"""EKF_STATUS_FLAGS: attitude, both velocities, relative, absolute and predicted position. Without them no GUIDED."""

_GUIDED, _LAND, _BRAKE = (ARDUCOPTER_MODES[name] for name in ("guided", "land", "brake"))


@dataclass(frozen=True, slots=True)
class ArduCopter:
    """ArduCopter's order of things."""

    height_m: float
    """Above each vehicle's home."""

    def streams(self) -> tuple[Command, ...]:
        """Whatever we read: ArduPilot streams nothing unasked."""
        return tuple(RequestStream(*stream) for stream in SLOW_S)

    def asked_once(self, swarm: Swarm, row: int) -> tuple[Command, ...]:
        """What is asked of all, and whether its estimator is there yet."""
        return (*missing(swarm, row), RequestMessage(messages.EKF_STATUS_REPORT))

    def ready(self, swarm: Swarm) -> Flags:
        """(N,) whose checks before arming pass and whose estimator knows where it is."""
        return np.asarray(swarm.ready & ((swarm.estimator & ESTIMATES) == ESTIMATES))

    def next_to_fly(self, swarm: Swarm, row: int) -> Command | None:
        """Towards hovering at height. After a landing the mode is LAND, in which nobody can be armed."""
        guided = swarm.custom_mode[row] == _GUIDED
        if may_arm(swarm, row):
            return Arm() if guided else ChangeMode(_GUIDED, 0)
        if swarm.armed[row] and guided and swarm.landed_state[row] in (ON_GROUND, UNKNOWN):
            return TakeOffAboveHome(self.height_m)
        return None

    def climbing(self, swarm: Swarm) -> Flags:
        """(N,) off the ground in GUIDED."""
        off = (swarm.landed_state != ON_GROUND) & (swarm.landed_state != UNKNOWN)
        return np.asarray(swarm.armed & off & (swarm.custom_mode == _GUIDED))

    def hovering(self, swarm: Swarm) -> Flags:
        """(N,) at height, and take-off is over."""
        return np.asarray(self.obeying(swarm) & at_height(swarm, self.height_m))

    def next_to_obey(self, swarm: Swarm, row: int) -> Command | None:
        """Towards GUIDED, where it is since before it took off."""
        return None if swarm.custom_mode[row] == _GUIDED else ChangeMode(_GUIDED, 0)

    def next_to_land(self, swarm: Swarm, row: int) -> Command | None:
        """Towards standing on the ground with rotors off."""
        return None if self.landing(swarm)[row] or not swarm.armed[row] else Land()

    def next_to_hold(self, swarm: Swarm, row: int) -> Command | None:
        """Towards BRAKE. LOITER would obey the throttle stick, and without a radio that is down."""
        return None if swarm.custom_mode[row] == _BRAKE or not swarm.armed[row] else ChangeMode(_BRAKE, 0)

    def obeying(self, swarm: Swarm) -> Flags:
        """(N,) in GUIDED, rotors running, and no longer taking off: a set-point would end that."""
        return np.asarray(swarm.armed & (swarm.custom_mode == _GUIDED) & (swarm.landed_state != TAKING_OFF))

    def ours(self, swarm: Swarm) -> Flags:
        """(N,) in GUIDED, BRAKE or LAND."""
        return in_modes(swarm, _GUIDED, _BRAKE, _LAND)

    def landing(self, swarm: Swarm) -> Flags:
        """(N,) in LAND."""
        return np.asarray(swarm.custom_mode == _LAND)
