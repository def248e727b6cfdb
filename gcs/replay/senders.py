"""Who spoke in a recording: vehicles, ground stations, and parts of either."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from gcs.messages import GROUND_COMPONENT, GROUND_SYSTEM, HEARTBEAT
from gcs.recording.channels import raw_sender
from gcs.replay.index import Times
from gcs.routes import introduces, of_station
from wire.frames import Frame, Framer
from wire.ids import TRUTH

Name = tuple[int, int]
"""System and component."""

LISTENED_NS = 10_000_000_000
"""Recorded time: whoever beats at all has done so by then."""


@dataclass(frozen=True, slots=True)
class Senders:
    """Those who introduced themselves."""

    vehicles: tuple[int, ...]
    """System ids whose autopilot beats, ascending."""
    stations: frozenset[Name]
    """Ground stations, our own among them."""

    def of_vehicle(self, frame: Frame) -> bool:
        """Whether a vehicle sent it, and not a ground station that calls itself alike, nor the simulation's truth."""
        return (
            frame.system in self.vehicles
            and frame.component != TRUTH
            and (frame.system, frame.component) not in self.stations
            and not (frame.message == HEARTBEAT and of_station(frame))
        )


def senders(reader: Any, heard: Mapping[str, Times]) -> Senders:
    """From the first heartbeats of everybody; reader: of mcap;  heard: topic → times of its messages, ns."""
    vehicles, stations = set[int](), {(GROUND_SYSTEM, GROUND_COMPONENT)}
    for topic, times in heard.items():
        if raw_sender(topic) is None:
            continue
        for frame in _beats(reader, topic, int(times[0])):
            if of_station(frame):
                stations.add((frame.system, frame.component))
            elif introduces(frame):
                vehicles.add(frame.system)
            break
    return Senders(tuple(sorted(vehicles)), frozenset(stations))


def _beats(reader: Any, topic: str, since_ns: int) -> Iterator[Frame]:
    framer = Framer()
    listened = reader.iter_messages(topics=topic, starting_at=since_ns, ending_before=since_ns + LISTENED_NS)
    for _schema, _channel, message in listened:
        yield from (frame for frame in framer.frames(message.log_time, message.data) if frame.message == HEARTBEAT)
