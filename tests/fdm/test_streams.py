"""Rates of messages on a grid of physics steps."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fdm.streams import Schedule


def due_steps(schedule, last, *, first=0, key=1):
    """Steps in (first, last] at which the key is due, one step at a time."""
    return [step for step in range(first + 1, last + 1) if key in schedule.take_due(step)]


def test_twenty_a_second_at_250_hz_alternate_13_and_12_steps():
    schedule = Schedule(250)
    schedule.set_interval(1, 0.05, step=0)
    steps = due_steps(schedule, 10_000)
    assert len(steps) == 20 * 40
    assert steps[:6] == [13, 25, 38, 50, 63, 75]
    assert steps == [math.ceil(12.5 * n) for n in range(1, 801)]


def test_equal_rates_stay_in_step_however_late_they_were_asked_for():
    schedule = Schedule(250)
    schedule.set_interval(1, 0.05, step=0)
    for step in range(1, 338):
        schedule.take_due(step)
    schedule.set_interval(2, 0.05, step=337)
    together = [(1 in due, 2 in due) for due in map(schedule.take_due, range(338, 2000))]
    assert set(together) == {(True, True), (False, False)}


def test_what_is_due_together_comes_in_ascending_order():
    schedule = Schedule(100)
    for key in (33, -2, 0, -1, 245, 32):
        schedule.set_interval(key, 0.1, step=0)
    assert schedule.take_due(10) == [-2, -1, 0, 32, 33, 245]


def test_a_new_interval_replaces_the_old_one():
    schedule = Schedule(100)
    schedule.set_interval(1, 1.0, step=0)
    assert due_steps(schedule, 250) == [100, 200]
    schedule.set_interval(1, 0.1, step=250)
    assert due_steps(schedule, 300, first=250) == [260, 270, 280, 290, 300]
    assert schedule.interval_s(1) == pytest.approx(0.1)


@pytest.mark.parametrize("off", [0.0, -1e-6, -1.0])
def test_an_interval_that_is_not_positive_stops_the_stream(off):
    schedule = Schedule(100)
    schedule.set_interval(1, 0.1, step=0)
    schedule.set_interval(1, off, step=0)
    assert due_steps(schedule, 1000) == []
    assert schedule.interval_s(1) == 0.0
    assert schedule.next_step > 10**15


def test_nothing_is_faster_than_physics():
    schedule = Schedule(250)
    schedule.set_interval(1, 1e-6, step=0)
    assert due_steps(schedule, 100) == list(range(1, 101))
    assert schedule.interval_s(1) == pytest.approx(0.004)


def test_what_is_due_once_comes_at_its_step_and_never_again():
    schedule = Schedule(250)
    schedule.set_interval(2, 0.05, step=0)
    schedule.once(1, step=20)
    assert (schedule.has(1), schedule.interval_s(1)) == (True, 0.0)
    assert due_steps(schedule, 1000) == [20]
    assert not schedule.has(1)
    schedule.once(1, step=1017)
    assert due_steps(schedule, 2000, first=1000) == [1017]


def test_a_stop_for_an_unknown_key_is_no_error():
    Schedule(250).set_interval(7, -1.0, step=3)


rates = st.floats(0.01, 2000.0)


@given(hz=st.integers(50, 2000), rate=rates, seconds=st.integers(1, 4))
def test_any_rate_at_any_physics_comes_as_often_as_asked(hz, rate, seconds):
    schedule = Schedule(hz)
    schedule.set_interval(1, 1.0 / rate, step=0)
    steps = due_steps(schedule, hz * seconds)
    assert abs(len(steps) - min(rate, hz) * seconds) <= 1
    interval = max(1.0, hz / rate)
    assert all(-1e-6 < step - interval * n < 1 + 1e-6 for n, step in enumerate(steps, start=1))


@given(hz=st.integers(50, 2000), rate=rates, start=st.integers(0, 10**8))
def test_a_stream_moves_on_after_days_of_flight(hz, rate, start):
    schedule = Schedule(hz)
    schedule.set_interval(1, 1.0 / rate, step=start)
    last = start
    for _ in range(20):
        step = schedule.next_step
        assert step > last
        assert schedule.take_due(step) == [1]
        last = step


@given(
    hz=st.integers(50, 2000),
    rates=st.lists(rates, min_size=1, max_size=5),
    bursts=st.lists(st.integers(1, 60), max_size=40),
)
def test_next_step_is_when_the_next_is_due_and_bursts_lose_none(hz, rates, bursts):
    every_step, jumping = Schedule(hz), Schedule(hz)
    for key, rate in enumerate(rates):
        every_step.set_interval(key, 1.0 / rate, step=0)
        jumping.set_interval(key, 1.0 / rate, step=0)
    expected = [(step, due) for step in range(1, sum(bursts) + 1) if (due := every_step.take_due(step))]
    got, step, target = [], 0, 0
    for burst in bursts:
        target += burst
        while step < target:
            step = min(target, jumping.next_step)
            if step == jumping.next_step:
                got.append((step, jumping.take_due(step)))
    assert got == expected
