"""The metrics of the paper's Table II, on tracks whose answers are known."""

from dataclasses import replace
from math import cos, inf, radians, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcs.mission import paper_leader, plan
from gcs.scoring import heading_error, min_separation, onsets, score
from gcs.track import Track
from scenarios import healthy_robots, load, offsets_ne

TRANSIT, EMERGENCY, DEMO = load("transit"), load("emergency"), load("demo")
TICK = 0.1


def ideal(scenario, *, until_s=None):
    """Everyone in place beside the paper's virtual leader, all trusted."""
    path = plan(scenario)
    ticks = scenario.time.ticks(path.read_out_s if until_s is None else until_s)
    times = np.arange(ticks + 1) * TICK
    virtual = np.array([paper_leader(path, time_s).position_ne for time_s in times])
    ne = virtual[:, None] + offsets_ne(scenario)
    height = np.full((*ne.shape[:2], 1), scenario.swarm.altitude_m)
    return Track(times, np.concatenate([ne, height], axis=2), np.ones(ne.shape[:2]), virtual, measured=False)


def moved(track, shift_ne, *, robots=slice(None), since_s=0.0):
    position = track.position.copy()
    position[track.time_s >= since_s - 1e-9, robots, :2] += shift_ne
    return replace(track, position=position)


def chord_turned(scenario, degrees, *, stretch=1.0):
    """After hand-over everyone flies the last leg turned clockwise by this angle."""
    track, path = ideal(scenario), plan(scenario)
    after = int(np.searchsorted(track.time_s, path.hand_over_s - 1e-9))
    turn = radians(degrees)
    turned = stretch * np.array([[cos(turn), -sin(turn)], [sin(turn), cos(turn)]])
    start = track.virtual_ne[after]
    shift = (track.virtual_ne[after:] - start) @ (turned.T - np.eye(2))
    position = track.position.copy()
    position[after:, :, :2] += shift[:, None]
    return replace(track, position=position)


def distrusted(track, robot, since_s, until_s=inf):
    trust = track.trust.copy()
    trust[(track.time_s >= since_s - 1e-9) & (track.time_s < until_s - 1e-9), robot - 1] = 0.49
    return replace(track, trust=trust)


@pytest.mark.parametrize("scenario", [DEMO, TRANSIT, EMERGENCY], ids=["demo", "transit", "emergency"])
def test_a_swarm_that_never_leaves_the_virtual_leader_has_no_error(scenario):
    result = score(ideal(scenario), scenario)
    assert result.heading_error_deg == pytest.approx(0, abs=1e-9)
    assert result.swarm_heading_error_deg == pytest.approx(0, abs=1e-9)
    assert result.distance_to_target_m == pytest.approx(0, abs=1e-9)
    assert result.min_separation_m == pytest.approx(3.0)
    assert result.passed
    assert (result.detected, result.false_alarms) == ({}, 0)


@pytest.mark.parametrize("degrees", [3.0, -3.0, 20.0, 90.0, -40.0])
def test_a_swarm_that_flies_off_by_an_angle_misses_by_its_chord(degrees):
    """From the tick after hand-over; Table II: 20.6 m = 2 · 30 m · sin 20° at 40°."""
    result = score(chord_turned(TRANSIT, degrees), TRANSIT)
    assert result.heading_error_deg == pytest.approx(abs(degrees), abs=1e-9)
    flown = np.linalg.norm(plan(TRANSIT).target_ne - ideal(TRANSIT).virtual_ne[54])
    assert result.distance_to_target_m == pytest.approx(2 * flown * sin(radians(abs(degrees)) / 2))
    assert result.passed == (abs(degrees) < 4)


@pytest.mark.parametrize(("stretch", "passes"), [(0.9, True), (1.1, True), (0.85, False)])
def test_too_far_and_too_short_count_as_distance_and_not_as_heading(stretch, passes):
    result = score(chord_turned(TRANSIT, 0.0, stretch=stretch), TRANSIT)
    assert result.heading_error_deg == pytest.approx(0, abs=1e-9)
    assert result.distance_to_target_m == pytest.approx(abs(1 - stretch) * 29.9)
    assert result.passed is passes


def test_a_swarm_that_is_always_beside_the_leader_has_distance_and_no_heading_error():
    result = score(moved(ideal(TRANSIT), (3.0, 4.0)), TRANSIT)
    assert result.heading_error_deg == pytest.approx(0, abs=1e-9)
    assert result.distance_to_target_m == pytest.approx(5.0)
    assert not result.passed


def test_the_failed_robot_counts_for_the_swarm_and_not_for_the_healthy():
    track = moved(moved(ideal(TRANSIT), (0.0, -9.0), robots=4), (0.0, -60.0), robots=4, since_s=10.0)
    result = score(track, TRANSIT)
    assert result.heading_error_deg == pytest.approx(0, abs=1e-9)
    assert result.distance_to_target_m == pytest.approx(0, abs=1e-9)
    assert result.swarm_heading_error_deg > 10


def test_what_happens_after_the_read_out_does_not_count():
    track = ideal(TRANSIT, until_s=40.0)
    after = plan(TRANSIT).read_out_s + TICK
    assert score(moved(track, (99, 0), since_s=after), TRANSIT) == score(track, TRANSIT)


@pytest.mark.parametrize(("until_s", "complete"), [(27.4, True), (27.3, False), (5.0, False), (0.0, False)])
def test_a_mission_that_ends_before_its_read_out_has_no_score(until_s, complete):
    assert (score(ideal(TRANSIT, until_s=until_s), TRANSIT) is not None) is complete


@pytest.mark.parametrize(("gap", "passes"), [(1.01, True), (0.99, False)])
def test_two_robots_that_come_too_close_for_a_tick_fail_the_flight(gap, passes):
    track = ideal(DEMO)
    position = track.position.copy()
    position[50, 0] = position[50, 1] + [0, 0, gap]
    result = score(replace(track, position=position), DEMO)
    assert result.min_separation_m == pytest.approx(gap)
    assert result.passed is passes


def lost(track, robots, since_s, until_s=inf):
    """As telemetry has it, which tells nothing of these robots for a while."""
    position = track.position.copy()
    position[np.ix_((track.time_s >= since_s - 1e-9) & (track.time_s < until_s - 1e-9), robots)] = np.nan
    return replace(track, position=position, measured=True)


def test_a_robot_that_is_not_heard_is_close_to_nobody_and_in_no_mean():
    astray = lost(moved(ideal(TRANSIT), (0.0, 50.0), robots=1), [1], 20.0)
    close = lost(
        moved(ideal(TRANSIT), ideal(TRANSIT).position[0, 0, :2] - (0.0, 0.1), robots=1, since_s=20.0), [1], 20.0
    )
    for track in (astray, close):
        result = score(track, TRANSIT)
        assert result.heading_error_deg == pytest.approx(0, abs=1e-9)
        assert result.distance_to_target_m == pytest.approx(0, abs=1e-9)
        assert result.swarm_heading_error_deg == pytest.approx(0, abs=1e-9)
        assert result.min_separation_m == pytest.approx(3.0)


def test_who_was_not_heard_only_between_hand_over_and_read_out_counts():
    track = moved(ideal(TRANSIT), (0.0, 50.0), robots=1)
    assert score(lost(track, [1], 10.0, 20.0), TRANSIT) == score(track, TRANSIT)


def test_where_nobody_that_counts_is_heard_at_the_read_out_there_is_no_score():
    assert score(lost(ideal(TRANSIT), [0, 1, 2, 3, 5], 27.0), TRANSIT) is None
    assert score(lost(ideal(TRANSIT), [0, 1, 2, 3], 27.0), TRANSIT) is not None


# --- trust


@pytest.mark.parametrize("delay_s", [0.0, 0.1, 1.9, 10.0])
def test_a_fault_is_detected_at_the_first_tick_of_distrust_after_its_onset(delay_s):
    scenario = load("transit", overrides=["fault.0.onset_s=3"])
    result = score(distrusted(ideal(scenario), 5, 3 + delay_s), scenario)
    assert result.detected == {5: pytest.approx(delay_s)}
    assert result.false_alarms == 0


def test_distrust_before_the_onset_is_a_false_alarm_and_where_it_passed_detected_nothing():
    scenario = load("transit", overrides=["fault.0.onset_s=6"])
    result = score(distrusted(ideal(scenario), 5, 2.0, 4.0), scenario)
    assert (result.detected, result.false_alarms) == ({}, 1)


def test_a_robot_is_sound_until_the_first_of_its_faults_and_never_again():
    late, early = (f'{{vehicle=5, kind="frozen_telemetry", onset_s={onset_s}}}' for onset_s in (9, 3))
    scenario = load("transit", overrides=[f"fault=[{late}, {early}]"])
    assert score(distrusted(ideal(scenario), 5, 3.0, 8.0), scenario).false_alarms == 0
    assert score(distrusted(ideal(scenario), 5, 2.9, 8.0), scenario).false_alarms == 1


@pytest.mark.parametrize("order", [(9, 3), (3, 9)])
def test_a_detection_counts_from_the_first_of_a_robots_faults_in_whatever_order_they_are_written(order):
    faults = ",".join(f'{{vehicle=5, kind="frozen_telemetry", onset_s={onset_s}}}' for onset_s in order)
    scenario = load("transit", overrides=[f"fault=[{faults}]"])
    assert onsets(scenario) == {5: 3.0}
    assert score(distrusted(ideal(scenario), 5, 4.5), scenario).detected == {5: pytest.approx(1.5)}


def test_a_fault_that_begins_after_the_read_out_leaves_its_robot_healthy():
    scenario = load("transit", overrides=["fault.0.onset_s=100"])
    astray = moved(ideal(scenario), (0.0, 60.0), robots=4, since_s=20.0)
    result = score(distrusted(astray, 5, 2.0), scenario)
    assert (result.detected, result.false_alarms) == ({}, 1)
    assert result.distance_to_target_m == pytest.approx(10.0)  # one of six that count


def test_where_nobody_knows_what_was_wrong_nobody_is_right_or_wrong_to_distrust_and_all_are_scored():
    track = replace(distrusted(moved(ideal(TRANSIT), (0.0, 60.0), robots=4), 5, 2.0), faults_known=False)
    result = score(track, TRANSIT)
    assert (result.detected, result.false_alarms) == ({}, 0)
    assert result.distance_to_target_m == pytest.approx(10.0)


def test_trust_of_exactly_one_half_is_trust():
    track = ideal(TRANSIT)
    result = score(replace(track, trust=np.full_like(track.trust, 0.5)), TRANSIT)
    assert (result.detected, result.false_alarms) == ({}, 0)


def test_each_healthy_robot_distrusted_at_any_tick_is_one_false_alarm():
    track = distrusted(distrusted(distrusted(ideal(TRANSIT), 1, 2.0, 2.1), 1, 8.0, 9.0), 6, 5.0)
    result = score(track, TRANSIT)
    assert result.false_alarms == 2
    assert result.detected == {}


def test_where_everybody_fails_distrust_is_no_false_alarm_and_all_are_scored():
    alone = load("transit", overrides=["swarm.rows=1", "swarm.columns=1", "swarm.leaders=[1]", "fault.0.vehicle=1"])
    result = score(distrusted(ideal(alone), 1, 2.0), alone)
    assert (result.detected, result.false_alarms) == ({1: pytest.approx(2.0)}, 0)
    assert result.distance_to_target_m == pytest.approx(0.0, abs=1e-9)


def test_healthy_is_whom_no_fault_ever_strikes():
    assert healthy_robots(TRANSIT).tolist() == [True, True, True, True, False, True]
    assert healthy_robots(DEMO).all()


# --- the two measures themselves


@given(st.floats(-180, 180), st.floats(-179.9, 179.9), st.floats(0.1, 100))
def test_heading_error_is_the_signed_angle_clockwise(heading_deg, off_deg, length):
    def towards(degrees):
        return np.array([cos(radians(degrees)), sin(radians(degrees))])

    start = np.array([3.0, -7.0])
    error = heading_error(start, start + length * towards(heading_deg + off_deg), towards(heading_deg))
    assert error == pytest.approx(off_deg, abs=1e-6)


def airborne(*places):
    return np.array([places], float)


def test_separation_is_in_three_dimensions():
    assert min_separation(airborne((0, 0, 10), (2, 3, 16))) == 7.0


def test_robots_on_the_ground_do_not_count_for_separation():
    assert min_separation(airborne((0, 0, 10), (0, 1, 0.29), (0, 5, 0.31))) == pytest.approx(np.hypot(5, 9.69))


@pytest.mark.parametrize("places", [[(0, 0, 5)], [(0, 0, 0), (1, 0, 0)], [(0, 0, 9), (1, 0, 0)]])
def test_without_two_in_the_air_there_is_no_separation(places):
    assert min_separation(airborne(*places)) == inf


@given(st.permutations(range(6)))
def test_separation_knows_no_names(order):
    position = np.random.default_rng(4).uniform(1, 20, (30, 6, 3))
    closest = min(np.linalg.norm(position[:, i] - position[:, j], axis=1).min() for i in range(6) for j in range(i))
    assert min_separation(position[:, list(order)]) == pytest.approx(closest)
