"""Reads recordings back: their scenario, their mission, and their frames tick by tick."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
import numpy.typing as npt
import orjson
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader, SeekingReader
from pydantic import ValidationError

from gcs.console import say
from gcs.events import Event, Rating
from gcs.gate import LOST_NS
from gcs.messages import GROUND_COMPONENT, GROUND_SYSTEM
from gcs.mission import plan
from gcs.recording.channels import RAW, raw_topic
from gcs.recording.files import FAULTS, MADE, METADATA, SCENARIO, SUMMARY, recovering, remainder
from gcs.recording.mcap_file import MAGIC
from gcs.track import Parts, Point, Track
from scenarios import Scenario, names
from wire.frames import Frame, Framer

RECORDING = "run.mcap"
"""A run's recording in its folder."""
LOG = ".tlog"
"""How the names of logs of frames end: a journal, or another ground station's."""
RECORD_SIZE_LIMIT = 64 << 20
DAMAGE = (McapError, struct.error, LookupError, ValueError, TypeError, RuntimeError, OverflowError, MemoryError)
"""What a torn, flipped or foreign file makes the readers raise: mcap's own, LZ4's, and those of what they hand on."""


Table = npt.NDArray[np.float64]


class UnreadableRecording(ValueError):
    """A file that is no recording of ours, in one sentence."""


class Message(NamedTuple):
    """One message, as it was recorded."""

    topic: str
    encoding: str
    """mavlink, json or protobuf."""
    time_ns: int
    """Since 1970: a frame's arrival or departure, else the tick's."""
    data: bytes


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """An open recording."""

    scenario: Scenario
    metadata: Mapping[str, Mapping[str, str]]
    """Record → its values."""
    messages: Iterator[Message]
    """All of them, once, in the file's order."""

    @property
    def summary(self) -> Mapping[str, Any] | None:
        """What the run reported, as in summary.json; None where the recording ends before it."""
        told: dict[str, Any] | None = orjson.loads(self.metadata[SUMMARY]["json"]) if SUMMARY in self.metadata else None
        return told

    @property
    def problem(self) -> str | None:
        """Why the flight could not be completed, or that the recording ends before it."""
        return CUT_SHORT if self.summary is None else self.summary["problem"]


@dataclass(frozen=True, slots=True, eq=False)
class Flown:
    """What a recording tells of a mission."""

    path: Path
    scenario: Scenario
    rated: bool
    """Whether people could say something, beforehand or while it was flown."""
    problem: str | None
    """Why the flight could not be completed, if it told."""
    track: Track | None


class RecordedTick(NamedTuple):
    """One turn of the recorded loop."""

    number: int
    """Counted from 0; a damaged recording that was recovered may lack some."""
    time_ns: int
    received: list[Frame]
    sent: list[bytes]
    events: tuple[Event, ...]
    """Ratings with the time since mission start at which they counted."""
    whole: bool
    """Whether every frame that it consumed is there."""


def located(path: Path) -> Path:
    """A recording, named by itself or by the folder of its run."""
    return path / RECORDING if path.is_dir() else path


def shown(path: Path) -> Path:
    """The same, for commands that show one file of a recording: on stderr is said if there are others."""
    path = located(path)
    others = remainder(path)
    if others is not None:
        say(f"gcs: {others}")
    return path


def instead_of_scenario(name: str) -> Path | None:
    """The recording that was named where a scenario may be; None if it is one. Scenarios that ship come first."""
    with suppress(OSError):  # too long a name, say
        path = located(Path(name))
        return path if path.suffix in (".mcap", LOG) and name not in names() else None
    return None


@contextmanager
def opened(path: Path) -> Iterator[Recording]:
    """A recording to be read. Whatever is wrong with it raises UnreadableRecording, while it is read too."""
    with readable(path), path.open("rb") as stream:
        reader = SeekingReader(stream, validate_crcs=True, record_size_limit=RECORD_SIZE_LIMIT)
        scenario = next((a.data for a in reader.iter_attachments() if a.name == SCENARIO), None)
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        if scenario is None or METADATA not in metadata:
            raise UnreadableRecording(f"{path}: an MCAP file, but no flight of ours: it holds no {SCENARIO}")
        yield Recording(Scenario.model_validate_json(scenario), metadata, _messages(stream))


def _messages(stream: BinaryIO) -> Iterator[Message]:
    """Chunk by chunk: the reader that seeks would hold all of them in memory."""
    stream.seek(0)
    reader = NonSeekingReader(stream, validate_crcs=True, record_size_limit=RECORD_SIZE_LIMIT)
    for _schema, channel, message in reader.iter_messages(log_time_order=False):
        yield Message(channel.topic, channel.message_encoding, message.log_time, message.data)


@contextmanager
def readable(path: Path) -> Iterator[None]:
    """Whatever is wrong with the file becomes one sentence."""
    if path.suffix == LOG:
        raise UnreadableRecording(f"{path}: a log of frames; gcs log import makes a recording of it")
    try:
        yield
    except UnreadableRecording:
        raise
    except OSError as error:
        raise UnreadableRecording(f"{path}: cannot be read: {error.strerror or error}") from None
    except ValidationError:
        raise UnreadableRecording(f"{path}: its {SCENARIO} is no scenario of this version") from None
    except DAMAGE:
        if not _begins_as_mcap(path):
            raise UnreadableRecording(f"{path}: not an MCAP file, or its beginning is lost") from None
        raise UnreadableRecording(f"{path}: torn or damaged; {recovering(path)} rebuilds it") from None


def _begins_as_mcap(path: Path) -> bool:
    with suppress(OSError), path.open("rb") as stream:
        return stream.read(len(MAGIC)) == MAGIC
    return False


CUT_SHORT = "the recording ends before the flight did"
POINTS = ("/mission", "/trust", "/truth/pose", "/swarm/state")


def read(path: Path) -> Flown:
    """Scenario, metadata and mission of a recording. Raises UnreadableRecording."""
    with opened(path) as recording:
        told: dict[str, dict[int, dict[str, Any]]] = {topic: {} for topic in POINTS}
        parts = list[Parts]()
        for message in recording.messages:
            if message.topic in told:
                content = orjson.loads(message.data)
                told[message.topic][content["tick"]] = content
            elif message.topic == "/roles":
                parts.append(parts_of(orjson.loads(message.data)))
        scenario = recording.scenario
        rated = recording.metadata[METADATA].get("ratings", "") != ""
        track = track_of(recording, told, parts)
        return Flown(path, scenario, rated, recording.problem, track)


def track_of(
    recording: Recording, told: Mapping[str, Mapping[int, Mapping[str, Any]]], parts: Sequence[Parts]
) -> Track | None:
    """The mission of a recording, for its score. told: topic → tick → what it told."""
    return Track.of(
        list(points(told)),
        read_out_s=plan(recording.scenario).read_out_s,
        parts=parts,
        faults_made=recording.metadata[METADATA].get(FAULTS) == MADE,
    )


def points(told: Mapping[str, Mapping[int, Mapping[str, Any]]]) -> Iterator[Point]:
    """The mission's ticks, in order; positions are telemetry where no truth was told.

    told: topic → tick → what it told. A tick of which a damaged recording lost a part is left out.
    """
    mission, trust, pose, telemetry = (told[topic] for topic in POINTS)
    measured = not pose
    places = telemetry if measured else pose
    for tick in sorted(mission.keys() & trust.keys() & places.keys()):
        position = np.array(places[tick]["position_m"], dtype=np.float64)
        if measured:
            position *= 1.0, 1.0, -1.0
            position[np.array(places[tick]["age_s"], dtype=np.float64) > LOST_NS / 1e9] = np.nan
        yield Point(
            time_s=mission[tick]["mission_s"],
            position=position,
            trust=np.array(trust[tick]["trust"]),
            virtual_ne=np.array([mission[tick]["north_m"], mission[tick]["east_m"]]),
            measured=measured,
        )


def parts_of(content: Mapping[str, Any]) -> Parts:
    """What /roles told."""
    return Parts(content["mission_s"], tuple(content["leaders"]), tuple(content["left_behind"]))


def rating_of(content: Mapping[str, Any]) -> Rating:
    """What /ratings told, with the time at which it counted."""
    whom = content["vehicle"]
    return Rating(content["rater"], None if whom == "swarm" else whom, content["rating"], content["time_s"])


SENT = raw_topic(GROUND_SYSTEM, GROUND_COMPONENT)
"""Topic of what the ground station sent."""


def ticks(path: Path) -> Iterator[RecordedTick]:
    """The frames of a recording as the loop took and sent them, in the file's order. Raises UnreadableRecording."""
    with readable(path), path.open("rb") as stream:
        yield from paged(_messages(stream))


def paged(messages: Iterable[Message]) -> Iterator[RecordedTick]:
    """The same of its messages; those behind the last tick are of none."""
    framer, received, sent, said = Framer(), list[Frame](), list[bytes](), list[Rating]()
    for topic, encoding, time_ns, data in messages:
        if topic == SENT:
            sent.append(data)
        elif encoding == RAW:
            received += framer.frames(time_ns, data)
        elif topic == "/ratings":
            said.append(rating_of(orjson.loads(data)))
        elif topic == "/tick":
            content = orjson.loads(data)
            whole = len(received) == content["frames"]
            yield RecordedTick(content["number"], time_ns, received, sent, (*content["events"], *said), whole)
            received, sent, said = [], [], []


FRESH_S = 0.3
"""Older telemetry says nothing of this tick."""
SteeredTick = tuple[int, Table, Table, Table]
"""(tick, set-points sent, velocities, positions), (N, 2) each: m/s and m, NaN where there is none."""


def steered(path: Path) -> Iterator[SteeredTick]:
    """Every tick at which set-points flowed, in order. Raises UnreadableRecording."""
    setpoint: dict[str, Any] | None = None
    with readable(path), path.open("rb") as stream:
        for topic, _encoding, _time_ns, data in _messages(stream):
            if topic == "/setpoint":
                setpoint = orjson.loads(data)
            elif topic == "/swarm/state":
                fleet = orjson.loads(data)
            elif topic == "/tick" and setpoint is not None:
                sent, commanded = _table(setpoint["sent"]), np.array(setpoint["commanded"])
                fresh = np.array(fleet["age_s"], dtype=np.float64) <= FRESH_S
                yield (
                    setpoint["tick"],
                    np.where(commanded[:, None], sent, np.nan),
                    np.where(fresh[:, None], _table(fleet["velocity_m_s"]), np.nan),
                    _table(fleet["position_m"]),
                )
                setpoint = None


def _table(rows: list[list[float | None]]) -> Table:
    """North and east of a topic's table; null is NaN."""
    return np.array(rows, dtype=np.float64)[:, :2]
