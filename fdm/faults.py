"""What goes wrong with the flight of one vehicle: faults as functions of the time since mission start.

What goes wrong with what it tells of itself is in `fdm.sensors`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from fdm.noise import Held, Purpose, generator, gusts
from scenarios import CompassBias, Fault, MotorDegradation, RotorFault, StuckVelocity, WindFault, direction
from scenarios.degradation import degrade

Vector = tuple[float, float, float]
Level = tuple[float, float]
"""(north, east)."""

GUST_S = 0.1
"""How long one draw of a gust lasts."""


@dataclass(frozen=True, slots=True)
class Rotor:
    """Health of one rotor, as fractions of a healthy one."""

    efficiency: float = 1.0
    speed_limit: float = 1.0


HEALTHY = Rotor()


class VehicleFaults:
    """The faults of one vehicle that change how it flies.

    They act as a set-point travels through a vehicle: one that is stuck replaces it, a wrong compass turns it, a
    degraded motor bends what is left.
    """

    def __init__(self, faults: Iterable[Fault], *, vehicle: int, cruise: float) -> None:
        mine = [fault for fault in faults if fault.vehicle == vehicle]
        self._stuck = [_Stuck(fault) for fault in mine if isinstance(fault, StuckVelocity)]
        self._compasses = [fault for fault in mine if isinstance(fault, CompassBias)]
        self._motors = [fault for fault in mine if isinstance(fault, MotorDegradation)]
        self._rotors = [fault for fault in mine if isinstance(fault, RotorFault)]
        self._cruise = cruise

    def flown(self, velocity_ned: Vector, time_s: float) -> Vector:
        """What becomes of a commanded velocity [m/s] at this time since mission start [s, negative before it].

        To be asked about every command, at times that never fall.
        """
        north, east, down = velocity_ned
        for stuck in self._stuck:
            north, east = stuck.flown((north, east), time_s)
        if turn := compass_turn(self._compasses, time_s):
            north, east = turned((north, east), turn)
        for fault in self._motors:
            if strength := fault.strength(time_s):
                bent = degrade(
                    (north, east),
                    cruise=self._cruise,
                    max_speed_fraction=fault.max_speed_fraction,
                    offset_fraction=fault.offset_fraction,
                )
                north, east = _between(north, bent[0], strength), _between(east, bent[1], strength)
        return north, east, down

    def rotors(self, time_s: float) -> dict[int, Rotor]:
        """Health of every rotor (0 to 3) that a fault names; of two faults at once the worse counts."""
        health: dict[int, Rotor] = {}
        for fault in self._rotors:
            rotor = fault.rotor - 1
            before = health.setdefault(rotor, HEALTHY)
            if strength := fault.strength(time_s):
                health[rotor] = Rotor(
                    min(before.efficiency, _between(1.0, fault.efficiency, strength)),
                    min(before.speed_limit, _between(1.0, fault.speed_limit, strength)),
                )
        return health


class FaultyAir:
    """The wind of faults around one vehicle, from one mission start on."""

    def __init__(self, faults: Sequence[WindFault], *, vehicle: int, seed: int) -> None:
        streams = generator(seed, vehicle, Purpose.FAULT_GUST).spawn(len(faults))
        self._winds = [(fault, _gusts(fault, rng)) for fault, rng in zip(faults, streams, strict=True)]

    def wind(self, time_s: float) -> Level:
        """Its velocity [m/s] at this time since mission start [s]; times must not fall."""
        north = east = 0.0
        for fault, gust in self._winds:
            from_n, from_e = direction(fault.from_deg)
            gust_n, gust_e = gust.at(time_s)
            strength = fault.strength(time_s)
            north += strength * (gust_n - fault.speed_m_s * from_n)
            east += strength * (gust_e - fault.speed_m_s * from_e)
        return north, east


def _gusts(fault: WindFault, rng: np.random.Generator) -> Held:
    draws = gusts(rng, deviation=fault.gust_m_s, correlation_s=fault.gust_time_s, dt=GUST_S)
    return Held(draws, period_s=GUST_S)


def wind_faults(faults: Iterable[Fault], *, vehicle: int) -> list[WindFault]:
    """Those that blow around this vehicle."""
    return [fault for fault in faults if isinstance(fault, WindFault) and (fault.everyone or fault.vehicle == vehicle)]


def compass_turn(faults: Iterable[CompassBias], time_s: float) -> float:
    """Angle by which set-points are flown clockwise of what was meant [rad]."""
    return math.radians(sum([fault.bias_deg * fault.strength(time_s) for fault in faults]))


def turned(velocity_ne: Level, angle: float) -> Level:
    """Turned clockwise, seen from above."""
    north, east = velocity_ne
    cos, sin = math.cos(angle), math.sin(angle)
    return north * cos - east * sin, north * sin + east * cos


class _Stuck:
    """A set-point that stays."""

    def __init__(self, fault: StuckVelocity) -> None:
        self._fault = fault
        self._held: Level | None = None

    def flown(self, velocity_ne: Level, time_s: float) -> Level:
        """The one commanded last before the fault began, or first, if none was."""
        if self._held is None or self._fault.is_yet_to_act(time_s):
            self._held = velocity_ne
        return self._held


def _between(healthy: float, faulty: float, strength: float) -> float:
    """The one at strength 0, the other, to the last bit, at 1."""
    return faulty if strength == 1.0 else healthy + strength * (faulty - healthy)
