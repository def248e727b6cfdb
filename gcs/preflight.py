"""What must hold before any vehicle is armed, in sentences where it does not.

Above all: whoever stops hearing from us must come down or go home by itself. The parameters that decide this are read
back from each vehicle, because both autopilots are delivered with some of it switched off.

PX4 (1.14 and later) leaves OFFBOARD after COM_OF_LOSS_T without set-points and then does COM_OBL_RC_ACT: 0 position,
1 altitude, 2 stabilized, 3 return, 4 land, 5 hold, 6 terminate, 7 disarm. The first three are a pilot's: with sticks on
the air PX4 flies them, without it returns (failsafe.cpp), and we cannot know which. NAV_DLL_ACT follows after
COM_DL_LOSS_T without a ground station's heartbeat: 0 nothing, 1 hold, 2 return, 3 land, 5 terminate, 6 disarm.
https://docs.px4.io/main/en/config/safety.html
https://github.com/PX4/PX4-Autopilot/blob/main/src/modules/commander/failsafe/failsafe.cpp

ArduCopter stops after GUID_TIMEOUT without set-points and stays in GUIDED; FS_GCS_ENABLE follows after FS_GCS_TIMEOUT
without a heartbeat of SYSID_MYGCS: 0 nothing, 1 return, 2 (gone since 4.0) mission, 3 SmartRTL or return, 4 SmartRTL
or land, 5 land, 6 DO_LAND_START or return, 7 brake or land.
https://ardupilot.org/copter/docs/gcs-failsafe.html
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from types import MappingProxyType

import numpy as np

from gcs.losses import vehicles
from gcs.messages import GROUND_SYSTEM
from gcs.parameters import untold
from gcs.telemetry import Swarm
from scenarios import Scenario
from wire.modes import ARDUPILOT, PX4

Told = Mapping[str, float]

MARGIN = 3
"""Robots are no nearer to each other than so many times the accuracy with which they know where they are."""
LEAST_BATTERY = 0.2
"""Of full: with less nobody takes off."""
SILENCE_S = 10.0
"""After so long without us, at the latest, a vehicle has noticed."""
PX4_SETPOINTS_S, GUIDED_S = 1.0, 3.0
"""Each autopilot's own patience with missing set-points: no more is allowed."""

_ON_SETPOINTS_LOST = MappingProxyType(
    {
        0: "position mode, or return without sticks,",
        1: "altitude mode, or return without sticks,",
        2: "stabilized mode, or return without sticks,",
        3: "return",
        4: "land",
        5: "hold",
        6: "terminate",
        7: "disarm",
    }
)
_ON_LINK_LOST = MappingProxyType({0: "nothing", 1: "hold", 2: "return", 3: "land", 5: "terminate", 6: "disarm"})


def refusals(swarm: Swarm, scenario: Scenario) -> tuple[str, ...]:
    """Why these vehicles may not be armed for this scenario; empty where they may. Says nothing of who is not heard."""
    heard = [row for row in range(len(swarm.ids)) if swarm.autopilot[row]]
    return (
        *by_vehicles((swarm.ids[row], why) for row in heard for why in _vehicle(swarm, row, scenario)),
        *_spacing(swarm, scenario),
    )


def by_vehicles(said: Iterable[tuple[int, str]]) -> tuple[str, ...]:
    """What is said of systems, (id, words), each thing once with all of whom it is said."""
    systems: dict[str, list[int]] = {}
    for system, words in said:
        systems.setdefault(words, []).append(system)
    return tuple(f"{vehicles(who)}: {words}" for words, who in systems.items())


def _vehicle(swarm: Swarm, row: int, scenario: Scenario) -> Iterator[str]:
    autopilot, told = int(swarm.autopilot[row]), swarm.parameters[row]
    if autopilot not in _PROTECTED:
        yield f"flown by MAV_AUTOPILOT {autopilot}; must be {ARDUPILOT} (ArduPilot) or {PX4} (PX4)"
        return
    lacking = untold(autopilot, told)
    yield from (f"does not tell its parameter {' or '.join(group)}" for group in lacking)
    if not lacking:
        yield from _PROTECTED[autopilot](told)
        yield from _speed(autopilot, told, scenario.limits.speed_m_s)
    if swarm.battery[row] < LEAST_BATTERY:
        yield f"battery at {swarm.battery[row]:.0%}; must be {LEAST_BATTERY:.0%} or more"


def _px4(told: Told) -> Iterator[str]:
    silence, after_setpoints, after_link, link_s = (
        told[name] for name in ("COM_OF_LOSS_T", "COM_OBL_RC_ACT", "NAV_DLL_ACT", "COM_DL_LOSS_T")
    )
    if not 0.0 < silence <= PX4_SETPOINTS_S:
        yield (
            f"COM_OF_LOSS_T = {silence:g} (seconds for which set-points may be missing); "
            f"must be above 0 and at most {PX4_SETPOINTS_S:g}"
        )
    # With sticks, whether anybody holds them or not, position mode stays where it is; the other two drift, or fall.
    comes_down = after_setpoints in (3, 4)
    link_brings_down = after_setpoints in (0, 5) and after_link in (2, 3) and 0.0 < link_s <= SILENCE_S
    if not comes_down and not link_brings_down:
        yield (
            f"COM_OBL_RC_ACT = {after_setpoints:g} ({_ON_SETPOINTS_LOST.get(int(after_setpoints), 'unknown')} when "
            f"set-points are lost) and NAV_DLL_ACT = {after_link:g} "
            f"({_ON_LINK_LOST.get(int(after_link), 'unknown')} when the ground station is lost, "
            f"after COM_DL_LOSS_T = {link_s:g} s); COM_OBL_RC_ACT must be 3 or 4, "
            f"or else 0 or 5 with NAV_DLL_ACT 2 or 3 and COM_DL_LOSS_T at most {SILENCE_S:g}"
        )


def _arducopter(told: Told) -> Iterator[str]:
    guided_s, action, silence_s = (told[name] for name in ("GUID_TIMEOUT", "FS_GCS_ENABLE", "FS_GCS_TIMEOUT"))
    if not 0.0 < guided_s <= GUIDED_S:
        yield (
            f"GUID_TIMEOUT = {guided_s:g} (seconds for which a set-point is flown); "
            f"must be above 0 and at most {GUIDED_S:g}"
        )
    if action not in (1, 3, 4, 5, 6, 7):
        what = {0: "nothing happens", 2: "a mission goes on"}.get(int(action), "nobody knows what happens")
        yield (f"FS_GCS_ENABLE = {action:g} ({what} when the ground station is lost); must be 1, 3, 4, 5, 6 or 7")
    if not 0.0 < silence_s <= SILENCE_S:
        yield (
            f"FS_GCS_TIMEOUT = {silence_s:g} (seconds after which the ground station is lost); "
            f"must be above 0 and at most {SILENCE_S:g}"
        )
    name, station = _first(told, "SYSID_MYGCS", "MAV_GCS_SYSID")
    if station != GROUND_SYSTEM:
        yield f"{name} = {station:g} (whose heartbeat is the ground station's); must be {GROUND_SYSTEM}"


_PROTECTED: Mapping[int, Callable[[Told], Iterator[str]]] = MappingProxyType({PX4: _px4, ARDUPILOT: _arducopter})


def _speed(autopilot: int, told: Told, wanted_m_s: float) -> Iterator[str]:
    """A vehicle that quietly flies slower than it is asked to looks like one that fails."""
    name, limit = _first(told, "MPC_XY_VEL_MAX") if autopilot == PX4 else _first(told, "WPNAV_SPEED", "WP_SPD")
    unit, scale = ("cm/s", 0.01) if name == "WPNAV_SPEED" else ("m/s", 1.0)
    if not limit * scale >= wanted_m_s:
        yield f"{name} = {limit:g} {unit} is below limits.speed_m_s = {wanted_m_s:g}"


def _first(told: Told, *names: str) -> tuple[str, float]:
    """The one of these names that was told, and its value."""
    name = next(name for name in names if name in told)
    return name, told[name]


def _spacing(swarm: Swarm, scenario: Scenario) -> Iterator[str]:
    """Robots that know where they are to a metre cannot keep two metres apart."""
    told = np.isfinite(swarm.accuracy_m)
    spacing = scenario.swarm.spacing_m
    for row in np.flatnonzero(np.isinf(swarm.accuracy_m)):
        yield (
            f"vehicle {swarm.ids[row]} does not know its horizontal accuracy (GPS_RAW_INT.h_acc): "
            f"swarm.spacing_m = {spacing:g} must be at least {MARGIN} × that"
        )
    if len(swarm.ids) > 1 and told.any():
        worst = int(np.nanargmax(np.where(told, swarm.accuracy_m, np.nan)))
        accuracy = float(swarm.accuracy_m[worst])
        if spacing < MARGIN * accuracy:
            yield (
                f"swarm.spacing_m = {spacing:g} is below {MARGIN} × {accuracy:.2g} m, "
                f"the horizontal accuracy that vehicle {swarm.ids[worst]} reports"
            )
