"""What the world does to one vehicle: wind, gusts, turbulence, broken rotors, bent commands, blurred and wrong sensors.

Time 0 of a scenario is mission start. Steady wind blows from boot; everything else begins with the mission, so that two
flights with one seed meet the same, however long they took to get there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from fdm.faults import FaultyAir, Vector, VehicleFaults, wind_faults
from fdm.noise import Purpose, generator, gusts
from fdm.sensors import Sensors
from fdm.vehicle import Vehicle
from scenarios import Scenario, direction

PERIOD_S = 0.1
"""How often the air is renewed."""


class Surroundings:
    """Everything that disturbs the vehicle with this system id."""

    def __init__(self, scenario: Scenario, *, vehicle: int, seed: int) -> None:
        self.sensors = Sensors(scenario, vehicle=vehicle, seed=seed)
        """What the vehicle tells of itself."""
        self._scenario, self._system, self._seed = scenario, vehicle, seed
        self._faults = VehicleFaults(scenario.fault, vehicle=vehicle, cruise=scenario.mission.cruise_m_s)
        self._wind = _steady(scenario, vehicle)
        self._turbulence = scenario.wind.turbulence if _is_in_the_wind(scenario, vehicle) else 0.0
        self._air: Iterator[tuple[float, ...]] | None = None
        self._faulty_air: FaultyAir | None = None
        self._rotors = self._faults.rotors(-math.inf)
        self._start_s = math.inf

    def settle(self, vehicle: Vehicle) -> None:
        """Before the first step: the steady wind alone."""
        vehicle.set_wind(self._wind)

    def begin(self, vehicle: Vehicle, time_s: float) -> None:
        """Mission start [s since boot]: from now on everything counts."""
        self._start_s = time_s
        self._air = _gusts(self._scenario, self._system, self._seed)
        self._faulty_air = _faulty_air(self._scenario, self._system, self._seed)
        self.sensors.begin(time_s)
        vehicle.set_turbulence(self._turbulence)

    def end(self, vehicle: Vehicle) -> None:
        """The flight is over; the next begins as this one did."""
        self._start_s = math.inf
        self.sensors.end()
        vehicle.set_turbulence(0.0)
        vehicle.set_wind(self._wind)
        for rotor in self._rotors:
            vehicle.set_rotor(rotor)
        self._rotors = self._faults.rotors(-math.inf)

    def renew(self, vehicle: Vehicle, time_s: float) -> None:
        """Every PERIOD_S: new air, and rotors as their faults have them."""
        if time_s < self._start_s:
            return
        self._blow(vehicle, time_s - self._start_s)
        if not self._rotors:
            return
        rotors = self._faults.rotors(time_s - self._start_s)
        for rotor, health in rotors.items():
            if self._rotors[rotor] != health:
                vehicle.set_rotor(rotor, efficiency=health.efficiency, speed_limit=health.speed_limit)
        self._rotors = rotors

    def _blow(self, vehicle: Vehicle, since_s: float) -> None:
        north, east, _ = self._wind
        if self._air is not None:
            gust_n, gust_e = next(self._air)
            north, east = north + gust_n, east + gust_e
        if self._faulty_air is not None:
            fault_n, fault_e = self._faulty_air.wind(since_s)
            north, east = north + fault_n, east + fault_e
        if self._air is not None or self._faulty_air is not None:
            vehicle.set_wind((north, east, 0.0))

    def flown(self, velocity_ned: Vector, time_s: float) -> Vector:
        """What becomes of a velocity set-point [m/s]."""
        return self._faults.flown(velocity_ned, time_s - self._start_s)


def _is_in_the_wind(scenario: Scenario, vehicle: int) -> bool:
    return scenario.wind.vehicles is None or vehicle in scenario.wind.vehicles


def _steady(scenario: Scenario, vehicle: int) -> Vector:
    """Velocity of the air [m/s]; weather names the direction it comes from."""
    if not _is_in_the_wind(scenario, vehicle):
        return 0.0, 0.0, 0.0
    north, east = direction(scenario.wind.from_deg)
    return -scenario.wind.speed_m_s * north, -scenario.wind.speed_m_s * east, 0.0


def _gusts(scenario: Scenario, vehicle: int, seed: int) -> Iterator[tuple[float, ...]] | None:
    noise = scenario.noise
    if noise.gust_m_s == 0.0:
        return None
    rng = generator(seed, vehicle, Purpose.GUST)
    return gusts(rng, deviation=noise.gust_m_s, correlation_s=noise.gust_time_s, dt=PERIOD_S)


def _faulty_air(scenario: Scenario, vehicle: int, seed: int) -> FaultyAir | None:
    faults = wind_faults(scenario.fault, vehicle=vehicle)
    return FaultyAir(faults, vehicle=vehicle, seed=seed) if faults else None
