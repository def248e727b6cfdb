"""ArduCopter's flight modes and failsafes, as pure functions. There is no radio, so modes that ask sticks sink.

                       arm              NAV_TAKEOFF            height reached
    GUIDED, disarmed ──────► on the ground ──────────► climbing ───────────────► holding
                                                          │                       │   ▲
                                                 set-point│              set-point│   │ set-points silent
                                                          ▼                       ▼   │ for GUID_TIMEOUT
                                                          └───────────────────► steered
                          1 s on the ground
    LAND, RETURN disarmed ◄────────────────── LAND, RETURN ◄── from any: land, return, or what FS_GCS_ENABLE says
                                                               once the ground station is silent for FS_GCS_TIMEOUT

It boots in STABILIZE. GUIDED is reported while it climbs, is steered, and holds: set-points that fall silent leave it
in GUIDED, where it stops and stays. Set-points in other modes are ignored; in GUIDED one that comes before the vehicle
has left the ground calls the take-off off, and none lifts it. Disarmed in LAND or RETURN it cannot be armed before
another mode is set. LOITER, POSITION_HOLD, ALTITUDE_HOLD and STABILIZE read a throttle stick that nobody holds: they
sink (a real STABILIZE would fall). BRAKE stops and stays. A ground station that was never heard cannot be lost: whoever
steers and never sends a heartbeat leaves the vehicle hovering, as a real one does. One that is lost, while somebody
still changes modes, is waited for anew.

https://ardupilot.org/copter/docs/ac2_guidedmode.html
https://ardupilot.org/dev/docs/copter-commands-in-guided-mode.html
https://ardupilot.org/copter/docs/gcs-failsafe.html
https://ardupilot.org/copter/docs/rtl-mode.html
https://ardupilot.org/copter/docs/land-mode.html
"""

from __future__ import annotations

import math

from fdm.modes import (
    PRESS_DOWN,
    REACHED,
    Mode,
    Outcome,
    Pilot,
    Result,
    Setpoint,
    Severity,
    Situation,
    Vector,
    anchored,
    borne_with,
    bound_home,
    comes_down,
    flyable,
    holding,
    homewards,
    landing,
    lost_at,
    over,
    overhead,
    refuse,
    silent_at,
    station_silent,
    watch_the_ground,
)
from fdm.rules import Action, Rules

READY_AFTER = 3.0  # s after boot until the EKF has settled; a real one takes some 40
LANDED_FOR = 1.0  # s on the ground, then a landing is over: LAND_DETECTOR_TRIGGER_SEC
SINKING = 2.5  # m/s with the stick down: PILOT_SPEED_DN 0 stands for PILOT_SPEED_UP
RETURN_SLOPE, RETURN_CLIMB = 3.0, 2.5  # RTL_CONE_SLOPE; m that a return climbs at least, however near

_STICKS = (Mode.STABILIZE, Mode.ALTITUDE_HOLD, Mode.LOITER, Mode.POSITION_HOLD)
_UNARMABLE = {Mode.LAND: "Land", Mode.RETURN: "RTL", Mode.BRAKE: "Brake"}


def boot() -> Pilot:
    """Power on: disarmed, in STABILIZE."""
    return Pilot(mode=Mode.STABILIZE)


def arm(pilot: Pilot, now: Situation, rules: Rules) -> Outcome:
    """Start the rotors, in the mode that is set; LAND, RETURN and BRAKE cannot begin a flight."""
    if pilot.armed:
        return Outcome(pilot)
    if now.time_s < READY_AFTER:
        return refuse(pilot, Result.FAILED, "PreArm: EKF is still settling")
    if station_silent(pilot, now, rules):
        return refuse(pilot, Result.FAILED, "PreArm: GCS failsafe on")
    if pilot.mode in _UNARMABLE:
        return refuse(pilot, Result.FAILED, f"Arm: {_UNARMABLE[pilot.mode]} mode not armable")
    armed = Pilot(
        armed=True,
        mode=pilot.mode,
        yaw=now.yaw,
        home_ned=(now.position_ned[0], now.position_ned[1], 0.0),
        station_s=pilot.station_s,
        grounded_since_s=now.time_s,
    )
    return Outcome(armed, words=((Severity.INFO, "Arming motors"),))


def disarm(pilot: Pilot, now: Situation, *, force: bool) -> Outcome:
    """Stop the rotors; in the air only by force."""
    if not pilot.armed:
        return Outcome(pilot)
    if not now.on_ground and not force:
        return refuse(pilot, Result.FAILED, "Disarm: not landed")
    return _disarmed(pilot, "Disarming motors")


def take_off(pilot: Pilot, now: Situation, _rules: Rules, height: float | None) -> Outcome:
    """Climb straight up to `height` [m above home], in GUIDED, from the ground, armed."""
    if pilot.mode is not Mode.GUIDED:
        return refuse(pilot, Result.FAILED, "Take-off refused: set GUIDED first")
    if not pilot.armed:
        return refuse(pilot, Result.FAILED, "Take-off refused: arm first")
    if not now.on_ground:
        return refuse(pilot, Result.FAILED, "Take-off refused: already flying")
    if height is None or height <= 0.0:
        return refuse(pilot, Result.FAILED, "Take-off refused: name a height above home")
    north, east, _ = now.position_ned
    return Outcome(pilot._replace(climbing=True, anchor_ned=(north, east, -height), setpoint=None))


def set_mode(pilot: Pilot, now: Situation, rules: Rules, mode: Mode | None) -> Outcome:
    """Change to any mode that needs no mission."""
    if mode is None:
        return refuse(pilot, Result.FAILED, "Mode change failed: no such mode here")
    if mode is pilot.mode:
        return Outcome(pilot)
    return Outcome(_changed(borne_with(pilot, now), now, rules, mode))


def hears(pilot: Pilot) -> bool:
    """Set-points are ignored outside GUIDED."""
    return pilot.mode is Mode.GUIDED


def hear(pilot: Pilot, setpoint: Setpoint) -> Pilot:
    """Fly this, and no longer whatever was flown."""
    return pilot._replace(setpoint=setpoint, climbing=False, anchor_ned=None)


def hear_station(pilot: Pilot, now: Situation) -> Outcome:
    """A heartbeat of its ground station."""
    back = ((Severity.WARNING, "GCS Failsafe Cleared"),) if pilot.station_lost else ()
    return Outcome(pilot._replace(station_s=now.time_s, station_lost=False), words=back)


def advance(pilot: Pilot, now: Situation, rules: Rules) -> Outcome:
    """Let time pass: arrivals, landings, silence."""
    if not pilot.armed:
        return Outcome(pilot)
    pilot = watch_the_ground(pilot, now)
    if _done(pilot, now, rules):
        return _disarmed(pilot, "Disarming motors")
    if over(lost_at(pilot, rules), now):
        return _station_lost(pilot, now, rules)
    if pilot.setpoint is not None and over(silent_at(pilot, rules), now):
        pilot = pilot._replace(setpoint=None)
    if pilot.climbing and pilot.anchor_ned and abs(now.position_ned[2] - pilot.anchor_ned[2]) < REACHED:
        pilot = pilot._replace(climbing=False)
    pilot = overhead(pilot, now)
    if not now.on_ground and pilot.setpoint is None and pilot.mode is not Mode.RETURN:
        pilot = anchored(pilot, now, sinking=_sinks(pilot))
    return Outcome(pilot)


def deadline(pilot: Pilot, rules: Rules) -> float:
    """When patience ends [s since boot]."""
    if not pilot.armed:
        return math.inf
    silent = math.inf if pilot.setpoint is None else silent_at(pilot, rules)
    return min(silent, lost_at(pilot, rules))


def steered(pilot: Pilot) -> bool:
    """Whether it flies set-points now."""
    return pilot.mode is Mode.GUIDED and pilot.setpoint is not None


def velocity(pilot: Pilot, now: Situation, rules: Rules) -> Vector:
    """What the mode asks for [m/s, NED]."""
    if now.on_ground and not pilot.climbing:
        return 0.0, 0.0, PRESS_DOWN
    if steered(pilot) and pilot.setpoint is not None:
        return flyable(pilot.setpoint.velocity_ned, rules)
    north, east, down = holding(pilot, now)
    if pilot.mode in _STICKS:
        stays = pilot.mode in (Mode.LOITER, Mode.POSITION_HOLD)
        return (north, east, SINKING) if stays else (0.0, 0.0, SINKING)
    match pilot.mode:
        case Mode.LAND:
            return landing(pilot, now, rules)
        case Mode.RETURN:
            return homewards(pilot, now, rules)
        case _:
            return north, east, max(down, -rules.takeoff_m_s) if pilot.climbing else down


def _sinks(pilot: Pilot) -> bool:
    return comes_down(pilot) or pilot.mode in _STICKS


def _changed(pilot: Pilot, now: Situation, rules: Rules, mode: Mode) -> Pilot:
    pilot = pilot._replace(setpoint=None)
    if mode is Mode.RETURN:
        least = RETURN_CLIMB - now.position_ned[2]
        return bound_home(pilot, now, rules, slope=RETURN_SLOPE, least=least)
    return pilot._replace(mode=mode, climbing=False, anchor_ned=None)


def _disarmed(pilot: Pilot, words: str) -> Outcome:
    """In the mode it was in: after a landing that is LAND, in which it cannot be armed."""
    still = pilot._replace(armed=False, climbing=False, setpoint=None)
    return Outcome(still, words=((Severity.INFO, words),))


def _done(pilot: Pilot, now: Situation, rules: Rules) -> bool:
    """Whether the rotors may stop by themselves."""
    if pilot.grounded_since_s is None or pilot.climbing:
        return False
    landed = pilot.mode is Mode.LAND or (pilot.mode is Mode.RETURN and pilot.airborne)
    patience_s = LANDED_FOR if landed else rules.landed_disarm_s if pilot.airborne else rules.idle_disarm_s
    return now.time_s - pilot.grounded_since_s >= patience_s


def _station_lost(pilot: Pilot, now: Situation, rules: Rules) -> Outcome:
    """On the ground the rotors stop; in the air the action is taken at once, whatever the mode."""
    known = pilot._replace(station_lost=True)
    if now.on_ground:
        return _disarmed(known, "GCS Failsafe - Disarming")
    mode, doing = (Mode.RETURN, "RTL") if rules.after_station is Action.RETURN else (Mode.LAND, "Landing")
    flown = known if pilot.mode is mode else _changed(known, now, rules, mode)
    return Outcome(flown, words=((Severity.CRITICAL, f"GCS Failsafe - {doing}"),))
