"""PX4's flight modes and failsafes, as pure functions. There is no radio: only the ground station steers.

                arm              take-off               height reached
    disarmed ─────────► HOLD ───────────────► TAKEOFF ─────────────────► HOLD
                                                                          │ mode OFFBOARD,
                                                                          ▼ set-points coming
                                                                       OFFBOARD
                                                                          │ set-points silent for COM_OF_LOSS_T, or the
                                       COM_OBL_RC_ACT or                  ▼ ground station (in any mode) COM_DL_LOSS_T
             0.5 s on the ground       NAV_DLL_ACT say so
    disarmed ◄───────────── LAND, RETURN ◄──────────────────────────── HOLD
                                          COM_FAIL_ACT_T later

Any mode may be asked for in any other, and disarmed: what was told TAKEOFF or OFFBOARD does so as soon as it is armed,
as clients that arm last expect. After a silence the vehicle stays in HOLD, LAND or RETURN, whatever set-points come,
until it is told OFFBOARD again. An OFFBOARD set-point that climbs takes off from the ground, as PX4 does. A ground
station that was never heard cannot be lost; one that is lost, while somebody still changes modes, is waited for anew.

https://docs.px4.io/main/en/flight_modes/offboard.html
https://docs.px4.io/main/en/config/safety.html
https://docs.px4.io/main/en/flight_modes_mc/return.html
"""

from __future__ import annotations

import math

from fdm.modes import (
    PRESS_DOWN,
    REACHED,
    Link,
    Loss,
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

READY_AFTER = 1.0  # s after boot until sensors have settled
LANDED_FOR = 0.5  # s on the ground, then a landing is over
RETURN_SLOPE, RETURN_LEAST = 1.0, 10.0  # RTL_CONE_ANG 45°, RTL_MIN_DIST: near home it climbs less

_ACTIONS = {
    Action.LAND: (Mode.LAND, "landing"),
    Action.RETURN: (Mode.RETURN, "returning"),
}


def boot() -> Pilot:
    """Power on: disarmed, in HOLD."""
    return Pilot()


def arm(pilot: Pilot, now: Situation, rules: Rules) -> Outcome:
    """Start the rotors: in TAKEOFF or OFFBOARD, where that was set before, else in HOLD."""
    if pilot.armed:
        return Outcome(pilot)
    if now.time_s < READY_AFTER:
        return refuse(pilot, Result.REJECTED, "Arming denied: sensors are settling")
    if station_silent(pilot, now, rules):
        return refuse(pilot, Result.REJECTED, "Arming denied: no ground station is heard")
    mode = pilot.mode if pilot.mode in (Mode.TAKEOFF, Mode.OFFBOARD) else Mode.HOLD
    if mode is Mode.OFFBOARD and over(silent_at(pilot, rules), now):
        return refuse(pilot, Result.REJECTED, "Arming denied: Offboard without set-points")
    armed = Pilot(
        armed=True,
        mode=mode,
        climbing=mode is Mode.TAKEOFF,
        anchor_ned=pilot.anchor_ned if mode is Mode.TAKEOFF else None,
        setpoint=pilot.setpoint,
        yaw=now.yaw,
        home_ned=(now.position_ned[0], now.position_ned[1], 0.0),
        station_s=pilot.station_s,
        grounded_since_s=now.time_s,
    )
    return Outcome(armed, words=((Severity.INFO, "Armed by external command"),))


def disarm(pilot: Pilot, now: Situation, *, force: bool) -> Outcome:
    """Stop the rotors; in the air only by force."""
    if pilot.armed and not now.on_ground and not force:
        return refuse(pilot, Result.REJECTED, "Disarming denied: not landed")
    return Outcome(pilot._replace(armed=False, mode=Mode.HOLD, climbing=False, loss=None))


def take_off(pilot: Pilot, now: Situation, rules: Rules, height: float | None) -> Outcome:
    """Climb straight up to `height` [m above home]; by itself to MIS_TAKEOFF_ALT, or stay where that is lower."""
    north, east, down = now.position_ned
    if height is None:
        height = max(rules.takeoff_height_m or 0.0, -down)
    if height <= 0.0:
        return refuse(pilot, Result.REJECTED, "Take-off denied: altitude is below home")
    anchor = north, east, -height
    return Outcome(
        borne_with(pilot, now)._replace(mode=Mode.TAKEOFF, climbing=pilot.armed, anchor_ned=anchor, loss=None),
        words=((Severity.INFO, f"Takeoff to {height:.1f} meters above home"),),
    )


def set_mode(pilot: Pilot, now: Situation, rules: Rules, mode: Mode | None) -> Outcome:
    """Change to HOLD, TAKEOFF, OFFBOARD, RETURN or LAND; the others need a radio, or a mission."""
    if mode is None:
        return refuse(pilot, Result.REJECTED, "This mode is not available")
    if mode is Mode.TAKEOFF:
        return take_off(pilot, now, rules, None)
    if mode is Mode.OFFBOARD and over(silent_at(pilot, rules), now):
        return refuse(pilot, Result.REJECTED, "Offboard denied: no set-points are coming")
    pilot = borne_with(pilot, now)
    return Outcome(pilot._replace(loss=None) if mode is pilot.mode else _changed(pilot, now, rules, mode))


def hears(_pilot: Pilot) -> bool:
    """PX4 takes note of set-points in every mode: they must come before OFFBOARD."""
    return True


def hear(pilot: Pilot, setpoint: Setpoint) -> Pilot:
    """Take note of a set-point; OFFBOARD flies it."""
    return pilot._replace(setpoint=setpoint)


def hear_station(pilot: Pilot, now: Situation) -> Outcome:
    """A heartbeat of a ground station."""
    back = ((Severity.INFO, "Ground station is heard again"),) if pilot.station_lost else ()
    return Outcome(pilot._replace(station_s=now.time_s, station_lost=False), words=back)


def advance(pilot: Pilot, now: Situation, rules: Rules) -> Outcome:
    """Let time pass: arrivals, landings, silence."""
    if not pilot.armed:
        return Outcome(pilot)
    pilot = watch_the_ground(pilot, now)
    why = _done(pilot, now, rules)
    if why:
        return Outcome(pilot._replace(armed=False, loss=None), words=((Severity.INFO, why),))
    if pilot.mode is Mode.TAKEOFF and pilot.anchor_ned and abs(now.position_ned[2] - pilot.anchor_ned[2]) < REACHED:
        words = ((Severity.INFO, "Take-off height reached"),)
        return Outcome(pilot._replace(mode=Mode.HOLD, climbing=False), words=words)
    if pilot.mode is Mode.OFFBOARD and over(silent_at(pilot, rules), now):
        return _lost(pilot, now, Link.SETPOINTS, "Set-points lost: holding")
    if over(lost_at(pilot, rules), now):
        return _station_lost(pilot, now, rules)
    if pilot.loss is not None and over(pilot.loss.since_s + rules.action_delay_s, now):
        return _act(pilot, now, rules, pilot.loss)
    pilot = overhead(pilot, now)
    if pilot.mode in (Mode.HOLD, Mode.LAND):
        pilot = anchored(pilot, now, sinking=pilot.mode is Mode.LAND)
    return Outcome(pilot)


def deadline(pilot: Pilot, rules: Rules) -> float:
    """When patience ends [s since boot]."""
    if not pilot.armed:
        return math.inf
    soonest = lost_at(pilot, rules)
    if pilot.mode is Mode.OFFBOARD:
        soonest = min(soonest, silent_at(pilot, rules))
    if pilot.loss is not None:
        soonest = min(soonest, pilot.loss.since_s + rules.action_delay_s)
    return soonest


def steered(pilot: Pilot) -> bool:
    """Whether it flies set-points now."""
    return pilot.mode is Mode.OFFBOARD and pilot.setpoint is not None


def velocity(pilot: Pilot, now: Situation, rules: Rules) -> Vector:
    """What the mode asks for [m/s, NED]."""
    asked = flyable(pilot.setpoint.velocity_ned, rules) if steered(pilot) and pilot.setpoint is not None else None
    if now.on_ground and pilot.mode is not Mode.TAKEOFF:
        return (0.0, 0.0, asked[2]) if asked is not None and asked[2] < 0.0 else (0.0, 0.0, PRESS_DOWN)
    if asked is not None:
        return asked
    match pilot.mode:
        case Mode.TAKEOFF:
            north, east, down = holding(pilot, now)
            return north, east, max(down, -rules.takeoff_m_s)
        case Mode.LAND:
            return landing(pilot, now, rules)
        case Mode.RETURN:
            return homewards(pilot, now, rules)
        case _:
            return holding(pilot, now)


def _changed(pilot: Pilot, now: Situation, rules: Rules, mode: Mode) -> Pilot:
    if mode is Mode.RETURN:
        return bound_home(pilot, now, rules, slope=RETURN_SLOPE, least=RETURN_LEAST)
    return pilot._replace(mode=mode, climbing=False, anchor_ned=None, loss=None)


def _done(pilot: Pilot, now: Situation, rules: Rules) -> str:
    """Why the rotors stop; empty where they need not."""
    if pilot.grounded_since_s is None:
        return ""
    grounded = now.time_s - pilot.grounded_since_s
    if pilot.mode is Mode.LAND or (pilot.mode is Mode.RETURN and pilot.airborne):
        return "Landed, disarmed" if grounded >= LANDED_FOR else ""
    patience_s = rules.landed_disarm_s if pilot.airborne else rules.idle_disarm_s
    if grounded < patience_s or velocity(pilot, now, rules)[2] < 0.0:
        return ""
    return "Landed, disarmed" if pilot.airborne else "Disarmed: no take-off"


def _lost(pilot: Pilot, now: Situation, link: Link, words: str) -> Outcome:
    """Hold first, so that a person has time to see why."""
    held = pilot._replace(mode=Mode.HOLD, climbing=False, anchor_ned=None, loss=Loss(link, now.time_s))
    return Outcome(held, words=((Severity.CRITICAL, words),))


def _station_lost(pilot: Pilot, now: Situation, rules: Rules) -> Outcome:
    """Whoever is coming home or down already goes on; so does the wait for what silent set-points lead to."""
    known = pilot._replace(station_lost=True)
    words = "Ground station lost"
    waits = pilot.loss is not None and rules.after_setpoints in _ACTIONS
    if waits or pilot.mode in (Mode.LAND, Mode.RETURN):
        return Outcome(known, words=((Severity.CRITICAL, words),))
    return _lost(known, now, Link.STATION, f"{words}: holding")


def _act(pilot: Pilot, now: Situation, rules: Rules, loss: Loss) -> Outcome:
    """The delay is over: do what the parameter says."""
    setpoints = loss.link is Link.SETPOINTS
    action = rules.after_setpoints if setpoints else rules.after_station
    if action not in _ACTIONS:
        return Outcome(pilot._replace(loss=None))
    mode, doing = _ACTIONS[action]
    missed = "Set-points did not come back" if setpoints else "Ground station is not back"
    return Outcome(_changed(pilot, now, rules, mode), words=((Severity.CRITICAL, f"{missed}: {doing}"),))
