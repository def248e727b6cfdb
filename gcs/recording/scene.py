"""/swarm/scene: the swarm at a glance, foxglove.SceneUpdate, whole in every message so that a viewer may jump anywhere.

Between two messages vehicles move with their own frames, links and the virtual leader with that of the formation (/tf):
what the message tells is where they are beside the others, which changes slowly.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

from gcs.loop import Tick
from gcs.mission import plan
from gcs.recording import shapes
from gcs.recording.looks import Look, looks
from gcs.recording.shapes import colour
from gcs.recording.transforms import FORMATION, SWARM, position_enu
from gcs.track import Parts, parts_of
from scenarios import Scenario

Array = npt.NDArray[np.float64]

TRAIL_NS, TRAIL_POINTS, TRAIL_PX = 1_000_000_000, 30, 2.0
"""Between two points of a vehicle's trail, how many it has, and how wide it is."""
GRAIN = 64
"""Points of a trail are told to this fraction of a metre: numbers of few digits pack well."""
LINK_PX, SEEN_PX = 16.0, 0.5
"""Width of a link of weight 1, and the narrowest that is drawn."""
LEADER_M = 0.6
"""Across the virtual leader."""


class Scene:
    """The message, kept from one to the next; what looks as before is not made anew."""

    def __init__(self, scenario: Scenario) -> None:
        swarm = scenario.swarm
        self._plan = plan(scenario)
        self._height_m = swarm.altitude_m
        self._at_first = Parts(0.0, swarm.leaders, ())
        self._calls = -1
        self._looks: list[Look | None] = [None] * swarm.count
        self._colours = [colour(shapes.PATH)] * swarm.count
        self._point_ns = 0
        self._update = SceneUpdate()
        self._path, self._trails, self._leader, self._links = (
            self._update.entities.add(frame_id=frame, id=name, frame_locked=True)
            for name, frame in (
                ("path", SWARM),
                ("trails", SWARM),
                ("virtual leader", FORMATION),
                ("links", FORMATION),
            )
        )
        self._vehicles = [self._update.entities.add() for _ in range(swarm.count)]
        for _ in self._vehicles:
            self._trails.lines.add(pose=shapes.pose(), thickness=TRAIL_PX, scale_invariant=True)

    def at(self, tick: Tick, trust: Array) -> bytes:
        """The whole scene, once the swarm's frame is known; positions are telemetry's.

        trust: (N,) as it is to be shown, NaN where nobody asks for it.
        """
        position = position_enu(tick)
        centre = position.mean(axis=0)
        self._draw_path(tick.diagnosis.mission_s)
        self._draw_vehicles(tick, trust)
        self._draw_trails(position, tick.time_ns)
        self._draw_leader(tick, centre)
        self._draw_links(position - centre, tick)
        seconds, nanoseconds = divmod(tick.time_ns, 1_000_000_000)
        for entity in self._update.entities:
            entity.timestamp.seconds, entity.timestamp.nanos = seconds, nanoseconds
        return bytes(self._update.SerializeToString())

    def _draw_path(self, mission_s: float) -> None:
        """Of a mission that was broken off, whose time is NaN, it stays as it was."""
        calls = self._plan.calls_by(mission_s)
        if calls > self._calls:
            self._calls = calls
            self._path.CopyFrom(shapes.path(self._plan, calls, self._height_m))

    def _draw_vehicles(self, tick: Tick, trust: Array) -> None:
        parts = parts_of(tick) or self._at_first
        for row, look in enumerate(looks(tick, parts, trust)):
            if look != self._looks[row]:
                self._looks[row], self._colours[row] = look, colour(look.colour)
                self._vehicles[row].CopyFrom(shapes.vehicle(tick.swarm.ids[row], look))

    def _draw_trails(self, position: Array, time_ns: int) -> None:
        """The last point of each goes along with its vehicle until it is time for another."""
        another = time_ns - self._point_ns >= TRAIL_NS
        if another:
            self._point_ns = time_ns
        places = (np.round(position * GRAIN) / GRAIN).tolist()
        for line, paint, (east, north, up) in zip(self._trails.lines, self._colours, places, strict=True):
            line.color.CopyFrom(paint)
            if another:
                line.points.add()
                del line.points[:-TRAIL_POINTS]
            last = line.points[-1]
            last.x, last.y, last.z = east, north, up

    def _draw_leader(self, tick: Tick, centre: Array) -> None:
        """The virtual leader, from (3,) the middle of the formation."""
        virtual = tick.diagnosis.virtual
        del self._leader.spheres[:], self._leader.texts[:]
        if virtual is not None:
            north, east = virtual.position_ne
            x, y, z = (np.array([east, north, self._height_m]) - centre).tolist()
            paint = colour(shapes.LEADER)
            self._leader.spheres.append(shapes.ball(LEADER_M, paint, x, y, z))
            self._leader.texts.append(shapes.text("virtual leader", x, y - LEADER_M, z - LEADER_M, paint))

    def _draw_links(self, beside: Array, tick: Tick) -> None:
        """From each robot half the way to each that heeds it, as wide as its weight: whom nobody heeds has none.

        beside: (N, 3) m, where vehicles are from the middle of the formation.
        """
        del self._links.lines[:]
        decision = tick.diagnosis.decision
        if decision is None:
            return
        graph, width = decision.graph, LINK_PX * decision.weights
        seen = (graph.sender != graph.receiver) & (width >= SEEN_PX)
        begin = beside[graph.sender[seen]]
        middle = 0.5 * (begin + beside[graph.receiver[seen]])
        at, wide = shapes.pose(), width[seen].tolist()
        links = zip(graph.sender[seen].tolist(), wide, np.hstack([begin, middle]).tolist(), strict=True)
        for sender, thickness, (x, y, z, east, north, up) in links:
            line = self._links.lines.add(
                type=LinePrimitive.LINE_LIST,
                pose=at,
                thickness=thickness,
                scale_invariant=True,
                color=self._colours[sender],
            )
            line.points.add(x=x, y=y, z=z)
            line.points.add(x=east, y=north, z=up)
