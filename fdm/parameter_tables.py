"""Which parameters each autopilot has, what they say of our vehicle, and what they may be set to.

Every line is true of the simulated vehicle: what governs its behaviour may be changed and is obeyed, what describes it
is fixed. Names, units and codes are the autopilots' own, of PX4 1.16 and ArduCopter 4.6:
https://docs.px4.io/main/en/advanced_config/parameter_reference.html
https://ardupilot.org/copter/docs/parameters.html
"""

from __future__ import annotations

from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as dialect

INT8, INT16 = dialect.MAV_PARAM_TYPE_INT8, dialect.MAV_PARAM_TYPE_INT16
INT32, REAL32 = dialect.MAV_PARAM_TYPE_INT32, dialect.MAV_PARAM_TYPE_REAL32


@dataclass(frozen=True, slots=True)
class Entry:
    """One parameter."""

    name: str
    """At most 16 characters."""
    kind: int
    """MAV_PARAM_TYPE."""
    value: float
    """What we deliver."""
    low: float
    """The least it may be set to."""
    high: float
    """And the greatest."""
    stock: float
    """What the autopilot is delivered with, where failsafes are its own."""
    choices: tuple[int, ...] = ()
    """Where it is a code: the ones that this vehicle can obey."""


def _real(name: str, value: float, low: float, high: float, *, stock: float | None = None) -> Entry:
    return Entry(name, REAL32, value, low, high, value if stock is None else stock)


def _whole(name: str, value: int, low: int, high: int, *, stock: int | None = None, kind: int = INT32) -> Entry:
    return Entry(name, kind, value, low, high, value if stock is None else stock)


def _code(name: str, value: int, choices: tuple[int, ...], *, stock: int | None = None, kind: int = INT32) -> Entry:
    stock = value if stock is None else stock
    return Entry(name, kind, value, min(choices), max(choices), stock, choices)


def _fixed(name: str, value: float, *, kind: int = INT32) -> Entry:
    return Entry(name, kind, value, value, value, value)


def px4(system: int) -> tuple[Entry, ...]:
    """PX4's, in the order in which it lists them."""
    return (
        _fixed("BAT1_CAPACITY", 5000.0, kind=REAL32),  # mAh
        _fixed("BAT1_N_CELLS", 4),
        _fixed("CAL_ACC0_ID", 1310988),  # any but 0: calibrated
        _fixed("CAL_GYRO0_ID", 1310988),
        _fixed("CAL_MAG0_ID", 197388),
        _fixed("CA_AIRFRAME", 0),  # multirotor
        _fixed("CA_ROTOR_COUNT", 4),
        _real("COM_DISARM_LAND", 2.0, -1.0, 20.0),  # s; negative: never
        _real("COM_DISARM_PRFLT", 10.0, -1.0, 3600.0),  # s; negative: never
        _whole("COM_DL_LOSS_T", 10, 5, 300),  # s
        _real("COM_FAIL_ACT_T", 5.0, 0.0, 25.0),  # s of holding before a failsafe acts
        _code("COM_OBL_RC_ACT", 4, (0, 1, 2, 3, 4, 5), stock=0),  # position, altitude, manual, return, land, hold
        _real("COM_OF_LOSS_T", 0.5, 0.0, 60.0, stock=1.0),  # s
        _fixed("COM_RC_IN_MODE", 4),  # there are no sticks
        _fixed("GF_ACTION", 0),  # there is no fence on board
        _fixed("GF_MAX_HOR_DIST", 0.0, kind=REAL32),
        _fixed("GF_MAX_VER_DIST", 0.0, kind=REAL32),
        _fixed("MAV_COMP_ID", 1),
        _fixed("MAV_PROTO_VER", 2),
        _fixed("MAV_SYS_ID", system),
        _fixed("MAV_TYPE", dialect.MAV_TYPE_QUADROTOR),
        _real("MIS_TAKEOFF_ALT", 2.5, 0.0, 80.0),  # m above home
        _real("MPC_LAND_ALT1", 3.0, 0.0, 100.0),  # m above home: below it MPC_LAND_SPEED
        _real("MPC_LAND_SPEED", 0.7, 0.6, 3.0),  # m/s
        _real("MPC_TKO_SPEED", 1.5, 1.0, 5.0),  # m/s
        _real("MPC_XY_CRUISE", 5.0, 3.0, 12.0),  # m/s
        _fixed("MPC_XY_P", 0.95, kind=REAL32),  # 1/s
        _real("MPC_XY_VEL_MAX", 12.0, 0.0, 12.0),  # m/s
        _real("MPC_Z_VEL_MAX_DN", 1.5, 0.5, 4.0),  # m/s
        _real("MPC_Z_VEL_MAX_UP", 3.0, 0.5, 8.0),  # m/s
        _real("MPC_Z_V_AUTO_DN", 1.5, 0.5, 4.0),  # m/s
        _real("MPC_Z_V_AUTO_UP", 3.0, 0.5, 8.0),  # m/s
        _code("NAV_DLL_ACT", 3, (0, 1, 2, 3), stock=0),  # nothing, hold, return, land
        _fixed("NAV_RCL_ACT", 0),  # there is no radio to lose
        _real("RTL_LAND_DELAY", 0.0, 0.0, 0.0),
        _real("RTL_RETURN_ALT", 60.0, 0.0, 150.0, stock=60.0),  # m above home
        _fixed("SYS_AUTOSTART", 4001),  # generic quadrotor
        _fixed("SYS_HITL", 0),
    )


def ardupilot(system: int) -> tuple[Entry, ...]:
    """ArduCopter's."""
    return (
        _fixed("AHRS_EKF_TYPE", 3, kind=INT8),
        _fixed("ARMING_CHECK", 1),  # all
        _fixed("BATT_CAPACITY", 5000),  # mAh
        _fixed("BATT_MONITOR", 4, kind=INT8),
        _fixed("COMPASS_ENABLE", 1, kind=INT8),
        _whole("DISARM_DELAY", 10, 0, 127, kind=INT8),  # s; 0: never
        _fixed("EK3_ENABLE", 1, kind=INT8),
        _fixed("FENCE_ACTION", 1, kind=INT8),
        _fixed("FENCE_ALT_MAX", 100.0, kind=REAL32),
        _fixed("FENCE_ENABLE", 0, kind=INT8),  # there is no fence on board
        _fixed("FENCE_RADIUS", 300.0, kind=REAL32),
        _fixed("FENCE_TYPE", 7, kind=INT8),
        _fixed("FRAME_CLASS", 1, kind=INT8),  # quadrotor
        _fixed("FRAME_TYPE", 1, kind=INT8),  # X
        _code("FS_GCS_ENABLE", 5, (0, 1, 5), stock=0, kind=INT8),  # nothing, return, land
        _real("FS_GCS_TIMEOUT", 5.0, 2.0, 120.0),  # s
        _fixed("FS_OPTIONS", 0),
        _fixed("FS_THR_ENABLE", 0, kind=INT8),  # there is no radio to lose
        _fixed("GPS1_TYPE", 1, kind=INT8),
        _fixed("GUID_OPTIONS", 0),
        _real("GUID_TIMEOUT", 0.5, 0.1, 5.0, stock=3.0),  # s
        _whole("LAND_ALT_LOW", 1000, 100, 10000, kind=INT16),  # cm above home: below it LAND_SPEED
        _whole("LAND_SPEED", 50, 30, 200, kind=INT16),  # cm/s
        _fixed("LAND_SPEED_HIGH", 0, kind=INT16),  # WPNAV_SPEED_DN
        _fixed("PILOT_SPEED_DN", 0, kind=INT16),
        _fixed("PILOT_SPEED_UP", 250, kind=INT16),
        _whole("RTL_ALT", 1500, 30, 30000),  # cm above home
        _fixed("RTL_ALT_FINAL", 0, kind=INT16),
        _fixed("SYSID_ENFORCE", 0, kind=INT8),
        _whole("SYSID_MYGCS", 255, 1, 255, kind=INT16),
        _fixed("SYSID_THISMAV", system, kind=INT16),
        _real("WPNAV_SPEED", 1000.0, 10.0, 1200.0),  # cm/s
        _real("WPNAV_SPEED_DN", 150.0, 10.0, 400.0),  # cm/s
        _real("WPNAV_SPEED_UP", 250.0, 10.0, 800.0),  # cm/s
    )
