"""What an autopilot is to a flight, whichever it is."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs import messages
from gcs.commands import Command, RequestMessage
from gcs.telemetry import Flags, Swarm

AT_HEIGHT = 0.3
"""m: off the height asked for."""
ON_GROUND, TAKING_OFF = dialect.MAV_LANDED_STATE_ON_GROUND, dialect.MAV_LANDED_STATE_TAKEOFF
UNKNOWN = dialect.MAV_LANDED_STATE_UNDEFINED
SLOW_S: tuple[tuple[int, float], ...] = (
    (messages.ATTITUDE, 1.0),
    (messages.SYS_STATUS, 1.0),
    (messages.EXTENDED_SYS_STATE, 1.0),
)
"""Message id and interval of what is shown and recorded now and then."""


class Autopilot(Protocol):
    """One kind of autopilot. Rows are those of the swarm; a vehicle of another kind is not asked about."""

    def streams(self) -> tuple[Command, ...]:
        """What a vehicle shall send regularly, and how often, beside its position and velocity."""
        ...

    def asked_once(self, swarm: Swarm, row: int) -> tuple[Command, ...]:
        """Messages that tell what is not known of a vehicle and no stream brings."""
        ...

    def next_to_fly(self, swarm: Swarm, row: int) -> Command | None:
        """Towards hovering at height. Rotors that turn in a mode into which we did not bring it are somebody else's."""
        ...

    def climbing(self, swarm: Swarm) -> Flags:
        """(N,) taking off, or there, and nobody has stopped it."""
        ...

    def hovering(self, swarm: Swarm) -> Flags:
        """(N,) at height, and take-off is over."""
        ...

    def next_to_obey(self, swarm: Swarm, row: int) -> Command | None:
        """Towards flying our set-points, which must already be coming."""
        ...

    def next_to_land(self, swarm: Swarm, row: int) -> Command | None:
        """Towards standing on the ground with rotors off."""
        ...

    def next_to_hold(self, swarm: Swarm, row: int) -> Command | None:
        """Towards staying where it is, at its height, without us."""
        ...

    def ready(self, swarm: Swarm) -> Flags:
        """(N,) whose own checks before arming pass."""
        ...

    def obeying(self, swarm: Swarm) -> Flags:
        """(N,) who flies our set-points."""
        ...

    def ours(self, swarm: Swarm) -> Flags:
        """(N,) in a mode that we use ourselves: in any other, somebody else flies."""
        ...

    def landing(self, swarm: Swarm) -> Flags:
        """(N,) coming down to land."""
        ...


def in_modes(swarm: Swarm, *modes: int) -> Flags:
    """(N,) whose heartbeat shows one of these."""
    return np.asarray((swarm.custom_mode[:, None] == modes).any(axis=1))  # np.isin sorts: five times as long for six


def may_arm(swarm: Swarm, row: int) -> bool:
    """Whether a vehicle stands on the ground with its rotors off."""
    return bool(not swarm.armed[row] and swarm.landed_state[row] == ON_GROUND)


def missing(swarm: Swarm, row: int) -> tuple[Command, ...]:
    """What any autopilot is asked for once: places, and how well it knows them.

    An origin that is never told follows from GLOBAL_POSITION_INT. The accuracy is asked for anew as long as anything
    else keeps the vehicle on the ground: receivers get better.
    """
    asked = [RequestMessage(messages.GPS_RAW_INT)]
    if not np.isfinite(swarm.origin[row]).all():
        asked += [RequestMessage(messages.GPS_GLOBAL_ORIGIN), RequestMessage(messages.GLOBAL_POSITION_INT)]
    if not np.isfinite(swarm.home_m[row]):
        asked.append(RequestMessage(messages.HOME_POSITION))
    return tuple(asked)


def at_height(swarm: Swarm, height_m: float) -> Flags:
    """(N,) who is as high above its home as it was asked to be."""
    return np.asarray(np.abs(-swarm.position_ned[:, 2] - height_m) < AT_HEIGHT)
