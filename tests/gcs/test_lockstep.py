"""A world as link and clock; and a vehicle lost out of it."""

import numpy as np
import pytest
from flights import Severed, fly_and_record
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs.lockstep import EPOCH_NS, Lockstep
from gcs.mission import plan
from gcs.reproduce import Condition, FlightNotCompleted, one_flight
from scenarios import load, offsets_ne
from wire.frames import decode

MISSION_S = 13.8
"""About when the missions below begin, since the flight began."""


def losing(system, *, after_s):
    """Wraps a link so that it loses one vehicle so long into the mission."""
    return lambda link, clock: Severed(link, clock, system=system, from_s=MISSION_S + after_s)


def lockstep(*overrides):
    return Lockstep.of(load("demo", overrides=overrides), seed=1)


def test_time_begins_in_2020_and_stands_still_unless_waited_for():
    link = lockstep()
    assert link.now() == EPOCH_NS == 1_577_836_800 * 10**9
    link.receive()
    link.send(1, b"not a frame")
    assert link.now() == EPOCH_NS


@pytest.mark.parametrize("hz", [100, 250, 300])
def test_waiting_ends_at_the_first_step_at_or_after_the_time_asked_for(hz):
    link = lockstep(f"time.physics_hz={hz}", "time.period_s=0.1")
    for asked in (1, 3_999_999, 4_000_000, 4_000_001, 100_000_000, 333_333_334):
        link.sleep_until(EPOCH_NS + asked)
        assert 0 <= link.now() - EPOCH_NS - asked < 1e9 / hz


def test_a_time_that_has_passed_moves_nothing():
    link = lockstep()
    link.sleep_until(EPOCH_NS + 10**9)
    link.sleep_until(EPOCH_NS)
    assert link.now() == EPOCH_NS + 10**9


def test_frames_come_once_in_the_order_of_time_with_the_time_at_which_they_were_sent():
    link = lockstep()
    link.sleep_until(EPOCH_NS + 2 * 10**9)
    frames = link.receive()
    times = [frame.time_ns for frame in frames]
    assert {frame.system for frame in frames} == set(range(1, 7))
    assert times == sorted(times)
    assert EPOCH_NS <= times[0] < times[-1] <= link.now()
    assert link.receive() == []


def test_the_steps_between_two_waits_do_not_change_what_is_sent():
    at_once, bit_by_bit = lockstep(), lockstep()
    at_once.sleep_until(EPOCH_NS + 10**9)
    got = []
    for tick in range(1, 11):
        bit_by_bit.sleep_until(EPOCH_NS + tick * 10**8)
        got += bit_by_bit.receive()
    assert got == at_once.receive()


def test_what_is_sent_is_there_at_once_and_answered_by_the_vehicle_it_was_for():
    link = lockstep()
    ask = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
    link.send(3, bytes(dialect.MAVLink_command_long_message(3, 1, 512, 0, 49, 0, 0, 0, 0, 0, 0).pack(ask)))
    link.sleep_until(link.now() + 10**8)
    acknowledged = [frame for frame in link.receive() if frame.message == dialect.MAVLINK_MSG_ID_COMMAND_ACK]
    assert [frame.system for frame in acknowledged] == [3]
    assert decode(acknowledged[0]).result == 0


@pytest.fixture(scope="module")
def without_the_dragging_robot():
    """The emergency, the failed robot silent from 10 s into the mission on."""
    return fly_and_record(
        "emergency", through=lambda link, clock: Severed(link, clock, system=5, from_s=MISSION_S + 10)
    )


def test_a_vehicle_lost_is_named_and_the_flight_is_not_completed(without_the_dragging_robot):
    summary = without_the_dragging_robot.summary
    assert "vehicle 5 fell silent" in summary.problem
    assert "into the mission" in summary.problem
    assert not summary.completed
    assert not summary.passed


def test_the_others_reach_their_target_without_it(without_the_dragging_robot):
    summary, expect = without_the_dragging_robot.summary, without_the_dragging_robot.scenario.expect
    assert summary.heading_error_deg <= expect.heading_error_deg
    assert summary.distance_to_target_m <= expect.distance_to_target_m
    assert summary.min_separation_m >= expect.min_separation_m


def test_a_lost_vehicle_lands_by_itself_and_the_others_when_told(without_the_dragging_robot):
    heard = without_the_dragging_robot.link.received
    last_beat = {
        f.system: decode(f) for f in heard if f.message == dialect.MAVLINK_MSG_ID_HEARTBEAT and f.component == 1
    }
    armed = {system for system, beat in last_beat.items() if beat.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED}
    assert armed == {5}  # as far as anybody has heard


def test_a_healthy_follower_lost_does_not_keep_the_others_from_passing():
    flight = fly_and_record("demo", through=losing(5, after_s=8))
    track, others = flight.read().track, [0, 1, 2, 3, 5]
    place = (track.position[-1, :, :2] - offsets_ne(flight.scenario))[others].mean(axis=0)
    assert np.linalg.norm(place - plan(flight.scenario).target_ne) <= flight.scenario.expect.distance_to_target_m
    assert "vehicle 5" in flight.summary.problem


def test_one_flight_that_is_not_completed_is_no_result():
    class Hopeless(Condition):
        def build(self):
            return load("demo", overrides=["time.timeout_s=2"])

    with pytest.raises(FlightNotCompleted, match=r"time\.timeout_s = 2 s"):
        one_flight(Hopeless("demo", None, "trust-r", "paper"), 1)


def test_a_vehicle_that_comes_down_is_named_and_the_others_fly_on():
    summary = fly_and_record("demo", 'fault=[{vehicle=5, kind="rotor", rotor=1, efficiency=0.0}]').summary
    assert summary.problem is not None
    assert summary.problem.startswith("vehicle 5 came down ")
    assert summary.faults == ["a broken rotor on robot 5"]
    assert summary.heading_error_deg < 4  # the five healthy ones got there
    assert summary.distance_to_target_m < 3.2
    assert not summary.passed
