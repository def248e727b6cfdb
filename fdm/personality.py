"""What differs from autopilot to autopilot: how it flies, the numbers of its modes, and how it understands the wire."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from pymavlink.dialects.v20 import ardupilotmega as dialect

from fdm import arducopter, px4
from fdm.modes import Machine, Mode, Result
from wire.modes import ARDUCOPTER_MODES, PX4_MODES

Name = Literal["px4", "ardupilot"]


@dataclass(frozen=True, slots=True)
class Personality:
    """An autopilot as its clients see it."""

    name: Name
    autopilot: int
    """MAV_AUTOPILOT of its HEARTBEAT."""
    machine: Machine
    """Its flight modes and failsafes."""
    custom_modes: Mapping[Mode, int]
    """HEARTBEAT.custom_mode of every mode it has."""
    streams_hz: Mapping[int, float]
    """Message id → rate before anybody asks."""
    frames: frozenset[int]
    """coordinate_frame of set-points that it understands."""
    takeoff_above_home: bool
    """NAV_TAKEOFF in a COMMAND_LONG names a height above home; else an altitude above sea level."""
    mode_has_parts: bool
    """DO_SET_MODE names a main mode and a sub mode; else a number."""
    unknown_message: Result
    """Its answer to REQUEST_MESSAGE for one that it does not have."""
    set_mode_acknowledged: int
    """The command that its answer to the message SET_MODE names."""

    def mode_of(self, main: int, sub: int) -> Mode | None:
        """The mode that param2 and param3 of DO_SET_MODE name; None where it is none of ours."""
        custom_mode = main << 16 | sub << 24 if self.mode_has_parts else main
        return next((mode for mode, number in self.custom_modes.items() if number == custom_mode), None)


PX4 = Personality(
    name="px4",
    autopilot=dialect.MAV_AUTOPILOT_PX4,
    machine=px4,
    custom_modes=MappingProxyType(
        {
            mode: PX4_MODES[mode.value].custom_mode
            for mode in (Mode.HOLD, Mode.TAKEOFF, Mode.OFFBOARD, Mode.RETURN, Mode.LAND)
        }
    ),
    streams_hz=MappingProxyType(
        {
            dialect.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
            dialect.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
            dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 1.0,
            dialect.MAVLINK_MSG_ID_BATTERY_STATUS: 0.5,
            dialect.MAVLINK_MSG_ID_HOME_POSITION: 0.5,
            dialect.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: 0.5,
            dialect.MAVLINK_MSG_ID_GPS_RAW_INT: 1.0,
            dialect.MAVLINK_MSG_ID_ATTITUDE: 1.0,
            dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 1.0,
            dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 1.0,
        }
    ),
    frames=frozenset({dialect.MAV_FRAME_LOCAL_NED, dialect.MAV_FRAME_BODY_NED}),
    takeoff_above_home=False,
    mode_has_parts=True,
    unknown_message=Result.DENIED,
    set_mode_acknowledged=dialect.MAV_CMD_DO_SET_MODE,
)
"""PX4, with the slow telemetry of a radio link; its clients ask for more."""

ARDUPILOT = Personality(
    name="ardupilot",
    autopilot=dialect.MAV_AUTOPILOT_ARDUPILOTMEGA,
    machine=arducopter,
    custom_modes=MappingProxyType(
        {
            mode: ARDUCOPTER_MODES[mode.value]
            for mode in (
                Mode.STABILIZE,
                Mode.ALTITUDE_HOLD,
                Mode.GUIDED,
                Mode.LOITER,
                Mode.RETURN,
                Mode.LAND,
                Mode.POSITION_HOLD,
                Mode.BRAKE,
            )
        }
    ),
    streams_hz=MappingProxyType({dialect.MAVLINK_MSG_ID_HEARTBEAT: 1.0}),
    frames=frozenset(
        {
            dialect.MAV_FRAME_LOCAL_NED,
            dialect.MAV_FRAME_LOCAL_OFFSET_NED,
            dialect.MAV_FRAME_BODY_NED,
            dialect.MAV_FRAME_BODY_OFFSET_NED,
        }
    ),
    takeoff_above_home=True,
    mode_has_parts=False,
    unknown_message=Result.FAILED,
    set_mode_acknowledged=dialect.MAVLINK_MSG_ID_SET_MODE,
)
"""ArduCopter: silent but for its heartbeat and its words until a client asks."""

PERSONALITIES: Mapping[Name, Personality] = MappingProxyType({"px4": PX4, "ardupilot": ARDUPILOT})
