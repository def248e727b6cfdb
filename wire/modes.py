"""Flight modes as autopilots number them in HEARTBEAT.custom_mode and MAV_CMD_DO_SET_MODE.

PX4: https://docs.px4.io/main/en/flight_modes/ and px4_custom_mode.h: main mode in bits 16–23, sub mode in bits 24–31.
ArduCopter: https://ardupilot.org/copter/docs/flight-modes.html; custom_mode is the mode's number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

PX4, ARDUPILOT = 12, 3
"""MAV_AUTOPILOT of the two whose modes we know."""


@dataclass(frozen=True, slots=True)
class Px4Mode:
    """A PX4 mode: param2 and param3 of DO_SET_MODE."""

    main: int
    sub: int = 0

    @property
    def custom_mode(self) -> int:
        """As HEARTBEAT carries it."""
        return self.main << 16 | self.sub << 24


PX4_MODES: Mapping[str, Px4Mode] = MappingProxyType(
    {
        "manual": Px4Mode(1),
        "altitude": Px4Mode(2),
        "position": Px4Mode(3),
        "takeoff": Px4Mode(4, 2),
        "hold": Px4Mode(4, 3),
        "mission": Px4Mode(4, 4),
        "return": Px4Mode(4, 5),
        "land": Px4Mode(4, 6),
        "offboard": Px4Mode(6),
    }
)
"""By our own names."""

ARDUCOPTER_MODES: Mapping[str, int] = MappingProxyType(
    {
        "stabilize": 0,
        "altitude hold": 2,
        "auto": 3,
        "guided": 4,
        "loiter": 5,
        "return": 6,
        "land": 9,
        "position hold": 16,
        "brake": 17,
    }
)
"""By our own names: param2 of DO_SET_MODE."""

_NAMES = {
    PX4: {mode.custom_mode: name for name, mode in PX4_MODES.items()},
    ARDUPILOT: {number: name for name, number in ARDUCOPTER_MODES.items()},
}


def mode_name(autopilot: int, custom_mode: int) -> str:
    """Our name for an autopilot's mode, or its number where we have none."""
    name = _NAMES.get(autopilot, {}).get(custom_mode)
    if name is not None:
        return name
    return f"mode {custom_mode >> 16 & 0xFF}.{custom_mode >> 24 & 0xFF}" if autopilot == PX4 else f"mode {custom_mode}"
