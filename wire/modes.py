"""Flight modes as autopilots number them in HEARTBEAT.custom_mode and MAV_CMD_DO_SET_MODE.

PX4: https://docs.px4.io/main/en/flight_modes/ and px4_custom_mode.h: main mode in bits 16–23, sub mode in bits 24–31.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


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
        "offboard": Px4Mode(6),
        "takeoff": Px4Mode(4, 2),
        "hold": Px4Mode(4, 3),
        "land": Px4Mode(4, 6),
    }
)
"""The modes we fly, by our own names."""


def px4_mode_name(custom_mode: int) -> str:
    """Our name for a PX4 custom mode, or its numbers where we have none."""
    for name, mode in PX4_MODES.items():
        if mode.custom_mode == custom_mode:
            return name
    return f"mode {custom_mode >> 16 & 0xFF}.{custom_mode >> 24 & 0xFF}"
