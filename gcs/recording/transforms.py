"""/tf: where each vehicle is and how it is turned, foxglove.FrameTransforms out of NED and FRD telemetry."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion

from gcs.loop import Tick

Array = npt.NDArray[np.float64]

SWARM = "swarm"
"""The frame of the swarm: x east, y north, z up, from where the mission begins, at the vehicles' homes' height."""

FORMATION = "formation"
"""The frame that goes along with the mean of all vehicles, turned as the swarm is: what is drawn in it goes along."""
GRAIN_M, GRAIN_TURN = 2.0**-10, 2.0**-20
"""How fine places and turns are told: finer than telemetry, and numbers of few digits pack well."""


def body(system: int) -> str:
    """The frame of a vehicle: x forward, y left, z up."""
    return f"uav_{system}"


def position_enu(tick: Tick) -> Array:
    """(N, 3) m in the swarm's frame, by telemetry; NaN until that frame is known."""
    enu = np.empty((len(tick.swarm.ids), 3))
    enu[:, 1::-1] = tick.diagnosis.position_ne
    enu[:, 2] = -tick.swarm.position_ned[:, 2]
    return enu


def enu_of_flu(attitude_rpy: Array) -> Array:
    """(N, 4) unit quaternions x, y, z, w that turn FLU bodies into ENU, of roll, pitch and yaw (N, 3) [rad].

    Roll, pitch and yaw turn FRD into NED, about z, then y, then x (MAVLink's ATTITUDE). The way round is
    (0, 1, 1, 0)/√2, half a turn about north-east, times that, times (0, 1, 0, 0), half a turn about forward.
    """
    (c1, c2, c3), (s1, s2, s3) = np.cos(0.5 * attitude_rpy).T, np.sin(0.5 * attitude_rpy).T
    w = c1 * c2 * c3 + s1 * s2 * s3
    x = s1 * c2 * c3 - c1 * s2 * s3
    y = c1 * s2 * c3 + s1 * c2 * s3
    z = c1 * c2 * s3 - s1 * s2 * c3
    return np.asarray(np.sqrt(0.5) * np.stack([x + y, x - y, w - z, w + z], axis=-1))


class Transforms:
    """The message, kept from tick to tick: most of it never changes."""

    def __init__(self, ids: Sequence[int]) -> None:
        self._message = FrameTransforms()
        for child in (*map(body, ids), FORMATION):
            self._message.transforms.add(parent_frame_id=SWARM, child_frame_id=child, rotation=Quaternion(w=1.0))
        self._parts = [(one.timestamp, one.translation, one.rotation) for one in self._message.transforms]
        self._attitude_rpy: Array | None = None

    def at(self, tick: Tick) -> bytes:
        """Of all vehicles, once the swarm's frame is known. Whose attitude was not told is level and heads north."""
        seconds, nanoseconds = divmod(tick.time_ns, 1_000_000_000)
        places = np.empty((len(self._parts), 3))
        places[:-1] = position_enu(tick)
        places[-1] = places[:-1].sum(axis=0) / len(places[:-1])
        for (time, place, _), (east, north, up) in zip(self._parts, _grained(places, GRAIN_M).tolist(), strict=True):
            time.seconds, time.nanos = seconds, nanoseconds
            place.x, place.y, place.z = east, north, up
        self._turn(tick.swarm.attitude_rpy)
        return bytes(self._message.SerializeToString())

    def _turn(self, attitude_rpy: Array) -> None:
        """Attitudes come seldom, and in a new array when they do."""
        if attitude_rpy is self._attitude_rpy:
            return
        self._attitude_rpy = attitude_rpy
        quaternions = _grained(enu_of_flu(np.nan_to_num(attitude_rpy)), GRAIN_TURN)
        for (_, _, rotation), (x, y, z, w) in zip(self._parts[:-1], quaternions.tolist(), strict=True):
            rotation.x, rotation.y, rotation.z, rotation.w = x, y, z, w


def _grained(values: Array, grain: float) -> Array:
    return np.asarray(np.round(values / grain) * grain)
