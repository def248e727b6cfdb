"""What goes wrong with one vehicle: the scenario's faults as functions of the time since mission start."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from scenarios import Fault, MotorDegradation, RotorFault
from scenarios.degradation import degrade

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Rotor:
    """Health of one rotor, as fractions of a healthy one."""

    efficiency: float = 1.0
    speed_limit: float = 1.0


HEALTHY = Rotor()


class VehicleFaults:
    """The faults of one vehicle."""

    def __init__(self, faults: Iterable[Fault], *, vehicle: int, cruise: float) -> None:
        mine = [fault for fault in faults if fault.vehicle == vehicle]
        self._motors = [fault for fault in mine if isinstance(fault, MotorDegradation)]
        self._rotors = [fault for fault in mine if isinstance(fault, RotorFault)]
        self._cruise = cruise

    def flown(self, velocity_ned: Vector, time_s: float) -> Vector:
        """What becomes of a commanded velocity [m/s] at this time since mission start [s, negative before it]."""
        for fault in self._motors:
            if fault.active(time_s):
                north, east = degrade(
                    velocity_ned[:2],
                    cruise=self._cruise,
                    max_speed_fraction=fault.max_speed_fraction,
                    offset_fraction=fault.offset_fraction,
                )
                velocity_ned = north, east, velocity_ned[2]
        return velocity_ned

    def rotors(self, time_s: float) -> dict[int, Rotor]:
        """Health of every rotor (0 to 3) that a fault names; of two faults at once the worse counts."""
        health: dict[int, Rotor] = {}
        for fault in self._rotors:
            rotor = fault.rotor - 1
            before = health.setdefault(rotor, HEALTHY)
            if fault.active(time_s):
                health[rotor] = Rotor(
                    min(before.efficiency, fault.efficiency), min(before.speed_limit, fault.speed_limit)
                )
        return health
