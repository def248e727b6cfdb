"""Flight modes and failsafes of a simulated vehicle: a pure state machine and the velocity each mode asks for.

                 arm              take-off                 height reached
    disarmed ───────────► HOLD ─────────────► TAKEOFF ───────────────────────► HOLD
        ▲                  │  ▲                                                 │
        │                  │  └───────────── set-points silent 0.5 s ───────┐   │ mode OFFBOARD,
        │                  │ land, or 5 s after set-points fell silent      │   │ set-points coming
        │ 0.5 s on         ▼                                                │   ▼
        └ the ground ──── LAND ◄───────────────────── land ────────────── OFFBOARD

Everything is SI and the vehicle's own NED frame. The numbers are PX4's defaults where PX4 has one.
https://docs.px4.io/main/en/advanced_config/parameter_reference.html
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

Vector = tuple[float, float, float]

TAKEOFF_SPEED = 1.5  # m/s, MPC_TKO_SPEED
DESCENT_SPEED = 1.5  # m/s, MPC_Z_V_AUTO_DN: landing, above SLOW_BELOW
LANDING_SPEED = 0.7  # m/s, MPC_LAND_SPEED: landing, near the ground
SLOW_BELOW = 3.0  # m above the take-off place
HOLD_GAIN = 0.95  # 1/s, MPC_XY_P
HOLD_SPEED = 3.0  # m/s, the most that holding a position may ask for
OFFBOARD_SPEED = 12.0  # m/s, MPC_XY_VEL_MAX: the most that a set-point may ask for
OFFBOARD_CLIMB, OFFBOARD_DESCENT = 3.0, 1.5  # m/s, MPC_Z_VEL_MAX_UP, MPC_Z_VEL_MAX_DN
STOPPED = 0.3  # m/s: below it, the place to hold is taken
REACHED = 0.2  # m: take-off is over
DEFAULT_TAKEOFF_HEIGHT = 2.5  # m, MIS_TAKEOFF_ALT
LANDED_FOR = 0.5  # s on the ground, then disarm
DISARM_LANDED = 2.0  # s, COM_DISARM_LAND: on the ground again, whatever the mode
IDLE_DISARM = 10.0  # s, COM_DISARM_PRFLT: armed but never taken off
READY_AFTER = 1.0  # s after boot until sensors have settled
PRESS_DOWN = 1.0  # m/s downwards asked for on the ground, so that rotors idle


class Mode(Enum):
    """What flies the vehicle."""

    HOLD = "hold"
    TAKEOFF = "takeoff"
    OFFBOARD = "offboard"
    LAND = "land"


class Severity(Enum):
    """MAV_SEVERITY of a word to the ground."""

    CRITICAL = 2
    WARNING = 4
    INFO = 6


@dataclass(frozen=True, slots=True)
class Failsafe:
    """When the vehicle stops trusting its ground station."""

    setpoint_silence_s: float = 0.5
    """COM_OF_LOSS_T: then it holds."""
    land_after_s: float = 5.0
    """After it began to hold: then it lands."""


class Setpoint(NamedTuple):
    """A velocity asked for from outside."""

    time_s: float
    """When it came."""
    velocity_ned: Vector
    yaw: float | None = None
    """rad; absent: as it is."""
    yaw_rate: float = 0.0
    """rad/s."""


class Situation(NamedTuple):
    """What the vehicle is and where, at one instant."""

    time_s: float
    position_ned: Vector
    velocity_ned: Vector
    yaw: float
    on_ground: bool


class Pilot(NamedTuple):
    """State of the machine; a tuple, because every set-point makes a new one."""

    armed: bool = False
    mode: Mode = Mode.HOLD
    anchor_ned: Vector | None = None
    """Where HOLD stays, once it has stopped; where TAKEOFF goes; over which place LAND comes down."""
    setpoint: Setpoint | None = None
    """The last one that came, whatever the mode."""
    yaw: float = 0.0
    """rad: heading to keep."""
    land_at_s: float | None = None
    """Set when set-points fall silent."""
    grounded_since_s: float | None = None
    airborne: bool = False
    """Has left the ground since it was armed."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What an event did: the state after it, and whether the vehicle agreed."""

    pilot: Pilot
    accepted: bool = True
    words: tuple[tuple[Severity, str], ...] = ()


def _refuse(pilot: Pilot, words: str) -> Outcome:
    return Outcome(pilot, accepted=False, words=((Severity.CRITICAL, words),))


def arm(pilot: Pilot, now: Situation) -> Outcome:
    """Start the rotors."""
    if pilot.armed:
        return Outcome(pilot)
    if now.time_s < READY_AFTER:
        return _refuse(pilot, "Arming denied: sensors are settling")
    armed = Pilot(armed=True, setpoint=pilot.setpoint, yaw=now.yaw, grounded_since_s=now.time_s)
    return Outcome(armed, words=((Severity.INFO, "Armed by external command"),))


def disarm(pilot: Pilot, now: Situation, *, force: bool) -> Outcome:
    """Stop the rotors; in the air only by force."""
    if pilot.armed and not now.on_ground and not force:
        return _refuse(pilot, "Disarming denied: not landed")
    return Outcome(pilot._replace(armed=False, mode=Mode.HOLD, land_at_s=None))


def take_off(pilot: Pilot, now: Situation, height: float) -> Outcome:
    """Climb straight up to `height` [m above the vehicle's origin]."""
    if not pilot.armed:
        return _refuse(pilot, "Take-off denied: arm first")
    if height <= 0.0:
        return _refuse(pilot, "Take-off denied: altitude is below home")
    north, east, _ = now.position_ned
    return Outcome(
        pilot._replace(mode=Mode.TAKEOFF, anchor_ned=(north, east, -height), land_at_s=None),
        words=((Severity.INFO, f"Takeoff to {height:.1f} meters above home"),),
    )


def set_mode(pilot: Pilot, now: Situation, mode: Mode, failsafe: Failsafe) -> Outcome:
    """Change to HOLD, OFFBOARD or LAND."""
    if mode is Mode.OFFBOARD and not hears_setpoints(pilot, now, failsafe):
        return _refuse(pilot, "Offboard denied: no set-points are coming")
    if mode is pilot.mode:
        return Outcome(pilot._replace(land_at_s=None))
    return Outcome(pilot._replace(mode=mode, anchor_ned=None, land_at_s=None))


def hear(pilot: Pilot, setpoint: Setpoint) -> Pilot:
    """Take note of a set-point; OFFBOARD flies it."""
    return pilot._replace(setpoint=setpoint)


def hears_setpoints(pilot: Pilot, now: Situation, failsafe: Failsafe) -> bool:
    """Whether the last set-point is young enough to fly by."""
    age_s = math.inf if pilot.setpoint is None else now.time_s - pilot.setpoint.time_s
    return age_s < failsafe.setpoint_silence_s


def advance(pilot: Pilot, now: Situation, failsafe: Failsafe) -> Outcome:
    """Let time pass: arrivals, landings, silence."""
    if not pilot.armed:
        return Outcome(pilot)
    pilot = _watch_the_ground(pilot, now)
    grounded_s = 0.0 if pilot.grounded_since_s is None else now.time_s - pilot.grounded_since_s
    if pilot.mode is Mode.LAND and grounded_s >= LANDED_FOR:
        return Outcome(pilot._replace(armed=False), words=((Severity.INFO, "Landed, disarmed"),))
    if pilot.mode is Mode.HOLD and grounded_s >= (DISARM_LANDED if pilot.airborne else IDLE_DISARM):
        why = "Landed, disarmed" if pilot.airborne else "Disarmed: no take-off"
        return Outcome(pilot._replace(armed=False), words=((Severity.INFO, why),))
    if pilot.mode is Mode.TAKEOFF and pilot.anchor_ned is not None:
        if abs(now.position_ned[2] - pilot.anchor_ned[2]) < REACHED:
            return Outcome(pilot._replace(mode=Mode.HOLD), words=((Severity.INFO, "Take-off height reached"),))
    elif pilot.mode is Mode.OFFBOARD and not hears_setpoints(pilot, now, failsafe):
        lost = pilot._replace(mode=Mode.HOLD, anchor_ned=None, land_at_s=now.time_s + failsafe.land_after_s)
        return Outcome(lost, words=((Severity.CRITICAL, "Set-points lost: holding"),))
    elif pilot.land_at_s is not None and now.time_s >= pilot.land_at_s:
        landing = pilot._replace(mode=Mode.LAND, anchor_ned=None, land_at_s=None)
        return Outcome(landing, words=((Severity.CRITICAL, "Set-points did not come back: landing"),))
    return Outcome(_anchored(pilot, now))


def command(pilot: Pilot, now: Situation) -> Vector:
    """The velocity the mode asks for [m/s, NED]."""
    if now.on_ground and pilot.mode is not Mode.TAKEOFF:
        return 0.0, 0.0, PRESS_DOWN
    if pilot.mode is Mode.OFFBOARD and pilot.setpoint is not None:
        return _flyable(pilot.setpoint.velocity_ned)
    north, east, down = (0.0, 0.0, 0.0) if pilot.anchor_ned is None else _towards(pilot.anchor_ned, now)
    if pilot.mode is Mode.TAKEOFF:
        down = max(down, -TAKEOFF_SPEED)
    elif pilot.mode is Mode.LAND:
        down = DESCENT_SPEED if -now.position_ned[2] > SLOW_BELOW else LANDING_SPEED
    return north, east, down


def heading(pilot: Pilot, dt: float) -> float:
    """The yaw to keep [rad], `dt` seconds after it was last asked for."""
    setpoint = pilot.setpoint
    if pilot.mode is not Mode.OFFBOARD or setpoint is None:
        return pilot.yaw
    yaw = pilot.yaw if setpoint.yaw is None else setpoint.yaw
    return math.remainder(yaw + setpoint.yaw_rate * dt, math.tau)


def _watch_the_ground(pilot: Pilot, now: Situation) -> Pilot:
    if not now.on_ground:
        flying = pilot.airborne and pilot.grounded_since_s is None
        return pilot if flying else pilot._replace(airborne=True, grounded_since_s=None)
    return pilot if pilot.grounded_since_s is not None else pilot._replace(grounded_since_s=now.time_s)


def _anchored(pilot: Pilot, now: Situation) -> Pilot:
    """Take the place to stay at, once slow enough; coming down does not count against LAND."""
    if pilot.mode not in (Mode.HOLD, Mode.LAND) or pilot.anchor_ned is not None:
        return pilot
    north, east, down = now.velocity_ned
    speed = math.hypot(north, east, 0.0 if pilot.mode is Mode.LAND else down)
    return pilot._replace(anchor_ned=now.position_ned) if speed < STOPPED else pilot


def _flyable(velocity_ned: Vector) -> Vector:
    """What a set-point may ask for: a huge one would wind the controller up for half a minute."""
    return _bounded(velocity_ned, OFFBOARD_SPEED, OFFBOARD_CLIMB, OFFBOARD_DESCENT)


def _towards(anchor_ned: Vector, now: Situation) -> Vector:
    north, east, down = (HOLD_GAIN * (a - p) for a, p in zip(anchor_ned, now.position_ned, strict=True))
    return _bounded((north, east, down), HOLD_SPEED, HOLD_SPEED, HOLD_SPEED)


def _bounded(velocity_ned: Vector, level: float, climb: float, descent: float) -> Vector:
    """A velocity no faster than these [m/s] on the level, up and down."""
    north, east, down = velocity_ned
    slower = min(1.0, level / max(math.hypot(north, east), 1e-9))
    return north * slower, east * slower, max(-climb, min(descent, down))
