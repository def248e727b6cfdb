"""What is written of a turn of the loop: raw frames first, then all that we make of it, each by code of its own.

Code that fails is left out from there on, and takes nothing else with it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import orjson
from mcap_protobuf.schema import build_file_descriptor_set

from gcs.loop import Tick
from gcs.messages import GROUND_COMPONENT, GROUND_SYSTEM
from gcs.recording import decoded, topics
from gcs.recording.channels import Channel, raw_channel
from gcs.recording.own_topics import OwnTopics, Pose, tick_topic
from gcs.recording.viewers import Viewers
from gcs.shielded import Shield
from wire.frames import Frame, Framer

OPTIONS = orjson.OPT_SERIALIZE_NUMPY
Written = tuple[Channel, int, bytes]
"""A message: plain tuples, because every frame becomes one."""


class Turn(NamedTuple):
    """One turn of the loop, to be written."""

    came: list[Frame]
    went: list[tuple[int, bytes]]
    """When, and what."""
    tick: Tick | None = None
    """None of a turn that was broken off: there are its frames, and nothing is said of it."""
    pose: Pose | None = None
    """The truth, as it was at this tick."""


class Source:
    """Messages of one kind."""

    def __init__(self, make: Callable[[Turn], Iterable[Written]], failed: str, say: Callable[[str], None]) -> None:
        """failed: what is to be said when the code fails that makes them, before the reason."""
        self._make = make
        self._shield = Shield(failed, say)

    @property
    def problem(self) -> str | None:
        """Why they are missing, if they are."""
        return self._shield.problem

    def write(self, turn: Turn, add: Callable[[Iterable[Written]], None]) -> None:
        """Hand those of a turn to `add`, which may fail on them, too."""
        self._shield.call(lambda: add(self._make(turn)), None)


def sources(
    path: Path, own: OwnTopics, viewers: Viewers, *, decodes: bool, say: Callable[[str], None]
) -> tuple[Source, ...]:
    """In the order in which they write. path: of the recording;  decodes: write frames' messages as JSON, too."""
    framer = Framer()
    makers: dict[str, Callable[[Turn], Iterable[Written]]] = {
        "raw frames": _raw,
        "decoded frames": lambda turn: _decoded(turn, framer),
        "our own topics": lambda turn: _own(turn, own),
        "topics for viewers": lambda turn: _drawn(turn, viewers),
        "ticks": _ticks,
    }
    if not decodes:
        del makers["decoded frames"]
    return tuple(Source(make, f"{path}: {name} are missing from here on", say) for name, make in makers.items())


def _raw(turn: Turn) -> list[Written]:
    """In the order in which they passed: what came, then what went."""
    ours = raw_channel(GROUND_SYSTEM, GROUND_COMPONENT)
    messages = [(raw_channel(system, component), time_ns, raw) for time_ns, system, component, _, _, raw in turn.came]
    messages += [(ours, time_ns, raw) for time_ns, raw in turn.went]
    return messages


def _decoded(turn: Turn, framer: Framer) -> Iterator[Written]:
    read = chain(turn.came, *(framer.frames(time_ns, raw) for time_ns, raw in turn.went))
    return filter(None, map(decoded.message, read))


def _own(turn: Turn, own: OwnTopics) -> Iterator[Written]:
    if turn.tick is not None:
        for topic, message in own.of(turn.tick, turn.pose):
            yield _json(topic, message.__class__), turn.tick.time_ns, orjson.dumps(message, option=OPTIONS)


def _drawn(turn: Turn, viewers: Viewers) -> Iterator[Written]:
    if turn.tick is not None:
        for topic, kind, data in viewers.of(turn.tick):
            yield _protobuf(topic, kind), turn.tick.time_ns, data  # type: ignore[arg-type]  # mypy has no class hashed


def _ticks(turn: Turn) -> Iterator[Written]:
    """/tick, which ends a turn."""
    if turn.tick is not None:
        said = orjson.dumps(tick_topic(turn.tick), option=OPTIONS)
        yield _json("/tick", topics.TickTopic), turn.tick.time_ns, said


@cache
def _json(topic: str, kind: Any) -> Channel:
    name = f"{topics.SCHEMA}{kind.__name__.removesuffix('Topic')}"
    return Channel(topic, "json", name, "jsonschema", orjson.dumps(topics.schema(kind)))


@cache
def _protobuf(topic: str, kind: type[Any]) -> Channel:
    described = build_file_descriptor_set(kind).SerializeToString(deterministic=True)
    return Channel(topic, "protobuf", kind.DESCRIPTOR.full_name, "protobuf", described)
