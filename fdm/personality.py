"""What differs on the wire from autopilot to autopilot: numbers of modes, and what is streamed unasked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from pymavlink.dialects.v20 import ardupilotmega as dialect

from fdm.modes import Mode
from wire.modes import PX4_MODES


@dataclass(frozen=True, slots=True)
class Personality:
    """An autopilot as its clients see it."""

    name: str
    autopilot: int
    """MAV_AUTOPILOT of its HEARTBEAT."""
    custom_modes: Mapping[Mode, int]
    """HEARTBEAT.custom_mode of every mode."""
    streams_hz: Mapping[int, float]
    """Message id → rate before anybody asks."""

    def mode_of(self, main: int, sub: int) -> Mode | None:
        """The mode that param2 and param3 of DO_SET_MODE name."""
        wanted = main << 16 | sub << 24
        return next((mode for mode, number in self.custom_modes.items() if number == wanted), None)


PX4 = Personality(
    name="px4",
    autopilot=dialect.MAV_AUTOPILOT_PX4,
    custom_modes=MappingProxyType({mode: PX4_MODES[mode.value].custom_mode for mode in Mode}),
    streams_hz=MappingProxyType(
        {
            dialect.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
            dialect.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
            dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 1.0,
            dialect.MAVLINK_MSG_ID_BATTERY_STATUS: 0.5,
            dialect.MAVLINK_MSG_ID_ATTITUDE: 1.0,
            dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 1.0,
            dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 1.0,
        }
    ),
)
"""PX4, with the slow telemetry of a radio link; its clients ask for more."""
