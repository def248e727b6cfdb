"""Where the virtual leader is: plans of the shipped missions, and both profiles along them."""

from itertools import pairwise
from math import cos, radians, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcs.mission import READ_OUT_AFTER_S, SWING_S, TURN_S, paper_leader, plan, recommended_leader, run_up
from scenarios import load, names, parse

CRUISE = 1.5


def along(heading_deg, length):
    return length * np.array([cos(radians(heading_deg)), sin(radians(heading_deg))])


PLANS = [  # hand-over [s], target [m], read-out [s]
    ("demo", 12 / 1.5, along(0, 12) + along(60, 15), 27 / 1.5 + 2),
    ("transit", 8 / 1.5, along(10, 8) + along(43, 30), 38 / 1.5 + 2),
    ("emergency", 9 / 1.5, along(60, 9) + along(0, 30), 39 / 1.5 + 2),
]
every_mission = pytest.mark.parametrize("name", names())


@pytest.mark.parametrize(("name", "hand_over_s", "target_ne", "read_out_s"), PLANS)
def test_plans_of_the_shipped_missions(name, hand_over_s, target_ne, read_out_s):
    path = plan(load(name))
    assert path.hand_over_s == pytest.approx(hand_over_s)
    assert path.target_ne == pytest.approx(target_ne)
    assert path.read_out_s == pytest.approx(read_out_s)


@every_mission
def test_segments_join_without_a_gap_in_place_or_time(name):
    segments = plan(load(name)).segments
    assert segments[0].begins_s == 0
    assert segments[0].start_ne.tolist() == [0, 0]
    for before, after in pairwise(segments):
        assert after.begins_s == before.ends_s
        assert after.start_ne == pytest.approx(before.end_ne, abs=1e-12)


def test_an_emergency_cuts_its_leg_short_and_begins_where_the_leader_is():
    path = plan(load("emergency"))
    inspection, accident = path.segments
    assert [[leg.task for leg in ahead] for ahead in path.known] == [[inspection.task], [accident.task]]
    assert path.known[0][0].end_ne == pytest.approx(along(60, 30))
    assert inspection.end_ne == pytest.approx(along(60, 9))
    assert inspection.planned_end_ne == pytest.approx(along(60, 30))
    assert accident.planned_end_ne == pytest.approx(accident.end_ne)
    assert (inspection.task, accident.task) == ("parking lot inspection", "car accident area")


def test_an_emergency_takes_the_place_of_all_legs_to_come():
    call = 'event=[{kind="redirect", at_length_m=5, task="call", heading_deg=180, length_m=9}]'
    path = plan(load("transit", overrides=[call]))
    assert [segment.task for segment in path.segments] == ["activity inspection", "call"]
    assert path.target_ne == pytest.approx(along(10, 5) + along(180, 9))


def test_a_second_call_interrupts_the_first():
    calls = ", ".join(
        f'{{kind="redirect", at_length_m={at}, task="call", heading_deg={heading}, length_m=20}}'
        for at, heading in ((9, 0), (15, 90))
    )
    path = plan(load("emergency", overrides=[f"event=[{calls}]"]))
    assert path.target_ne == pytest.approx(along(60, 9) + along(0, 6) + along(90, 20))
    assert path.hand_over_s == pytest.approx(15 / CRUISE)


@pytest.mark.parametrize(
    ("time_s", "task"), [(-5, "first"), (0, "first"), (7.9, "first"), (8, "second"), (99, "second")]
)
def test_the_segment_being_flown(time_s, task):
    assert plan(load("demo")).segment_at(time_s).task == f"{task} field"


# --- the paper's leader


@pytest.mark.parametrize(
    ("time_s", "position_ne", "velocity_ne"),
    [
        (0, (0, 0), along(10, CRUISE)),
        (4, along(10, 6), along(10, CRUISE)),
        (8 / 1.5, along(10, 8), along(43, CRUISE)),
        (8 / 1.5 + 2, along(10, 8) + along(43, 3), along(43, CRUISE)),
        (38 / 1.5, along(10, 8) + along(43, 30), (0, 0)),
        (99, along(10, 8) + along(43, 30), (0, 0)),
        (-1, along(10, -1.5), along(10, CRUISE)),
    ],
)
def test_the_papers_leader_runs_at_cruise_turns_on_the_spot_and_stops_at_once(time_s, position_ne, velocity_ne):
    leader = paper_leader(plan(load("transit")), time_s)
    assert leader.position_ne == pytest.approx(np.array(position_ne), abs=1e-9)
    assert leader.velocity_ne == pytest.approx(np.array(velocity_ne), abs=1e-9)
    assert not leader.acceleration_ne.any()


# --- the recommended leader


@st.composite
def missions(draw):
    """Plans of one to four legs, most with an emergency call at any moment, a corner's included."""
    heading = st.floats(-180, 180)
    cruise = draw(st.sampled_from([0.5, 1.0, 1.5, 3.0]))
    lengths = [cruise * seconds for seconds in draw(st.lists(st.floats(0.5, 20), min_size=1, max_size=4))]
    legs = ", ".join(f'{{task="leg", heading_deg={draw(heading)}, length_m={length}}}' for length in lengths)
    event = ""
    if draw(st.booleans()):
        at = draw(st.floats(0.01, 0.99).map(lambda part: part * sum(lengths)) | st.sampled_from(lengths))
        at = min(at, 0.999 * sum(lengths))
        length = draw(st.floats(0.2, 15)) * cruise
        event = f'{{kind="redirect", at_length_m={at}, task="call", heading_deg={draw(heading)}, length_m={length}}}'
    text = f'title = "any"\nevent = [{event}]\n[mission]\ncruise_m_s = {cruise}\nleg = [{legs}]'
    return plan(parse(text, source="any"))


def at(leader, path, times):
    """(T, 2) each: position, velocity, acceleration."""
    states = [leader(path, time_s) for time_s in times]
    return tuple(
        np.array([getattr(state, name) for state in states])
        for name in ("position_ne", "velocity_ne", "acceleration_ne")
    )


@given(missions())
def test_the_recommended_leader_never_jumps_in_place_or_velocity(path):
    """Between samples it moves as its velocity says, and its velocity changes as its acceleration says."""
    step = 0.05
    times = np.arange(-1.0, path.read_out_s + 1.0, step)
    position, velocity, acceleration = at(recommended_leader, path, times)
    strongest = 1.05 * np.linalg.norm(acceleration, axis=1).max() + 1e-9
    moved = np.diff(position, axis=0) - step * 0.5 * (velocity[1:] + velocity[:-1])
    assert np.linalg.norm(moved, axis=1).max() <= strongest * step**2 / 4
    assert np.linalg.norm(np.diff(velocity, axis=0), axis=1).max() <= strongest * step


@every_mission
def test_its_velocity_and_acceleration_are_the_derivatives_of_its_place(name):
    path, h = plan(load(name)), 1e-4
    times = np.arange(0.0137, path.read_out_s, 0.05)  # misses the few instants at which the acceleration steps
    position, velocity, acceleration = at(recommended_leader, path, times)
    ahead, behind = at(recommended_leader, path, times + h), at(recommended_leader, path, times - h)
    assert (ahead[0] - behind[0]) / (2 * h) == pytest.approx(velocity, abs=1e-6)
    assert (ahead[1] - behind[1]) / (2 * h) == pytest.approx(acceleration, abs=1e-6)
    assert np.isfinite(position).all()


@given(missions(), st.floats(0, 1))
def test_away_from_corners_it_is_the_papers(path, part):
    time_s = part * path.read_out_s
    calls = [ahead[0].begins_s for ahead in path.known[1:]]
    swinging = any(call <= time_s <= call + SWING_S for call in calls)
    for segment in path.known[sum(call <= time_s for call in calls)]:
        if segment.begins_s + TURN_S / 2 < time_s < segment.ends_s - TURN_S / 2 and not swinging:
            ours, papers = recommended_leader(path, time_s), paper_leader(path, time_s)
            assert (ours.position_ne == papers.position_ne).all()
            assert (ours.velocity_ne == papers.velocity_ne).all()
            assert not ours.acceleration_ne.any()


@given(missions())
def test_it_ends_at_rest_at_the_target_before_the_read_out(path):
    for time_s in (path.segments[-1].ends_s + TURN_S / 2, path.read_out_s, path.read_out_s + 99):
        leader = recommended_leader(path, time_s)
        assert leader.position_ne == pytest.approx(path.target_ne, abs=1e-9)
        assert leader.velocity_ne == pytest.approx([0, 0], abs=1e-9)
    assert TURN_S / 2 < READ_OUT_AFTER_S


@given(missions(), st.floats(-1, 1.2))
def test_it_is_never_faster_than_cruise_at_a_foreseen_corner_and_never_far_from_the_papers(path, part):
    time_s = part * path.read_out_s
    cruise = np.linalg.norm(path.segments[0].velocity_ne)
    leader = recommended_leader(path, time_s)
    if len(path.known) == 1:
        assert np.linalg.norm(leader.velocity_ne) <= cruise * (1 + 1e-9)
    # a parabola leaves its corner by Δv T/8, a swing by Δv T 4/27 and by where it began; Δv ≤ 2 cruise
    away = np.linalg.norm(leader.position_ne - paper_leader(path, time_s).position_ne)
    swung = TURN_S / 8 + SWING_S * 4 / 27 if len(path.known) > 1 else 0.0
    assert away <= 2 * cruise * (TURN_S / 8 + swung) * (1 + 1e-9)


def test_a_corner_is_rounded_by_a_parabola_that_passes_an_eighth_of_the_turn_inside():
    path = plan(load("demo"))
    corner, change = path.segments[0].end_ne, path.segments[1].velocity_ne - path.segments[0].velocity_ne
    leader = recommended_leader(path, path.segments[0].ends_s)
    assert leader.position_ne == pytest.approx(corner + change * TURN_S / 8)
    assert leader.velocity_ne == pytest.approx(path.segments[0].velocity_ne + change / 2)
    assert leader.acceleration_ne == pytest.approx(change / TURN_S)


@pytest.mark.parametrize(
    ("name", "at_length_m"), [("emergency", 9), ("emergency", 29.5), ("demo", 12), ("demo", 12.6), ("demo", 26.5)]
)
def test_until_an_emergency_call_it_flies_as_if_there_were_none(name, at_length_m):
    call = f'event=[{{kind="redirect", at_length_m={at_length_m}, task="call", heading_deg=180, length_m=9}}]'
    quiet, called = plan(load(name, overrides=["event=[]"])), plan(load(name, overrides=[call]))
    for time_s in np.arange(0, called.hand_over_s - 1e-6, 0.1):
        assert (recommended_leader(quiet, time_s).position_ne == recommended_leader(called, time_s).position_ne).all()


def test_at_an_emergency_call_it_flies_on_as_it_was_and_three_seconds_later_is_on_the_new_leg():
    path = plan(load("emergency"))
    called = recommended_leader(path, path.hand_over_s)
    assert called.velocity_ne == pytest.approx(path.segments[0].velocity_ne)
    just_before = recommended_leader(path, path.hand_over_s + SWING_S - 1e-9)
    assert just_before.position_ne == pytest.approx(path.segments[1].start_ne + path.segments[1].velocity_ne * SWING_S)
    assert just_before.velocity_ne == pytest.approx(path.segments[1].velocity_ne, abs=1e-6)


# --- the run-up


@pytest.mark.parametrize(
    ("time_s", "distance", "speed"),
    [(0, 0, 0), (1, 0.375, 0.75), (2, 1.5, 1.5), (3, 3.0, 1.5), (4, 4.5, 1.5)],
)
def test_the_run_up_accelerates_for_half_its_time_and_cruises_for_the_other(time_s, distance, speed):
    assert run_up(CRUISE, 4.0, time_s) == pytest.approx((distance, speed))


@given(st.floats(0.1, 5), st.floats(0.1, 20))
def test_the_run_up_takes_three_quarters_of_what_cruise_would_cover(cruise, duration_s):
    assert run_up(cruise, duration_s, duration_s) == pytest.approx((0.75 * cruise * duration_s, cruise))


@given(st.floats(0.1, 5), st.floats(0.1, 20), st.floats(0.001, 0.999))
def test_the_run_ups_speed_is_the_derivative_of_its_distance(cruise, duration_s, part):
    h, time_s = 1e-5 * duration_s, part * duration_s
    ahead, behind = (run_up(cruise, duration_s, time_s + side)[0] for side in (h, -h))
    assert (ahead - behind) / (2 * h) == pytest.approx(run_up(cruise, duration_s, time_s)[1], abs=1e-3 * cruise)


def test_no_run_up_begins_at_cruise_where_the_leg_begins():
    assert run_up(CRUISE, 0.0, 0.0) == (0.0, CRUISE)
