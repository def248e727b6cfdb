"""Where a vehicle says that it is, how it moves and how well it knows: the messages of position, attitude and origin.

Pages: https://mavlink.io/en/messages/common.html
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import pymap3d
from pymavlink.dialects.v20 import ardupilotmega as dialect

from fdm.craft import EPOCH_US, Craft, Moment, Report
from wire.payloads import (
    IGNORE_YAW,
    IGNORE_YAW_RATE,
    POSITION_ONLY,
    VELOCITY_ONLY,
    LocalPosition,
    pack_local_position,
)

SATELLITES, DILUTION = 14, 0.7
"""Under an open sky."""
RECEIVER_M, RECEIVER_M_S = 0.01, 0.01
"""The least that a receiver claims to err, a corrected one."""
FIXED_BELOW_M, FLOAT_BELOW_M = 0.05, 0.5
"""Errors of a receiver with carrier-phase corrections, by the kind of its fix."""
FULL_ROTOR_SPEED = 1000.0
"""rad/s, params/max-rotor-speed of aircraft/quad."""
UNKNOWN_16 = 0xFFFF

MEASUREMENTS = frozenset(
    {
        dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
        dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        dialect.MAVLINK_MSG_ID_GPS_RAW_INT,
        dialect.MAVLINK_MSG_ID_VFR_HUD,
    }
)
"""Messages that report one measurement where they are due together."""


def accuracy_m(craft: Craft) -> float:
    """Root mean square of the horizontal error: both axes have the scenario's noise."""
    return max(RECEIVER_M, math.sqrt(2.0) * craft.noise.position_m)


def pack_local(craft: Craft, time_s: float, measured: tuple[float, ...]) -> bytes:
    """Payload of LOCAL_POSITION_NED, from the estimator's origin: by hand, because it flies many times a second."""
    north, east, down, vn, ve, vd = measured
    origin_n, origin_e = craft.origin_ne
    boot_ms = round(time_s * 1e3)
    return pack_local_position(LocalPosition(boot_ms, north - origin_n, east - origin_e, down, vn, ve, vd))


def _global_position(craft: Craft, moment: Moment) -> Any:
    latitude, longitude = _measured_place(craft, moment)
    _, _, down, *velocity = moment.measured
    return dialect.MAVLink_global_position_int_message(
        moment.boot_ms,
        latitude,
        longitude,
        round((craft.home.altitude_m - down) * 1e3),
        round(-down * 1e3),
        *(max(-32767, min(32767, round(v * 100))) for v in velocity),
        _compass_cdeg(moment.now.yaw),
    )


def _gps_raw(craft: Craft, moment: Moment) -> Any:
    latitude, longitude = _measured_place(craft, moment)
    _, _, down, vn, ve, _ = moment.measured
    speed = math.hypot(vn, ve)
    altitude_mm = round((craft.home.altitude_m - down) * 1e3)
    horizontal_m = accuracy_m(craft)
    return dialect.MAVLink_gps_raw_int_message(
        EPOCH_US + moment.boot_us,
        _fix(horizontal_m),
        latitude,
        longitude,
        altitude_mm,
        round(DILUTION * 100),
        round(DILUTION * 100),
        min(UNKNOWN_16 - 1, round(speed * 100)),
        _compass_cdeg(math.atan2(ve, vn)) if speed > RECEIVER_M_S else UNKNOWN_16,
        SATELLITES,
        alt_ellipsoid=altitude_mm,
        h_acc=round(horizontal_m * 1e3),
        v_acc=round(RECEIVER_M * 1e3),
        vel_acc=round(max(RECEIVER_M_S, math.sqrt(2.0) * craft.noise.velocity_m_s) * 1e3),
    )


def _fix(accuracy: float) -> int:
    if accuracy < FIXED_BELOW_M:
        return int(dialect.GPS_FIX_TYPE_RTK_FIXED)
    return int(dialect.GPS_FIX_TYPE_RTK_FLOAT if accuracy < FLOAT_BELOW_M else dialect.GPS_FIX_TYPE_3D_FIX)


def _vfr_hud(craft: Craft, moment: Moment) -> Any:
    """There is no airspeed sensor: ArduPilot puts the speed over the ground in its place, PX4 nothing."""
    _, _, down, vn, ve, vd = moment.measured
    over_ground = math.hypot(vn, ve)
    has_guess = craft.personality.autopilot == dialect.MAV_AUTOPILOT_ARDUPILOTMEGA
    speeds = craft.vehicle.rotor_speeds
    thrust = sum((speed / FULL_ROTOR_SPEED) ** 2 for speed in speeds) / len(speeds)
    return dialect.MAVLink_vfr_hud_message(
        over_ground if has_guess else 0.0,
        over_ground,
        round(math.degrees(moment.now.yaw)) % 360,
        round(100 * thrust),
        craft.home.altitude_m - down,
        -vd,
    )


def _gps_global_origin(craft: Craft, moment: Moment) -> Any:
    latitude, longitude = _place_from_pad(craft, *craft.origin_ne)
    altitude_mm = round(craft.home.altitude_m * 1e3)
    return dialect.MAVLink_gps_global_origin_message(latitude, longitude, altitude_mm, moment.boot_us)


def _home_position(craft: Craft, moment: Moment) -> Any:
    """Where it was armed, and where that is from the estimator's origin; which way it lies is nobody's concern."""
    north, east, down = moment.pilot.home_ned
    origin_n, origin_e = craft.origin_ne
    latitude, longitude = _place_from_pad(craft, north, east)
    return dialect.MAVLink_home_position_message(
        latitude,
        longitude,
        round((craft.home.altitude_m - down) * 1e3),
        north - origin_n,
        east - origin_e,
        down,
        [1.0, 0.0, 0.0, 0.0],
        *(math.nan,) * 3,
        time_usec=moment.boot_us,
    )


def _attitude(craft: Craft, moment: Moment) -> Any:
    state = craft.vehicle.state()
    return dialect.MAVLink_attitude_message(moment.boot_ms, *state.attitude_rpy, *state.rate_body)


def _attitude_quaternion(craft: Craft, moment: Moment) -> Any:
    state = craft.vehicle.state()
    return dialect.MAVLink_attitude_quaternion_message(moment.boot_ms, *state.attitude_wxyz, *state.rate_body)


def _position_target(craft: Craft, moment: Moment) -> Any:
    """What is flown: the set-point from outside, or else the place where the mode stays or goes."""
    pilot = moment.pilot
    position, velocity, yaw, yaw_rate = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), pilot.yaw, 0.0
    mask = VELOCITY_ONLY & ~IGNORE_YAW
    if craft.personality.machine.steered(pilot) and pilot.setpoint is not None:
        setpoint = pilot.setpoint
        velocity, yaw_rate = setpoint.velocity_ned, setpoint.yaw_rate
        if setpoint.yaw is None:
            yaw, mask = 0.0, mask | IGNORE_YAW
        else:
            yaw = setpoint.yaw
        if yaw_rate:
            mask &= ~IGNORE_YAW_RATE
    elif pilot.anchor_ned is not None:
        north, east, down = pilot.anchor_ned
        position = (north - craft.origin_ne[0], east - craft.origin_ne[1], down)
        mask = POSITION_ONLY & ~IGNORE_YAW
    return dialect.MAVLink_position_target_local_ned_message(
        moment.boot_ms, dialect.MAV_FRAME_LOCAL_NED, mask, *position, *velocity, 0.0, 0.0, 0.0, yaw, yaw_rate
    )


REPORTS: Mapping[int, Report] = MappingProxyType(
    {
        dialect.MAVLINK_MSG_ID_GPS_RAW_INT: _gps_raw,
        dialect.MAVLINK_MSG_ID_ATTITUDE: _attitude,
        dialect.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: _attitude_quaternion,
        dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: _global_position,
        dialect.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: _gps_global_origin,
        dialect.MAVLINK_MSG_ID_VFR_HUD: _vfr_hud,
        dialect.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: _position_target,
        dialect.MAVLINK_MSG_ID_HOME_POSITION: _home_position,
    }
)
"""All but LOCAL_POSITION_NED, which `pack_local` packs."""

EQUATOR_M, ECCENTRICITY_SQUARED = 6378137.0, 6.69437999014e-3
"""WGS-84."""


def _place_from_pad(craft: Craft, north: float, east: float) -> tuple[int, int]:
    """A place so many metres away in the tangent plane there: 1e-7 degrees."""
    home = craft.home
    latitude, longitude, _ = pymap3d.ned2geodetic(
        north, east, 0.0, home.latitude_deg, home.longitude_deg, home.altitude_m
    )
    return round(float(latitude) * 1e7), round(float(longitude) * 1e7)


def _displaced(latitude: float, longitude: float, north: float, east: float) -> tuple[float, float]:
    """A place [degrees] so many metres away from another, by the radii of curvature there; a few metres only."""
    bulge = 1.0 - ECCENTRICITY_SQUARED * math.sin(math.radians(latitude)) ** 2
    along_parallel = EQUATOR_M / math.sqrt(bulge)
    along_meridian = along_parallel * (1.0 - ECCENTRICITY_SQUARED) / bulge
    return (
        latitude + math.degrees(north / along_meridian),
        longitude + math.degrees(east / (along_parallel * math.cos(math.radians(latitude)))),
    )


def _measured_place(craft: Craft, moment: Moment) -> tuple[int, int]:
    """The true place, moved by the error of the measured one: 1e-7 degrees."""
    state, truth = craft.vehicle.state(), craft.vehicle.position_velocity()
    north, east = moment.measured[0] - truth[0], moment.measured[1] - truth[1]
    latitude, longitude = _displaced(state.latitude_deg, state.longitude_deg, north, east)
    return round(latitude * 1e7), round(longitude * 1e7)


def _compass_cdeg(angle: float) -> int:
    """From radians."""
    return round(math.degrees(angle) % 360.0 * 100) % 36000
