"""/uav/<id>/fix: where each vehicle is on the Earth, foxglove.LocationFix, for viewers with a map."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt
from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix

from gcs.loop import Tick
from gcs.recording.looks import shades
from gcs.recording.shapes import colour
from gcs.recording.transforms import body
from gcs.swarm_frame import SwarmFrame

Array = npt.NDArray[np.float64]

VERTICAL = 2.0
"""Receivers are some two times as far off in height as on the map; they tell of the latter only."""


class Fixes:
    """The messages, kept from one to the next."""

    def __init__(self, ids: Sequence[int]) -> None:
        self._messages = [LocationFix(frame_id=body(system)) for system in ids]

    def at(self, tick: Tick, frame: SwarmFrame, trust: Array) -> Iterator[bytes]:
        """Of each vehicle in the order of their ids, by telemetry; altitude is above mean sea level.

        trust: (N,) as it is to be shown, NaN where nobody asks for it.
        """
        seconds, nanoseconds = divmod(tick.time_ns, 1_000_000_000)
        places = frame.to_geodetic(tick.diagnosis.position_ne).tolist()
        altitudes = np.where(np.isfinite(tick.swarm.home_m), tick.swarm.home_m, tick.swarm.origin[:, 2])
        altitudes = altitudes - tick.swarm.position_ned[:, 2]
        accuracies_m = tick.swarm.accuracy_m.tolist()
        known = zip(self._messages, places, altitudes.tolist(), accuracies_m, shades(trust), strict=True)
        for fix, (latitude, longitude), altitude, accuracy_m, shade in known:
            fix.timestamp.seconds, fix.timestamp.nanos = seconds, nanoseconds
            fix.latitude, fix.longitude, fix.altitude = latitude, longitude, altitude
            fix.color.CopyFrom(colour(shade))
            _claim(fix, accuracy_m)
            yield bytes(fix.SerializeToString())


def _claim(fix: LocationFix, accuracy_m: float) -> None:
    """How far off it may be, if the receiver says: variances along east, north and up."""
    del fix.position_covariance[:]
    fix.position_covariance_type = LocationFix.UNKNOWN
    if math.isfinite(accuracy_m):
        level, upright = accuracy_m**2, (VERTICAL * accuracy_m) ** 2
        fix.position_covariance.extend((level, 0.0, 0.0, 0.0, level, 0.0, 0.0, 0.0, upright))
        fix.position_covariance_type = LocationFix.APPROXIMATED
