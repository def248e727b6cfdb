"""One horizontal frame for vehicles that each have their own origin.

The swarm's origin is where the first leg begins: the mean of the formation as it stands, moved ahead by the run-up.
Height is no part of it: that is each vehicle's own, above its home, because receivers differ by metres in altitude.
`gcs.telemetry` counts it from home wherever the origin is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pymap3d

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class SwarmFrame:
    """A plane at the fleet's height; 100 m from where it touches it is good to some millimetres, poles apart."""

    latitude_deg: float
    longitude_deg: float
    """Where the plane touches."""
    metres_per_degree: Array
    """(2,) along the meridian and along the parallel."""
    origin_ne: Array
    """(2,) m, the swarm's origin from there."""

    def to_ne(self, latitude_deg: Array, longitude_deg: Array) -> Array:
        """(N, 2) m north, east of the swarm's origin, of (N,) geodetic places."""
        ne = np.empty((len(latitude_deg), 2))
        ne[:, 0] = (latitude_deg - self.latitude_deg) * self.metres_per_degree[0] - self.origin_ne[0]
        east_deg = (longitude_deg - self.longitude_deg + 180.0) % 360.0 - 180.0
        ne[:, 1] = east_deg * self.metres_per_degree[1] - self.origin_ne[1]
        return ne

    def to_geodetic(self, ne: Array) -> Array:
        """(N, 2) latitude, longitude [degrees] of (N, 2) places [m] in the swarm's frame."""
        places = (ne + self.origin_ne) / self.metres_per_degree + (self.latitude_deg, self.longitude_deg)
        places[:, 1] = (places[:, 1] + 180.0) % 360.0 - 180.0
        return np.asarray(places)


def origin_of(
    latitude_deg: float, longitude_deg: float, altitude_m: float, position_ned: Sequence[float]
) -> tuple[float, float, float]:
    """Latitude, longitude [degrees] and altitude [m] of the origin from which a place is `position_ned` [m] away."""
    north, east, down = position_ned
    back: tuple[float, float, float] = pymap3d.ned2geodetic(
        -north, -east, -down, latitude_deg, longitude_deg, altitude_m
    )
    return back


def swarm_frame(origin: Array, position_ne: Array, offset_ne: Array, run_up_ne: Array) -> SwarmFrame:
    """The frame of a fleet about to take off.

    origin: (N, 3) of each vehicle's own origin, latitude, longitude [degrees], altitude [m];  position_ne: (N, 2) m
    from it;  offset_ne: (N, 2) m, the formation;  run_up_ne: (2,) m from here to where the first leg begins.
    """
    latitude, longitude, altitude = origin[0].tolist()
    tiny = 1e-4  # degrees, some 10 m: the curve of the Earth is 0.01 mm there
    north, _, _ = pymap3d.geodetic2ned(latitude + tiny, longitude, altitude, latitude, longitude, altitude)
    _, east, _ = pymap3d.geodetic2ned(latitude, longitude + tiny, altitude, latitude, longitude, altitude)
    touching = SwarmFrame(latitude, longitude, np.array([north, east]) / tiny, np.zeros(2))
    places = touching.to_ne(origin[:, 0], origin[:, 1]) + position_ne
    return SwarmFrame(latitude, longitude, touching.metres_per_degree, (places - offset_ne).mean(axis=0) + run_up_ne)
