"""When a fault acts, how strongly, what it has come to, and who is to blame."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios import GpsJump, MotorDegradation, WindFault, healthy_robots, load


def jump(**keys):
    return GpsJump(**{"vehicle": 5, "kind": "gps_jump"} | keys)


ages = st.floats(-50, 200)
"""Of a moment since mission start [s]."""
faults = st.builds(
    jump,
    onset_s=st.floats(0, 20),
    end_s=st.none() | st.floats(21, 100),
    grows_over_s=st.just(0.0) | st.floats(0.1, 50),
    period_s=st.none() | st.floats(0.5, 30),
    on_fraction=st.floats(0.05, 1.0),
)


@pytest.mark.parametrize(
    ("time_s", "strength"),
    [(-math.inf, 0), (-1, 0), (3.9, 0), (4, 0), (5, 0.1), (9, 0.5), (14, 1), (15.9, 1), (16, 0), (math.inf, 0)],
)
def test_a_growing_fault_grows_evenly_from_onset_and_stops_at_its_end(time_s, strength):
    fault = jump(onset_s=4, end_s=16, grows_over_s=10)
    assert fault.strength(time_s) == pytest.approx(strength)
    assert fault.active(time_s) is (4 <= time_s < 16)


@pytest.mark.parametrize(
    ("time_s", "on"),
    [(4.9, False), (5, True), (5.9, True), (6, False), (8.9, False), (9, True), (9.99, True), (10, False), (25, True)],
)
def test_a_fault_that_comes_and_goes_acts_in_the_first_part_of_each_period_since_onset(time_s, on):
    fault = jump(onset_s=5, period_s=4, on_fraction=0.25)
    assert fault.active(time_s) is on
    assert fault.strength(time_s) == on


def test_tenths_of_a_second_fall_into_the_part_of_the_period_where_people_count_them():
    fault = jump(onset_s=0.1, period_s=0.7, on_fraction=3 / 7)
    assert [fault.active(n * 0.1) for n in range(1, 141)] == [True, True, True, False, False, False, False] * 20


def test_a_fault_on_all_of_each_period_never_pauses():
    assert jump(onset_s=1, period_s=3, on_fraction=1.0).on_since(100.0) == 1.0


def test_a_growing_fault_that_comes_and_goes_is_stronger_each_time():
    fault = jump(grows_over_s=100, period_s=10, on_fraction=0.5)
    assert [fault.strength(t) for t in (10, 14, 16, 20, 110)] == pytest.approx([0.1, 0.14, 0, 0.2, 1])


@given(faults, ages)
def test_strength_lies_between_nothing_and_all_and_is_nothing_where_it_does_not_act(fault, time_s):
    assert 0.0 <= fault.strength(time_s) <= 1.0
    if not fault.active(time_s):
        assert fault.strength(time_s) == fault.built_up_s(time_s) == 0.0
        assert fault.is_yet_to_act(time_s)
    else:
        assert fault.onset_s <= fault.on_since(time_s) <= time_s + 1e-9


@given(faults, ages)
def test_what_has_built_up_is_the_integral_of_the_strength_since_it_last_came(fault, time_s):
    since_s = min(fault.on_since(time_s), time_s)
    n = 400
    step = (time_s - since_s) / n
    integral = step * sum(fault.strength(since_s + (k + 0.5) * step) for k in range(n))
    assert fault.built_up_s(time_s) == pytest.approx(integral, abs=1e-6 + step)


@pytest.mark.parametrize(("time_s", "built_up_s"), [(2, 0), (4, 0.2), (12, 5), (20, 13)])
def test_a_rate_that_grows_builds_up_by_the_square_of_time_and_then_evenly(time_s, built_up_s):
    assert jump(onset_s=2, grows_over_s=10).built_up_s(time_s) == pytest.approx(built_up_s)


def test_a_fault_is_blamed_on_the_vehicle_that_it_strikes():
    assert MotorDegradation(vehicle=3, kind="motor_degradation").blamed == 3
    assert WindFault(vehicle=3, kind="wind").blamed == 3


def test_nobody_is_blamed_for_wind_that_blows_on_everyone():
    assert WindFault(vehicle=3, kind="wind", everyone=True).blamed is None
    windy = load("demo", overrides=['fault=[{vehicle=3, kind="wind", everyone=true}, {vehicle=2, kind="gps_drift"}]'])
    assert healthy_robots(windy).tolist() == [True, False, True, True, True, True]
