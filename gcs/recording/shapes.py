"""What viewers draw in the 3-D scene: vehicles, the path and its targets, as entities of foxglove.SceneUpdate.

Sizes are metres, about twice those of the vehicles; lines and letters are pixels, so that they are seen from afar.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
from foxglove_schemas_protobuf.ArrowPrimitive_pb2 import ArrowPrimitive
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.CylinderPrimitive_pb2 import CylinderPrimitive
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SpherePrimitive_pb2 import SpherePrimitive
from foxglove_schemas_protobuf.TextPrimitive_pb2 import TextPrimitive
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3

from gcs.mission import Plan, Segment
from gcs.recording.looks import Look
from gcs.recording.transforms import SWARM, body

Array = npt.NDArray[np.float64]

ARM, ROTOR = 0.4, 0.5
"""m from the middle to each rotor, and across one."""
RING = 1.1
"""m: radius of what is drawn round a robot that somebody should look at."""
MAST, BALL = 0.15, 1.0
"""m across a target's mast, and the ball on it."""
LABEL = 16.0
"""Pixels."""
FADED = 0.35
"""Opacity of what is there no longer: a vehicle that is silent, the rest of a leg that a call cut short."""
PATH, TARGET, LEADER = (0.55, 0.57, 0.60), (0.91, 0.64, 0.0), (0.11, 0.62, 0.55)
"""Red, green, blue: seen on black and on white."""


def colour(rgb: tuple[float, float, float], opacity: float = 1.0) -> Color:
    """As the schema has it."""
    red, green, blue = rgb
    return Color(r=red, g=green, b=blue, a=opacity)


def vehicle(system: int, look: Look) -> SceneEntity:
    """A quadrotor from above: an X, four rotors, and an arrow ahead; it moves with its own frame."""
    paint, ahead = colour(look.colour, FADED if look.faded else 1.0), ARM * math.sqrt(0.5)
    corners = [point(ahead * x, ahead * y, 0.0) for x, y in ((1, 1), (-1, -1), (1, -1), (-1, 1))]
    arms = LinePrimitive(type=LinePrimitive.LINE_LIST, pose=pose(), thickness=0.06, points=corners, color=paint)
    lines = [arms, _ring(paint)] if look.ringed else [arms]
    disc = Vector3(x=ROTOR, y=ROTOR, z=0.04)
    rotors = [CylinderPrimitive(pose=pose(c.x, c.y, 0.03),
                                size=disc, bottom_scale=1.0, top_scale=1.0, color=paint) for c in corners]  # fmt: skip
    nose = ArrowPrimitive(pose=pose(), shaft_length=0.35, shaft_diameter=0.07, head_length=0.25, head_diameter=0.2,
                          color=paint)  # fmt: skip
    label = text(look.label, -2.0 * ARM, 0.0, ARM, colour(look.colour))
    return SceneEntity(
        frame_id=body(system),
        id=body(system),
        frame_locked=True,
        lines=lines,
        cylinders=rotors,
        arrows=[nose],
        texts=[label],
    )


def _ring(paint: Color) -> LinePrimitive:
    turns = np.linspace(0.0, math.tau, 24, endpoint=False)
    points = [point(x, y, 0.0) for x, y in (RING * np.stack([np.cos(turns), np.sin(turns)], axis=-1)).tolist()]
    return LinePrimitive(
        type=LinePrimitive.LINE_LOOP, pose=pose(), thickness=3.0, scale_invariant=True, points=points, color=paint
    )


def path(plan: Plan, calls: int, height_m: float) -> SceneEntity:
    """The legs as they are known after so many emergency calls: those that a call cut short, and what lies ahead."""
    past, ahead = plan.legs(calls)
    entity = SceneEntity(frame_id=SWARM, id="path", frame_locked=True)
    entity.lines.extend(_legs(past, ahead, height_m))
    for number, segment in enumerate((*past, *ahead), start=1):
        _add_target(entity, number, segment, height_m, opacity=FADED if segment in past else 1.0)
    return entity


def _legs(past: tuple[Segment, ...], ahead: tuple[Segment, ...], height_m: float) -> Iterator[LinePrimitive]:
    flown = [(segment.start_ne, segment.end_ne) for segment in (*past, *ahead)]
    cut = [(leg.end_ne, leg.planned_end_ne) for leg in past if not np.allclose(leg.end_ne, leg.planned_end_ne)]
    for legs, opacity in ((flown, 1.0), (cut, FADED)):
        points = [point(east, north, height_m) for leg in legs for north, east in leg]
        yield LinePrimitive(
            type=LinePrimitive.LINE_LIST,
            pose=pose(),
            thickness=2.0,
            scale_invariant=True,
            points=points,
            color=colour(PATH, opacity),
        )


def _add_target(entity: SceneEntity, number: int, segment: Segment, height_m: float, *, opacity: float) -> None:
    """A mast up to where the swarm flies, a ball on it, and what is to be done there."""
    north, east = segment.planned_end_ne.tolist()
    paint = colour(TARGET, opacity)
    entity.cylinders.add(
        pose=pose(east, north, 0.5 * height_m),
        size=Vector3(x=0.15, y=0.15, z=height_m),
        bottom_scale=1.0,
        top_scale=1.0,
        color=paint,
    )
    entity.spheres.append(ball(BALL, paint, east, north, height_m))
    entity.texts.append(text(f"target {number}: {segment.task}", east, north, height_m + 1.5, paint))


def ball(across: float, paint: Color, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> SpherePrimitive:
    """So many metres across."""
    return SpherePrimitive(pose=pose(x, y, z), size=Vector3(x=across, y=across, z=across), color=paint)


def text(words: str, x: float, y: float, z: float, paint: Color) -> TextPrimitive:
    """Words that face whoever looks."""
    return TextPrimitive(
        pose=pose(x, y, z), billboard=True, font_size=LABEL, scale_invariant=True, color=paint, text=words
    )


def pose(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Pose:
    """There, and not turned."""
    return Pose(position=Vector3(x=x, y=y, z=z), orientation=Quaternion(w=1.0))


def point(x: float, y: float, z: float) -> Point3:
    """As the schema has it."""
    return Point3(x=x, y=y, z=z)
