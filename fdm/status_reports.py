"""What a vehicle says of its health and of itself: modes, sensors, battery, estimator, clock, version.

Pages: https://mavlink.io/en/messages/common.html, https://mavlink.io/en/messages/ardupilotmega.html
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from fdm.craft import EPOCH_US, Craft, Moment, Report
from fdm.modes import phase
from fdm.position_reports import RECEIVER_M, accuracy_m

SENSORS = (
    dialect.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | dialect.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | dialect.MAV_SYS_STATUS_SENSOR_3D_MAG
    | dialect.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | dialect.MAV_SYS_STATUS_SENSOR_GPS
    | dialect.MAV_SYS_STATUS_SENSOR_ANGULAR_RATE_CONTROL
    | dialect.MAV_SYS_STATUS_SENSOR_ATTITUDE_STABILIZATION
    | dialect.MAV_SYS_STATUS_SENSOR_YAW_POSITION
    | dialect.MAV_SYS_STATUS_SENSOR_BATTERY
)
"""Healthy from boot."""
ESTIMATES = dialect.MAV_SYS_STATUS_AHRS
"""Healthy once sensors have settled."""
PREARM, MOTORS = dialect.MAV_SYS_STATUS_PREARM_CHECK, dialect.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
FENCES = MappingProxyType(
    {dialect.MAV_AUTOPILOT_PX4: 0, dialect.MAV_AUTOPILOT_ARDUPILOTMEGA: dialect.MAV_SYS_STATUS_GEOFENCE},
)
"""ArduCopter's fence of FENCE_TYPE is there, but not enabled, and so never breached: MAVProxy warns of one that is."""

SETTLED = 0x033F
"""Flags of an estimator that knows attitude, velocity and position, and can foretell them. Both autopilots number
them alike."""
SETTLING = dialect.EKF_ATTITUDE | dialect.EKF_VELOCITY_VERT | dialect.EKF_POS_VERT_ABS | dialect.EKF_CONST_POS_MODE

OFFICIAL_RELEASE = 255
VERSIONS = MappingProxyType(
    {dialect.MAV_AUTOPILOT_PX4: (1, 16, 0), dialect.MAV_AUTOPILOT_ARDUPILOTMEGA: (4, 6, 3)},
)
"""The releases whose parameters and rules we took over."""
PARAMETER_ENCODINGS = MappingProxyType(
    {
        dialect.MAV_AUTOPILOT_PX4: dialect.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE,
        dialect.MAV_AUTOPILOT_ARDUPILOTMEGA: dialect.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST,
    }
)
CAPABILITIES = (
    dialect.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
    | dialect.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | dialect.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
    | dialect.MAV_PROTOCOL_CAPABILITY_MAVLINK2
)

CAPACITY_MAH = 5000
"""params/battery-capacity-mah of aircraft/quad."""
UNKNOWN_16, UNKNOWN_32 = 0xFFFF, -1


def _heartbeat(craft: Craft, moment: Moment) -> Any:
    pilot = moment.pilot
    armed = dialect.MAV_MODE_FLAG_SAFETY_ARMED if pilot.armed else 0
    return dialect.MAVLink_heartbeat_message(
        dialect.MAV_TYPE_QUADROTOR,
        craft.personality.autopilot,
        dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | armed,
        craft.personality.custom_modes[pilot.mode],
        _system_state(moment),
        3,
    )


def _system_state(moment: Moment) -> int:
    if not moment.pilot.armed:
        return int(dialect.MAV_STATE_STANDBY)
    in_failsafe = moment.pilot.loss is not None or moment.pilot.station_lost
    return int(dialect.MAV_STATE_CRITICAL if in_failsafe else dialect.MAV_STATE_ACTIVE)


def _sys_status(craft: Craft, moment: Moment) -> Any:
    battery = craft.vehicle.battery
    fence = FENCES[craft.personality.autopilot]
    needed = SENSORS | ESTIMATES | PREARM
    enabled = needed | MOTORS if moment.pilot.armed else needed
    health = SENSORS | MOTORS | fence | (ESTIMATES | PREARM if craft.is_ready(moment.now) else 0)
    return dialect.MAVLink_sys_status_message(
        needed | MOTORS | fence,
        enabled,
        health,
        0,
        round(battery.volts * 1e3),
        round(battery.amps * 1e2),
        round(battery.remaining * 100),
        0, 0, 0, 0, 0, 0,
    )  # fmt: skip


def _battery_status(craft: Craft, _moment: Moment) -> Any:
    battery = craft.vehicle.battery
    return dialect.MAVLink_battery_status_message(
        0,
        dialect.MAV_BATTERY_FUNCTION_ALL,
        dialect.MAV_BATTERY_TYPE_LIPO,
        0x7FFF,
        [round(battery.volts * 1e3)] + [UNKNOWN_16] * 9,
        round(battery.amps * 1e2),
        round((1.0 - battery.remaining) * CAPACITY_MAH),
        UNKNOWN_32,
        round(battery.remaining * 100),
    )


def _extended_sys_state(_craft: Craft, moment: Moment) -> Any:
    landed = phase(moment.pilot, moment.now)
    return dialect.MAVLink_extended_sys_state_message(dialect.MAV_VTOL_STATE_UNDEFINED, landed.value)


def _autopilot_version(craft: Craft, _moment: Moment) -> Any:
    autopilot = craft.personality.autopilot
    major, minor, patch = VERSIONS[autopilot]
    return dialect.MAVLink_autopilot_version_message(
        CAPABILITIES | PARAMETER_ENCODINGS[autopilot],
        major << 24 | minor << 16 | patch << 8 | OFFICIAL_RELEASE,
        0,
        0,
        0,
        [0] * 8,
        [0] * 8,
        [0] * 8,
        0,
        0,
        craft.system,
        list(craft.system.to_bytes(18, "little")),
    )


def _system_time(_craft: Craft, moment: Moment) -> Any:
    return dialect.MAVLink_system_time_message(EPOCH_US + moment.boot_us, moment.boot_ms)


def _ekf_status(craft: Craft, moment: Moment) -> Any:
    """ArduPilot's. What is estimated is what is measured, so nothing is left to disagree."""
    return dialect.MAVLink_ekf_status_report_message(
        SETTLED if craft.is_ready(moment.now) else SETTLING, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    )


def _estimator_status(craft: Craft, moment: Moment) -> Any:
    """PX4's, as above; it adds what it claims to err [m]."""
    return dialect.MAVLink_estimator_status_message(
        moment.boot_us,
        SETTLED if craft.is_ready(moment.now) else SETTLING,
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        accuracy_m(craft),
        RECEIVER_M,
    )  # fmt: skip


REPORTS: Mapping[int, Report] = MappingProxyType(
    {
        dialect.MAVLINK_MSG_ID_HEARTBEAT: _heartbeat,
        dialect.MAVLINK_MSG_ID_SYS_STATUS: _sys_status,
        dialect.MAVLINK_MSG_ID_SYSTEM_TIME: _system_time,
        dialect.MAVLINK_MSG_ID_BATTERY_STATUS: _battery_status,
        dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION: _autopilot_version,
        dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: _extended_sys_state,
    }
)
"""Of every autopilot."""
OWN_REPORTS: Mapping[int, Mapping[int, Report]] = MappingProxyType(
    {
        dialect.MAV_AUTOPILOT_PX4: {dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS: _estimator_status},
        dialect.MAV_AUTOPILOT_ARDUPILOTMEGA: {dialect.MAVLINK_MSG_ID_EKF_STATUS_REPORT: _ekf_status},
    }
)
"""Of one alone."""
