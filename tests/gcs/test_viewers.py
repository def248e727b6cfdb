"""What a viewer draws of a flight without being configured."""

import math
from functools import cache

import numpy as np
import pymap3d
import pytest
from flights import SHORT, Severed, fly_and_record, recorded
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from viewed import by_time, rgb, sayings, scenes, transforms, viewed, xyz

from gcs.events import Rating
from gcs.flight import Flight
from gcs.lockstep import Lockstep
from gcs.loop import fly
from gcs.recording import sentences
from gcs.recording.happenings import Kind
from gcs.recording.looks import SHADES
from gcs.recording.scene import GRAIN, LINK_PX, SEEN_PX, TRAIL_POINTS
from gcs.recording.transforms import GRAIN_M, enu_of_flu
from gcs.recording.viewers import Viewers
from gcs.trust_colour import UNASKED, trust_colour
from scenarios import Scenario, load
from wire.ids import TRUTH
from wire.payloads import unpack_sim_state

angles = st.floats(-math.pi, math.pi)
HALF = math.sqrt(0.5)


def axes(roll, pitch, yaw):
    """Where a body's forward, left and up point, east, north, up, each a column."""
    return Rotation.from_quat(enu_of_flu(np.array([[roll, pitch, yaw]]))[0]).as_matrix()


@pytest.mark.parametrize(
    ("attitude_deg", "forward", "left"),
    [
        ((0, 0, 0), (0, 1, 0), (-1, 0, 0)),  # level, heading north: a yaw of 90° in ENU
        ((0, 0, 90), (1, 0, 0), (0, 1, 0)),  # heading east: none
        ((0, 0, -135), (-HALF, -HALF, 0), (HALF, -HALF, 0)),  # heading south-west
        ((0, 30, 0), (0, math.cos(math.radians(30)), 0.5), (-1, 0, 0)),  # nose up
        ((30, 0, 0), (0, 1, 0), (-math.cos(math.radians(30)), 0, 0.5)),  # right side down
    ],
)
def test_an_attitude_points_where_a_pilot_would_say(attitude_deg, forward, left):
    turned = axes(*np.radians(attitude_deg))
    assert turned[:, 0] == pytest.approx(forward, abs=1e-12)
    assert turned[:, 1] == pytest.approx(left, abs=1e-12)
    assert turned[:, 2] == pytest.approx(np.cross(forward, left), abs=1e-12)


@given(angles, st.floats(-math.pi / 2, math.pi / 2), angles)
def test_every_attitude_is_the_one_of_scipy_with_axes_exchanged(roll, pitch, yaw):
    ned_of_frd = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
    enu_of_ned, frd_of_flu = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]), np.diag([1, -1, -1])
    assert axes(roll, pitch, yaw) == pytest.approx(enu_of_ned @ ned_of_frd @ frd_of_flu, abs=1e-12)


SYSTEMS = range(1, 7)


def test_every_vehicle_is_drawn_every_tick_where_telemetry_has_it():
    flight = recorded("demo", *SHORT)
    fleets = by_time(flight.path, "/swarm/state")
    known = {time_ns for time_ns, fleet in fleets.items() if fleet["position_m"][0][0] is not None}
    drawn = transforms(flight)
    assert set(drawn) == known
    for time_ns, frames in drawn.items():
        north, east, down = np.array(fleets[time_ns]["position_m"]).T
        placed = np.array([xyz(frames[f"uav_{system}"].translation) for system in SYSTEMS])
        assert placed == pytest.approx(np.column_stack([east, north, -down]), abs=GRAIN_M)
        assert xyz(frames["formation"].translation) == pytest.approx(placed.mean(axis=0), abs=GRAIN_M)
        assert {one.parent_frame_id for one in frames.values()} == {"swarm"}


def test_a_vehicle_is_drawn_turned_as_its_telemetry_says():
    flight = recorded("demo", *SHORT)
    for system in SYSTEMS:
        for time_ns, state in by_time(flight.path, f"/uav/{system}/state").items():
            if time_ns in transforms(flight):
                drawn = transforms(flight)[time_ns][f"uav_{system}"].rotation
                turned = Rotation.from_quat([drawn.x, drawn.y, drawn.z, drawn.w]).as_matrix()
                assert turned == pytest.approx(axes(*state["attitude_rad"]), abs=1e-5)


def test_a_fix_is_where_the_vehicle_truly_is_on_the_earth():
    flight = recorded("demo", *SHORT)
    truths = {
        (frame.system, frame.time_ns // 1_000_000_000): unpack_sim_state(frame.payload)
        for frame in reversed(flight.link.received)  # the first of each second stays
        if frame.component == TRUTH
    }
    for system in SYSTEMS:
        fixes = viewed(flight.path)[f"/uav/{system}/fix"]
        assert len(fixes) > 20
        for time_ns, fix in fixes:
            truth = truths[system, time_ns // 1_000_000_000]
            east, north, up = pymap3d.geodetic2enu(
                fix.latitude, fix.longitude, fix.altitude, truth.lat_int / 1e7, truth.lon_int / 1e7, truth.alt
            )
            assert math.hypot(east, north) < 0.5
            assert abs(up) < 0.5
            assert fix.frame_id == f"uav_{system}"


def test_a_fix_says_how_far_off_the_receiver_may_be():
    _, fix = viewed(recorded("demo", *SHORT).path)["/uav/1/fix"][-1]
    east, north, up = np.array(fix.position_covariance).reshape(3, 3).diagonal()
    assert math.sqrt(east) == math.sqrt(north) == pytest.approx(0.141, abs=1e-3)  # what the simulated receiver claims
    assert up > north
    assert fix.position_covariance_type == fix.APPROXIMATED


def test_every_scene_is_whole_so_that_a_viewer_may_jump_anywhere():
    for _, drawn in scenes(recorded("emergency")):
        assert set(drawn) == {"path", "trails", "virtual leader", "links", *(f"uav_{n}" for n in SYSTEMS)}
        assert len(drawn["trails"].lines) == len(SYSTEMS)
        assert drawn["path"].spheres
        assert all(drawn[f"uav_{n}"].cylinders and drawn[f"uav_{n}"].texts for n in SYSTEMS)


def test_scenes_come_twice_a_second_and_move_between_with_frames_that_come_every_tick():
    flight = recorded("emergency")
    assert {int(apart) for apart in np.diff([time_ns for time_ns, _ in scenes(flight)])} == {500_000_000}
    for time_ns, drawn in scenes(flight):
        assert all(entity.frame_locked for entity in drawn.values())
        assert {drawn[f"uav_{n}"].frame_id for n in SYSTEMS} == set(transforms(flight)[time_ns]) - {"formation"}
        assert drawn["links"].frame_id == drawn["virtual leader"].frame_id == "formation"
        assert drawn["path"].frame_id == drawn["trails"].frame_id == "swarm"


def test_vehicles_and_trails_have_the_colour_of_their_trust():
    flight = eventful()
    trusts = by_time(flight.path, "/trust")
    flown = [(drawn, trusts[time_ns]["trust"]) for time_ns, drawn in scenes(flight) if time_ns in trusts]
    assert min(trust for _, all_trusts in flown for trust in all_trusts) < 0.5  # somebody was spoken against
    for drawn, all_trusts in flown:
        for system, trust in zip(SYSTEMS, all_trusts, strict=True):
            wanted = pytest.approx(trust_colour(round(trust * SHADES) / SHADES))
            assert rgb(drawn[f"uav_{system}"].lines[0].color) == wanted
            assert rgb(drawn["trails"].lines[system - 1].color) == wanted
            assert ("distrusted" in drawn[f"uav_{system}"].texts[0].text) == (trust < 0.5)


def test_a_map_shows_trust_as_well():
    flight = recorded("emergency")
    last = {system: viewed(flight.path)[f"/uav/{system}/fix"][-1][1].color for system in SYSTEMS}
    for system, colour in last.items():
        assert rgb(colour) == pytest.approx(trust_colour(float(system != 5)))


def test_a_rule_that_asks_for_no_trust_is_drawn_grey_and_nobody_is_distrusted():
    flight = recorded("demo", *SHORT, "control.rule=average")
    for _, drawn in scenes(flight):
        assert all(rgb(drawn[f"uav_{n}"].lines[0].color) == tuple(UNASKED) for n in SYSTEMS)
    assert not [words for name, _, words in sayings(flight) if name.startswith("distrust")]


def test_links_are_as_wide_as_the_weight_and_reach_half_the_way_to_whom_they_convince():
    flight = recorded("emergency")
    weights = by_time(flight.path, "/weights")
    linked = 0
    for time_ns, drawn in scenes(flight):
        lines = drawn["links"].lines
        if time_ns not in weights:
            assert not lines
            continue
        matrix, place = np.array(weights[time_ns]["weights"]), _beside(transforms(flight)[time_ns])
        np.fill_diagonal(matrix, 0.0)
        wanted = np.argwhere(LINK_PX * matrix >= SEEN_PX)
        assert len(lines) == len(wanted)
        for line, (receiver, sender) in zip(lines, wanted, strict=True):
            begin, end = (xyz(point) for point in line.points)
            assert line.thickness == pytest.approx(LINK_PX * matrix[receiver, sender])
            assert begin == pytest.approx(place[sender], abs=2 * GRAIN_M)
            assert end == pytest.approx(0.5 * (place[sender] + place[receiver]), abs=2 * GRAIN_M)
            linked += 1
    assert linked > 1000


def _beside(frames):
    """(N, 3) m from the middle of the formation."""
    middle = xyz(frames["formation"].translation)
    return np.array([xyz(frames[f"uav_{n}"].translation) for n in SYSTEMS]) - middle


def test_no_link_leaves_the_failed_robot_and_it_is_ringed():
    flight = recorded("emergency")
    flown = [(time_ns, drawn) for time_ns, drawn in scenes(flight) if drawn["links"].lines]
    for time_ns, drawn in flown:
        failed = _beside(transforms(flight)[time_ns])[4]
        assert all(math.dist(xyz(line.points[0]), failed) > 0.1 for line in drawn["links"].lines)
        assert [len(drawn[f"uav_{n}"].lines) for n in SYSTEMS] == [1, 1, 1, 1, 2, 1]


def test_a_trail_ends_at_its_vehicle_and_goes_back_half_a_minute():
    flight = recorded("emergency")
    positions = {time_ns: _places(frames) for time_ns, frames in transforms(flight).items()}
    for time_ns, drawn in scenes(flight):
        for place, trail in zip(positions[time_ns], drawn["trails"].lines, strict=True):
            assert xyz(trail.points[-1]) == pytest.approx(place, abs=1.0 / GRAIN)
            assert len(trail.points) <= TRAIL_POINTS
    time_ns, drawn = scenes(flight)[-1]
    ago = positions[time_ns - 29_000_000_000 - 500_000_000]
    assert [xyz(trail.points[0]) for trail in drawn["trails"].lines] == pytest.approx(ago, abs=0.8)


def _places(frames):
    return np.array([xyz(frames[f"uav_{n}"].translation) for n in SYSTEMS])


def test_nobody_sees_the_second_target_before_the_call():
    flight = recorded("emergency")
    called_ns = next(t for t, m in viewed(flight.path)["/log"] if m.message == "next task: car accident area")
    for time_ns, drawn in scenes(flight):
        words = [text.text for text in drawn["path"].texts]
        assert words[0] == "target 1: parking lot inspection"
        assert words[1:] == (["target 2: car accident area"] if time_ns >= called_ns else [])
        opacity = [ball.color.a for ball in drawn["path"].spheres]
        assert opacity == ([0.35, 1.0] if time_ns >= called_ns else [1.0])


def test_the_virtual_leader_is_drawn_while_there_is_one():
    flight = recorded("emergency")
    missions = by_time(flight.path, "/mission")
    for time_ns, drawn in scenes(flight):
        balls = drawn["virtual leader"].spheres
        assert len(balls) == (time_ns in missions)
        for ball in balls:
            middle, there = xyz(transforms(flight)[time_ns]["formation"].translation), missions[time_ns]
            assert np.add(middle, xyz(ball.pose.position)) == pytest.approx(
                (there["east_m"], there["north_m"], flight.scenario.swarm.altitude_m), abs=GRAIN_M
            )


def test_the_log_tells_the_flight_in_the_order_in_which_it_went():
    told = sayings(recorded("emergency"))
    assert [words for name, _, words in told if name == "phase"] == [
        "joining",
        "taking off",
        "taking control",
        "running up",
        "mission: parking lot inspection",
        "next task: car accident area",
        "landing",
        "done",
    ]
    assert [(name, words) for name, _, words in told if name.startswith("distrust")] == [
        ("distrust/uav_5", "robot 5 is distrusted")
    ]
    assert ("word/uav_3", INFO, "vehicle 3: Armed by external command") in told


INFO, WARNING, ERROR = 2, 3, 4
"""Levels of foxglove.Log."""


@cache
def eventful():
    """A flight in which somebody speaks, somebody falls silent, and the operator ends it."""
    ticks = iter(range(10_000))

    def says():
        number = next(ticks)
        return {115: (Rating("ann", 2, 1), Rating("bob", 2, 1)), 150: ("land",)}.get(number, ())

    def through(link, clock):
        return Severed(link, clock, system=4, from_s=11.0, to_s=13.0)

    return fly_and_record("demo", *SHORT, "trust.source=ratings", through=through, events=says, ratings=())


def test_the_log_tells_of_people_of_silence_and_of_other_hands():
    flight = eventful()
    told = sayings(flight)
    assert ("rating/uav_2", INFO, "ann rates robot 2 1 of 5: complete distrust") in told
    assert ("word", WARNING, "the operator says: land") in told
    assert ("link/uav_4", ERROR, "vehicle 4 is silent") in told
    assert ("link/uav_4", INFO, "vehicle 4 is heard again") in told
    assert ("hands/uav_4", WARNING, "vehicle 4 is not ours any more: nothing is sent to it") in told
    assert ("problem", ERROR, flight.summary.problem) in told
    labels = {text.text for _, drawn in scenes(flight) for n in SYSTEMS for text in drawn[f"uav_{n}"].texts}
    assert {"2: distrusted", "4: silent", "4: not ours"} <= labels
    assert {name.partition("/")[0] for name, _, _ in told} <= {kind.value for kind in Kind}


def test_what_a_simulation_knows_of_its_faults_is_told_to_no_viewer():
    scenario = load("demo", overrides=(*SHORT, "trust.source=auto"))
    healthy = Scenario.model_validate(scenario.model_dump() | {"fault": []})
    world, ticks = Lockstep.of(scenario, seed=1), Kept()
    fly(world, world, Flight(scenario), (ticks,), period_ns=scenario.time.period_ns)
    told, told_of_health = (
        [[*viewers.of(tick)] for tick in ticks.all] for viewers in map(Viewers, (scenario, healthy))
    )
    assert told == told_of_health
    assert sum(map(len, told)) > 300


class Kept:
    """A record of everything."""

    def __init__(self):
        self.all = []

    def tick(self, tick):
        self.all.append(tick)


@pytest.mark.parametrize(
    ("rating", "words"),
    [
        (Rating("op1", 5, 2), "op1 rates robot 5 2 of 5: distrust"),
        (Rating("op1", None, 4), "op1 rates the swarm 4 of 5: trust"),
    ],
)
def test_a_rating_is_told_as_its_rater_would_tell_it(rating, words):
    assert sentences.rating(rating) == words
