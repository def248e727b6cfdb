"""A recording's messages as rows of tables, as they go by: nothing is kept longer than its tick.

Lists over vehicles are in the order of their system ids, which count from 1.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import orjson

from gcs.recording.layouts import layout
from gcs.recording.tables import (
    FAULTS,
    LINKS,
    MISSION,
    OF_VEHICLES,
    RATINGS,
    REJECTED,
    ROLES,
    STATES,
    TICKS,
    VEHICLES,
    WEIGHTS,
    OfVehicle,
    Table,
    of_message,
    path,
)
from gcs.recording.topics import (
    EvidenceTopic,
    FaultTopic,
    FleetTopic,
    LinkTopic,
    MissionTopic,
    RatingTopic,
    RolesTopic,
    TickTopic,
    WeightsTopic,
)
from wire.frames import Frame

Content = Mapping[str, Any]
"""A message of ours, out of its JSON."""
Row = tuple[Any, ...]
"""A value for each column; None where nothing was told."""
Rows = Iterator[tuple[Table, Row]]


def of_frame(frame: Frame) -> tuple[Table, Row] | None:
    """A row of its message's table; None of a message that our dialect lacks."""
    known, table = layout(frame.message), of_message(frame.message)
    if known is None or table is None:
        return None
    row: list[Any] = [frame.time_ns, frame.system, frame.component]
    for value in known.read(frame.payload).values():
        row += value if isinstance(value, tuple) else (value,)
    return table, tuple(row)


def _state(vehicle: int, content: Content, time_ns: int) -> Row:
    told = (content["custom_mode"], content["armed"], content["battery"])
    return (content["tick"], time_ns, vehicle, *content["attitude_rad"], *told)


def _rating(content: Content, time_ns: int) -> Rows:
    whom = None if content["vehicle"] == "swarm" else content["vehicle"]
    yield RATINGS, (content["tick"], time_ns, content["time_s"], content["rater"], whom, content["rating"])


def _roles(content: Content, time_ns: int) -> Rows:
    for key, role in (("leaders", "leader"), ("left_behind", "left behind")):
        for vehicle in content[key]:
            yield ROLES, (content["tick"], time_ns, content["mission_s"], vehicle, role)


def _fault(content: Content, time_ns: int) -> Rows:
    definition = orjson.dumps(content["definition"]).decode()
    told = (content["mission_s"], content["vehicle"], content["kind"], content["active"])
    yield FAULTS, (time_ns, *told, definition)


def _link(content: Content, time_ns: int) -> Rows:
    counts = (content[column.name] for column in LINKS.columns[3:])
    for vehicle, row in enumerate(zip(*counts, strict=True), 1):
        yield LINKS, (content["tick"], time_ns, vehicle, *row)
    for reason, count in content["rejected"].items():
        yield REJECTED, (content["tick"], time_ns, reason, count)


OF_A_TICK = {path(topic) for topic in (MissionTopic, EvidenceTopic, WeightsTopic, *(one.topic for one in OF_VEHICLES))}
"""Topics whose rows are made when the tick itself is told, which comes last of it."""
OF_ITSELF: dict[str, Callable[[Content, int], Rows]] = {
    path(RatingTopic): _rating,
    path(RolesTopic): _roles,
    path(FaultTopic): _fault,
    path(LinkTopic): _link,
}
"""Topics whose rows are made at once."""
_STATE = re.compile(r"/uav/(\d+)/state")


class Tidy:
    """Gathers what is told of one tick."""

    def __init__(self) -> None:
        self._told: dict[str, Content] = {}

    def rows(self, topic: str, time_ns: int, data: bytes) -> Rows:
        """The rows that a message completes; of a topic that is none of ours there are none. data: its JSON."""
        if topic in OF_A_TICK:
            self._told[topic] = orjson.loads(data)
        elif topic == path(TickTopic):
            yield from self._tick(orjson.loads(data), time_ns)
        elif topic in OF_ITSELF:
            yield from OF_ITSELF[topic](orjson.loads(data), time_ns)
        elif (of_vehicle := _STATE.fullmatch(topic)) is not None:
            yield STATES, _state(int(of_vehicle[1]), orjson.loads(data), time_ns)

    def _tick(self, content: Content, time_ns: int) -> Rows:
        number = content["number"]
        told = {topic: said for topic, said in self._told.items() if said["tick"] == number}
        self._told = {}
        mission = told.get(path(MissionTopic), {})
        evidence = told.get(path(EvidenceTopic), {})
        when = (number, time_ns, mission.get("mission_s"))
        turn = (content["phase"], content["frames"], content["lateness_ns"], "; ".join(content["events"]))
        yield TICKS, (*when, *turn, evidence.get("velocity_noise_m_s"), evidence.get("position_noise_m"))
        if mission:
            yield MISSION, (*when, *(mission[column.name] for column in MISSION.columns[len(when) :]))
        yield from _weights(told.get(path(WeightsTopic), {}))
        yield from _vehicles(told, when)


def _weights(content: Content) -> Rows:
    for robot, row in enumerate(content.get("weights", ()), 1):
        for heeds, weight in enumerate(row, 1):
            if weight:
                yield WEIGHTS, (content["tick"], content["mission_s"], robot, heeds, weight)


def _vehicles(told: Mapping[str, Content], when: Row) -> Rows:
    """told: topic → what it told of the tick."""
    count = len(told.get(path(FleetTopic), {}).get("age_s", ()))
    columns = (_over_vehicles(source, told, count) for source in OF_VEHICLES)
    for vehicle, values in enumerate(zip(*columns, strict=True), 1):
        yield VEHICLES, (*when, vehicle, *values)


def _over_vehicles(source: OfVehicle, told: Mapping[str, Content], count: int) -> list[Any]:
    """(N,) values of one column."""
    values = told.get(path(source.topic), {}).get(source.key)
    if values is None:
        return [None] * count
    return list(values) if source.axis is None else [vector[source.axis] for vector in values]
