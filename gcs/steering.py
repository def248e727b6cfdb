"""From the velocities that a phase wants to the set-points that leave: height, heading, and the gate."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from gcs.autopilots import Fleet
from gcs.flight_state import Diagnosis, FlightState, Step
from gcs.gate import Limits, Standing, admit
from gcs.mission import Plan
from gcs.telemetry import Flags, Swarm
from scenarios import Scenario
from trustr.leader import VirtualLeader

Array = npt.NDArray[np.float64]

HEIGHT_GAIN, CLIMB_SPEED = 0.8, 1.0
"""1/s and m/s: altitude is held apart from the consensus."""


class Steering:
    """Knows what never changes."""

    def __init__(self, scenario: Scenario, plan: Plan, fleet: Fleet, *, centre_ne: Array) -> None:
        """centre_ne: (2,) m, the fence's in the swarm's frame."""
        self._plan = plan
        self._fleet = fleet
        self._centre_ne = centre_ne
        self._limits = Limits.of(scenario)
        self._altitude_m = scenario.swarm.altitude_m
        self._crawl_m_s = 0.1 * scenario.mission.cruise_m_s
        self._time = scenario.time

    def at_height(self, swarm: Swarm, velocity_ne: Array, *, lower: Array | float = 0.0) -> Array:
        """(N, 3) m/s: these velocities (N, 2), towards the scenario's height, or so many metres below it."""
        height_error = swarm.position_ned[:, 2] + self._altitude_m - lower
        asked = np.empty_like(swarm.position_ned)
        asked[:, :2] = velocity_ne
        asked[:, 2] = np.clip(-HEIGHT_GAIN * height_error, -CLIMB_SPEED, CLIMB_SPEED)
        return asked

    def send(
        self,
        state: FlightState,
        swarm: Swarm,
        now_ns: int,
        asked_ned: Array,
        diagnosis: Diagnosis,
        *,
        among: Flags | None = None,
    ) -> Step:
        """Send what passes the gate, (N, 3) m/s, to those of `among`, everybody, whom we may send it."""
        hands = state.hands
        ours = ~hands.released & ~hands.mute & (self._fleet.ours(swarm) | hands.coming)
        standing = Standing(
            ids=swarm.ids,
            ours=ours if among is None else ours & among,
            age_ns=now_ns - swarm.position_ns,
            place_ned=np.column_stack([state.position_ne(swarm) - self._centre_ne, swarm.position_ned[:, 2]]),
            velocity_ned=swarm.velocity_ned,
            before_ned=np.where(state.commanded[:, None], state.sent_ned, np.nan),
            lateness_ns=state.lateness_ns(now_ns, self._time.period_ns),
        )
        passed = admit(asked_ned, self._heading(diagnosis.virtual), standing, self._limits, dt=self._time.period_s)
        told = replace(
            diagnosis,
            asked_ned=asked_ned,
            sent_ned=passed.sent_ned,
            verdict=passed.verdict,
            commanded=passed.commanded,
        )
        return replace(state, sent_ned=passed.sent_ned, commanded=passed.commanded), [*passed.commands], told

    def _heading(self, virtual: VirtualLeader | None) -> float:
        """Face the direction of travel; at its end, the last leg's."""
        north, east = self._plan.segments[0].velocity_ne if virtual is None else virtual.velocity_ne
        if math.hypot(north, east) < self._crawl_m_s:
            north, east = self._plan.segments[-1].velocity_ne
        return math.atan2(east, north)
