"""What is accepted of set-points: fit ones, from one sender at a time, the newest last."""

import math

import pytest
from clients import ACCEPTED, ALONE, BODY_NED, MODE, OFFBOARD, SET_INTERVAL, WITH_YAW, Flight, Station, setpoint
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from fdm.modes import Mode, Setpoint
from fdm.setpoints import CLOCK, Inlet
from wire.payloads import PositionTarget

KEEP_ALIVE_S = 0.5
OURS, THEIRS = (255, 190), (254, 190)


def target(velocity=(1.0, 0.0, 0.0), *, mask=ALONE, frame=1, yaw=0.0, yaw_rate=0.0, time_ms=0):
    return PositionTarget(time_ms, 0, 0, 0, *velocity, 0, 0, 0, yaw, yaw_rate, mask, 1, 1, frame)


class Gate:
    """An inlet, and how to hand something in."""

    def __init__(self, frames=frozenset({1, 8})):
        self.inlet = Inlet(frames)

    def hand_in(self, sender=OURS, *, time_s=0.0, flown=True, **message):
        told = target(**message)
        return self.inlet.admit(told, sender, time_s=time_s, yaw=0.0, flown=flown, keep_alive_s=KEEP_ALIVE_S)

    def taken(self, *arguments, **message):
        return self.hand_in(*arguments, **message).setpoint is not None


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        ({"mask": 0}, "mask"),
        ({"mask": 0x0DF8}, "mask"),
        ({"frame": 7}, "frame"),
        ({"frame": 0}, "frame"),
        ({"velocity": (math.nan, 0.0, 0.0)}, "number"),
        ({"velocity": (0.0, 0.0, math.inf)}, "number"),
        ({"velocity": (3.4e38, 0.0, 0.0)}, "number"),
        ({"velocity": (800.0, 0.0, -800.0)}, "number"),
        ({"mask": WITH_YAW, "yaw": math.nan}, "number"),
    ],
)
def test_what_cannot_be_flown_is_counted_by_its_reason(message, reason):
    gate = Gate()
    assert not gate.taken(**message)
    assert gate.inlet.refused == {reason: 1}


def test_what_cannot_be_flown_owns_nothing():
    gate = Gate()
    gate.hand_in(THEIRS, mask=0)
    assert gate.taken(OURS)
    gate.hand_in(THEIRS, time_s=0.4, frame=0)
    gate.hand_in(OURS, time_s=0.45, mask=0)
    assert gate.taken(THEIRS, time_s=0.51)


def test_whoever_is_flown_steers_until_silent():
    gate = Gate()
    assert gate.taken(OURS, time_s=10.0)
    assert not gate.taken(THEIRS, time_s=10.1)
    assert gate.taken(OURS, time_s=10.4)
    assert not gate.taken(THEIRS, time_s=10.89)
    assert gate.taken(THEIRS, time_s=10.9)
    assert not gate.taken(OURS, time_s=11.0)
    assert gate.inlet.refused == {"other sender": 3}


def test_the_ignored_are_told_of_once_for_each_who_steers():
    gate = Gate()
    gate.hand_in(OURS)
    words = [gate.hand_in(sender, time_s=0.1).words for sender in (THEIRS, THEIRS, (1, 2), THEIRS, (1, 2))]
    assert words == [
        "Set-points of 254/190 ignored: 255/190 steers",
        "",
        "Set-points of 1/2 ignored: 255/190 steers",
        "",
        "",
    ]
    assert gate.taken(THEIRS, time_s=1.0)
    assert gate.hand_in(OURS, time_s=1.1).words == "Set-points of 255/190 ignored: 254/190 steers"
    assert gate.taken(OURS, time_s=2.0)
    assert gate.hand_in(THEIRS, time_s=2.1).words == "Set-points of 254/190 ignored: 255/190 steers"


def test_while_none_are_flown_the_last_to_speak_is_the_one():
    gate = Gate()
    assert gate.taken(OURS, flown=False)
    assert gate.taken(THEIRS, flown=False)
    assert not gate.taken(OURS, time_s=0.1)


@pytest.mark.parametrize(
    ("before", "after", "taken"),
    [(100, 101, True), (100, 100, True), (100, 99, False), (0, 0, True), (CLOCK - 1, 3, True), (3, CLOCK - 1, False)],
)
def test_a_set_point_that_was_overtaken_is_ignored(before, after, taken):
    gate = Gate()
    gate.hand_in(time_ms=before)
    assert gate.taken(time_s=0.1, time_ms=after) is taken
    assert gate.inlet.refused.total() == (0 if taken else 1)


def test_a_sender_that_began_again_is_heard_after_its_silence():
    gate = Gate()
    gate.hand_in(time_ms=60_000)
    assert not gate.taken(time_s=0.1, time_ms=0)
    assert not gate.taken(time_s=0.49, time_ms=390)
    assert gate.taken(time_s=0.5, time_ms=400)
    assert gate.taken(time_s=0.6, time_ms=500)


@given(st.lists(st.tuples(st.integers(0, 20_000), st.floats(0.0, 0.4)), max_size=30))
def test_of_one_sender_that_is_never_silent_the_clock_never_runs_back(told):
    gate, now, newest = Gate(), 0.0, None
    for time_ms, later in told:
        now += later if gate.inlet.refused.total() == 0 else 0.0
        taken = gate.taken(time_s=now, time_ms=time_ms)
        assert taken is (newest is None or time_ms >= newest)
        newest = time_ms if taken else newest


def test_a_set_point_carries_what_its_mask_says_in_the_worlds_frame():
    gate, heading = Gate(), math.radians(90)
    told = target((2.0, 1.0, -0.5), frame=BODY_NED, mask=WITH_YAW, yaw=0.25, yaw_rate=9.0)
    verdict = gate.inlet.admit(told, OURS, time_s=7.0, yaw=heading, flown=False, keep_alive_s=KEEP_ALIVE_S)
    assert verdict.setpoint == Setpoint(7.0, pytest.approx((-1.0, 2.0, -0.5)), pytest.approx(heading + 0.25), 0.0)


# On a vehicle


@pytest.mark.parametrize("autopilot", ["px4", "ardupilot"])
def test_no_set_point_is_too_huge_to_be_told_of_turned_by_the_heading(autopilot):
    flight = Flight(yaw=math.radians(60.0), autopilot=autopilot)
    flight = flight.hover() if autopilot == "px4" else flight.guided()
    assert flight.ask(SET_INTERVAL, dialect.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED, 20_000) == ACCEPTED
    for velocity in ((3.4e38, 3.4e38, 0.0), (-3.4e38, 3.4e38, 3.4e38), (999.0, 0.0, 0.0), (700.0, -700.0, 0.0)):
        flight.stream(0.2, velocity, frame=BODY_NED)
        if autopilot == "px4":
            flight.ask(MODE, 1, *OFFBOARD)
        flight.stream(0.1, velocity, frame=BODY_NED)
    assert flight.endpoint.refused_setpoints == {"number": 12}
    flown = flight.last("POSITION_TARGET_LOCAL_NED")
    assert math.hypot(flown.vx, flown.vy) == pytest.approx(math.hypot(700.0, 700.0))


def rival(flight, velocity):
    """Set-points of another ground station."""
    other = Station(system=254)
    flight.endpoint.receive(other.pack(setpoint(velocity)))
    flight.listen()


def test_a_second_ground_station_does_not_steer_a_vehicle_that_is_steered():
    flight = Flight().hover(20.0).offboard((1.0, 0.0, 0.0), 3.0)
    for _ in range(60):
        flight.send(setpoint((1.0, 0.0, 0.0)))
        rival(flight, (-3.0, 0.0, 0.0))
        flight.wait(0.05)
    assert flight.velocity == pytest.approx((1.0, 0.0, 0.0), abs=0.05)
    assert flight.words()[-1] == "Set-points of 254/190 ignored: 255/190 steers"
    assert len([words for words in flight.words() if "ignored" in words]) == 1
    assert flight.endpoint.refused_setpoints == {"other sender": 60}


def test_a_second_ground_station_keeps_nobody_from_failing_safe():
    flight = Flight().hover(20.0).offboard((1.0, 0.0, 0.0), 3.0)
    for _ in range(9):
        rival(flight, (1.0, 0.0, 0.0))
        flight.wait(0.05)
    assert flight.pilot.mode is Mode.OFFBOARD
    flight.wait(0.1)
    assert flight.pilot.mode is Mode.HOLD


def test_a_reordered_set_point_is_not_flown():
    flight = Flight().hover(20.0)
    flight.send(setpoint((0, 0, 0), time_ms=1000))
    assert flight.ask(MODE, 1, *OFFBOARD) == ACCEPTED
    for n in range(40):
        flight.send(
            setpoint((2.0, 0.0, 0.0), time_ms=1100 + 100 * n), setpoint((-9.0, 0.0, 0.0), time_ms=1050 + 100 * n)
        )
        flight.wait(0.1)
    assert flight.velocity == pytest.approx((2.0, 0.0, 0.0), abs=0.05)
    assert flight.endpoint.refused_setpoints == {"overtaken": 40}
