"""What a simulated vehicle says: MAVLink frames of its autopilot (component 1) and of the truth (component 200)."""

from __future__ import annotations

import math
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as dialect

from fdm.modes import READY_AFTER, Mode, Pilot, Severity, Situation
from fdm.personality import Personality
from fdm.vehicle import Geodetic, Vehicle
from wire.frames import Sender
from wire.ids import AUTOPILOT, TRUTH
from wire.payloads import (
    LOCAL_POSITION_NED,
    SIM_STATE,
    LocalPosition,
    SimState,
    pack_local_position,
    pack_sim_state,
)

SENSORS = (
    dialect.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | dialect.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | dialect.MAV_SYS_STATUS_SENSOR_3D_MAG
    | dialect.MAV_SYS_STATUS_SENSOR_GPS
)
LANDED_STATES = {
    Mode.TAKEOFF: dialect.MAV_LANDED_STATE_TAKEOFF,
    Mode.LAND: dialect.MAV_LANDED_STATE_LANDING,
}
UNKNOWN_16, UNKNOWN_32 = 0xFFFF, -1


class Reporter:
    """Packs every message that the vehicle knows."""

    def __init__(self, vehicle: Vehicle, *, system: int, origin: Geodetic, personality: Personality) -> None:
        self._vehicle = vehicle
        self._system = system
        self._origin = origin
        self._personality = personality
        self._autopilot = Sender(system, AUTOPILOT)
        self._truth = Sender(system, TRUTH)
        self._messages: dict[int, Callable[[Pilot, Situation, tuple[float, ...]], bytes]] = {
            dialect.MAVLINK_MSG_ID_HEARTBEAT: self._heartbeat,
            dialect.MAVLINK_MSG_ID_SYS_STATUS: self._sys_status,
            dialect.MAVLINK_MSG_ID_ATTITUDE: self._attitude,
            dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self._local_position,
            dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._global_position,
            dialect.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: self._gps_global_origin,
            dialect.MAVLINK_MSG_ID_BATTERY_STATUS: self._battery_status,
            dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION: self._autopilot_version,
            dialect.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: self._extended_sys_state,
        }

    def knows(self, message: int) -> bool:
        """Whether `report` can pack this message id."""
        return message in self._messages

    def report(self, message: int, pilot: Pilot, now: Situation, measured: tuple[float, ...]) -> bytes:
        """A frame with the vehicle's state; measured: (n, e, d, vn, ve, vd), SI, from the vehicle's own origin."""
        return self._messages[message](pilot, now, measured)

    def truth(self) -> bytes:
        """SIM_STATE: the state without noise."""
        state = self._vehicle.state()
        payload = SimState(
            *state.attitude_wxyz,
            *state.attitude_rpy,
            *state.acceleration_body,
            *state.rate_body,
            state.latitude_deg,
            state.longitude_deg,
            state.altitude_m,
            0.0,
            0.0,
            *state.velocity_ned,
            round(state.latitude_deg * 1e7),
            round(state.longitude_deg * 1e7),
        )
        return self._truth.frame(SIM_STATE, pack_sim_state(payload))

    def acknowledge(self, command: int, result: int, *, to_system: int, to_component: int) -> bytes:
        """COMMAND_ACK to whoever asked."""
        return self._autopilot.pack(
            dialect.MAVLink_command_ack_message(command, result, target_system=to_system, target_component=to_component)
        )

    def word(self, severity: Severity, text: str) -> bytes:
        """STATUSTEXT for a person."""
        return self._autopilot.pack(dialect.MAVLink_statustext_message(severity.value, text.encode()[:50]))

    def message_interval(self, message: int, interval_s: float) -> bytes:
        """MESSAGE_INTERVAL: what a stream's rate is; 0 s is off."""
        interval_us = min(round(interval_s * 1e6), 2**31 - 1) if interval_s else -1
        return self._autopilot.pack(dialect.MAVLink_message_interval_message(message, interval_us))

    def _heartbeat(self, pilot: Pilot, _now: Situation, _measured: tuple[float, ...]) -> bytes:
        armed = dialect.MAV_MODE_FLAG_SAFETY_ARMED if pilot.armed else 0
        return self._autopilot.pack(
            dialect.MAVLink_heartbeat_message(
                dialect.MAV_TYPE_QUADROTOR,
                self._personality.autopilot,
                dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | armed,
                self._personality.custom_modes[pilot.mode],
                dialect.MAV_STATE_ACTIVE if pilot.armed else dialect.MAV_STATE_STANDBY,
                3,
            )
        )

    def _sys_status(self, _pilot: Pilot, now: Situation, _measured: tuple[float, ...]) -> bytes:
        battery = self._vehicle.battery
        prearm = dialect.MAV_SYS_STATUS_PREARM_CHECK
        health = SENSORS | (prearm if now.time_s >= READY_AFTER else 0)
        return self._autopilot.pack(
            dialect.MAVLink_sys_status_message(
                SENSORS | prearm,
                SENSORS | prearm,
                health,
                0,
                round(battery.volts * 1e3),
                round(battery.amps * 1e2),
                round(battery.remaining * 100),
                0, 0, 0, 0, 0, 0,
            )
        )  # fmt: skip

    def _attitude(self, _pilot: Pilot, now: Situation, _measured: tuple[float, ...]) -> bytes:
        state = self._vehicle.state()
        return self._autopilot.pack(
            dialect.MAVLink_attitude_message(_boot_ms(now), *state.attitude_rpy, *state.rate_body)
        )

    def _local_position(self, _pilot: Pilot, now: Situation, measured: tuple[float, ...]) -> bytes:
        payload = pack_local_position(LocalPosition(_boot_ms(now), *measured))
        return self._autopilot.frame(LOCAL_POSITION_NED, payload)

    def _global_position(self, _pilot: Pilot, now: Situation, measured: tuple[float, ...]) -> bytes:
        state, truth = self._vehicle.state(), self._vehicle.position_velocity()
        latitude, longitude = _nearby(state.latitude_deg, state.longitude_deg, measured, truth)
        heading_cdeg = round(math.degrees(now.yaw) % 360.0 * 100) % 36000
        return self._autopilot.pack(
            dialect.MAVLink_global_position_int_message(
                _boot_ms(now),
                round(latitude * 1e7),
                round(longitude * 1e7),
                round((self._origin.altitude_m - measured[2]) * 1e3),
                round(-measured[2] * 1e3),
                *(max(-32767, min(32767, round(v * 100))) for v in measured[3:6]),
                heading_cdeg,
            )
        )

    def _gps_global_origin(self, _pilot: Pilot, now: Situation, _measured: tuple[float, ...]) -> bytes:
        origin = self._origin
        return self._autopilot.pack(
            dialect.MAVLink_gps_global_origin_message(
                round(origin.latitude_deg * 1e7),
                round(origin.longitude_deg * 1e7),
                round(origin.altitude_m * 1e3),
                round(now.time_s * 1e6),
            )
        )

    def _battery_status(self, _pilot: Pilot, _now: Situation, _measured: tuple[float, ...]) -> bytes:
        battery = self._vehicle.battery
        return self._autopilot.pack(
            dialect.MAVLink_battery_status_message(
                0,
                dialect.MAV_BATTERY_FUNCTION_ALL,
                dialect.MAV_BATTERY_TYPE_LIPO,
                0x7FFF,
                [round(battery.volts * 1e3)] + [UNKNOWN_16] * 9,
                round(battery.amps * 1e2),
                UNKNOWN_32,
                UNKNOWN_32,
                round(battery.remaining * 100),
            )
        )

    def _autopilot_version(self, _pilot: Pilot, _now: Situation, _measured: tuple[float, ...]) -> bytes:
        capabilities = (
            dialect.MAV_PROTOCOL_CAPABILITY_MAVLINK2 | dialect.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
        )
        return self._autopilot.pack(
            dialect.MAVLink_autopilot_version_message(
                capabilities, 0, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, self._system
            )
        )

    def _extended_sys_state(self, pilot: Pilot, now: Situation, _measured: tuple[float, ...]) -> bytes:
        landed = dialect.MAV_LANDED_STATE_IN_AIR
        if now.on_ground:
            landed = dialect.MAV_LANDED_STATE_ON_GROUND
        elif pilot.armed:
            landed = LANDED_STATES.get(pilot.mode, landed)
        return self._autopilot.pack(
            dialect.MAVLink_extended_sys_state_message(dialect.MAV_VTOL_STATE_UNDEFINED, landed)
        )


def _boot_ms(now: Situation) -> int:
    return round(now.time_s * 1e3)


EQUATOR_M, ECCENTRICITY_SQUARED = 6378137.0, 6.69437999014e-3
"""WGS-84."""


def _nearby(
    latitude: float, longitude: float, measured: tuple[float, ...], truth: tuple[float, ...]
) -> tuple[float, float]:
    """The true place [degrees] moved by the error of the measured one [m], by the radii of curvature there."""
    north, east = measured[0] - truth[0], measured[1] - truth[1]
    bulge = 1.0 - ECCENTRICITY_SQUARED * math.sin(math.radians(latitude)) ** 2
    along_parallel = EQUATOR_M / math.sqrt(bulge)
    along_meridian = along_parallel * (1.0 - ECCENTRICITY_SQUARED) / bulge
    return (
        latitude + math.degrees(north / along_meridian),
        longitude + math.degrees(east / (along_parallel * math.cos(math.radians(latitude)))),
    )
