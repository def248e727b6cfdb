"""Tidy tables of a flight: which there are, and what their columns mean.

What a column means is said once: by the topic it comes from, by `column_words`, or by the MAVLink dialect.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from gcs.recording.column_words import WORDS
from gcs.recording.layouts import Field, layout
from gcs.recording.topics import (
    EvidenceTopic,
    FaultTopic,
    FleetTopic,
    LinkTopic,
    MissionTopic,
    PoseTopic,
    RatingTopic,
    RolesTopic,
    SetpointTopic,
    StateTopic,
    TickTopic,
    TrustTopic,
    WeightsTopic,
    schema,
)

AXES = ("north", "east", "down", "height")
UNITS = {"_m_s": "m/s", "_rad": "rad", "_ns": "ns", "_m": "m", "_s": "s"}
"""The end of a column's name → its unit."""


@dataclass(frozen=True, slots=True)
class Column:
    """One column of a table."""

    name: str
    type: str
    """As Arrow calls it: int64, float64, float32, uint8 and so on, bool, string."""
    unit: str
    """m/s, or as MAVLink writes it; "" if it has none."""
    sentence: str

    @property
    def axis(self) -> str:
        """That its numbers are along, or ""."""
        return next((axis for axis in AXES if axis in self.name.split("_")), "")


@dataclass(frozen=True, slots=True)
class Table:
    """A table without its rows."""

    name: str
    sentence: str
    columns: tuple[Column, ...]


@dataclass(frozen=True, slots=True)
class OfVehicle:
    """Where a column of `vehicles` comes from: a list over vehicles, or one axis of a list of vectors."""

    topic: type
    key: str
    axis: int | None
    column: Column


def path(topic: type) -> str:
    """Where a topic is recorded: it says so itself."""
    return _sentence(topic).partition(":")[0]


def _sentence(topic: type) -> str:
    said: str = schema(topic)["description"]
    return said


def _column(topic: type, key: str, name: str | None = None, type_: str = "float64") -> Column:
    """What a topic tells under a key; in the topic's own words, unless they are about more than this column."""
    name = key if name is None else name
    unit = next((unit for end, unit in UNITS.items() if name.endswith(end)), "")
    said = WORDS.get((topic, name)) or schema(topic)["properties"][key]["description"]
    return Column(name, type_, unit, said)


def _numbers(topic: type, *keys: str) -> tuple[OfVehicle, ...]:
    return tuple(OfVehicle(topic, key, None, _column(topic, key)) for key in keys)


def _vectors(topic: type, key: str, *names: str) -> tuple[OfVehicle, ...]:
    return tuple(OfVehicle(topic, key, axis, _column(topic, key, name)) for axis, name in enumerate(names))


TIME = Column("time_ns", "int64", "ns", "Since 1970: a frame's arrival or departure, else the tick's.")
TICK = _column(TickTopic, "number", "tick", "int64")
MISSION_S = _column(MissionTopic, "mission_s")
VEHICLE = Column("vehicle", "int64", "", "System id.")

OF_VEHICLES = (
    *_vectors(FleetTopic, "position_m", "north_m", "east_m", "down_m"),
    *_vectors(FleetTopic, "velocity_m_s", "velocity_north_m_s", "velocity_east_m_s", "velocity_down_m_s"),
    *_numbers(FleetTopic, "age_s"),
    *_vectors(PoseTopic, "position_m", "truth_north_m", "truth_east_m", "truth_height_m"),
    *_vectors(
        PoseTopic, "velocity_m_s", "truth_velocity_north_m_s", "truth_velocity_east_m_s", "truth_velocity_down_m_s"
    ),
    *_numbers(TrustTopic, "trust"),
    *_numbers(EvidenceTopic, "log_odds", "spoken", "response_m_s", "inconsistency_m", "disagreement_m_s"),
    *_vectors(SetpointTopic, "asked", "asked_north_m_s", "asked_east_m_s", "asked_down_m_s"),
    *_vectors(SetpointTopic, "sent", "sent_north_m_s", "sent_east_m_s", "sent_down_m_s"),
    OfVehicle(SetpointTopic, "verdict", None, _column(SetpointTopic, "verdict", type_="int64")),
    OfVehicle(SetpointTopic, "commanded", None, _column(SetpointTopic, "commanded", type_="bool")),
)

VEHICLES = Table(
    "vehicles",
    "Each vehicle at each tick: telemetry, truth, trust, evidence and set-point.",
    (TICK, TIME, MISSION_S, VEHICLE, *(source.column for source in OF_VEHICLES)),
)
STATES = Table(
    "states",
    _sentence(StateTopic),
    (
        TICK,
        TIME,
        VEHICLE,
        *(_column(StateTopic, "attitude_rad", f"{angle}_rad") for angle in ("roll", "pitch", "yaw")),
        _column(StateTopic, "custom_mode", type_="int64"),
        _column(StateTopic, "armed", type_="bool"),
        _column(StateTopic, "battery"),
    ),
)
WEIGHTS = Table(
    "weights",
    f"{_sentence(WeightsTopic)} Pairs of weight 0 are left out.",
    (
        TICK,
        MISSION_S,
        Column("robot", "int64", "", "System id of i."),
        Column("heeds", "int64", "", "System id of whom it heeds."),
        Column("weight", "float64", "", WORDS[WeightsTopic, "weight"]),
    ),
)
MISSION = Table(
    "mission",
    _sentence(MissionTopic),
    (
        TICK,
        TIME,
        MISSION_S,
        _column(MissionTopic, "task", type_="string"),
        *(_column(MissionTopic, k) for k in ("north_m", "east_m", "velocity_north_m_s", "velocity_east_m_s")),
    ),
)
TICKS = Table(
    "ticks",
    _sentence(TickTopic),
    (
        TICK,
        TIME,
        MISSION_S,
        _column(TickTopic, "phase", type_="string"),
        _column(TickTopic, "frames", type_="int64"),
        _column(TickTopic, "lateness_ns", type_="int64"),
        _column(TickTopic, "events", type_="string"),
        _column(EvidenceTopic, "velocity_noise_m_s"),
        _column(EvidenceTopic, "position_noise_m"),
    ),
)
RATINGS = Table(
    "ratings",
    _sentence(RatingTopic),
    (
        TICK,
        TIME,
        _column(RatingTopic, "time_s"),
        _column(RatingTopic, "rater", type_="string"),
        Column("vehicle", "int64", "", "System id; none where the whole swarm is rated."),
        _column(RatingTopic, "rating", type_="int64"),
    ),
)
ROLES = Table(
    "roles",
    _sentence(RolesTopic),
    (TICK, TIME, MISSION_S, VEHICLE, Column("role", "string", "", "leader, or left behind.")),
)
FAULTS = Table(
    "faults",
    _sentence(FaultTopic),
    (
        TIME,
        _column(FaultTopic, "mission_s"),
        _column(FaultTopic, "vehicle", type_="int64"),
        _column(FaultTopic, "kind", type_="string"),
        _column(FaultTopic, "active", type_="bool"),
        _column(FaultTopic, "definition", type_="string"),
    ),
)
LINKS = Table(
    "links",
    _sentence(LinkTopic),
    (
        TICK,
        TIME,
        VEHICLE,
        *(_column(LinkTopic, key, type_="int64") for key in ("received", "lost", "reordered", "duplicated")),
    ),
)
REJECTED = Table(
    "rejected",
    "Frames of anybody that were refused, once a second; live flights only.",
    (
        TICK,
        TIME,
        Column("reason", "string", "", "Why they were refused."),
        Column("frames", "int64", "", "How many since the beginning."),
    ),
)
OURS = (VEHICLES, STATES, WEIGHTS, MISSION, TICKS, RATINGS, ROLES, FAULTS, LINKS, REJECTED)

ARROW_TYPES = {"float": "float32", "double": "float64", "char": "string"}
"""MAVLink's type → Arrow's, where taking off its _t does not do."""


@cache
def of_message(message: int) -> Table | None:
    """The table of the MAVLink message with this id, arrays as numbered columns; None if our dialect lacks it."""
    known = layout(message)
    if known is None:
        return None
    columns = (
        TIME,
        Column("system", "uint8", "", "Id of who sent it."),
        Column("component", "uint8", "", "Id of its part that sent it."),
        *(column for field in known.fields for column in _of_field(field)),
    )
    return Table(f"mavlink_{known.name}", known.sentence, columns)


def _of_field(field: Field) -> tuple[Column, ...]:
    numbered = bool(field.length) and not field.text
    names = [f"{field.name}_{place}" for place in range(field.length)] if numbered else [field.name]
    type_ = ARROW_TYPES.get(field.type, field.type.removesuffix("_t"))
    said = " ".join(filter(None, (field.sentence, field.enum and f"({field.enum})")))
    return tuple(Column(name, type_, field.unit, said) for name in names)
