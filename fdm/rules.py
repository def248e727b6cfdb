"""How a vehicle behaves, read from its autopilot's parameters, in SI and without their codes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from fdm.parameters import Parameters


class Action(Enum):
    """What a failsafe does."""

    NOTHING = "nothing"
    HOLD = "hold"
    RETURN = "return"
    LAND = "land"


@dataclass(frozen=True, slots=True)
class Rules:
    """When a vehicle does something by itself, and how fast it moves."""

    setpoint_silence_s: float
    """Without a set-point for so long, it stops."""
    after_setpoints: Action
    """What follows the stop; NOTHING leaves it in its mode at zero velocity."""
    action_delay_s: float
    """For so long it holds before any action."""
    station_silence_s: float
    """Without a heartbeat of a ground station for so long; never, where infinite."""
    after_station: Action
    landed_disarm_s: float
    """On the ground after a flight, whatever the mode; never, where infinite."""
    idle_disarm_s: float
    """Armed and not yet taken off; never, where infinite."""
    takeoff_height_m: float | None
    """Where the command names none; None: it must."""
    takeoff_m_s: float
    level_m_s: float
    """The most that a set-point may ask for on the level."""
    climb_m_s: float
    descent_m_s: float
    landing_fast_m_s: float
    """Coming down, high up."""
    landing_slow_m_s: float
    """Near the ground."""
    slow_below_m: float
    """Where near the ground begins, above home."""
    return_height_m: float
    return_m_s: float


def rules(parameters: Parameters) -> Rules:
    """What these parameters, of either autopilot, come to."""
    return _px4(parameters) if "COM_OF_LOSS_T" in parameters else _ardupilot(parameters)


def _px4(told: Parameters) -> Rules:
    get = told.get
    station = _PX4_STATION[int(get("NAV_DLL_ACT"))]
    return Rules(
        setpoint_silence_s=get("COM_OF_LOSS_T"),
        after_setpoints=_PX4_SETPOINTS[int(get("COM_OBL_RC_ACT"))],
        action_delay_s=get("COM_FAIL_ACT_T"),
        station_silence_s=get("COM_DL_LOSS_T") if station is not Action.NOTHING else math.inf,
        after_station=station,
        landed_disarm_s=_or_never(get("COM_DISARM_LAND")),
        idle_disarm_s=_or_never(get("COM_DISARM_PRFLT")),
        takeoff_height_m=get("MIS_TAKEOFF_ALT"),
        takeoff_m_s=get("MPC_TKO_SPEED"),
        level_m_s=get("MPC_XY_VEL_MAX"),
        climb_m_s=get("MPC_Z_VEL_MAX_UP"),
        descent_m_s=get("MPC_Z_VEL_MAX_DN"),
        landing_fast_m_s=get("MPC_Z_V_AUTO_DN"),
        landing_slow_m_s=get("MPC_LAND_SPEED"),
        slow_below_m=get("MPC_LAND_ALT1"),
        return_height_m=get("RTL_RETURN_ALT"),
        return_m_s=get("MPC_XY_CRUISE"),
    )


def _ardupilot(told: Parameters) -> Rules:
    get = told.get
    station = _ARDUPILOT_STATION[int(get("FS_GCS_ENABLE"))]
    disarm_s = get("DISARM_DELAY") or math.inf
    return Rules(
        setpoint_silence_s=get("GUID_TIMEOUT"),
        after_setpoints=Action.NOTHING,
        action_delay_s=0.0,
        station_silence_s=get("FS_GCS_TIMEOUT") if station is not Action.NOTHING else math.inf,
        after_station=station,
        landed_disarm_s=disarm_s,
        idle_disarm_s=disarm_s,
        takeoff_height_m=None,
        takeoff_m_s=get("WPNAV_SPEED_UP") / 100.0,
        level_m_s=get("WPNAV_SPEED") / 100.0,
        climb_m_s=get("WPNAV_SPEED_UP") / 100.0,
        descent_m_s=get("WPNAV_SPEED_DN") / 100.0,
        landing_fast_m_s=get("WPNAV_SPEED_DN") / 100.0,
        landing_slow_m_s=get("LAND_SPEED") / 100.0,
        slow_below_m=get("LAND_ALT_LOW") / 100.0,
        return_height_m=get("RTL_ALT") / 100.0,
        return_m_s=get("WPNAV_SPEED") / 100.0,
    )


_PX4_SETPOINTS = {
    **dict.fromkeys((0, 1, 2), Action.RETURN),  # a pilot's modes, which cannot run without sticks: PX4 returns instead
    3: Action.RETURN,
    4: Action.LAND,
    5: Action.HOLD,
}
"""COM_OBL_RC_ACT. https://docs.px4.io/main/en/flight_modes/offboard.html, and for want of sticks PX4's failsafe.cpp."""
_PX4_STATION = {0: Action.NOTHING, 1: Action.HOLD, 2: Action.RETURN, 3: Action.LAND}
"""NAV_DLL_ACT."""
_ARDUPILOT_STATION = {0: Action.NOTHING, 1: Action.RETURN, 5: Action.LAND}
"""FS_GCS_ENABLE. https://ardupilot.org/copter/docs/gcs-failsafe.html"""


def _or_never(seconds: float) -> float:
    """PX4 writes never as a negative time."""
    return math.inf if seconds < 0.0 else seconds
