"""/log: what happens in a flight, foxglove.Log, one sentence each, as it happens.

A message's name is what it is about (`happenings.Kind`), with the vehicle behind it where it is about one: "phase",
"distrust/uav_5". What a simulation knows of its faults is not said here.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain

from foxglove_schemas_protobuf.Log_pb2 import Log
from google.protobuf.timestamp_pb2 import Timestamp

from gcs.flight_state import Phase
from gcs.gate import LOST_NS
from gcs.loop import Tick
from gcs.recording import sentences
from gcs.recording.happenings import Kind
from gcs.recording.transforms import body
from gcs.scoring import DISTRUSTED
from gcs.summary import trust_of
from gcs.telemetry import NEVER
from gcs.track import Parts, parts_of
from scenarios import Scenario

SEVERITIES = (Log.FATAL, Log.FATAL, Log.ERROR, Log.ERROR, Log.WARNING, Log.INFO, Log.INFO, Log.DEBUG)
"""MAV_SEVERITY → level."""
Said = tuple[Kind, int | None, Log.Level.ValueType, str]
"""What it is about, which vehicle (system id) if any, how grave it is, and the sentence."""


class Sayings:
    """Remembers what was so at the last tick, and says what is another."""

    def __init__(self, scenario: Scenario) -> None:
        nobody = [False] * scenario.swarm.count
        self._asks_for_trust = trust_of(scenario) is not None
        self._phase: Phase | None = None
        self._task = ""
        self._distrusted = self._silent = self._released = nobody
        self._parts = Parts(0.0, scenario.swarm.leaders, ())
        self._problem: str | None = None

    def at(self, tick: Tick) -> Iterator[bytes]:
        """What there is to say of a tick, in the order in which it came about."""
        seconds, nanoseconds = divmod(tick.time_ns, 1_000_000_000)
        for kind, system, level, words in chain(
            self._people(tick),
            self._vehicles(tick),
            self._silence(tick),
            self._flight(tick),
            self._trust(tick),
            self._roles(tick),
        ):
            name = kind.value if system is None else f"{kind.value}/{body(system)}"
            time = Timestamp(seconds=seconds, nanos=nanoseconds)
            yield bytes(Log(timestamp=time, level=level, message=words, name=name).SerializeToString())

    def _people(self, tick: Tick) -> Iterator[Said]:
        for event in tick.events:
            if isinstance(event, str):
                yield Kind.WORD, None, Log.WARNING, sentences.operator(event)
        for rating in tick.diagnosis.ratings:
            yield Kind.RATING, rating.vehicle, Log.INFO, sentences.rating(rating)

    def _vehicles(self, tick: Tick) -> Iterator[Said]:
        swarm, released = tick.swarm, tick.state.released.tolist()
        for system, severity, text in swarm.words:
            yield Kind.WORD, system, SEVERITIES[min(severity, len(SEVERITIES) - 1)], sentences.vehicle(system, text)
        for answer in swarm.answers:
            if answer.refused:
                yield Kind.WORD, answer.system, Log.WARNING, answer.words
        for system, words in sentences.hands(swarm.ids, self._released, released):
            yield Kind.HANDS, system, Log.WARNING, words
        self._released = released

    def _silence(self, tick: Tick) -> Iterator[Said]:
        swarm = tick.swarm
        silent = ((swarm.position_ns != NEVER) & (tick.time_ns - swarm.position_ns > LOST_NS)).tolist()
        for system, lost in _differing(swarm.ids, self._silent, silent):
            yield Kind.LINK, system, Log.ERROR if lost else Log.INFO, sentences.silence(system, lost=lost)
        self._silent = silent

    def _trust(self, tick: Tick) -> Iterator[Said]:
        """In the mission, where the rule asks for trust: elsewhere nothing follows from it."""
        if not self._asks_for_trust or tick.diagnosis.phase is not Phase.MISSION:
            return
        distrusted = (tick.diagnosis.trust < DISTRUSTED).tolist()
        for system, fell in _differing(tick.swarm.ids, self._distrusted, distrusted):
            yield Kind.DISTRUST, system, Log.WARNING if fell else Log.INFO, sentences.distrust(system, fell=fell)
        self._distrusted = distrusted

    def _roles(self, tick: Tick) -> Iterator[Said]:
        parts = parts_of(tick)
        if parts is not None:
            for system, words in sentences.parts(self._parts, parts):
                yield Kind.ROLES, system, Log.WARNING, words
            self._parts = parts

    def _flight(self, tick: Tick) -> Iterator[Said]:
        """Why it went wrong, then what it does instead."""
        diagnosis, problem = tick.diagnosis, tick.state.problem
        if problem is not None and problem != self._problem:
            yield Kind.PROBLEM, None, Log.ERROR, problem
        task = diagnosis.task if diagnosis.phase is Phase.MISSION else ""
        if diagnosis.phase is not self._phase:
            yield Kind.PHASE, None, Log.INFO, sentences.phase(diagnosis.phase.value, task)
        elif task != self._task:
            yield Kind.PHASE, None, Log.INFO, sentences.next_task(task)
        self._phase, self._task, self._problem = diagnosis.phase, task, problem


KINDS = {kind.value: kind for kind in Kind}


def read(data: bytes) -> tuple[Kind, int | None, str]:
    """What a message of /log is about, which vehicle (system id) if any, and the sentence."""
    said = Log.FromString(data)
    kind, _, whom = said.name.partition("/")
    return KINDS[kind], int(whom.removeprefix("uav_")) if whom else None, said.message


def _differing(ids: Iterable[int], before: list[bool], now: list[bool]) -> Iterator[tuple[int, bool]]:
    """Of which vehicles (system id) it is not so any more, or so at last."""
    if now != before:
        yield from ((system, so) for system, was, so in zip(ids, before, now, strict=True) if so != was)
