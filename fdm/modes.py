"""What both autopilots' mode machines are made of: modes, what a vehicle knows of itself, and how it holds, goes home
and comes down.

A machine (`fdm.px4`, `fdm.arducopter`) is a module of pure functions: state and situation in, state and words out.
Everything is SI and NED from the vehicle's pad. What can be set is in `Rules`, which parameters make.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import NamedTuple, Protocol

from pymavlink.dialects.v20 import ardupilotmega as dialect

from fdm.rules import Rules

Vector = tuple[float, float, float]

HOLD_GAIN = 0.95  # 1/s, MPC_XY_P
HOLD_SPEED = 3.0  # m/s, the most that holding a position may ask for
STOPPED = 0.3  # m/s: below it, the place to hold is taken
REACHED = 0.2  # m: take-off is over
OVERHEAD = 0.5  # m from home on the level: coming down begins
PRESS_DOWN = 1.0  # m/s downwards asked for on the ground, so that rotors idle
ON_TIME = 1e-5  # s: parameters are float32, and a deadline must not slip by a step for that


class Mode(Enum):
    """What flies the vehicle; values are the names of `wire.modes`."""

    HOLD = "hold"
    TAKEOFF = "takeoff"
    OFFBOARD = "offboard"
    RETURN = "return"
    LAND = "land"
    STABILIZE = "stabilize"
    ALTITUDE_HOLD = "altitude hold"
    GUIDED = "guided"
    LOITER = "loiter"
    POSITION_HOLD = "position hold"
    BRAKE = "brake"


class Phase(Enum):
    """Where in a flight the vehicle is, as EXTENDED_SYS_STATE tells it."""

    ON_GROUND = dialect.MAV_LANDED_STATE_ON_GROUND
    TAKING_OFF = dialect.MAV_LANDED_STATE_TAKEOFF
    IN_AIR = dialect.MAV_LANDED_STATE_IN_AIR
    LANDING = dialect.MAV_LANDED_STATE_LANDING


class Severity(Enum):
    """MAV_SEVERITY of a word to the ground."""

    CRITICAL = 2
    WARNING = 4
    INFO = 6


class Result(IntEnum):
    """MAV_RESULT of a command."""

    ACCEPTED = dialect.MAV_RESULT_ACCEPTED
    REJECTED = dialect.MAV_RESULT_TEMPORARILY_REJECTED
    DENIED = dialect.MAV_RESULT_DENIED
    UNSUPPORTED = dialect.MAV_RESULT_UNSUPPORTED
    FAILED = dialect.MAV_RESULT_FAILED


class Link(Enum):
    """What a vehicle in the air may lose."""

    SETPOINTS = "set-points"
    STATION = "ground station"


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


class Loss(NamedTuple):
    """A link that fell silent: the vehicle holds, and acts when its delay is over."""

    link: Link
    since_s: float


class Pilot(NamedTuple):
    """State of the machine; a tuple, because every set-point makes a new one."""

    armed: bool = False
    mode: Mode = Mode.HOLD
    climbing: bool = False
    """On its way up to the height of a take-off."""
    anchor_ned: Vector | None = None
    """Where it stays, once it has stopped; where a take-off or the way home leads; over which place it comes down."""
    setpoint: Setpoint | None = None
    """The last one that came; PX4 takes note in every mode, ArduCopter in GUIDED."""
    yaw: float = 0.0
    """rad: heading to keep."""
    home_ned: Vector = (0.0, 0.0, 0.0)
    """Where it was armed."""
    loss: Loss | None = None
    """Set while a failsafe waits to act."""
    station_s: float | None = None
    """When a ground station was last heard, or somebody flew on without it."""
    station_lost: bool = False
    """It has been silent for too long, and that has been dealt with."""
    grounded_since_s: float | None = None
    airborne: bool = False
    """Has left the ground since it was armed."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What an event did: the state after it, the answer, and words for people."""

    pilot: Pilot
    result: Result = Result.ACCEPTED
    words: tuple[tuple[Severity, str], ...] = ()


class Machine(Protocol):
    """An autopilot's way to fly. Modules are machines."""

    READY_AFTER: float
    """s after boot until its own checks before arming pass."""

    def boot(self) -> Pilot:
        """Power on."""

    def arm(self, pilot: Pilot, now: Situation, rules: Rules, /) -> Outcome:
        """Start the rotors."""

    def disarm(self, pilot: Pilot, now: Situation, /, *, force: bool) -> Outcome:
        """Stop the rotors; in the air only by force."""

    def take_off(self, pilot: Pilot, now: Situation, rules: Rules, height: float | None, /) -> Outcome:
        """Climb straight up to `height` [m above home]; None leaves it to the vehicle."""

    def set_mode(self, pilot: Pilot, now: Situation, rules: Rules, mode: Mode | None, /) -> Outcome:
        """Change to a mode; None is one that it does not have."""

    def hears(self, pilot: Pilot, /) -> bool:
        """Whether it takes note of set-points."""

    def hear(self, pilot: Pilot, setpoint: Setpoint, /) -> Pilot:
        """Take note of a set-point."""

    def hear_station(self, pilot: Pilot, now: Situation, /) -> Outcome:
        """A heartbeat of its ground station."""

    def advance(self, pilot: Pilot, now: Situation, rules: Rules, /) -> Outcome:
        """Let time pass: arrivals, landings, silence."""

    def deadline(self, pilot: Pilot, rules: Rules, /) -> float:
        """When `advance` must be asked next because patience ends [s since boot]; infinite for never."""

    def steered(self, pilot: Pilot, /) -> bool:
        """Whether it flies set-points now."""

    def velocity(self, pilot: Pilot, now: Situation, rules: Rules, /) -> Vector:
        """What the mode asks for [m/s, NED]."""


def phase(pilot: Pilot, now: Situation) -> Phase:
    """Where in a flight it is."""
    if now.on_ground:
        return Phase.ON_GROUND
    if pilot.armed and pilot.climbing:
        return Phase.TAKING_OFF
    return Phase.LANDING if pilot.armed and comes_down(pilot) else Phase.IN_AIR


def refuse(pilot: Pilot, result: Result, words: str) -> Outcome:
    """Nothing changes, and a person is told why."""
    return Outcome(pilot, result, ((Severity.CRITICAL, words),))


def heading(pilot: Pilot, dt: float, *, steered: bool) -> float:
    """The yaw to keep [rad], `dt` seconds after it was last asked for."""
    setpoint = pilot.setpoint
    if not steered or setpoint is None:
        return pilot.yaw
    yaw = pilot.yaw if setpoint.yaw is None else setpoint.yaw
    return math.remainder(yaw + setpoint.yaw_rate * dt, math.tau)


def silent_at(pilot: Pilot, rules: Rules) -> float:
    """When the last set-point will be too old to fly by [s]; −∞ where there is none."""
    return -math.inf if pilot.setpoint is None else pilot.setpoint.time_s + rules.setpoint_silence_s


def lost_at(pilot: Pilot, rules: Rules) -> float:
    """When the ground station will have been silent for too long [s]; never, where none was heard or it is known."""
    return math.inf if pilot.station_s is None or pilot.station_lost else pilot.station_s + rules.station_silence_s


def station_silent(pilot: Pilot, now: Situation, rules: Rules) -> bool:
    """Whether a ground station was heard once, and not for too long since."""
    return pilot.station_s is not None and over(pilot.station_s + rules.station_silence_s, now)


def borne_with(pilot: Pilot, now: Situation) -> Pilot:
    """Whoever changes the mode of a vehicle that has lost its ground station flies on: its patience begins again.

    Real ones wait for the station then, and without it stay up for ever.
    """
    lost = pilot.armed and pilot.station_lost
    return pilot._replace(station_s=now.time_s, station_lost=False) if lost else pilot


def over(deadline: float, now: Situation) -> bool:
    """Whether a deadline has come [s]."""
    return now.time_s >= deadline - ON_TIME


def watch_the_ground(pilot: Pilot, now: Situation) -> Pilot:
    """Since when it stands, and whether it has flown."""
    if not now.on_ground:
        flying = pilot.airborne and pilot.grounded_since_s is None
        return pilot if flying else pilot._replace(airborne=True, grounded_since_s=None)
    return pilot if pilot.grounded_since_s is not None else pilot._replace(grounded_since_s=now.time_s)


def anchored(pilot: Pilot, now: Situation, *, sinking: bool) -> Pilot:
    """Take the place to stay at, once slow enough; where it sinks on purpose, only the level counts."""
    if pilot.anchor_ned is not None:
        return pilot
    north, east, down = now.velocity_ned
    speed = math.hypot(north, east, 0.0 if sinking else down)
    return pilot._replace(anchor_ned=now.position_ned) if speed < STOPPED else pilot


def bound_home(pilot: Pilot, now: Situation, rules: Rules, *, slope: float, least: float) -> Pilot:
    """On its way home: no lower than it is, and as high as `return_height_m` unless home is near.

    slope: m of height that a metre of distance is worth;  least: m above home, however near.
    """
    north, east, _ = pilot.home_ned
    height = pilot.home_ned[2] - now.position_ned[2]
    distance = math.hypot(now.position_ned[0] - north, now.position_ned[1] - east)
    height = max(height, min(rules.return_height_m, max(slope * distance, least)))
    anchor = north, east, pilot.home_ned[2] - height
    return pilot._replace(mode=Mode.RETURN, climbing=False, anchor_ned=anchor, loss=None)


def overhead(pilot: Pilot, now: Situation) -> Pilot:
    """Home is reached: come down there. A return that leads to the ground is a landing."""
    if pilot.mode is not Mode.RETURN or pilot.anchor_ned is None or comes_down(pilot):
        return pilot
    north, east, _ = (a - p for a, p in zip(pilot.anchor_ned, now.position_ned, strict=True))
    if math.hypot(north, east) > OVERHEAD or math.hypot(*now.velocity_ned) > STOPPED:
        return pilot
    return pilot._replace(anchor_ned=pilot.home_ned)


def comes_down(pilot: Pilot) -> bool:
    """Whether it is landing."""
    return pilot.mode is Mode.LAND or (pilot.mode is Mode.RETURN and pilot.anchor_ned == pilot.home_ned)


def holding(pilot: Pilot, now: Situation) -> Vector:
    """The velocity that stops, and then stays at the anchor."""
    return (0.0, 0.0, 0.0) if pilot.anchor_ned is None else towards(pilot.anchor_ned, now)


def landing(pilot: Pilot, now: Situation, rules: Rules) -> Vector:
    """The velocity that comes down over the anchor."""
    north, east, _ = holding(pilot, now)
    high = pilot.home_ned[2] - now.position_ned[2] > rules.slow_below_m
    return north, east, rules.landing_fast_m_s if high else rules.landing_slow_m_s


def homewards(pilot: Pilot, now: Situation, rules: Rules) -> Vector:
    """The velocity of a return: up, along, down."""
    if comes_down(pilot) or pilot.anchor_ned is None:
        return landing(pilot, now, rules)
    if now.position_ned[2] - pilot.anchor_ned[2] > REACHED:
        _, _, down = towards(pilot.anchor_ned, now)
        return 0.0, 0.0, max(down, -rules.climb_m_s)
    return towards(pilot.anchor_ned, now, level=rules.return_m_s)


def flyable(velocity_ned: Vector, rules: Rules) -> Vector:
    """What a set-point may ask for: a huge one would wind the controller up for half a minute."""
    return bounded(velocity_ned, rules.level_m_s, rules.climb_m_s, rules.descent_m_s)


def towards(anchor_ned: Vector, now: Situation, *, level: float = HOLD_SPEED) -> Vector:
    """In proportion to the way, up to a speed [m/s]."""
    north, east, down = (HOLD_GAIN * (a - p) for a, p in zip(anchor_ned, now.position_ned, strict=True))
    return bounded((north, east, down), level, HOLD_SPEED, HOLD_SPEED)


def bounded(velocity_ned: Vector, level: float, climb: float, descent: float) -> Vector:
    """A velocity no faster than these [m/s] on the level, up and down."""
    north, east, down = velocity_ned
    slower = min(1.0, level / max(math.hypot(north, east), 1e-9))
    return north * slower, east * slower, max(-climb, min(descent, down))
