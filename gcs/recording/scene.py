"""/swarm/scene: the swarm at a glance, foxglove.SceneUpdate, whole in every message so that a viewer may jump anywhere.

Vehicles move with their own frames (/tf) between two messages; links, trails and the virtual leader with each message.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

from gcs.gate import LOST_NS
from gcs.loop import Tick
from gcs.mission import plan
from gcs.recording import shapes
from gcs.recording.shapes import Look, colour
from gcs.recording.transforms import SWARM, body, position_enu
from gcs.scoring import DISTRUSTED
from gcs.summary import trust_of
from gcs.track import Parts, parts_of
from gcs.trust_colour import trust_colour
from scenarios import Scenario

Array = npt.NDArray[np.float64]

SHADES = 20
"""Steps of trust: what changes by less looks as before."""
TRAIL_NS, TRAIL_POINTS, TRAIL_PX = 1_000_000_000, 30, 2.0
"""Between two points of a vehicle's trail, how many it has, and how wide it is."""
LINK_PX, SEEN_PX = 24.0, 0.5
"""Width of a link of weight 1, and the narrowest that is drawn."""
LEADER_M = 0.6
"""Across the virtual leader."""
WORDS = "leads", "distrusted", "left behind", "silent", "not ours"
"""On a vehicle's label."""


class Scene:
    """The message, kept from one to the next; entities are made anew where they look otherwise than before."""

    def __init__(self, scenario: Scenario) -> None:
        swarm = scenario.swarm
        ids = range(1, swarm.count + 1)
        self._plan = plan(scenario)
        self._height_m = swarm.altitude_m
        self._asks_for_trust = trust_of(scenario) is not None
        self._at_first = Parts(0.0, swarm.leaders, ())
        self._calls = -1
        self._looks: list[Look | None] = [None] * swarm.count
        self._colours = [colour(shapes.PATH)] * swarm.count
        self._point_ns = 0
        self._update = SceneUpdate()
        entities = self._update.entities
        self._path, self._leader, self._links, self._trails = (
            entities.add(frame_id=SWARM, id=name, frame_locked=True)
            for name in ("path", "virtual leader", "links", "trails")
        )
        self._vehicles = [entities.add(id=body(system)) for system in ids]
        for _ in ids:
            self._trails.lines.add(
                pose=shapes.pose(), thickness=TRAIL_PX, scale_invariant=True, points=[shapes.point(0.0, 0.0, 0.0)]
            )

    def at(self, tick: Tick) -> bytes:
        """The whole scene, once the swarm's frame is known; positions are telemetry's."""
        places: list[list[float]] = position_enu(tick).tolist()
        self._draw_path(tick.diagnosis.mission_s)
        self._draw_leader(tick)
        self._draw_vehicles(tick)
        self._draw_trails(places, tick.time_ns)
        self._draw_links(places, tick)
        seconds, nanoseconds = divmod(tick.time_ns, 1_000_000_000)
        for entity in self._update.entities:
            entity.timestamp.seconds, entity.timestamp.nanos = seconds, nanoseconds
        return bytes(self._update.SerializeToString())

    def _draw_path(self, mission_s: float) -> None:
        calls = sum(ahead[0].begins_s <= mission_s + 1e-9 for ahead in self._plan.known[1:])
        if calls != self._calls:
            self._calls = calls
            self._path.CopyFrom(shapes.path(self._plan, calls, self._height_m))

    def _draw_leader(self, tick: Tick) -> None:
        virtual = tick.diagnosis.virtual
        del self._leader.spheres[:], self._leader.texts[:]
        if virtual is not None:
            north, east = virtual.position_ne.tolist()
            paint = colour(shapes.LEADER)
            self._leader.spheres.append(shapes.ball(LEADER_M, paint, east, north, self._height_m))
            self._leader.texts.append(shapes.text("virtual leader", east, north, self._height_m - 1.0, paint))

    def _draw_vehicles(self, tick: Tick) -> None:
        for row, look in enumerate(self._looks_at(tick)):
            if look != self._looks[row]:
                self._looks[row] = look
                self._colours[row] = colour(look.colour)
                self._vehicles[row].CopyFrom(shapes.vehicle(row + 1, look))

    def _looks_at(self, tick: Tick) -> list[Look]:
        """Of each vehicle."""
        parts = parts_of(tick) or self._at_first
        trust = tick.diagnosis.trust if self._asks_for_trust else np.full(len(tick.swarm.ids), np.nan)
        shades: list[tuple[float, float, float]] = list(map(tuple, trust_colour(np.round(trust * SHADES) / SHADES)))
        told = (
            [system in parts.leaders for system in tick.swarm.ids],
            (trust < DISTRUSTED).tolist(),
            [system in parts.left_behind for system in tick.swarm.ids],
            (tick.time_ns - tick.swarm.position_ns > LOST_NS).tolist(),
            tick.state.released.tolist(),
        )
        looks = []
        for system, shade, *flags in zip(tick.swarm.ids, shades, *told, strict=True):
            _leads, distrusted, left, silent, _released = flags
            words = [word for word, so in zip(WORDS, flags, strict=True) if so]
            label = f"{system}: {', '.join(words)}" if words else str(system)
            looks.append(Look(shade, label, ringed=distrusted or left, faded=silent))
        return looks

    def _draw_trails(self, places: list[list[float]], time_ns: int) -> None:
        """The last point of each goes along with its vehicle."""
        another = time_ns - self._point_ns >= TRAIL_NS
        for line, paint, (east, north, up) in zip(self._trails.lines, self._colours, places, strict=True):
            line.color.CopyFrom(paint)
            if another:
                line.points.add()
                del line.points[:-TRAIL_POINTS]
            last = line.points[-1]
            last.x, last.y, last.z = east, north, up
        if another:
            self._point_ns = time_ns

    def _draw_links(self, places: list[list[float]], tick: Tick) -> None:
        """A line for each two of whom one heeds the other, as wide as the larger of both weights."""
        del self._links.lines[:]
        decision = tick.diagnosis.decision
        if decision is None:
            return
        weights = decision.graph.dense(decision.weights)
        width = np.triu(LINK_PX * np.maximum(weights, weights.T), 1)
        trust = tick.diagnosis.trust.tolist()
        for one, other in np.argwhere(width >= SEEN_PX).tolist():
            line = self._links.lines.add(
                type=LinePrimitive.LINE_LIST,
                pose=shapes.pose(),
                thickness=float(width[one, other]),
                scale_invariant=True,
                color=self._colours[one if trust[one] < trust[other] else other],
            )
            for east, north, up in (places[one], places[other]):
                line.points.add(x=east, y=north, z=up)
