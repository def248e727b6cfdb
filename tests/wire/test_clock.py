"""The wall clock, with the machine's two clocks in our hands."""

import pytest

from wire import clock
from wire.clock import WallClock

SECOND = 1_000_000_000
MORNING = 1_700_000_000 * SECOND


class Machine:
    """A machine whose calendar clock and monotonic clock are set by hand."""

    def __init__(self):
        self.calendar, self.monotonic = MORNING, 77 * SECOND

    def time_ns(self):
        return self.calendar

    def monotonic_ns(self):
        return self.monotonic

    def wait(self, seconds):
        self.calendar += round(seconds * SECOND)
        self.monotonic += round(seconds * SECOND)


@pytest.fixture
def machine(monkeypatch):
    machine = Machine()
    monkeypatch.setattr(clock.time, "time_ns", machine.time_ns)
    monkeypatch.setattr(clock.time, "monotonic_ns", machine.monotonic_ns)
    return machine


@pytest.mark.usefixtures("machine")
def test_it_starts_at_the_walls_time():
    assert WallClock().now() == MORNING


@pytest.mark.parametrize("speed", [0.5, 1.0, 2.0, 10.0])
def test_it_runs_at_its_speed(machine, speed):
    wall = WallClock(speed=speed)
    machine.wait(3)
    assert wall.now() == MORNING + 3 * speed * SECOND


@pytest.mark.parametrize("jump_s", [-3600, 3600])
def test_a_calendar_set_back_or_forth_moves_nothing(machine, jump_s):
    wall = WallClock()
    machine.wait(1)
    machine.calendar += jump_s * SECOND
    assert wall.now() == MORNING + SECOND


@pytest.mark.parametrize("speed", [0.5, 1.0, 4.0])
def test_real_seconds_until_a_time_shrink_with_speed(machine, speed):
    wall = WallClock(speed=speed)
    assert wall.seconds_until(MORNING + 2 * SECOND) == pytest.approx(2 / speed)
    machine.wait(2 / speed)
    assert wall.seconds_until(MORNING + 2 * SECOND) == 0


@pytest.mark.usefixtures("machine")
def test_a_time_that_has_passed_is_no_seconds_away():
    assert WallClock().seconds_until(MORNING - 99 * SECOND) == 0


def test_the_machines_own_clock_never_runs_back():
    wall = WallClock(speed=3.0)
    times = [wall.now() for _ in range(1000)]
    assert times == sorted(times)
