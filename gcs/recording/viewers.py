"""What a viewer draws of a flight without being configured: Foxglove's well-known schemas, in protobuf.

`Viewers.of` yields finished bytes with the class that reads them: the recorder writes them as they are, and takes the
schema of a topic's channel from the class. Viewers' frames are ENU and FLU (REP-103): "swarm" is where the mission
begins, "uav_<id>" the body of a vehicle, "formation" goes along with the mean of all vehicles.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

from gcs.loop import Tick
from gcs.recording.fixes import Fixes
from gcs.recording.said import Sayings
from gcs.recording.scene import Scene
from gcs.recording.transforms import Transforms
from gcs.summary import trust_of
from scenarios import Scenario

FIX_S = 1.0
"""Between two fixes of a vehicle: maps draw the way it came."""
SCENE_S = 0.5
"""Between two scenes: what is in them moves smoothly all the same, with frames that /tf tells every tick."""


class Drawn(NamedTuple):
    """One message."""

    topic: str
    kind: type[Any]
    """The class of foxglove_schemas_protobuf that reads it."""
    data: bytes


class Viewers:
    """Turns ticks into messages; keeps what does not change from one to the next."""

    def __init__(self, scenario: Scenario) -> None:
        ids = tuple(range(1, scenario.swarm.count + 1))
        self._transforms = Transforms(ids)
        self._fixes = Fixes(ids)
        self._fix_topics = [f"/uav/{system}/fix" for system in ids]
        self._fix_ticks = scenario.time.ticks(FIX_S)
        self._scene = Scene(scenario)
        self._scene_ticks = scenario.time.ticks(SCENE_S)
        self._sayings = Sayings(scenario)
        self._asks_for_trust = trust_of(scenario) is not None
        self._unasked = np.full(len(ids), np.nan)

    def of(self, tick: Tick) -> Iterator[Drawn]:
        """Everything that this turn of the loop has for viewers; places only once the swarm's frame is known."""
        for sentence in self._sayings.at(tick):
            yield Drawn("/log", Log, sentence)
        frame = tick.state.frame
        if frame is None:
            return
        yield Drawn("/tf", FrameTransforms, self._transforms.at(tick))
        trust = tick.diagnosis.trust if self._asks_for_trust else self._unasked
        if tick.number % self._fix_ticks == 0:
            for topic, fix in zip(self._fix_topics, self._fixes.at(tick, frame, trust), strict=True):
                yield Drawn(topic, LocationFix, fix)
        if tick.number % self._scene_ticks == 0:
            yield Drawn("/swarm/scene", SceneUpdate, self._scene.at(tick, trust))
