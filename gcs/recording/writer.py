"""Writes a recording while a flight goes on.

On the way of a frame nothing is written: a `Tap` notes what passes. When a turn of the loop is over, its set-points
have left, and it is time, the recorder writes whatever turns it has noted: several at once cost less than one by one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from itertools import chain
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import orjson
from mcap_protobuf.schema import build_file_descriptor_set

from gcs import console
from gcs.loop import Clock, Link, Tick
from gcs.messages import GROUND_COMPONENT, GROUND_SYSTEM
from gcs.recording import decoded, topics
from gcs.recording.channels import Channel, Message, raw_channel
from gcs.recording.own_topics import OwnTopics, Pose, pose_of, tick_topic
from gcs.recording.rotation import About, Rotation
from gcs.recording.viewers import Viewers
from gcs.shielded import in_words
from gcs.summary import Reception
from gcs.truth import Truth
from scenarios import Scenario
from wire.frames import Frame, Framer

PROMPTLY_NS = 80_000_000
"""For flights that nobody can fly again: a killed process loses no more of the recording than this and one tick."""
IN_LARGE_CHUNKS_NS = 1_000_000_000
"""For flights that can: fewer, larger chunks cost less."""
OPTIONS = orjson.OPT_SERIALIZE_NUMPY


class Passed(NamedTuple):
    """Frames of one turn of the loop."""

    came: list[Frame]
    went: list[tuple[int, bytes]]
    """When, and what."""


class Turn(NamedTuple):
    """One turn of the loop, to be written."""

    tick: Tick
    passed: Passed
    pose: Pose | None
    """The truth, as it was at this tick."""


class Recorder:
    """One recording: raw frames through a `Tap`, our topics and the viewers' tick by tick."""

    def __init__(
        self,
        path: Path,
        scenario: Scenario,
        truth: Truth,
        *,
        start_ns: int,
        metadata: dict[str, str],
        flush_ns: int = IN_LARGE_CHUNKS_NS,
        decodes: bool = False,
        reception: Callable[[], Reception] = Reception,
        faults_made: bool = False,
        say: Callable[[str], None] = console.say,
    ) -> None:
        """flush_ns: how long anything may wait to be written;  decodes: write frames' messages as JSON, too.

        faults_made: whether we make the scenario's faults ourselves, whatever the vehicles tell.
        reception: tells how the vehicles were heard, where the link knows;  say: what to do with a sentence about a
        recording that stops, or goes on. Raises RecordingError.
        """
        about = About(scenario.model_dump_json(indent=1).encode(), metadata, start_ns)
        self._path, self._say = path, say
        self._files = Rotation(path, about, say)
        self._truth = truth
        self._own = OwnTopics(scenario, reception, faults_made=faults_made)
        self._viewers = Viewers(scenario)
        self._framer = Framer()
        self._decodes = decodes
        self._passed = Passed([], [])
        self._turns: list[Turn] = []
        self._flush_ns, self._flushed_ns = flush_ns, start_ns
        self._defect: str | None = None

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Whatever happened, the file is whole."""
        self.close()

    @property
    def problem(self) -> str | None:
        """Why some of the flight is not recorded, if it is not: it goes on all the same."""
        return self._defect or self._files.problem

    def came(self, frames: list[Frame]) -> None:
        """Note frames that were received in this turn of the loop."""
        self._passed.came.extend(frames)

    def went(self, time_ns: int, frame: bytes) -> None:
        """Note a frame that is being sent."""
        self._passed.went.append((time_ns, frame))

    def tick(self, tick: Tick) -> None:
        """Note the turn that is over; whenever it is time, everything noted is written, and leaves the process."""
        passed, self._passed = self._passed, Passed([], [])
        self._attempt(lambda: self._noted(Turn(tick, passed, pose_of(tick, self._truth))))

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """What is known only in the end, and is no part of the promise of same seed, same bytes."""
        self._attempt(lambda: self._files.metadata(name, values))

    def close(self) -> None:
        """Write what is left, of an interrupted turn too, and the summary."""
        self._attempt(self._write)
        self._attempt(lambda: self._files.add(self._frames(self._passed)))
        self._attempt(self._files.finish)
        self._files.close()

    def _attempt(self, write: Callable[[], object]) -> None:
        """Write, unless our own code has failed before: vehicles are in the air either way."""
        if self._defect is None:
            try:
                write()
            except Exception as error:  # not of the disk
                self._defect = f"{self._path}: the recording stopped: {in_words(error)}"
                self._say(f"gcs: {self._defect}; the flight goes on without it")

    def _noted(self, turn: Turn) -> None:
        self._turns.append(turn)
        time_ns = turn.tick.time_ns
        if time_ns - self._flushed_ns >= self._flush_ns:
            self._flushed_ns = time_ns
            self._write()
            self._files.flush(time_ns)

    def _write(self) -> None:
        turns, self._turns = self._turns, []
        for turn in turns:
            self._files.add([*self._frames(turn.passed), *self._topics(turn.tick, turn.pose)])

    def _frames(self, passed: Passed) -> list[Message]:
        """In the order in which they passed: what came, then what went."""
        came, went = passed
        ours = raw_channel(GROUND_SYSTEM, GROUND_COMPONENT)
        messages = [Message(raw_channel(frame.system, frame.component), frame.time_ns, frame.raw) for frame in came]
        messages += [Message(ours, time_ns, raw) for time_ns, raw in went]
        if self._decodes:
            read = chain(came, *(self._framer.frames(time_ns, raw) for time_ns, raw in went))
            messages += filter(None, map(decoded.message, read))
        return messages

    def _topics(self, tick: Tick, pose: Pose | None) -> Iterator[Message]:
        """What is said of a turn; /tick ends it."""
        time_ns = tick.time_ns
        for topic, message in self._own.of(tick, pose):
            yield Message(_json(topic, message.__class__), time_ns, orjson.dumps(message, option=OPTIONS))
        for topic, kind, data in self._viewers.of(tick):
            yield Message(_protobuf(topic, kind), time_ns, data)  # type: ignore[arg-type]  # mypy has no class hashed
        yield Message(_json("/tick", topics.TickTopic), time_ns, orjson.dumps(tick_topic(tick), option=OPTIONS))


class Tap:
    """A link whose frames are recorded."""

    def __init__(self, link: Link, clock: Clock, recorder: Recorder) -> None:
        self._link, self._clock, self._recorder = link, clock, recorder

    def receive(self) -> list[Frame]:
        """What came, under its time of arrival."""
        frames = self._link.receive()
        self._recorder.came(frames)
        return frames

    def send(self, system: int, frame: bytes) -> None:
        """What goes, whether or not it arrives."""
        self._recorder.went(self._clock.now(), frame)
        self._link.send(system, frame)

    @property
    def rejected(self) -> int:
        """What the link refused."""
        return self._link.rejected


@cache
def _json(topic: str, kind: Any) -> Channel:
    name = f"trustr.{kind.__name__.removesuffix('Topic')}"
    return Channel(topic, "json", name, "jsonschema", orjson.dumps(topics.schema(kind)))


@cache
def _protobuf(topic: str, kind: type[Any]) -> Channel:
    described = build_file_descriptor_set(kind).SerializeToString(deterministic=True)
    return Channel(topic, "protobuf", kind.DESCRIPTOR.full_name, "protobuf", described)
