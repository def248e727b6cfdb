"""The one loop, with a link, a clock and a decision that are a few lines each."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs.commands import Beat, SetVelocity
from gcs.loop import fly
from wire.frames import Framer, Sender

START, PERIOD = 7_000_000_000, 100_000_000


class LateClock:
    """Goes to the time asked for, and beyond it by as much as each tick is told to be late."""

    def __init__(self, late=None):
        self._now, self._tick, self._late = START, -1, late or {}
        self.deadlines = []

    def now(self):
        return self._now

    def sleep_until(self, time_ns):
        self._tick += 1
        self.deadlines.append(time_ns)
        self._now = max(self._now, time_ns) + self._late.get(self._tick, 0)


class Mailbox:
    """A link with one heartbeat a tick from vehicle 2, and all that is sent."""

    def __init__(self, clock):
        self._clock, self._sender = clock, Sender(2, 1)
        self.given, self.sent = [], []

    def receive(self):
        frames = Framer().frames(
            self._clock.now(), self._sender.pack(dialect.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3))
        )
        self.given += frames
        return frames

    def send(self, system, frame):
        self.sent.append((system, frame))


@dataclass(frozen=True)
class Countdown:
    """A state: how many ticks are left."""

    left: int

    @property
    def done(self):
        return self.left == 0


class Decision:
    """Asks vehicle 1 for a velocity each tick, vehicle 2 for nothing but a beat each second one."""

    ids = (1, 2)

    def __init__(self, ticks=5):
        self._ticks = ticks
        self.seen = []

    def start(self):
        return Countdown(self._ticks)

    def __call__(self, state, swarm, events, now_ns):
        self.seen.append((state, swarm, events, now_ns))
        commands = [(1, SetVelocity(1.0, 2.0, -0.5, 0.25))] + [(2, Beat())] * (state.left % 2)
        return replace(state, left=state.left - 1), commands, f"{state.left} left"


class Kept:
    def __init__(self):
        self.ticks = []

    def tick(self, tick):
        self.ticks.append(tick)


def flown(*, late=None, ticks=5, events=tuple):
    clock, decision, kept = LateClock(late), Decision(ticks), Kept()
    link = Mailbox(clock)
    state = fly(link, clock, decision, (kept,), period_ns=PERIOD, events=events)
    return clock, link, decision, kept, state


def test_it_ends_when_the_decision_is_done_and_returns_its_last_state():
    _, _, decision, kept, state = flown(ticks=3)
    assert state == Countdown(0)
    assert len(decision.seen) == len(kept.ticks) == 3


def test_deadlines_are_absolute_so_that_a_late_tick_does_not_shift_the_rest():
    clock, _, _, kept, _ = flown(late={1: 30_000_000, 2: 250_000_000})
    assert clock.deadlines == [START + number * PERIOD for number in range(5)]
    assert [tick.lateness_ns for tick in kept.ticks] == [0, 30_000_000, 250_000_000, 150_000_000, 50_000_000]


def test_the_decision_is_told_the_time_that_it_is_and_not_the_deadline():
    _, _, decision, kept, _ = flown(late={1: 30_000_000})
    assert [now for *_, now in decision.seen] == [tick.time_ns for tick in kept.ticks]
    assert kept.ticks[1].time_ns == START + PERIOD + 30_000_000


def test_set_points_carry_the_time_of_their_tick_and_not_of_its_lateness():
    _, link, _, _, _ = flown(late={1: 30_000_000})
    mav = dialect.MAVLink(None)
    decoded = [mav.decode(bytearray(frame)) for system, frame in link.sent if system == 1]
    assert [message.time_boot_ms for message in decoded] == [0, 100, 200, 300, 400]
    assert {(m.vx, m.vy, m.vz, m.yaw) for m in decoded} == {(1.0, 2.0, -0.5, 0.25)}
    assert {(m.target_system, m.target_component, m.type_mask) for m in decoded} == {(1, 1, 0x9C7)}


def test_every_vehicle_has_sequence_numbers_of_its_own():
    _, link, _, _, _ = flown()
    numbers = {system: [frame[4] for to, frame in link.sent if to == system] for system in (1, 2)}
    assert numbers == {1: [0, 1, 2, 3, 4], 2: [0, 1, 2]}


def test_every_frame_is_taken_once_before_its_tick_is_decided():
    _, link, decision, kept, _ = flown()
    assert [frame for tick in kept.ticks for frame in tick.frames] == link.given
    for _, swarm, _, now in decision.seen:
        assert swarm.heartbeat_ns[1] == now
        assert np.isnan(swarm.position_ned).all()


def test_an_operators_word_is_handed_on_once():
    words = iter([(), ("land",), (), (), ()])
    _, _, decision, kept, _ = flown(events=lambda: next(words))
    assert [events for *_, events, _ in decision.seen] == [(), ("land",), (), (), ()]
    assert [tick.events for tick in kept.ticks] == [(), ("land",), (), (), ()]


def test_recorders_are_told_in_their_order_what_was_decided():
    clock, told = LateClock(), []

    class Teller:
        def __init__(self, name):
            self._name = name

        def tick(self, tick):
            told.append((self._name, tick.number, tick.diagnosis, tick.state.left))

    fly(Mailbox(clock), clock, Decision(2), (Teller("first"), Teller("second")), period_ns=PERIOD)
    assert told == [
        ("first", 0, "2 left", 1),
        ("second", 0, "2 left", 1),
        ("first", 1, "1 left", 0),
        ("second", 1, "1 left", 0),
    ]


def test_what_goes_wrong_in_a_recorder_is_not_hidden():
    clock = LateClock()

    class Full:
        def tick(self, _tick):
            raise OSError("No space left on device")

    with pytest.raises(OSError, match="No space"):
        fly(Mailbox(clock), clock, Decision(), (Full(),), period_ns=PERIOD)
