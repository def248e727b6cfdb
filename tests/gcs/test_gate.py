"""The only way for a set-point to come into being: what passes is asked of the frame, as pymavlink decodes it."""

import ast
from dataclasses import replace
from math import inf, nan, radians
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pymavlink.dialects.v20 import ardupilotmega as dialect

import gcs
from gcs.gate import (
    BRAKING,
    FENCED,
    LATE_PERIODS,
    LOST_NS,
    PASSED,
    REFUSED,
    RESPONSE_S,
    SLOWED,
    WITHHELD,
    Limits,
    Standing,
    admit,
)
from gcs.messages import Encoder
from gcs.mission import plan, run_up
from scenarios import load, offsets_ne
from scenarios.fence import reach_m

DT, N = 0.1, 6
LIMITS = Limits(speed=5.0, acceleration=10.0)
FENCE = Limits(speed=5.0, acceleration=10.0, radius=40.0, ceiling=15.0, floor=1.0)
MIDDLE = (0.0, 0.0, -8.0)


def single(vectors):
    """As MAVLink carries numbers."""
    return np.asarray(vectors, float).astype(np.float32).astype(float)


def of_vehicles(elements):
    return arrays(float, (N, 3), elements=elements)


hostile = of_vehicles(st.floats(-1e6, 1e6) | st.floats() | st.sampled_from([nan, inf, -inf, 1e200, -1.7e308, 5e-324]))
asked = of_vehicles(st.floats(-20, 20)) | hostile
sane = of_vehicles(st.floats(-3, 3)).map(single)  # no part is longer than √18 < 5 m/s
places = of_vehicles(st.floats(-45, 45))
limits = st.builds(
    Limits,
    speed=st.floats(5, 20),
    acceleration=st.floats(0.1, 100),
    radius=st.floats(5, 60) | st.just(inf),
    ceiling=st.floats(10, 30) | st.just(inf),
    floor=st.floats(0, 5) | st.just(-inf),
)


def standing(before_ned=None, **changed):
    """Six vehicles hovering in the middle of a fence, ours, and heard of just now."""
    n = N if before_ned is None else len(before_ned)
    fleet = Standing(
        ids=tuple(range(1, n + 1)),
        ours=np.ones(n, bool),
        age_ns=np.zeros(n, np.int64),
        place_ned=np.tile(MIDDLE, (n, 1)),
        velocity_ned=np.zeros((n, 3)),
        before_ned=np.zeros((n, 3)) if before_ned is None else before_ned,
        lateness_ns=0,
    )
    return replace(fleet, **changed)


def admitted(asked_ned, fleet, limits, yaw=0.0):
    return admit(asked_ned, yaw, fleet, limits, dt=DT)


def decoded(passage):
    """System id → velocity (north, east, down), as a vehicle reads it off the frame."""
    mav = dialect.MAVLink(None)
    read = {}
    for system, command in passage.commands:
        message = mav.decode(bytearray(Encoder(system).encode(command, 0)))
        assert (message.coordinate_frame, message.type_mask) == (dialect.MAV_FRAME_LOCAL_NED, 0x09C7)
        assert message.target_system == system
        assert np.isfinite(message.yaw)
        read[system] = np.array([message.vx, message.vy, message.vz])
    return read


def one(asked_ned, before_ned=(0.0, 0.0, 0.0), limits=LIMITS, **changed):
    passage = admitted(np.array([asked_ned], float), standing(np.array([before_ned], float), **changed), limits)
    return passage.sent_ned[0], passage.verdict[0]


def level(vector):
    return float(np.hypot(*vector[:2]))


# --- what leaves, whatever was asked: bounds of the decoded frame, not of an intention


@given(asked, sane, limits, places, sane, st.floats(allow_nan=True))
def test_every_frame_is_finite_no_faster_than_allowed_and_no_more_of_a_change(
    asked_ned, before_ned, limits, place_ned, velocity_ned, yaw
):
    fleet = standing(before_ned, place_ned=place_ned, velocity_ned=velocity_ned)
    passage = admitted(asked_ned, fleet, limits, yaw)
    frames = decoded(passage)
    assert frames.keys() == set(fleet.ids)
    for row, system in enumerate(fleet.ids):
        velocity, change = frames[system], frames[system] - before_ned[row]
        assert np.isfinite(velocity).all()
        assert (velocity == passage.sent_ned[row]).all()
        assert level(velocity) <= limits.speed
        assert abs(velocity[2]) <= limits.speed
        assert level(change) <= limits.acceleration * DT
        assert abs(change[2]) <= limits.acceleration * DT


def stopping(place, velocity, set_point, *, lag_s, braking):
    """Where a vehicle with a first-order lag ends whose set-point is brought straight to zero."""
    speed = np.linalg.norm(set_point)
    return place + lag_s * velocity + set_point * 0.5 * speed / braking


@given(asked, sane, places, sane, st.floats(0, RESPONSE_S))
def test_the_stopping_point_is_inside_the_fence_wherever_braking_can_keep_it_there(
    asked_ned, before_ned, place_ned, velocity_ned, lag_s
):
    place_ned[:, 2] = place_ned[:, 2] / 6 - 8.0
    fleet = standing(before_ned, place_ned=place_ned, velocity_ned=velocity_ned)
    frames = decoded(admitted(asked_ned, fleet, FENCE))
    braked = decoded(admitted(np.zeros((N, 3)), fleet, Limits(5.0, 10.0)))
    for row, system in enumerate(fleet.ids):
        place, velocity = place_ned[row], velocity_ned[row]

        def ends(set_point, part, braking, at=place[:], flies=velocity[:]):
            lags = (0.0, lag_s, RESPONSE_S)
            return [stopping(at[part], flies[part], set_point[part], lag_s=lag, braking=braking) for lag in lags]

        def drift(set_point, part, at=place[:], flies=velocity[:]):
            """The places that braking from this set-point passes, a tick of it included."""
            return [
                at[part] + lag * flies[part] + share * set_point[part] * DT
                for lag in (0, RESPONSE_S)
                for share in (0, 1)
            ]

        def well(points):
            return all(np.linalg.norm(point) <= FENCE.radius for point in points)

        def high(points):
            return all(-FENCE.ceiling <= point[0] <= -FENCE.floor for point in points)

        for part, inside, braking in ((slice(0, 2), well, BRAKING[0]), (slice(2, 3), high, BRAKING[1])):
            could = [
                end + set_point * DT
                for set_point in [braked[system][part]]
                for end in ends(braked[system], part, braking)
            ]
            if inside(could) and inside(drift(braked[system], part)):
                assert inside(ends(frames[system], part, braking))


@given(of_vehicles(st.floats(-0.5, 0.5)))
def test_far_from_its_fence_a_swarm_flies_as_if_there_were_none(asked_ned):
    inner = admitted(asked_ned, standing(), FENCE)
    assert (inner.sent_ned == admitted(asked_ned, standing(), LIMITS).sent_ned).all()
    assert set(inner.verdict.tolist()) == {PASSED}


# --- vehicles that fly what passes, whoever asks


class Vehicle:
    """A point with a first-order lag, and as much acceleration as it takes, or no more than so much."""

    def __init__(self, lag_s, most=inf):
        self.place, self.velocity = np.array(MIDDLE), np.zeros(3)
        self._lag_s, self._most = lag_s, most

    def fly(self, set_point, *, steps=20):
        h = DT / steps
        for _ in range(steps):
            change = (set_point - self.velocity) * (1.0 if self._lag_s == 0 else -np.expm1(-h / self._lag_s))
            change *= min(1.0, self._most * h / max(np.linalg.norm(change), 1e-12))
            self.place = self.place + (self.velocity + 0.5 * change) * h
            self.velocity = self.velocity + change


kinds = st.builds(Vehicle, lag_s=st.floats(0, RESPONSE_S)) | st.just((0.3, 4.0)).map(lambda kind: Vehicle(*kind))
urges = st.lists(arrays(float, 3, elements=st.floats(-50, 50)), min_size=1, max_size=12)


@given(kinds, urges, st.integers(1, 40), st.sampled_from([10.0, 3.0, 0.5]))
def test_a_vehicle_that_is_asked_for_the_worst_never_leaves_its_fence(vehicle, urges, ticks, acceleration):
    small = replace(FENCE, radius=8.0, acceleration=acceleration)
    before = np.zeros((1, 3))
    for urge in urges:
        for _ in range(ticks):
            fleet = standing(before, place_ned=vehicle.place[None], velocity_ned=vehicle.velocity[None])
            before = admitted(urge[None], fleet, small).sent_ned
            vehicle.fly(before[0])
            assert level(vehicle.place) <= small.radius
            assert small.floor <= -vehicle.place[2] <= small.ceiling


@pytest.mark.parametrize("acceleration", [0.3, 0.8, 2.0])
def test_limits_below_what_an_autopilot_brakes_at_are_what_it_brakes_at(acceleration):
    gentle = replace(FENCE, acceleration=acceleration)
    vehicle, before = Vehicle(0.5), np.zeros((1, 3))
    for _ in range(1000):
        fleet = standing(before, place_ned=vehicle.place[None], velocity_ned=vehicle.velocity[None])
        before = admitted(np.array([[5.0, 0.0, -5.0]]), fleet, gentle).sent_ned
        vehicle.fly(before[0])
        assert vehicle.place[0] <= FENCE.radius
        assert -vehicle.place[2] <= FENCE.ceiling
    assert vehicle.place[0] > FENCE.radius - 1.0


@pytest.mark.parametrize("lag_s", [0.0, 0.3, 1.0])
def test_a_vehicle_sent_against_its_fence_comes_close_and_comes_back_when_asked(lag_s):
    vehicle, before = Vehicle(lag_s), np.zeros((1, 3))
    out, back = [], []
    for asked_ned, kept in (((5.0, 0.0, -3.0), out), ((-2.0, 0.0, 1.0), back)):
        for _ in range(200):
            fleet = standing(before, place_ned=vehicle.place[None], velocity_ned=vehicle.velocity[None])
            before = admitted(np.array([asked_ned]), fleet, FENCE).sent_ned
            vehicle.fly(before[0])
            kept.append(vehicle.place)
    assert FENCE.radius - 0.5 < out[-1][0] <= FENCE.radius
    assert FENCE.ceiling - 0.5 < -out[-1][2] <= FENCE.ceiling
    assert back[-1][0] < 10.0
    assert -back[-1][2] < 2.0


def test_a_vehicle_blown_outwards_is_braked_as_hard_as_the_limits_allow():
    place, velocity = np.array([[39.9, 0.0, -8.0]]), np.array([[3.0, 0.0, 0.0]])
    sent, verdict = one((3, 0, 0), (3, 0, 0), FENCE, place_ned=place, velocity_ned=velocity)
    assert sent == pytest.approx([2.0, 0.0, 0.0])
    assert verdict == FENCED


@pytest.mark.parametrize(
    ("asked_ned", "sent"),
    [((-0.5, 0, 0), (-0.5, 0, 0)), ((0.5, 0, 0), (0, 0, 0)), ((0, 0.5, 0), (0, 0, 0)), ((0, 0, 0.5), (0, 0, 0.5))],
    ids=["back", "on", "along", "down"],
)
def test_a_vehicle_outside_may_come_back_and_go_no_farther(asked_ned, sent):
    flown, verdict = one(asked_ned, limits=FENCE, place_ned=np.array([[41.0, 0.0, -8.0]]))
    assert flown == pytest.approx(sent, abs=0.01)
    assert verdict == (PASSED if sent == asked_ned else FENCED)


OUTWARDS = {"on the level": (np.array([1.0, 0, 0]), FENCE.radius), "in height": (np.array([0, 0, -1.0]), FENCE.ceiling)}


@pytest.mark.parametrize("out_m", [0.0, 0.5])
@pytest.mark.parametrize("drift_m_s", [0.01, 0.3, 1.0])
@pytest.mark.parametrize("way", OUTWARDS)
def test_a_vehicle_that_drifts_out_at_its_bound_comes_back_when_asked(way, drift_m_s, out_m):
    outwards, bound = OUTWARDS[way]
    place = np.where(outwards != 0, (bound + out_m) * outwards, MIDDLE)
    news = {"place_ned": place[None], "velocity_ned": drift_m_s * outwards[None]}
    for back_m_s in (0.5, 0.01):
        assert one(-back_m_s * outwards, limits=FENCE, **news)[0] == pytest.approx(-back_m_s * outwards)
    assert one(0.5 * outwards, limits=FENCE, **news)[0] == pytest.approx(np.zeros(3), abs=1e-3)


def test_nor_does_it_cross_its_fence_to_be_as_far_out_on_the_other_side():
    news = {"place_ned": np.array([[0.5, 0, -8]]), "velocity_ned": np.array([[3.0, 0, 0]])}
    small = replace(FENCE, radius=2.0, acceleration=100.0)
    sent, _ = one((-5, 0, 0), limits=small, **news)
    assert sent[0] < 0
    assert stopping(0.5, 0.0, sent[:1], lag_s=0.0, braking=BRAKING[0]) >= -small.radius


@pytest.mark.parametrize("part", [0, 2])
@pytest.mark.parametrize("speed", [0.1, 0.3, 0.6])
def test_rounding_takes_nobody_over_the_wall(part, speed):
    """A set-point from which a vehicle would stop on the very wall is a little faster when it has become single."""
    assert single(speed) > speed
    outwards = np.where(np.arange(3) == part, -1.0 if part == 2 else 1.0, 0.0)
    bound, braking = (FENCE.ceiling, BRAKING[1]) if part == 2 else (FENCE.radius, BRAKING[0])

    def way(at_m_s):
        return at_m_s * (0.5 * at_m_s / braking + DT)

    place = np.where(outwards != 0, (bound - way(speed)) * outwards, MIDDLE)
    fleet = standing(np.zeros((1, 3)), place_ned=place[None])
    (sent,) = decoded(admitted(speed * outwards[None], fleet, FENCE)).values()
    assert 0.9 * speed < sent @ outwards
    assert place @ outwards + way(sent @ outwards) <= bound


@pytest.mark.parametrize("name", ["place_ned", "velocity_ned"])
def test_inside_a_fence_nobody_moves_who_does_not_know_where_he_is(name):
    unknown = standing(**{name: np.where(np.arange(N)[:, None] == 2, nan, np.tile(MIDDLE, (N, 1)) * 0)})
    unknown = replace(unknown, place_ned=unknown.place_ned + np.array(MIDDLE))
    passage = admitted(np.full((N, 3), 0.2), unknown, FENCE)
    assert passage.verdict.tolist() == [PASSED, PASSED, REFUSED, PASSED, PASSED, PASSED]
    assert not passage.sent_ned[2].any()
    assert admitted(np.full((N, 3), 0.2), unknown, LIMITS).verdict.tolist() == [PASSED] * N


def test_old_telemetry_is_flown_on_before_the_fence_is_asked():
    place, velocity = np.array([[36.5, 0.0, -8.0]]), np.array([[1.5, 0.0, 0.0]])
    news = {"place_ned": place, "velocity_ned": velocity}
    assert one((1.5, 0, 0), (1.5, 0, 0), FENCE, **news)[1] == PASSED
    assert one((1.5, 0, 0), (1.5, 0, 0), FENCE, **news, age_ns=np.array([LOST_NS]))[1] == FENCED


def test_a_scenarios_limits_are_the_gates():
    assert Limits.of(load("transit")) == LIMITS
    assert not Limits.of(load("transit")).fenced
    fenced = load("transit", overrides=["limits.fence.radius_m=70", "limits.speed_m_s=4"])
    assert Limits.of(fenced) == Limits(4.0, 10.0, radius=70.0)
    assert Limits.of(fenced).fenced


@pytest.mark.parametrize("name", ["demo", "emergency", "transit"])
@pytest.mark.parametrize("run_up_s", [0.0, 4.0])
def test_how_far_a_fence_reckons_that_a_mission_goes_is_how_far_its_plan_does(name, run_up_s):
    scenario = load(name, overrides=[f"mission.run_up_s={run_up_s}"])
    legs, cruise = plan(scenario).segments, scenario.mission.cruise_m_s
    begins = run_up(cruise, run_up_s, run_up_s)[0] * legs[0].velocity_ne / cruise if run_up_s else np.zeros(2)
    corners = [-begins, *(leg.start_ne for leg in legs), legs[-1].end_ne]
    places = np.array([corner + begins + place for corner in corners for place in offsets_ne(scenario)])
    assert reach_m(scenario) == pytest.approx(np.hypot(*places.T).max())


# --- who is sent anything at all


@given(asked, sane, arrays(bool, N), arrays(np.int64, N, elements=st.integers(0, 2 * LOST_NS)))
def test_who_is_not_ours_or_not_heard_is_sent_nothing(asked_ned, before_ned, ours, age_ns):
    passage = admitted(asked_ned, standing(before_ned, ours=ours, age_ns=age_ns), FENCE)
    sent_to = ours & (age_ns <= LOST_NS)
    assert passage.commanded.tolist() == sent_to.tolist()
    assert [system for system, _ in passage.commands] == (np.flatnonzero(sent_to) + 1).tolist()
    assert ((passage.verdict == WITHHELD) == ~sent_to).all()
    assert not passage.sent_ned[~sent_to].any()


def test_the_last_moment_of_being_heard_counts():
    for age_ns, verdict in ((LOST_NS, PASSED), (LOST_NS + 1, WITHHELD)):
        assert one((0.1, 0, 0), age_ns=np.array([age_ns]))[1] == verdict


def test_to_who_is_sent_nothing_nothing_is_on_record_as_sent():
    nobody = standing(np.tile((3.0, 0, 0), (N, 1)), ours=np.zeros(N, bool))
    assert not admitted(np.zeros((N, 3)), nobody, LIMITS).sent_ned.any()


UNSENT = np.full((N, 3), nan)


@given(asked, of_vehicles(st.floats(-9, 9)), limits, places)
def test_who_was_sent_nothing_goes_on_from_what_it_flies(asked_ned, velocity_ned, limits, place_ned):
    """Whoever flew it meanwhile: no faster than it may, and with no more of a change than it may."""
    fleet = standing(UNSENT, velocity_ned=velocity_ned, place_ned=place_ned)
    for row, (north, east, down) in enumerate(admitted(asked_ned, fleet, limits).sent_ned):
        level_m_s, most = np.hypot(*velocity_ned[row, :2]), limits.acceleration * DT
        slower = min(1.0, limits.speed / max(level_m_s, 1e-9))
        flown = np.append(velocity_ned[row, :2] * slower, np.clip(velocity_ned[row, 2], -limits.speed, limits.speed))
        assert np.hypot(north - flown[0], east - flown[1]) <= most + 1e-4
        assert abs(down - flown[2]) <= most + 1e-4
        assert np.hypot(north, east) <= limits.speed
        assert abs(down) <= limits.speed


def test_a_vehicle_given_back_in_flight_is_not_jerked_to_a_stop():
    sent, verdict = one((4.0, 0, 0), (nan, nan, nan), velocity_ned=np.array([[4.0, 0.0, 0.0]]))
    assert sent == pytest.approx([4.0, 0, 0])
    assert verdict == PASSED


def test_who_was_sent_nothing_and_does_not_tell_how_fast_it_is_begins_at_rest():
    sent, _ = one((4.0, 0, 0), (nan, nan, nan), velocity_ned=np.full((1, 3), nan))
    assert sent.tolist() == [1.0, 0, 0]


LATE_NS = round(LATE_PERIODS * DT * 1e9)


@given(asked, sane, st.integers(LATE_NS - 5, LATE_NS + 5) | st.integers(0, 10**10))
def test_a_decision_two_periods_late_asks_nobody_to_move(asked_ned, before_ned, lateness_ns):
    passage = admitted(asked_ned, standing(before_ned, lateness_ns=lateness_ns), FENCE)
    if lateness_ns > LATE_NS:
        assert set(passage.verdict.tolist()) == {REFUSED}
        for sent, before in zip(passage.sent_ned, before_ned, strict=True):
            assert level(sent) <= max(0.0, level(before) - 0.99)
    else:
        assert REFUSED not in passage.verdict[(np.abs(asked_ned) < 1e6).all(axis=1)].tolist()


# --- refused, slowed, passed


@given(hostile, sane)
def test_a_set_point_that_is_no_number_is_refused_and_the_vehicle_slows_to_a_stop(asked_ned, before_ned):
    refused = ~(np.abs(asked_ned) <= 1e6).all(1)
    passage = admitted(asked_ned, standing(before_ned), LIMITS)
    assert ((passage.verdict == REFUSED) == refused).all()
    stopped = passage.sent_ned
    assert (np.hypot(*stopped[refused, :2].T) <= np.hypot(*before_ned[refused, :2].T)).all()
    for _ in range(6):  # 5 m/s at 1 m/s a tick
        stopped = admitted(np.full((N, 3), nan), standing(stopped), LIMITS).sent_ned
    assert not stopped.any()


@given(sane, sane)
def test_what_is_within_the_limits_is_sent_as_asked(asked_ned, before_ned):
    passage = admitted(asked_ned, standing(before_ned), Limits(speed=5.0, acceleration=1000.0))
    assert passage.sent_ned == pytest.approx(asked_ned, abs=1e-12)
    assert (passage.verdict == PASSED).all()


@given(sane)
def test_what_was_sent_may_be_sent_again(before_ned):
    passage = admitted(before_ned, standing(before_ned), LIMITS)
    assert (passage.sent_ned == before_ned).all()
    assert (passage.verdict == PASSED).all()


@given(asked, sane, places, st.integers(0, N - 1), sane)
def test_one_vehicles_set_point_is_no_matter_of_the_others(asked_ned, before_ned, place_ned, row, other):
    changed = other.copy()
    changed[row] = asked_ned[row]
    fleet = standing(before_ned, place_ned=place_ned)
    alone, beside = admitted(asked_ned, fleet, FENCE), admitted(changed, fleet, FENCE)
    assert (alone.sent_ned[row] == beside.sent_ned[row]).all()
    assert alone.verdict[row] == beside.verdict[row]


@pytest.mark.parametrize("asked_ned", [(30, 40, 0), (-300, 400, 0), (0, -1e6, 0)])
def test_a_set_point_that_is_too_fast_keeps_its_direction(asked_ned):
    sent, verdict = one(asked_ned, limits=Limits(speed=5.0, acceleration=1e9))
    assert sent == pytest.approx(5 * np.array(asked_ned) / np.linalg.norm(asked_ned), abs=1e-6)
    assert verdict == SLOWED


@pytest.mark.parametrize("down", [9.0, -9.0])
def test_climb_and_descent_are_limited_by_themselves(down):
    sent, verdict = one((3, 4, down), before_ned=(3, 4, down / 9 * 4.5))
    assert sent == pytest.approx([3, 4, np.copysign(5, down)])
    assert verdict == SLOWED


def test_from_rest_the_first_set_point_goes_as_far_as_the_acceleration_allows():
    sent, verdict = one((1.5, 0, 0))
    assert sent.tolist() == [1.0, 0, 0]
    assert verdict == SLOWED


@given(sane, sane, st.floats(0.1, 100))
def test_asking_again_and_again_arrives_and_stays(asked_ned, before_ned, acceleration):
    assume(acceleration * DT * 100 > 12)
    sent, limits = before_ned, Limits(5.0, acceleration)
    for _ in range(100):
        passage = admitted(asked_ned, standing(sent), limits)
        sent = passage.sent_ned
    assert sent == pytest.approx(asked_ned, abs=1e-9)
    assert (passage.verdict == PASSED).all()


@given(st.floats(0.01, 20), st.floats(0, 360), st.floats(0, 360))
def test_turning_at_full_speed_is_not_stopped_by_rounding(speed, from_deg, to_deg):
    """Between two set-points on the very bound there is always another."""
    on = single(np.array([[speed * np.cos(radians(d)), speed * np.sin(radians(d)), 0.0] for d in (from_deg, to_deg)]))
    limits = Limits(speed=speed, acceleration=10 * speed)
    sent = np.zeros((1, 3))
    for target in on:
        for _ in range(40):
            sent = admitted(target[None], standing(sent), limits).sent_ned
        assert sent[0] == pytest.approx(target, abs=1e-5 * speed)


def test_what_is_asked_stays_as_it_was():
    asked_ned, before_ned = np.array([[9.0, nan, 0]]), np.array([[1.0, 2.0, 3.0]])
    admitted(asked_ned, standing(before_ned), FENCE)
    assert np.array_equal(asked_ned, [[9.0, nan, 0]], equal_nan=True)
    assert before_ned.tolist() == [[1, 2, 3]]


# --- there is no other way


def calls(name):
    """Modules of the ground station that call something of this name, or make it in a way that calls nothing."""
    root = Path(gcs.__file__).parent
    for path in sorted(root.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call):
                callee = node.func.value if isinstance(node.func, ast.Attribute) else node.func
                names = {getattr(node.func, "attr", None), getattr(node.func, "id", None), getattr(callee, "id", None)}
                if name in names:
                    yield path.relative_to(root).as_posix()


def test_nothing_else_in_the_ground_station_makes_a_set_point():
    assert set(calls("SetVelocity")) == {"gate.py"}


def test_nothing_else_in_the_ground_station_writes_one_but_the_wrapper_that_slows_a_vehicle_down():
    assert "messages.py" in set(calls("pack_position_target")) <= {"messages.py", "degrade.py"}
    assert not set(calls("MAVLink_set_position_target_local_ned_message"))
    assert not set(calls("set_position_target_local_ned_send"))
