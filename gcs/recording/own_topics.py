"""What our own topics have to say of one turn of the loop, in the order in which it is recorded."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from gcs.beliefs import Belief
from gcs.link_quality import LinkQuality
from gcs.loop import Tick
from gcs.recording import topics
from gcs.summary import Reception
from gcs.track import Parts, changed, parts_of
from gcs.truth import Truth
from scenarios import Fault, Scenario

Array = npt.NDArray[np.float64]

STATE_EVERY_TICKS = 5
"""Between two /uav/<id>/state: attitude, mode and battery do not come more often."""
LINK_EVERY_NS = 1_000_000_000
Said = tuple[str, Any]
"""A topic, and the dataclass of gcs.recording.topics that is its message."""
Pose = tuple[Array, Array]
"""Where a simulation's vehicles really are, (N, 3) m, north, east of the swarm's origin and height above home; and how
fast they move, (N, 3) m/s, north, east, down.
"""


class OwnTopics:
    """Remembers what is told only when it changes."""

    def __init__(self, scenario: Scenario, reception: Callable[[], Reception], *, faults_made: bool = False) -> None:
        """reception: tells how the vehicles were heard; /link is where it knows.

        faults_made: whether we make the scenario's faults ourselves. Where we do not, and vehicles do not tell their
        truth, nobody knows whether anything is wrong with them.
        """
        self._reception, self._faults_made = reception, faults_made
        self._faults = scenario.fault
        self._active = [False] * len(scenario.fault)
        self._parts: Parts | None = None
        self._link_ns: int | None = None

    def of(self, tick: Tick, pose: Pose | None) -> Iterator[Said]:
        """Everything but /tick, which ends a turn. pose: the truth at this tick, where it is known."""
        number, diagnosis = tick.number, tick.diagnosis
        yield from self._fleet(tick)
        if diagnosis.sent_ned is not None:
            yield (
                "/setpoint",
                topics.SetpointTopic(
                    number, diagnosis.asked_ned, diagnosis.sent_ned, diagnosis.verdict, diagnosis.commanded
                ),
            )
        if diagnosis.virtual is not None:
            yield from self._mission(tick)
            if self._faults_made or pose is not None:
                yield from self._faulty(diagnosis.mission_s)
        if pose is not None:
            yield "/truth/pose", topics.PoseTopic(number, diagnosis.mission_s, *pose)
        for rating in diagnosis.ratings:
            whom = "swarm" if rating.vehicle is None else rating.vehicle
            yield (
                "/ratings",
                topics.RatingTopic(number, diagnosis.mission_s, rating.rater, whom, rating.rating, diagnosis.trust),
            )
        if self._link_ns is None or tick.time_ns - self._link_ns >= LINK_EVERY_NS:
            self._link_ns = tick.time_ns
            yield from self._link(tick)

    def _mission(self, tick: Tick) -> Iterator[Said]:
        number, diagnosis = tick.number, tick.diagnosis
        virtual, mission_s = diagnosis.virtual, diagnosis.mission_s
        assert virtual is not None
        place = *virtual.position_ne.tolist(), *virtual.velocity_ne.tolist()
        yield "/mission", topics.MissionTopic(number, mission_s, diagnosis.task, *place)
        yield "/trust", topics.TrustTopic(number, mission_s, diagnosis.trust)
        if diagnosis.decision is not None:
            weights = diagnosis.decision.graph.dense(diagnosis.decision.weights)
            yield "/weights", topics.WeightsTopic(number, mission_s, weights)
            yield from self._roles(tick)
        if diagnosis.belief is not None and diagnosis.belief.evidence is not None:
            yield "/evidence", _evidence_topic(number, mission_s, diagnosis.belief)

    def _faulty(self, mission_s: float) -> Iterator[Said]:
        """What the scenario has begin and end."""
        for index, fault in enumerate(self._faults):
            if fault.active(mission_s) != self._active[index]:
                self._active[index] = not self._active[index]
                yield "/truth/fault", _fault_topic(fault, mission_s)

    def _roles(self, tick: Tick) -> Iterator[Said]:
        parts = parts_of(tick)
        if parts is not None and (self._parts is None or changed(self._parts, parts)):
            self._parts = parts
            leaders, left_behind = list(parts.leaders), list(parts.left_behind)
            yield "/roles", topics.RolesTopic(tick.number, parts.time_s, leaders, left_behind)

    def _fleet(self, tick: Tick) -> Iterator[Said]:
        swarm = tick.swarm
        position = swarm.position_ned.copy()
        position[:, :2] = tick.diagnosis.position_ne
        age_s = np.where(swarm.position_ns > 0, (tick.time_ns - swarm.position_ns) / 1e9, np.nan)
        yield "/swarm/state", topics.FleetTopic(tick.number, position, swarm.velocity_ned, age_s)
        if tick.number % STATE_EVERY_TICKS == 0:
            for row, system in enumerate(swarm.ids):
                state = topics.StateTopic(
                    tick=tick.number,
                    position_m=position[row],
                    velocity_m_s=swarm.velocity_ned[row],
                    attitude_rad=swarm.attitude_rpy[row],
                    age_s=float(age_s[row]),
                    custom_mode=int(swarm.custom_mode[row]),
                    armed=bool(swarm.armed[row]),
                    battery=float(swarm.battery[row]),
                )
                yield f"/uav/{system}/state", state

    def _link(self, tick: Tick) -> Iterator[Said]:
        heard = self._reception()
        if not heard.quality:
            return
        quality = [heard.quality.get(system, LinkQuality()) for system in tick.swarm.ids]
        yield (
            "/link",
            topics.LinkTopic(
                tick=tick.number,
                received=np.array([one.received for one in quality]),
                lost=np.array([one.lost for one in quality]),
                reordered=np.array([one.reordered for one in quality]),
                duplicated=np.array([one.duplicated for one in quality]),
                rejected=dict(heard.rejections),
            ),
        )


def pose_of(tick: Tick, truth: Truth) -> Pose | None:
    """The truth at this tick; None where nobody tells it, or the swarm's frame is not known yet."""
    if not truth.known or tick.state.frame is None:
        return None
    return truth.position(tick.state.frame, tick.swarm), truth.velocity_ned.copy()


def tick_topic(tick: Tick) -> topics.TickTopic:
    """What ends a turn: the frames before it, and behind the last one, are what it received and sent."""
    words = [event for event in tick.events if isinstance(event, str)]
    return topics.TickTopic(tick.number, len(tick.frames), tick.lateness_ns, tick.diagnosis.phase.value, words)


def _evidence_topic(number: int, mission_s: float, belief: Belief) -> topics.EvidenceTopic:
    evidence = belief.evidence
    assert evidence is not None
    return topics.EvidenceTopic(
        tick=number,
        mission_s=mission_s,
        log_odds=evidence.log_odds,
        spoken=belief.spoken,
        response_m_s=np.hypot(*evidence.residual_ne.T),
        inconsistency_m=np.hypot(*evidence.inconsistency_ne.T),
        disagreement_m_s=np.hypot(*evidence.disagreement_ne.T),
        velocity_noise_m_s=evidence.velocity_noise**0.5,
        position_noise_m=evidence.place_noise**0.5,
    )


def _fault_topic(fault: Fault, mission_s: float) -> topics.FaultTopic:
    definition = fault.model_dump()
    return topics.FaultTopic(mission_s, fault.vehicle, definition["kind"], fault.active(mission_s), definition)
