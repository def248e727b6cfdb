"""Our own topics of a recording: frozen dataclasses that are their own JSON, and their JSON Schemas.

NaN is written as null. Lists over vehicles are in the order of their system ids.
"""

from __future__ import annotations

import inspect
import re
from dataclasses import dataclass, fields
from functools import cache
from typing import Any

import numpy.typing as npt

SCHEMA = "trustr."
"""Before a topic's title: the name of its schema."""
Vector = npt.NDArray[Any]
"""One number for each vehicle."""
Table = npt.NDArray[Any]
"""A row for each vehicle."""


@dataclass(frozen=True, slots=True, eq=False)
class TickTopic:
    """/tick: one turn of the loop. The raw frames between two of these are what it received and sent."""

    number: int
    frames: int
    """How many received frames it consumed."""
    lateness_ns: int
    """After its deadline."""
    phase: str
    events: list[str]
    """What an operator asked for."""


@dataclass(frozen=True, slots=True, eq=False)
class MissionTopic:
    """/mission: where the virtual leader is."""

    tick: int
    mission_s: float
    """Since mission start."""
    task: str
    north_m: float
    east_m: float
    velocity_north_m_s: float
    velocity_east_m_s: float


@dataclass(frozen=True, slots=True, eq=False)
class TrustTopic:
    """/trust: what the ground station believes of each vehicle, 0 to 1."""

    tick: int
    mission_s: float
    trust: Vector


@dataclass(frozen=True, slots=True, eq=False)
class EvidenceTopic:
    """/evidence: what trust was drawn from; log odds are of being faulty, positive speaks against a vehicle."""

    tick: int
    mission_s: float
    log_odds: Vector
    """From behaviour."""
    spoken: Vector
    """Log odds from ratings."""
    response_m_s: Vector
    """Velocity off what a healthy vehicle would make of its set-points, smoothed."""
    inconsistency_m: Vector
    """Position off where the vehicle's own velocities take it, smoothed."""
    disagreement_m_s: Vector
    """Velocity off the median of its trusted neighbours, smoothed."""
    velocity_noise_m_s: float
    """Standard deviation of telemetry's white noise, an axis, as estimated."""
    position_noise_m: float


@dataclass(frozen=True, slots=True, eq=False)
class RatingTopic:
    """/ratings: what a person said, at the tick at which it counted, and what was believed then."""

    tick: int
    time_s: float
    """Since mission start; null before."""
    rater: str
    vehicle: int | str
    """System id, or "swarm"."""
    rating: int
    trust: Vector
    """Of all vehicles, with this rating counted."""


@dataclass(frozen=True, slots=True, eq=False)
class RolesTopic:
    """/roles: who leads, and who was left behind, whenever it changes."""

    tick: int
    mission_s: float
    leaders: list[int]
    left_behind: list[int]


@dataclass(frozen=True, slots=True, eq=False)
class WeightsTopic:
    """/weights: row i is how much robot i heeds each robot, eq. 17; rows sum to 1."""

    tick: int
    mission_s: float
    weights: Table


@dataclass(frozen=True, slots=True, eq=False)
class SetpointTopic:
    """/setpoint: velocities (north, east, down) m/s that the controller asked for and that passed the gate."""

    tick: int
    asked: Table | None
    sent: Table | None
    verdict: Vector | None
    """0 as asked, 1 slowed, 2 asked to stop (no number, or too late), 3 kept inside its fence, 4 sent nothing."""
    commanded: Vector | None
    """False for vehicles that were sent none."""


@dataclass(frozen=True, slots=True, eq=False)
class FleetTopic:
    """/swarm/state: where telemetry has all vehicles, every tick."""

    tick: int
    position_m: Table
    """North, east of the swarm's origin, down from each vehicle's own."""
    velocity_m_s: Table
    age_s: Vector
    """Of both."""


@dataclass(frozen=True, slots=True, eq=False)
class StateTopic:
    """/uav/<sysid>/state: one vehicle as telemetry tells it, twice a second."""

    tick: int
    position_m: Vector
    """North, east of the swarm's origin, down from its own."""
    velocity_m_s: Vector
    attitude_rad: Vector
    """Roll, pitch, yaw."""
    age_s: float
    """Of position and velocity."""
    custom_mode: int
    armed: bool
    battery: float
    """0 to 1."""


@dataclass(frozen=True, slots=True, eq=False)
class PoseTopic:
    """/truth/pose: where a simulation's vehicles really are."""

    tick: int
    mission_s: float
    position_m: Table
    """North, east of the swarm's origin, height above home."""
    velocity_m_s: Table


@dataclass(frozen=True, slots=True, eq=False)
class LinkTopic:
    """/link: how the vehicles were heard since each was first heard, once a second; live flights only."""

    tick: int
    received: Vector
    """Frames of each autopilot, each counted once."""
    lost: Vector
    reordered: Vector
    duplicated: Vector
    rejected: dict[str, Any]
    """Reason → how many frames of anybody were refused for it."""


@dataclass(frozen=True, slots=True, eq=False)
class FaultTopic:
    """/truth/fault: a fault of the scenario begins or ends."""

    mission_s: float
    vehicle: int
    kind: str
    active: bool
    definition: dict[str, Any]
    """As the scenario has it."""


NUMBER: dict[str, Any] = {"type": ["number", "null"]}
JSON_TYPES: dict[str, dict[str, Any]] = {
    "int": {"type": "integer"},
    "float": NUMBER,
    "str": {"type": "string"},
    "bool": {"type": "boolean"},
    "int | str": {"type": ["integer", "string"]},
    "list[int]": {"type": "array", "items": {"type": "integer"}},
    "list[str]": {"type": "array", "items": {"type": "string"}},
    "dict[str, Any]": {"type": "object"},
    "Vector": {"type": "array", "items": {"type": ["number", "boolean", "null"]}},
    "Table": {"type": "array", "items": {"type": "array", "items": NUMBER}},
}


def _json_type(annotation: str) -> dict[str, Any]:
    return JSON_TYPES[annotation.removesuffix(" | None")]


@cache
def schema(topic: type[Any]) -> dict[str, Any]:
    """The JSON Schema of a topic's class, with its sentences as descriptions."""
    said = _sentences(topic)
    return {
        "title": topic.__name__.removesuffix("Topic"),
        "description": inspect.cleandoc(topic.__doc__ or ""),
        "type": "object",
        "properties": {
            field.name: _json_type(str(field.type)) | ({"description": said[field.name]} if field.name in said else {})
            for field in fields(topic)
        },
        "required": [field.name for field in fields(topic)],
    }


def _sentences(topic: type) -> dict[str, str]:
    """Field name → the string literal under it."""
    return dict(re.findall(r'^    (\w+): .*\n    """(.*?)"""', inspect.getsource(topic), flags=re.MULTILINE))
