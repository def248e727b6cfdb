"""Writes a recording while a flight goes on."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import numpy as np
import orjson
from mcap.writer import CompressionType, Writer

from gcs import console
from gcs.beliefs import Belief
from gcs.loop import Clock, Link, Tick
from gcs.messages import GROUND_COMPONENT, GROUND_SYSTEM
from gcs.recording import topics
from gcs.shielded import in_words
from gcs.truth import Truth
from scenarios import Fault, Scenario
from trustr.roles import Roles
from wire.frames import Frame

FLUSH_NS = 80_000_000
"""A killed process loses no more of the recording than this and one tick."""
STATE_EVERY_TICKS = 5
"""Between two /uav/<id>/state: attitude, mode and battery do not come more often."""
OPTIONS = orjson.OPT_SERIALIZE_NUMPY
SCENARIO = "scenario.json"
METADATA, SUMMARY = "trustr", "summary"
"""Names of the metadata records: what was flown, and what came of it."""


class RecordingError(OSError):
    """A recording that cannot be written, in one sentence."""


class Recorder:
    """One MCAP file: raw frames through a `Tap`, our topics tick by tick."""

    def __init__(
        self,
        path: Path,
        scenario: Scenario,
        truth: Truth,
        *,
        start_ns: int,
        metadata: dict[str, str],
        say: Callable[[str], None] = console.say,
    ) -> None:
        """say: what to do with the one sentence about a recording that stops."""
        self._say = say
        self.problem: str | None = None
        """Why the recording stopped, if it did: the flight goes on without it."""
        self._path = path
        self._file = _open(path)
        self._writer = Writer(self._file, compression=CompressionType.LZ4)
        self._writer.start(profile="", library="trustr")
        self._writer.add_metadata(METADATA, metadata)
        self._writer.add_attachment(
            start_ns, start_ns, SCENARIO, "application/json", scenario.model_dump_json(indent=1).encode()
        )
        self._raw: dict[tuple[int, int], int] = {}
        self._topics: dict[str, int] = {}
        self._truth = truth
        self._faults = scenario.fault
        self._active = [False] * len(scenario.fault)
        self._flushed_ns = start_ns
        self._roles: tuple[list[int], list[int]] | None = None

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Whatever happened, the file is whole."""
        self.close()

    def close(self) -> None:
        """Write the summary."""
        if not self._file.closed:
            self._attempt(self._writer.finish)
            with suppress(OSError):  # what could not be written has been told
                self._file.close()

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """What is known only in the end, and is no part of the promise of same seed, same bytes."""
        self._attempt(lambda: self._writer.add_metadata(name, values))

    def _attempt(self, write: Callable[[], object]) -> None:
        """Write, unless writing has failed before: behind a torn chunk nothing is readable."""
        if self.problem is None:
            try:
                write()
            except Exception as error:  # of the disk, or a defect of ours: vehicles are in the air either way
                self._stopped(error)

    def _stopped(self, error: Exception) -> None:
        why = (error.strerror or error) if isinstance(error, OSError) else in_words(error)
        self.problem = f"{self._path}: the recording stopped: {why}"
        self._say(f"gcs: {self.problem}; the flight goes on without it")

    def raw(self, time_ns: int, system: int, component: int, frame: bytes) -> None:
        """A frame, under the name of its sender."""
        if self.problem is not None:
            return
        try:
            self._raw_frame(time_ns, system, component, frame)
        except Exception as error:  # a chunk may be full at any frame, and the disk with it
            self._stopped(error)

    def _raw_frame(self, time_ns: int, system: int, component: int, frame: bytes) -> None:
        channel = self._raw.get((system, component))
        if channel is None:
            topic = f"/mavlink/{system}_{component}/raw"
            channel = self._raw[system, component] = self._writer.register_channel(topic, "mavlink", 0)
        self._writer.add_message(channel, time_ns, frame, time_ns)

    def tick(self, tick: Tick) -> None:
        """Our own topics of one turn of the loop, and every FLUSH_NS all that waits, to the disk."""
        self._attempt(lambda: self._turn(tick))

    def _turn(self, tick: Tick) -> None:
        number, time_ns, diagnosis = tick.number, tick.time_ns, tick.diagnosis
        self._fleet(tick)
        if diagnosis.sent_ned is not None:
            self._write(
                time_ns,
                "/setpoint",
                topics.SetpointTopic(
                    number, diagnosis.asked_ned, diagnosis.sent_ned, diagnosis.verdict, diagnosis.commanded
                ),
            )
        if diagnosis.virtual is not None:
            self._mission(tick)
        if self._truth.known and tick.state.frame is not None:
            position = self._truth.position(tick.state.frame, tick.swarm)
            pose = topics.PoseTopic(number, diagnosis.mission_s, position, self._truth.velocity_ned)
            self._write(time_ns, "/truth/pose", pose)
        for rating in diagnosis.ratings:
            whom = "swarm" if rating.vehicle is None else rating.vehicle
            said = topics.RatingTopic(number, diagnosis.mission_s, rating.rater, whom, rating.rating, diagnosis.trust)
            self._write(time_ns, "/ratings", said)
        words = [event for event in tick.events if isinstance(event, str)]
        turn = topics.TickTopic(number, len(tick.frames), tick.lateness_ns, diagnosis.phase.value, words)
        self._write(time_ns, "/tick", turn)
        if time_ns - self._flushed_ns >= FLUSH_NS:
            self._writer.flush()  # type: ignore[no-untyped-call]
            self._flushed_ns = time_ns

    def _mission(self, tick: Tick) -> None:
        number, time_ns, diagnosis = tick.number, tick.time_ns, tick.diagnosis
        virtual, mission_s = diagnosis.virtual, diagnosis.mission_s
        assert virtual is not None
        place = topics.MissionTopic(
            number, mission_s, diagnosis.task, *virtual.position_ne.tolist(), *virtual.velocity_ne.tolist()
        )
        self._write(time_ns, "/mission", place)
        self._write(time_ns, "/trust", topics.TrustTopic(number, mission_s, diagnosis.trust))
        if diagnosis.decision is not None:
            weights = diagnosis.decision.graph.dense(diagnosis.decision.weights)
            self._write(time_ns, "/weights", topics.WeightsTopic(number, mission_s, weights))
            self._told_roles(tick, diagnosis.decision.roles)
        if diagnosis.belief is not None and diagnosis.belief.evidence is not None:
            self._write(time_ns, "/evidence", _evidence_topic(number, mission_s, diagnosis.belief))
        for index, fault in enumerate(self._faults):
            if fault.active(mission_s) != self._active[index]:
                self._active[index] = not self._active[index]
                self._write(time_ns, "/truth/fault", _fault_topic(fault, mission_s))

    def _told_roles(self, tick: Tick, roles: Roles) -> None:
        ids = tick.swarm.ids
        told = [ids[row] for row in roles.leaders], [ids[row] for row in np.flatnonzero(roles.left)]
        if told != self._roles:
            self._roles = told
            self._write(tick.time_ns, "/roles", topics.RolesTopic(tick.number, tick.diagnosis.mission_s, *told))

    def _fleet(self, tick: Tick) -> None:
        swarm = tick.swarm
        position = swarm.position_ned.copy()
        position[:, :2] = tick.diagnosis.position_ne
        age_s = np.where(swarm.position_ns > 0, (tick.time_ns - swarm.position_ns) / 1e9, np.nan)
        fleet = topics.FleetTopic(tick.number, position, swarm.velocity_ned, age_s)
        self._write(tick.time_ns, "/swarm/state", fleet)
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
                self._write(tick.time_ns, f"/uav/{system}/state", state)

    def _write(self, time_ns: int, topic: str, message: Any) -> None:
        channel = self._topics.get(topic)
        if channel is None:
            kind: Any = type(message)
            schema = self._writer.register_schema(
                f"trustr.{kind.__name__.removesuffix('Topic')}",
                "jsonschema",
                orjson.dumps(topics.schema(kind)),
            )
            channel = self._topics[topic] = self._writer.register_channel(topic, "json", schema)
        self._writer.add_message(channel, time_ns, orjson.dumps(message, option=OPTIONS), time_ns)


class Tap:
    """A link that records what passes through it."""

    def __init__(self, link: Link, clock: Clock, recorder: Recorder) -> None:
        self._link = link
        self._clock = clock
        self._recorder = recorder

    def receive(self) -> list[Frame]:
        """What came, recorded under its time of arrival."""
        frames = self._link.receive()
        for frame in frames:
            self._recorder.raw(frame.time_ns, frame.system, frame.component, frame.raw)
        return frames

    def send(self, system: int, frame: bytes) -> None:
        """What goes, recorded before it does."""
        self._recorder.raw(self._clock.now(), GROUND_SYSTEM, GROUND_COMPONENT, frame)
        self._link.send(system, frame)

    @property
    def rejected(self) -> int:
        """What the link refused."""
        return self._link.rejected


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


def _open(path: Path) -> BinaryIO:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return path.open("wb")
    except OSError as error:
        raise RecordingError(f"{path}: the recording cannot be written: {error.strerror or error}") from None
