"""The paper's fault in front of a sound fleet: what leaves is its closed form, and flies like the fault on board."""

import math
from functools import cache

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs.commands import Arm, Beat, ChangeMode, Land, RequestStream, SetVelocity, TakeOff
from gcs.degrade import Degraded, degrading
from gcs.lockstep import Lockstep
from gcs.loop import fly
from gcs.messages import Encoder
from gcs.scoring import score
from gcs.track import Tracker
from gcs.trial import ToItsReadOut
from gcs.truth import Truth
from scenarios import MotorDegradation, load
from scenarios.degradation import degrade
from wire.frames import Framer, Sender, decode
from wire.payloads import unpack_position_target

TRANSIT = load("transit")
RUN_UP_S = 4.0
CRUISE = 1.5
speeds = st.floats(-6, 6, width=32)


class Wire:
    """A link that keeps what is sent."""

    rejected = 3

    def __init__(self):
        self.sent = []

    def receive(self):
        return ["a frame"]

    def send(self, system, frame):
        self.sent.append((system, frame))


class Time:
    """Nanoseconds that pass when told to."""

    def __init__(self):
        self.ns = 10**18

    def now(self):
        return self.ns

    def pass_s(self, seconds):
        self.ns += round(seconds * 1e9)


class Bench:
    """A degraded link, and an encoder of its own for each vehicle."""

    def __init__(self, scenario=TRANSIT, system=5):
        self.wire, self.time = Wire(), Time()
        self.link = Degraded(self.wire, self.time, scenario, system)
        self.encoders = {number: Encoder(number) for number in range(1, 7)}

    def send(self, system, command):
        """(the frame that was sent, the frame that left)."""
        frame = self.encoders[system].encode(command, 12_345)
        return frame, self.through(system, frame)

    def through(self, system, frame):
        self.link.send(system, frame)
        to, left = self.wire.sent[-1]
        assert to == system
        return left

    def flown(self, north, east, *, system=5, down=0.25):
        """(north, east, down) m/s of the set-point that left."""
        left = read(self.send(system, SetVelocity(north, east, down, 0.5))[1])
        return left.vx, left.vy, left.vz

    def under_way(self):
        """A tick after mission start."""
        self.flown(0.0, CRUISE, system=1)
        self.time.pass_s(RUN_UP_S + 0.1)
        return self


def read(frame):
    (one,) = Framer().frames(0, frame)
    return unpack_position_target(one.payload)


def papers(north, east, *, left=0.4, offset=0.47):
    return degrade((north, east), cruise=CRUISE, max_speed_fraction=left, offset_fraction=offset)


# --- what leaves


@given(speeds, speeds)
def test_what_leaves_is_the_closed_form_of_the_papers_fault(north, east):
    bench = Bench().under_way()
    assert bench.flown(north, east) == pytest.approx((*papers(north, east), 0.25), abs=1e-6)


def test_northwards_at_cruise_it_crawls_at_two_fifths_and_drifts_west_by_almost_half():
    assert Bench().under_way().flown(CRUISE, 0.0) == pytest.approx((0.6, -0.705, 0.25))


@given(speeds, speeds)
def test_what_leaves_is_one_sound_frame_that_differs_in_two_numbers_alone(north, east):
    sent, left = Bench().under_way().send(5, SetVelocity(north, east, 0.25, 0.5))
    (one,) = Framer().frames(0, left)
    assert one.raw == left
    before, after = decode_all(sent), decode_all(left)
    assert {key for key in before if before[key] != after[key]} <= {"vx", "vy"}
    assert sent[1:10] == left[1:10], "length, sequence and sender"


def decode_all(frame):
    (one,) = Framer().frames(0, frame)
    message = decode(one)
    return message.to_dict() | {"sequence": message.get_seq(), "system": one.system, "component": one.component}


def test_sequence_numbers_are_those_of_the_ground_station():
    bench = Bench().under_way()
    frames = [bench.send(5, SetVelocity(CRUISE, 0.0, 0.0, 0.0))[1] for _ in range(300)]
    numbers = [decode_all(frame)["sequence"] for frame in frames]
    assert numbers == [number % 256 for number in range(300)]


@given(speeds, speeds, st.floats(0.1, 3))
def test_it_is_never_faster_than_the_scenario_allows(north, east, fastest):
    limits = [f"limits.speed_m_s={fastest}", f"mission.cruise_m_s={fastest}", "fault.0.offset_fraction=1"]
    bench = Bench(load("transit", overrides=[*limits, "fault.0.max_speed_fraction=1"])).under_way()
    asked = math.hypot(north, east)
    north, east = (
        (north, east) if asked <= fastest else (0.999 * north * fastest / asked, 0.999 * east * fastest / asked)
    )
    assert math.hypot(*bench.flown(north, east)[:2]) <= fastest


def test_a_robot_asked_to_stop_stops():
    assert Bench().under_way().flown(0.0, 0.0) == (0.0, 0.0, 0.25)


@pytest.mark.parametrize("system", [1, 2, 3, 4, 6])
def test_set_points_of_the_others_leave_as_they_are(system):
    bench = Bench().under_way()
    sent, left = bench.send(system, SetVelocity(CRUISE, 1.0, 0.0, 0.0))
    assert left == sent


@pytest.mark.parametrize(
    "command",
    [Beat(), Arm(), Land(), TakeOff(400.0), ChangeMode(6, 0), RequestStream(32, 0.05)],
    ids=lambda c: type(c).__name__,
)
def test_all_other_frames_leave_as_they_are(command):
    sent, left = Bench().under_way().send(5, command)
    assert left == sent


@pytest.mark.parametrize("mask", [0x0DF8, 0x0FFF, 0x0DC7 | 0x08])
def test_set_points_whose_velocity_does_not_count_leave_as_they_are(mask):
    message = dialect.MAVLink_set_position_target_local_ned_message(
        1, 5, 1, 1, mask, 10.0, 20.0, -5.0, 1.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    )
    frame = Sender(255, 190).pack(message)
    assert Bench().under_way().through(5, frame) == frame


def test_what_is_no_number_leaves_as_it_is():
    sent, left = Bench().under_way().send(5, SetVelocity(math.nan, 1.0, 0.0, 0.0))
    assert left == sent


def test_what_comes_back_is_untouched():
    bench = Bench()
    assert bench.link.receive() == ["a frame"]
    assert bench.link.rejected == 3


# --- when it acts


def test_it_begins_with_the_mission_which_is_the_run_up_after_the_first_motion_of_anybody():
    bench = Bench()
    for _ in range(3):
        assert bench.flown(0.0, 0.0) == (0.0, 0.0, 0.25)
        bench.time.pass_s(60)
    assert bench.flown(CRUISE, 0.0, system=2)[:2] == (CRUISE, 0.0)
    bench.time.pass_s(RUN_UP_S)
    assert bench.flown(CRUISE, 0.0)[:2] == (CRUISE, 0.0)
    bench.time.pass_s(0.1)
    assert bench.flown(CRUISE, 0.0)[:2] == pytest.approx((0.6, -0.705))


def test_climbing_is_no_motion_sideways():
    bench = Bench()
    bench.flown(0.0, 0.0, down=-1.0)
    bench.time.pass_s(60)
    assert bench.flown(CRUISE, 0.0)[:2] == (CRUISE, 0.0)


def test_the_scenarios_own_fault_is_flown_with_its_onset_growth_and_end():
    keys = ("max_speed_fraction=0.7", "offset_fraction=0.2", "onset_s=5", "grows_over_s=10", "end_s=30")
    bench = Bench(load("transit", overrides=[f"fault.0.{key}" for key in keys])).under_way()
    full = papers(CRUISE, 0.0, left=0.7, offset=0.2)
    assert full == pytest.approx((1.05, -0.3))
    for time_s, expected in ((4.9, (1.5, 0.0)), (10.0, (1.275, -0.15)), (15.0, full), (29.9, full), (30.0, (1.5, 0.0))):
        bench.time.ns = 10**18 + round((RUN_UP_S + time_s) * 1e9)
        assert bench.flown(CRUISE, 0.0)[:2] == pytest.approx(expected), time_s


@pytest.mark.parametrize("overrides", [["fault=[]"], ["fault.0.vehicle=2"], ['fault=[{vehicle=5, kind="gps_drift"}]']])
def test_a_vehicle_without_a_fault_of_its_own_has_the_papers(overrides):
    assert Bench(load("transit", overrides=overrides)).under_way().flown(CRUISE, 0.0)[:2] == pytest.approx(
        (0.6, -0.705)
    )


def test_another_vehicle_can_be_chosen():
    bench = Bench(system=2).under_way()
    assert bench.flown(CRUISE, 0.0, system=2)[:2] == pytest.approx((0.6, -0.705))
    assert bench.flown(CRUISE, 0.0, system=5)[:2] == (CRUISE, 0.0)


def test_the_scenario_that_is_flown_has_the_fault_in_it_so_that_finding_it_is_no_false_alarm():
    assert degrading(TRANSIT, 5) == TRANSIT
    healthy = TRANSIT.without_faults()
    assert degrading(healthy, 2).fault == (MotorDegradation(kind="motor_degradation", vehicle=2),)
    assert degrading(healthy, 2).without_faults() == healthy


@pytest.mark.parametrize("system", [0, 7, -1])
def test_a_vehicle_that_is_not_there_is_refused(system):
    with pytest.raises(ValueError, match=f"vehicle {system} cannot be degraded: there are 1 to 6"):
        Degraded(Wire(), Time(), TRANSIT, system)


# --- flown


AUTO = load("transit", overrides=['trust.source="auto"'])


@cache
def flown(where):
    """The score of the transit with its fault on board, in the link, or nowhere."""
    world = Lockstep.of(AUTO if where == "on board" else AUTO.without_faults(), seed=1)
    link = Degraded(world, world, AUTO, 5) if where == "in the link" else world
    flight = ToItsReadOut(AUTO)
    truth = Truth(flight.ids)
    tracker = Tracker(flight, truth)
    fly(link, world, flight, (truth, tracker), period_ns=AUTO.time.period_ns)
    return score(tracker.track, AUTO)


def test_a_fault_in_the_link_flies_like_one_on_board_and_is_found():
    link, board = flown("in the link"), flown("on board")
    assert link.heading_error_deg == pytest.approx(board.heading_error_deg, abs=0.01)
    assert link.distance_to_target_m == pytest.approx(board.distance_to_target_m, abs=0.01)
    assert link.detected == board.detected
    assert link.detected.keys() == {5}
    assert link.false_alarms == 0


def test_without_it_nobody_is_found():
    assert flown("nowhere").detected == {}
