"""N vehicles in one air, on one step count."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pymap3d

from fdm.endpoint import Endpoint
from fdm.noise import Purpose, generator
from fdm.parameters import table
from fdm.personality import PERSONALITIES, Name
from fdm.shaping import shape_of
from fdm.surroundings import Surroundings
from fdm.vehicle import Geodetic, Vehicle
from scenarios import Scenario, offsets_ne

SITE = Geodetic(41.1512, -81.4161, 320.0)
"""Where scenarios begin: beside the airfield of Kent State University, the paper's home. Any other place does."""


class World:
    """The vehicles of a scenario, on their pads, disarmed, at step 0.

    autopilot:       what they are taken for
    stock_failsafes: with the autopilot's own failsafe parameters instead of ours
    origins_ne:      (N, 2) m from each vehicle's pad to where its own positions count from; the pads, unless told
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        seed: int = 1,
        autopilot: Name = "px4",
        stock_failsafes: bool = False,
        origins_ne: npt.ArrayLike | None = None,
    ) -> None:
        self.physics_hz = scenario.time.physics_hz
        self.steps = 0
        self._run_up_steps = scenario.time.ticks(scenario.mission.run_up_s) * scenario.time.steps_per_tick
        self._mission_step: int | None = None
        places = pads(scenario)
        origins = np.zeros((len(places), 2)) if origins_ne is None else np.asarray(origins_ne, float)
        if origins.shape != (len(places), 2) or not np.isfinite(origins).all():
            raise ValueError(f"origins_ne must be {len(places)} rows of two finite numbers, not {origins_ne!r}")
        self.endpoints = [
            _endpoint(scenario, system, pad, seed, autopilot, stock_failsafes, (float(north), float(east)))
            for system, (pad, (north, east)) in enumerate(zip(places, origins, strict=True), start=1)
        ]

    def deliver(self, system: int, datagram: bytes) -> None:
        """Hand a datagram to one vehicle, now."""
        self.endpoints[system - 1].receive(datagram)

    def step(self, steps: int) -> None:
        """Let this many physics steps pass."""
        target = self.steps + steps
        while self.steps < target:
            self._open_or_close_the_mission()
            self._burst(min(target, self._next_turn(target)) - self.steps)

    @property
    def next_event_step(self) -> int:
        """The next step at which any vehicle has something to do or to send."""
        return min(endpoint.next_event_step for endpoint in self.endpoints)

    def collect(self) -> list[tuple[int, int, bytes]]:
        """What the vehicles sent since the last call: (step, system, frame), in the order of time, then of ids."""
        sent = [
            (step, endpoint.system, frame) for endpoint in self.endpoints for step, frame in endpoint.data_to_send()
        ]
        sent.sort(key=lambda entry: entry[0])
        return sent

    def _open_or_close_the_mission(self) -> None:
        if self._mission_step is None:
            self._mission_step = self._first_motion()
        if self._mission_step is None:
            return
        if not any(endpoint.pilot.armed for endpoint in self.endpoints):
            self._mission_step = None
            for endpoint in self.endpoints:
                endpoint.end_mission()
        elif self._mission_step == self.steps:
            for endpoint in self.endpoints:
                endpoint.begin_mission()

    def _next_turn(self, target: int) -> int:
        """The step at which the mission may open or close: nobody disarms but where something is due."""
        if self._mission_step is None:
            return target
        opens = self._mission_step if self._mission_step > self.steps else target
        return min(opens, self.next_event_step)

    def _burst(self, steps: int) -> None:
        for endpoint in self.endpoints:
            endpoint.step(steps)
        self.steps += steps

    def _first_motion(self) -> int | None:
        """The step of mission start, once a vehicle was asked to move: the run-up comes first."""
        moved = [e.first_motion_step for e in self.endpoints if e.first_motion_step is not None]
        return min(moved) + self._run_up_steps if moved else None


def pads(scenario: Scenario) -> list[Geodetic]:
    """Take-off places of all vehicles: the formation, its mean at SITE."""
    offsets = offsets_ne(scenario)
    latitude, longitude, altitude = pymap3d.ned2geodetic(
        offsets[:, 0],
        offsets[:, 1],
        np.zeros(len(offsets)),
        SITE.latitude_deg,
        SITE.longitude_deg,
        SITE.altitude_m,
    )
    return [
        Geodetic(float(lat), float(lon), SITE.altitude_m)
        for lat, lon, _ in zip(latitude, longitude, altitude, strict=True)
    ]


def _endpoint(
    scenario: Scenario,
    system: int,
    pad: Geodetic,
    seed: int,
    autopilot: Name,
    stock_failsafes: bool,
    origin_ne: tuple[float, float],
) -> Endpoint:
    vehicle = Vehicle(
        home=pad,
        yaw=math.radians(scenario.mission.leg[0].heading_deg),
        physics_hz=scenario.time.physics_hz,
        seed=int(generator(seed, system, Purpose.TURBULENCE).integers(2**31)),
    )
    return Endpoint(
        vehicle,
        Surroundings(scenario, vehicle=system, seed=seed),
        system=system,
        home=pad,
        physics_hz=scenario.time.physics_hz,
        personality=PERSONALITIES[autopilot],
        parameters=table(autopilot, stock_failsafes, system=system),
        origin_ne=origin_ne,
        noise=scenario.noise,
        shape=shape_of(scenario),
    )
