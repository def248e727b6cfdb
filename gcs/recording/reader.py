"""Reads recordings back: their scenario, their mission, and their frames tick by tick."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import orjson
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader, SeekingReader
from pydantic import ValidationError

from gcs.events import Event, Rating
from gcs.messages import GROUND_COMPONENT, GROUND_SYSTEM
from gcs.mission import plan
from gcs.recording.writer import METADATA, SCENARIO, SUMMARY
from gcs.track import Parts, Point, Track
from scenarios import Scenario
from wire.frames import Frame, Framer

RECORDING = "run.mcap"
"""A run's recording in its folder."""
RECORD_SIZE_LIMIT = 64 << 20
DAMAGE = (McapError, struct.error, LookupError, ValueError, TypeError, RuntimeError, OverflowError, MemoryError)
"""What a torn, flipped or foreign file makes the readers raise: mcap's own, LZ4's, and those of what they hand on."""


Table = npt.NDArray[np.float64]


class UnreadableRecording(ValueError):
    """A file that is no recording of ours, in one sentence."""


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

    time_ns: int
    received: list[Frame]
    sent: list[bytes]
    events: tuple[Event, ...]


def located(path: Path) -> Path:
    """A recording, named by itself or by the folder of its run."""
    return path / RECORDING if path.is_dir() else path


def read(path: Path) -> Flown:
    """Scenario, metadata and mission of a recording. Raises UnreadableRecording."""
    with _readable(path), path.open("rb") as stream:
        reader = SeekingReader(stream, validate_crcs=True, record_size_limit=RECORD_SIZE_LIMIT)
        scenario = next((a.data for a in reader.iter_attachments() if a.name == SCENARIO), None)
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        if scenario is None or METADATA not in metadata:
            raise UnreadableRecording(f"{path}: an MCAP file, but no flight of ours: it holds no {SCENARIO}")
        loaded = Scenario.model_validate_json(scenario)
        points, parts = list(_points(reader)), list(_parts(reader))
        problem = orjson.loads(metadata[SUMMARY]["json"])["problem"] if SUMMARY in metadata else CUT_SHORT
    rated = metadata[METADATA].get("ratings", "") != ""
    track = Track.of(points, read_out_s=plan(loaded).read_out_s, parts=parts)
    return Flown(path, loaded, rated, problem, track)


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """Whatever is wrong with the file becomes one sentence."""
    try:
        yield
    except UnreadableRecording:
        raise
    except OSError as error:
        raise UnreadableRecording(f"{path}: cannot be read: {error.strerror or error}") from None
    except ValidationError:
        raise UnreadableRecording(f"{path}: its {SCENARIO} is no scenario of this version") from None
    except DAMAGE as error:
        said = " ".join(str(error).split()) or type(error).__name__
        raise UnreadableRecording(f"{path}: torn, damaged or not an MCAP file: {said}") from None


CUT_SHORT = "the recording ends before the flight did"
POINTS = ("/mission", "/trust", "/truth/pose", "/swarm/state")


def _points(reader: Any) -> Iterator[Point]:
    """The mission's ticks, in order; positions are telemetry where no truth was told."""
    told: dict[str, dict[int, dict[str, Any]]] = {topic: {} for topic in POINTS}
    for _schema, channel, message in reader.iter_messages(topics=POINTS):
        content = orjson.loads(message.data)
        told[channel.topic][content["tick"]] = content
    mission, trust, pose, telemetry = (told[topic] for topic in POINTS)
    for tick, there in sorted(mission.items()):
        measured = tick not in pose
        yield Point(
            time_s=there["mission_s"],
            position=_upwards(telemetry[tick]["position_m"]) if measured else np.array(pose[tick]["position_m"]),
            trust=np.array(trust[tick]["trust"]),
            virtual_ne=np.array([there["north_m"], there["east_m"]]),
            measured=measured,
        )


def _parts(reader: Any) -> Iterator[Parts]:
    for _schema, _channel, message in reader.iter_messages(topics="/roles"):
        content = orjson.loads(message.data)
        yield Parts(content["mission_s"], tuple(content["leaders"]), tuple(content["left_behind"]))


def _upwards(position_ned: list[list[float | None]]) -> npt.NDArray[np.float64]:
    """North, east, down as north, east, height; null is NaN."""
    return np.array(position_ned, dtype=np.float64) * (1.0, 1.0, -1.0)


def ticks(path: Path) -> Iterator[RecordedTick]:
    """The frames of a recording as the loop took and sent them, in the file's order. Raises UnreadableRecording."""
    framer, received, sent, said = Framer(), list[Frame](), list[bytes](), list[Rating]()
    own = f"/mavlink/{GROUND_SYSTEM}_{GROUND_COMPONENT}/raw"
    with _readable(path), path.open("rb") as stream:
        reader = NonSeekingReader(stream, validate_crcs=True, record_size_limit=RECORD_SIZE_LIMIT)
        for _schema, channel, message in reader.iter_messages(log_time_order=False):
            if channel.topic == own:
                sent.append(message.data)
            elif channel.message_encoding == "mavlink":
                received += framer.frames(message.log_time, message.data)
            elif channel.topic == "/ratings":
                content = orjson.loads(message.data)
                whom = content["vehicle"]
                said.append(Rating(content["rater"], None if whom == "swarm" else whom, content["rating"]))
            elif channel.topic == "/tick":
                content = orjson.loads(message.data)
                yield RecordedTick(message.log_time, received, sent, (*content["events"], *said))
                received, sent, said = [], [], []


FRESH_S = 0.3
"""Older telemetry says nothing of this tick."""
SteeredTick = tuple[int, Table, Table, Table]
"""(tick, set-points sent, velocities, positions), (N, 2) each: m/s and m, NaN where there is none."""


def steered(path: Path) -> Iterator[SteeredTick]:
    """Every tick at which set-points flowed, in order. Raises UnreadableRecording."""
    setpoint: dict[str, Any] | None = None
    with _readable(path), path.open("rb") as stream:
        reader = NonSeekingReader(stream, validate_crcs=True, record_size_limit=RECORD_SIZE_LIMIT)
        for _schema, channel, message in reader.iter_messages(log_time_order=False):
            if channel.topic == "/setpoint":
                setpoint = orjson.loads(message.data)
            elif channel.topic == "/swarm/state":
                fleet = orjson.loads(message.data)
            elif channel.topic == "/tick" and setpoint is not None:
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
