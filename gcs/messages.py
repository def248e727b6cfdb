"""Our commands as MAVLink, and the numbers of the messages that `telemetry` and `truth` read."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs.commands import (
    Arm,
    Beat,
    ChangeMode,
    Command,
    Kill,
    Land,
    RequestMessage,
    RequestParameter,
    RequestStream,
    SetVelocity,
    TakeOff,
    TakeOffAboveHome,
)
from wire.frames import Sender
from wire.ids import AUTOPILOT
from wire.payloads import SET_POSITION_TARGET_LOCAL_NED, PositionTarget, pack_position_target

GROUND_SYSTEM, GROUND_COMPONENT = 255, 190
"""Who we are on the wire."""

HEARTBEAT = dialect.MAVLINK_MSG_ID_HEARTBEAT
SYS_STATUS = dialect.MAVLINK_MSG_ID_SYS_STATUS
ATTITUDE = dialect.MAVLINK_MSG_ID_ATTITUDE
LOCAL_POSITION_NED = dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED
GLOBAL_POSITION_INT = dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
GPS_GLOBAL_ORIGIN = dialect.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN
BATTERY_STATUS = dialect.MAVLINK_MSG_ID_BATTERY_STATUS
EXTENDED_SYS_STATE = dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE
STATUSTEXT = dialect.MAVLINK_MSG_ID_STATUSTEXT
SIM_STATE = dialect.MAVLINK_MSG_ID_SIM_STATE
COMMAND_ACK = dialect.MAVLINK_MSG_ID_COMMAND_ACK
EKF_STATUS_REPORT = dialect.MAVLINK_MSG_ID_EKF_STATUS_REPORT
GPS_RAW_INT = dialect.MAVLINK_MSG_ID_GPS_RAW_INT
HOME_POSITION = dialect.MAVLINK_MSG_ID_HOME_POSITION
PARAM_VALUE = dialect.MAVLINK_MSG_ID_PARAM_VALUE
ATTITUDE_QUATERNION = dialect.MAVLINK_MSG_ID_ATTITUDE_QUATERNION
ATTITUDE_TARGET = dialect.MAVLINK_MSG_ID_ATTITUDE_TARGET
VFR_HUD = dialect.MAVLINK_MSG_ID_VFR_HUD

GPS_FIX_3D = dialect.GPS_FIX_TYPE_3D_FIX
ARMED = dialect.MAV_MODE_FLAG_SAFETY_ARMED
PREARM_CHECK = dialect.MAV_SYS_STATUS_PREARM_CHECK

FORCE = 21196
"""param2 of MAV_CMD_COMPONENT_ARM_DISARM: whatever the autopilot thinks of it."""
BY_NAME = -1
"""param_index of PARAM_REQUEST_READ: the name says which."""
VELOCITY_WITH_YAW = 0x09C7
"""type_mask: velocity and yaw count, all else is to be ignored."""


class Encoder:
    """Commands to one vehicle: a link of its own, with its own sequence numbers."""

    def __init__(self, system: int) -> None:
        self._system = system
        self._sender = Sender(GROUND_SYSTEM, GROUND_COMPONENT)

    def encode(self, command: Command, time_ms: int) -> bytes:
        """One frame; time_ms: ms since the ground station's loop began."""
        match command:
            case SetVelocity(north, east, down, yaw):
                target = PositionTarget(
                    time_ms, 0.0, 0.0, 0.0, north, east, down, 0.0, 0.0, 0.0, yaw, 0.0,
                    VELOCITY_WITH_YAW, self._system, AUTOPILOT, dialect.MAV_FRAME_LOCAL_NED,
                )  # fmt: skip
                return self._sender.frame(SET_POSITION_TARGET_LOCAL_NED, pack_position_target(target))
            case Beat():
                return self._sender.pack(
                    dialect.MAVLink_heartbeat_message(
                        dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID, 0, 0, dialect.MAV_STATE_ACTIVE, 3
                    )
                )
            case RequestStream(message, interval_s):
                return self._long(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, message, interval_s * 1e6)
            case RequestMessage(message):
                return self._long(dialect.MAV_CMD_REQUEST_MESSAGE, message)
            case RequestParameter(name):
                return self._sender.pack(
                    dialect.MAVLink_param_request_read_message(self._system, AUTOPILOT, name.encode(), BY_NAME)
                )
            case Arm():
                return self._long(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)
            case Kill():
                return self._long(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0, FORCE)
            case TakeOff(altitude_m):
                nan = math.nan
                return self._long(dialect.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, nan, nan, nan, altitude_m)
            case TakeOffAboveHome(height_m):
                return self._long(dialect.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, height_m)
            case ChangeMode(main, sub):
                return self._long(dialect.MAV_CMD_DO_SET_MODE, dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, main, sub)
            case Land():
                return self._long(dialect.MAV_CMD_NAV_LAND)

    def _long(self, command: int, *params: float) -> bytes:
        padded = [*map(float, params), *[0.0] * (7 - len(params))]
        message: Any = dialect.MAVLink_command_long_message(self._system, AUTOPILOT, command, 0, *padded)
        return self._sender.pack(message)
