"""What a mode asks for, on its way to the flight controller: through what is wrong with the vehicle, and as slowly as
such a vehicle takes it up.
"""

from __future__ import annotations

from collections.abc import Callable

from fdm.modes import Machine, Pilot, Situation, Vector, heading
from fdm.rules import Rules
from fdm.shaping import Level, Motion
from fdm.surroundings import Surroundings
from fdm.vehicle import Vehicle


class Helm:
    """One vehicle's. shape: a motion and the velocity wanted, to the motion SHAPING_S later; None: at once."""

    def __init__(
        self,
        vehicle: Vehicle,
        surroundings: Surroundings,
        machine: Machine,
        shape: Callable[[Motion, Level], Motion] | None,
    ) -> None:
        self._vehicle = vehicle
        self._surroundings = surroundings
        self._machine = machine
        self._shape = shape
        self._motion: Motion | None = None
        """What is asked of the flight controller, where set-points are shaped and flown."""
        self._wanted_ned: Vector = (0.0, 0.0, 0.0)

    def fly(self, pilot: Pilot, now: Situation, rules: Rules, *, dt: float) -> Pilot:
        """Hand the mode's velocity on; the pilot with the heading it then has. dt: s of yaw rate."""
        velocity = self._machine.velocity(pilot, now, rules)
        steered = self._machine.steered(pilot)
        if steered:
            velocity = self._shaped(self._surroundings.flown(velocity, now.time_s), now)
        else:
            self._motion = None
        yaw = heading(pilot, dt, steered=steered)
        self._vehicle.set_velocity(velocity, yaw)
        return pilot if yaw == pilot.yaw else pilot._replace(yaw=yaw)

    def take_up(self, pilot: Pilot) -> None:
        """Every SHAPING_S: a little nearer to what is wanted."""
        if self._shape is None or self._motion is None or not self._machine.steered(pilot):
            return
        north, east, down = self._wanted_ned
        self._motion = self._shape(self._motion, (north, east))
        self._vehicle.set_velocity((*self._motion.velocity_ne, down), pilot.yaw)

    def _shaped(self, velocity_ned: Vector, now: Situation) -> Vector:
        """Where a slow vehicle is on its way to this velocity. It begins with the one it has."""
        if self._shape is None:
            return velocity_ned
        self._wanted_ned = velocity_ned
        if self._motion is None:
            self._motion = Motion((now.velocity_ned[0], now.velocity_ned[1]))
        return (*self._motion.velocity_ne, velocity_ned[2])
