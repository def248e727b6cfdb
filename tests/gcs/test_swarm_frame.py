"""One horizontal frame for vehicles that each have their own origin, against pymap3d's ellipsoid."""

import numpy as np
import pymap3d
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcs.swarm_frame import origin_of, swarm_frame
from scenarios import load, offsets_ne

NOWHERE = np.zeros(2)
latitudes = st.floats(-60, 60)
longitudes = st.floats(-179, 179)


def geodetic(position_ne, latitude_deg, longitude_deg):
    """(N, 3) latitude, longitude [degrees], altitude [m] of places on the ground [m north, east]."""
    places = [pymap3d.ned2geodetic(north, east, 0.0, latitude_deg, longitude_deg, 0.0) for north, east in position_ne]
    return np.array([(latitude, longitude, 0.0) for latitude, longitude, _ in places])


def frame_at(latitude_deg, longitude_deg, *, run_up_ne=NOWHERE):
    """Of a single robot that stands at its own origin."""
    return swarm_frame(np.array([[latitude_deg, longitude_deg, 0.0]]), np.zeros((1, 2)), np.zeros((1, 2)), run_up_ne)


@given(latitudes, longitudes, st.floats(0, 100), st.floats(-np.pi, np.pi))
def test_a_place_up_to_100_m_away_is_right_to_two_millimetres(latitude_deg, longitude_deg, distance, bearing):
    place = distance * np.array([[np.cos(bearing), np.sin(bearing)]])
    latitude, longitude, _ = geodetic(place, latitude_deg, longitude_deg).T
    assert frame_at(latitude_deg, longitude_deg).to_ne(latitude, longitude) == pytest.approx(place, abs=2e-3)


@given(latitudes, longitudes)
def test_a_lone_robot_without_run_up_is_the_origin(latitude_deg, longitude_deg):
    frame = frame_at(latitude_deg, longitude_deg)
    assert frame.to_ne(np.array([latitude_deg]), np.array([longitude_deg])) == pytest.approx(np.zeros((1, 2)), abs=1e-9)


@pytest.mark.parametrize("run_up_ne", [(4.5, 0.0), (-1.0, 2.0)])
def test_the_run_up_moves_the_origin_ahead(run_up_ne):
    frame = frame_at(41.0, -81.0, run_up_ne=np.array(run_up_ne))
    assert frame.to_ne(np.array([41.0]), np.array([-81.0])) == pytest.approx(-np.array([run_up_ne]), abs=1e-9)


@pytest.mark.parametrize("name", ["demo", "transit", "emergency"])
def test_a_fleet_in_formation_stands_at_its_offsets_whichever_origin_each_vehicle_has(name):
    offset = offsets_ne(load(name))
    rng = np.random.default_rng(1)
    origins_ne = 10 + rng.uniform(-5, 5, (6, 2))  # where each was switched on
    origins = geodetic(origins_ne, 47.4, 8.5)
    position_ne = (20 + offset) - origins_ne
    frame = swarm_frame(origins, position_ne, offset, NOWHERE)
    assert frame.to_ne(origins[:, 0], origins[:, 1]) + position_ne == pytest.approx(offset, abs=1e-3)


def test_errors_of_the_formation_are_shared_out_so_that_the_mean_is_right():
    offset = offsets_ne(load("demo"))
    ragged = offset + np.random.default_rng(2).uniform(-0.5, 0.5, (6, 2))
    origins = np.tile([47.4, 8.5, 0.0], (6, 1))
    frame = swarm_frame(origins, ragged, offset, NOWHERE)
    place = frame.to_ne(origins[:, 0], origins[:, 1]) + ragged - offset
    assert place.mean(0) == pytest.approx([0, 0], abs=1e-9)
    assert place == pytest.approx((ragged - offset) - (ragged - offset).mean(0), abs=1e-9)


def test_a_fleet_may_straddle_the_date_line():
    origin = np.array([[10.0, 179.99999, 0.0], [10.0, -179.99999, 0.0]])
    frame = swarm_frame(origin, np.zeros((2, 2)), np.zeros((2, 2)), np.zeros(2))
    places = frame.to_ne(origin[:, 0], origin[:, 1])
    assert places.mean(axis=0) == pytest.approx([0, 0], abs=1e-6)
    assert places[1, 1] - places[0, 1] == pytest.approx(2e-5 * frame.metres_per_degree[1], rel=1e-6)


@given(latitudes, longitudes, st.tuples(*[st.floats(-100, 100)] * 3))
def test_the_origin_of_a_place_is_where_that_place_is_counted_from(latitude_deg, longitude_deg, position_ned):
    place = pymap3d.ned2geodetic(*position_ned, latitude_deg, longitude_deg, 300.0)
    back = pymap3d.geodetic2ned(*origin_of(*place, position_ned), latitude_deg, longitude_deg, 300.0)
    assert back == pytest.approx((0, 0, 0), abs=5e-3)  # down is not quite the same direction 140 m away


@given(latitudes, longitudes, st.floats(-100, 100), st.floats(-100, 100))
def test_the_way_back_to_the_earth_ends_where_it_began(latitude_deg, longitude_deg, north, east):
    frame = frame_at(latitude_deg, longitude_deg, run_up_ne=np.array([4.5, -1.0]))
    place = frame.to_geodetic(np.array([[north, east]]))
    assert frame.to_ne(*place.T) == pytest.approx(np.array([[north, east]]), abs=1e-6)


def test_east_of_the_date_line_is_west():
    frame = frame_at(10.0, 179.9999)
    ((_, longitude_deg),) = frame.to_geodetic(np.array([[0.0, 100.0]]))
    assert longitude_deg == pytest.approx(-179.9992, abs=1e-4)
