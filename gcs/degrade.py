"""The paper's behavioural fault as a wrapper of the link: set-points to one vehicle are bent on their way out.

So the fault can be flown with any autopilot, which knows nothing of it. The vehicles behind the link must be sound, as
`fdm serve --no-fault` has them: whoever brings the fault along would bend its set-points twice.
"""

from __future__ import annotations

import math

from gcs.loop import Clock, Link
from scenarios import MotorDegradation, Scenario
from scenarios.degradation import degrade
from wire.frames import CRC, HEADER_2, MAGIC_2, Frame, sealed
from wire.payloads import (
    IGNORE_LEVEL_VELOCITY,
    SET_POSITION_TARGET_LOCAL_NED,
    PositionTarget,
    pack_position_target,
    unpack_position_target,
)

_MESSAGE = SET_POSITION_TARGET_LOCAL_NED.to_bytes(3, "little")
_FLOAT32_ROOM = 1.0 - 2.0**-22
"""What is this much shorter stays below its bound when it is rounded."""

Level = tuple[float, float]


def degrading(scenario: Scenario, system: int) -> Scenario:
    """What is flown with `Degraded`: its own degraded motors of this vehicle, or else the paper's fault."""
    if not 1 <= system <= scenario.swarm.count:
        raise ValueError(f"vehicle {system} cannot be degraded: there are 1 to {scenario.swarm.count}")
    if _motors(scenario, system):
        return scenario
    faults = (*scenario.fault, MotorDegradation(kind="motor_degradation", vehicle=system))
    return Scenario.model_validate(scenario.model_dump() | {"fault": [fault.model_dump() for fault in faults]})


class Degraded:
    """A link to a fleet one of whose vehicles does not fly what it is told, though it believes it does.

    Recording and journal lie before it, so that both hold what the controller sent, as if the fault were on board. A
    fault's time counts from mission start: the first set-point to any vehicle that moves it sideways, and the run-up
    behind it, as far as a link can know.
    """

    def __init__(self, link: Link, clock: Clock, scenario: Scenario, system: int) -> None:
        """Raises ValueError where the scenario has no such vehicle."""
        self._link, self._clock, self._system = link, clock, system
        self._faults = _motors(degrading(scenario, system), system)
        self._cruise = scenario.mission.cruise_m_s
        self._fastest = scenario.limits.speed_m_s
        self._run_up_ns = scenario.time.ticks(scenario.mission.run_up_s) * scenario.time.period_ns
        self._start_ns: int | None = None

    def receive(self) -> list[Frame]:
        """As they come: the vehicle tells the truth."""
        return self._link.receive()

    def send(self, system: int, frame: bytes) -> None:
        """On their way, velocity set-points to the one vehicle become what it will fly; all else stays as it is."""
        target = _velocity_target(frame)
        if target is not None:
            self._watch_for_the_start(target)
            if system == self._system:
                frame = self._bent(frame, target)
        self._link.send(system, frame)

    @property
    def rejected(self) -> int:
        """How much came that was no good frame."""
        return self._link.rejected

    def _watch_for_the_start(self, target: PositionTarget) -> None:
        if self._start_ns is None and target.moves_sideways:
            self._start_ns = self._clock.now() + self._run_up_ns

    def _bent(self, frame: bytes, target: PositionTarget) -> bytes:
        now_ns = self._clock.now()
        if self._start_ns is None or now_ns <= self._start_ns:  # on board too, the mission begins behind its set-point
            return frame
        asked = target.vx, target.vy
        flown = self._flown(asked, (now_ns - self._start_ns) / 1e9)
        if flown == asked:
            return frame
        north, east = _at_most(flown, self._fastest)
        payload = pack_position_target(target._replace(vx=north, vy=east)).rstrip(b"\0")
        return sealed(bytes([len(payload)]) + frame[2:HEADER_2] + payload, SET_POSITION_TARGET_LOCAL_NED)

    def _flown(self, velocity: Level, time_s: float) -> Level:
        """What becomes of a horizontal velocity [m/s] at this time since mission start [s]."""
        for fault in self._faults:
            if strength := fault.strength(time_s):
                bent = degrade(
                    velocity,
                    cruise=self._cruise,
                    max_speed_fraction=fault.max_speed_fraction,
                    offset_fraction=fault.offset_fraction,
                )
                velocity = _between(velocity[0], bent[0], strength), _between(velocity[1], bent[1], strength)
        return velocity


def _motors(scenario: Scenario, system: int) -> tuple[MotorDegradation, ...]:
    return tuple(fault for fault in scenario.fault if isinstance(fault, MotorDegradation) and fault.vehicle == system)


def _velocity_target(frame: bytes) -> PositionTarget | None:
    """A set-point of ours whose horizontal velocity counts, in whatever frame: the fault turns with the direction."""
    if frame[0] != MAGIC_2 or frame[2] or frame[7:HEADER_2] != _MESSAGE:
        return None
    target = unpack_position_target(frame[HEADER_2:-CRC])
    if target.type_mask & IGNORE_LEVEL_VELOCITY or not math.isfinite(target.vx + target.vy):
        return None
    return target


def _at_most(velocity: Level, fastest: float) -> Level:
    speed = math.hypot(*velocity)
    if speed <= fastest * _FLOAT32_ROOM:
        return velocity
    scale = fastest * _FLOAT32_ROOM / speed
    return velocity[0] * scale, velocity[1] * scale


def _between(healthy: float, faulty: float, strength: float) -> float:
    """The one at strength 0, the other, to the last bit, at 1."""
    return faulty if strength == 1.0 else healthy + strength * (faulty - healthy)
