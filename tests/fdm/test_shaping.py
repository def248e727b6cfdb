"""A slow autopilot's velocity against closed forms, and in flight."""

import math

import numpy as np
import pytest
from clients import Fleet, Flight, scenario, setpoint
from hypothesis import given
from hypothesis import strategies as st

from fdm.modes import Mode
from fdm.shaping import SHAPING_S, Motion, shape, shape_of

DT = SHAPING_S
REST = Motion((0.0, 0.0))
ARDUCOPTER = {"lag_s": 0.2, "acceleration_m_s2": 2.5, "jerk_m_s3": 5.0}
FIRST_ORDER = {"lag_s": 0.8}
"""What `Vehicle` documents."""


def shaped(wanted, *, seconds=None, start=REST, **parameters):
    """Motions, one every DT, towards one velocity, or towards one after another."""
    targets = [wanted] * round(seconds / DT) if seconds is not None else wanted
    motions = [start]
    for target in targets:
        motions.append(shape(motions[-1], target, **{"lag_s": 0.0} | parameters, dt=DT))
    return motions


def speeds(motions):
    return np.array([motion.velocity_ne[0] for motion in motions])


def test_without_bounds_and_lag_it_is_there_at_once():
    assert shaped((2.0, -1.0), seconds=DT)[-1].velocity_ne == pytest.approx((2.0, -1.0))


@pytest.mark.parametrize("lag_s", [0.1, 0.8, 3.0])
def test_a_lag_alone_is_first_order_to_the_last_digit(lag_s):
    v = speeds(shaped((2.0, 0.0), seconds=5, lag_s=lag_s))
    t = np.arange(len(v)) * DT
    assert v == pytest.approx(2.0 * (1.0 - np.exp(-t / lag_s)), abs=1e-12)


def test_bounded_acceleration_alone_is_a_ramp():
    v = speeds(shaped((2.0, 0.0), seconds=2, acceleration_m_s2=2.5))
    t = np.arange(len(v)) * DT
    assert v == pytest.approx(np.minimum(2.5 * t, 2.0))


def test_bounded_jerk_takes_the_time_optimal_s_curve():
    """Half of a step Δ takes √(Δ / jerk); v = ½ jerk t² until there."""
    jerk, half_s = 5.0, math.sqrt(2.0 / 5.0)
    v = speeds(shaped((2.0, 0.0), seconds=2, jerk_m_s3=jerk))
    t = np.arange(len(v)) * DT
    first = np.minimum(t, half_s)
    rest = np.clip(2 * half_s - t, 0.0, half_s)
    ideal = np.where(t <= half_s, jerk * first**2 / 2, 2.0 - jerk * rest**2 / 2)
    assert v == pytest.approx(ideal, abs=2 * DT * jerk * half_s / 2)
    assert v[t > 2 * half_s + 3 * DT] == pytest.approx(2.0, abs=jerk * DT**2)


def test_both_bounds_make_three_parts_of_the_way():
    """Δ/a + a/jerk in all: 0.8 s and 0.5 s."""
    motions = shaped((2.0, 0.0), seconds=2, acceleration_m_s2=2.5, jerk_m_s3=5.0)
    a = np.array([motion.acceleration_ne[0] for motion in motions])
    t = np.arange(len(a)) * DT
    assert a[(t > 0.5) & (t < 0.78)] == pytest.approx(2.5)
    assert a[t > 1.3 + 3 * DT] == pytest.approx(0.0, abs=5.0 * DT)
    assert speeds(motions)[-1] == pytest.approx(2.0)


targets = st.lists(st.tuples(st.floats(-12, 12), st.floats(-12, 12)), min_size=1, max_size=8)
accelerations, jerks, lags = st.floats(0.5, 20), st.floats(0.5, 50), st.just(0.0) | st.floats(0.02, 3)


@given(targets, st.integers(1, 60), accelerations, jerks, lags)
def test_no_sequence_of_set_points_gets_more_acceleration_or_jerk_out_of_it_than_its_bounds(
    wanted, steps, acceleration, jerk, lag
):
    motions = shaped(
        np.repeat(wanted, steps, axis=0).tolist(), lag_s=lag, acceleration_m_s2=acceleration, jerk_m_s3=jerk
    )
    v, a = (np.array([motion[part] for motion in motions]) for part in (0, 1))
    assert np.hypot(*a.T).max() <= acceleration * (1 + 1e-9)
    assert np.hypot(*np.diff(a, axis=0).T).max() <= jerk * DT * (1 + 1e-9)
    assert np.diff(v, axis=0) == pytest.approx(a[1:] * DT, abs=1e-9)


@given(targets, st.integers(1, 60), accelerations, jerks, lags)
def test_wherever_it_was_sent_before_it_comes_to_the_last_set_point_and_stays(wanted, steps, acceleration, jerk, lag):
    parameters = {"lag_s": lag, "acceleration_m_s2": acceleration, "jerk_m_s3": jerk}
    sent = shaped(np.repeat(wanted, steps, axis=0).tolist(), **parameters)[-1]
    slowest = 3 * (34 / acceleration + acceleration / jerk + 2 * math.sqrt(34 / jerk)) + 12 * lag
    there = shaped(wanted[-1], seconds=slowest, start=sent, **parameters)[-1]
    assert there.velocity_ne == pytest.approx(wanted[-1], abs=1e-3)
    assert there.acceleration_ne == pytest.approx((0.0, 0.0), abs=1e-2)


@given(st.floats(0.01, 12), jerks, lags)
def test_from_rest_it_never_overshoots_by_what_anybody_could_see(step, jerk, lag):
    v = speeds(shaped((step, 0.0), seconds=2, lag_s=lag, jerk_m_s3=jerk))
    assert v.max() <= step + jerk * DT**2 / 4


@given(targets, st.floats(-math.pi, math.pi))
def test_it_knows_no_compass(wanted, turn):
    def turned(n, e):
        return n * math.cos(turn) - e * math.sin(turn), n * math.sin(turn) + e * math.cos(turn)

    sent = np.repeat(wanted, 20, axis=0).tolist()
    one = turned(*shaped(sent, **ARDUCOPTER)[-1].velocity_ne)
    assert shaped([turned(*to) for to in sent], **ARDUCOPTER)[-1].velocity_ne == pytest.approx(one, abs=1e-6)


def test_a_fleet_that_no_key_slows_down_is_not_shaped():
    assert shape_of(scenario()) is None
    for key, value in ARDUCOPTER.items():
        assert shape_of(scenario(vehicle={key: value})) is not None


# --- in flight


def answer(step_m_s=2.0, **vehicle):
    """(t, v / v_step) of a step of the set-point from rest, every 20 ms."""
    flight = Flight(scenario(vehicle=vehicle)).hover().offboard(seconds=1.0)
    share = []
    for n in range(400):
        if n % 5 == 0:
            flight.send(setpoint((step_m_s, 0.0, 0.0)))
        flight.endpoint.step(5)
        share.append(flight.velocity[0] / step_m_s)
    return np.arange(1, 401) * 0.02, np.array(share)


def rise_s(t, share):
    """10–90 %."""
    return np.interp(0.9, share[: np.argmax(share > 0.95)], t[: np.argmax(share > 0.95)]) - np.interp(
        0.1, share[: np.argmax(share > 0.95)], t[: np.argmax(share > 0.95)]
    )


def mean_lag_s(t, share):
    return np.trapezoid(1 - np.append(0.0, share), np.append(0.0, t))


@pytest.mark.parametrize(
    ("vehicle", "rise", "mean_lag"), [({}, 0.58, 0.47), (ARDUCOPTER, 1.01, 1.13), (FIRST_ORDER, 2.0, 1.27)]
)
def test_the_fleets_that_ship_answer_as_documented(vehicle, rise, mean_lag):
    t, share = answer(**vehicle)
    assert rise_s(t, share) == pytest.approx(rise, abs=0.02)
    assert mean_lag_s(t, share) == pytest.approx(mean_lag, abs=0.01)
    assert share[-50:] == pytest.approx(1.0, abs=0.002)


def test_the_first_order_fleet_rises_as_one_of_900_ms_but_for_the_corner_at_its_begin():
    t, share = answer(**FIRST_ORDER)
    ideal = 1.0 - np.exp(-np.maximum(t - 0.38, 0.0) / 0.9)
    assert np.abs(share - ideal).max() < 0.07
    assert np.abs(share - ideal)[t > 0.7].max() < 0.03


def told_to_fly(flight, monkeypatch):
    """Horizontal velocities that the flight controller is asked for, from now on."""
    told = []
    set_velocity = flight.vehicle.set_velocity

    def spy(velocity, yaw):
        told.append(velocity)
        set_velocity(velocity, yaw)

    monkeypatch.setattr(flight.vehicle, "set_velocity", spy)
    return told


def test_faults_bend_what_a_slow_vehicle_wants_so_that_it_slides_into_them_slowly(monkeypatch):
    fault = {"vehicle": 1, "kind": "motor_degradation", "onset_s": 1.0}
    flight = Flight(scenario(vehicle=ARDUCOPTER, fault=[fault])).hover().offboard((1.5, 0.0, 0.0), 4.0)
    flight.endpoint.begin_mission()
    told = told_to_fly(flight, monkeypatch)
    flight.stream(6.0, (1.5, 0.0, 0.0), rate_hz=10)
    a = np.array(told)[:, :2]
    assert a[0] == pytest.approx((1.5, 0.0), abs=1e-3)
    assert a[-1] == pytest.approx((0.6, -0.705), abs=1e-3)
    assert np.hypot(*np.diff(a, axis=0).T).max() <= 2.5 * DT + 1e-9


def test_a_slow_vehicle_begins_offboard_with_the_velocity_it_has():
    flight = Flight(scenario(vehicle=FIRST_ORDER)).hover().offboard((3.0, 0.0, 0.0), 5.0)
    flight.ask(176, 1, 4, 3)
    flight.stream(0.1, (3.0, 0.0, 0.0))
    before = flight.velocity[0]
    flight.offboard((3.0, 0.0, 0.0), 0.5)
    assert flight.velocity[0] > 0.5 * before


def test_a_slow_vehicle_holds_and_lands_when_set_points_fall_silent():
    flight = Flight(scenario(vehicle=FIRST_ORDER)).hover(5.0).offboard((1.5, 0.0, 0.0), 4.0)
    flight.wait(0.7)
    assert flight.pilot.mode is Mode.HOLD
    flight.wait(3.0)
    assert flight.speed < 0.3
    flight.wait(15.0)
    assert not flight.pilot.armed
    assert flight.position[2] == pytest.approx(0.0, abs=0.1)


def test_the_missions_own_clock_is_that_of_a_slow_fleet_too():
    fleet = Fleet(scenario(vehicle=ARDUCOPTER))
    fleet.take_off()
    fleet.offboard((1.5, 0.0, 0.0))
    fleet.stream(6.0, (1.5, 0.0, 0.0))
    (endpoint,) = fleet.world.endpoints
    assert endpoint.pilot.mode is Mode.OFFBOARD
    assert endpoint.vehicle.position_velocity()[3] == pytest.approx(1.5, abs=0.01)


def test_how_many_steps_are_taken_at_a_time_changes_nothing_for_a_slow_vehicle():
    def flown(at_once):
        fleet = Fleet(scenario(vehicle=ARDUCOPTER))
        fleet.take_off(at_once=at_once)
        fleet.offboard((1.5, 0.0, 0.0), at_once=at_once)
        fleet.stream(3.0, (1.5, 0.5, 0.0), at_once=at_once)
        return fleet.world.endpoints[0].vehicle.position_velocity()

    assert flown(None) == flown(7)
