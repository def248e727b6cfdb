"""What is left when somebody dies in flight: the ground station, or a vehicle."""

import math
import signal
import socket
import subprocess
import time
from contextlib import closing, suppress
from dataclasses import dataclass

import numpy as np
import orjson
import pytest
from flights import GCS, Severed, column, fly_and_record, messages, recorded, start, told
from pymavlink.dialects.v20 import ardupilotmega as dialect
from test_live import HOST, ended, fly, free_port, vehicles

from fdm.modes import Mode
from fdm.world import World
from gcs.flight import Flight
from gcs.lockstep import Lockstep
from gcs.loop import fly as fly_the_loop
from scenarios import load
from wire.frames import Framer, decode
from wire.ids import AUTOPILOT, TRUTH
from wire.payloads import SIM_STATE, unpack_sim_state

STOP_S, STILL_S, STILL = 0.5, 2.0, 0.1
"""After its last set-point a vehicle asks itself for zero velocity, and so much later it is slower than 0.1 m/s."""
AUTOPILOTS = ("px4", "ardupilot")


class Dead(BaseException):
    """The ground station's end."""


class DiesIn:
    """Ends the ground station so long into a mission, in the middle of a turn of its loop."""

    def __init__(self, mission_s):
        self._mission_s = mission_s

    def tick(self, tick):
        if tick.diagnosis.mission_s >= self._mission_s:
            raise Dead


@dataclass(frozen=True)
class Left:
    """What vehicles did without a ground station, from its last set-point on; one row a physics step."""

    world: World
    time_s: np.ndarray
    asked_ned: np.ndarray
    """(T, N, 3) m/s: what each vehicle's flight controller was asked for."""
    velocity_ned: np.ndarray
    """(T, N, 3) m/s: the truth."""
    modes: list[list[tuple[float, Mode]]]
    """When each vehicle came into which mode."""
    disarmed_s: list[float]


@pytest.fixture(scope="module", params=AUTOPILOTS)
def left(request):
    scenario = load("transit")
    world = World(scenario, seed=1, autopilot=request.param)
    link = Lockstep(world)
    with suppress(Dead):
        fly_the_loop(link, link, Flight(scenario), (DiesIn(5.0),), period_ns=scenario.time.period_ns)
    asked, flown, modes, disarmed = [], [], [[] for _ in world.endpoints], {}
    died = world.steps
    while len(disarmed) < len(world.endpoints):
        world.step(1)
        now_s = (world.steps - died) / world.physics_hz
        assert now_s < 40.0, "they must have landed by now"
        asked.append([[node.get_double_value() for node in e.vehicle._set_points[:3]] for e in world.endpoints])
        flown.append([e.vehicle.position_velocity()[3:] for e in world.endpoints])
        for row, endpoint in enumerate(world.endpoints):
            if not modes[row] or modes[row][-1][1] is not endpoint.pilot.mode:
                modes[row].append((now_s, endpoint.pilot.mode))
            if not endpoint.pilot.armed:
                disarmed.setdefault(row, now_s)
    time_s = np.arange(1, len(asked) + 1) / world.physics_hz
    return Left(world, time_s, np.array(asked), np.array(flown), modes, list(disarmed.values()))


def test_half_a_second_after_its_last_set_point_each_vehicle_asks_for_zero_velocity(left):
    at = round(STOP_S * left.world.physics_hz) - 1
    assert left.time_s[at] == STOP_S
    assert (left.asked_ned[at] == 0.0).all()
    assert (np.linalg.norm(left.asked_ned[:at], axis=2) > 0.1).all()


def test_two_seconds_later_it_is_slower_than_a_tenth_of_a_metre_a_second(left):
    stopped = (left.time_s >= STOP_S + STILL_S) & (left.time_s < 4.0)
    assert (np.linalg.norm(left.velocity_ned[stopped], axis=2) < STILL).all()
    cruising = np.linalg.norm(left.velocity_ned[0, :, :2], axis=1)
    assert (cruising > 0.5).all()


def test_then_it_lands_when_its_own_parameters_say_so(left):
    for endpoint, modes, disarmed_s in zip(left.world.endpoints, left.modes, left.disarmed_s, strict=True):
        limit = endpoint.parameters.get
        if endpoint.personality.name == "px4":
            hold_s = limit("COM_OF_LOSS_T")
            expected = [(0.0, Mode.OFFBOARD), (hold_s, Mode.HOLD), (hold_s + limit("COM_FAIL_ACT_T"), Mode.LAND)]
        else:  # its patience begins with the last heartbeat, which comes twice a second
            landing_s = modes[-1][0]
            assert limit("FS_GCS_TIMEOUT") - 0.5 <= landing_s <= limit("FS_GCS_TIMEOUT")
            expected = [(0.0, Mode.GUIDED), (landing_s, Mode.LAND)]
        assert [mode for _, mode in modes] == [mode for _, mode in expected]
        assert [time_s for time_s, _ in modes] == pytest.approx([time_s for time_s, _ in expected], abs=0.1)
        assert disarmed_s > expected[-1][0]
        assert endpoint.vehicle.position_velocity()[2] == pytest.approx(0.0, abs=0.1)


LOST_S, FOUND_S = 8.0, 14.0
"""Into the mission: when vehicle 5 falls silent, and when it is heard again, on the ground or on its way there."""
LEG_BEGINS_S = 13.8
"""About when the mission begins, since the flight began."""
FIVE = 4


@pytest.fixture(scope="module", params=AUTOPILOTS)
def lost(request):
    """The transit, its dragging robot not heard for six seconds."""

    def through(link, clock):
        return Severed(link, clock, system=5, from_s=LEG_BEGINS_S + LOST_S, to_s=LEG_BEGINS_S + FOUND_S)

    return fly_and_record("transit", through=through, autopilot=request.param)


def test_a_silent_vehicle_weighs_nothing_at_the_first_tick_after_three_tenths_of_a_second(lost):
    ticks = {row["tick"]: row["age_s"][FIVE] for row in told(lost, "/swarm/state")}
    weights = {row["tick"]: np.array(row["weights"]) for row in told(lost, "/weights")}
    stale = [tick for tick in weights if ticks[tick] > 0.3]
    first = stale[0]
    assert ticks[first] <= 0.4  # the tick before was not later than 0.3 s
    assert np.delete(weights[first][:, FIVE], FIVE).max() == 0.0
    assert np.delete(weights[first - 1][:, FIVE], FIVE).max() > 0.0
    assert len(stale) == pytest.approx((FOUND_S - LOST_S) * 10, abs=5)
    assert all(np.delete(weights[tick][:, FIVE], FIVE).max() == 0.0 for tick in weights if tick >= first)


def test_the_others_go_on_and_arrive(lost):
    assert "vehicle 5 fell silent" in lost.summary.problem
    expect = lost.scenario.expect
    assert lost.summary.heading_error_deg <= expect.heading_error_deg
    assert lost.summary.distance_to_target_m <= expect.distance_to_target_m
    assert lost.summary.min_separation_m >= expect.min_separation_m
    time_s, _ = column(lost, "/truth/pose", "position_m")
    assert time_s[-1] == column(recorded("transit"), "/truth/pose", "position_m")[0][-1]


def test_when_it_comes_back_it_is_heard_but_neither_heeded_nor_steered_nor_armed(lost):
    heard = {row["tick"]: row["age_s"][FIVE] or 0.0 for row in told(lost, "/swarm/state")}
    found = next(tick for tick in heard if heard[tick] < 0.2 and heard.get(tick - 1, 0.0) > 1.0)
    assert max(heard[tick] for tick in range(found, found + 60)) < 0.2
    steered = [row["tick"] for row in told(lost, "/setpoint") if row["commanded"] and row["commanded"][FIVE]]
    assert max(steered) < found
    armed = [place for place, (system, frame) in enumerate(lost.link.sent) if system == 5 and arms(frame)]
    to_five = [place for place, (system, _) in enumerate(lost.link.sent) if system == 5]
    assert armed
    assert to_five.index(max(armed)) < 60  # of some hundreds: before take-off


def arms(raw):
    """Whether this frame starts a vehicle's rotors."""
    [frame] = Framer().frames(0, raw)
    if frame.message != dialect.MAVLINK_MSG_ID_COMMAND_LONG:
        return False
    command = decode(frame)
    return command.command == dialect.MAV_CMD_COMPONENT_ARM_DISARM and command.param1 == 1.0


# The same, with processes that are killed.

SPEED = 2.0
"""At twice its speed, half a second without a set-point is a quarter of a second of this machine's."""
LOW = ("--set", "swarm.altitude_m=3", "--set", "mission.run_up_s=1", "--set", "mission.leg.0.length_m=3")
LONG = (*LOW, "--set", "mission.leg.1.length_m=50")
QUICK = (*LOW, "--set", "mission.leg.1.length_m=15")


def truth_after(port, seconds):
    """(real time, system, m/s) of each SIM_STATE, and the last word on being armed, of vehicles that send here."""
    speeds, armed, framer = [], {}, Framer()
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as udp:
        udp.bind((HOST, port))
        udp.settimeout(0.2)
        end = time.monotonic() + seconds
        while time.monotonic() < end and (len(armed) < 6 or any(armed.values())):
            with suppress(TimeoutError):
                for frame in framer.frames(0, udp.recv(2048)):
                    if frame.component == TRUTH and frame.message == SIM_STATE:
                        state = unpack_sim_state(frame.payload)
                        speed = math.hypot(state.vn, state.ve, state.vd)
                        speeds.append((time.monotonic(), frame.system, speed))
                    elif frame.component == AUTOPILOT and frame.message == dialect.MAVLINK_MSG_ID_HEARTBEAT:
                        armed[frame.system] = bool(decode(frame).base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
    return speeds, armed


def fly_over(links, out):
    """`gcs fly transit` over these links."""
    words = (GCS, "fly", "transit", *QUICK, *links, "--speed", SPEED, "--json", "--arm", "--yes", "--out", out)
    return start(*words, stdin=subprocess.DEVNULL)


def until_the_mission(process):
    """Read a ground station's words until it flies its mission."""
    for line in process.stderr:
        if "mission" in line:
            return


@pytest.mark.wall_clock
def test_vehicles_of_a_ground_station_that_was_killed_stop_and_land(tmp_path):
    port = free_port()
    with vehicles("transit", port, *LONG, speed=SPEED):
        process = fly("transit", port, *LONG, "--arm", "--yes", "--out", tmp_path, speed=SPEED)
        until_the_mission(process)
        process.send_signal(signal.SIGKILL)
        killed = time.monotonic()
        process.communicate(timeout=10)
        speeds, armed = truth_after(port, 40.0 / SPEED)
    assert armed == dict.fromkeys(range(1, 7), False)
    begin, end = (killed + seconds / SPEED for seconds in (STOP_S + STILL_S + 0.4, 4.0))
    still = [speed for at, _, speed in speeds if begin < at < end]
    assert len(still) > 20
    assert max(still) < STILL


@pytest.mark.wall_clock
def test_a_vehicle_that_was_killed_is_missed_and_when_it_boots_again_nobody_arms_it(tmp_path):
    """Vehicle 5 flies in a process of its own; to what each process sends for the other's vehicles, nobody listens."""
    ports = free_port(), free_port()
    options = ("--ports", "separate", *QUICK)
    places = [ports[0], ports[0] + 1, ports[0] + 2, ports[0] + 3, ports[0] + 5, ports[1] + FIVE]
    links = [word for place in places for word in ("--link", f"udpin:{HOST}:{place}")]
    with vehicles("transit", ports[0], *options, speed=SPEED):
        with vehicles("transit", ports[1], *options, speed=SPEED) as own:
            process = fly_over(links, tmp_path)
            until_the_mission(process)
            time.sleep(1.0 / SPEED)
            own.send_signal(signal.SIGKILL)
        with vehicles("transit", ports[1], *options, speed=SPEED):
            code, summary, _ = ended(process)
    assert code == 3
    assert "vehicle 5 fell silent" in summary["problem"]
    assert summary["heading_error_deg"] is not None  # the others flew on to the read-out
    topics = [(topic, data) for topic, _, data in messages(tmp_path / "run.mcap")]
    ticks = [orjson.loads(data) for topic, data in topics if topic == "/tick"]
    takes_off = next(tick["number"] for tick in ticks if tick["phase"] == "taking control")
    tick, armed, booted = 0, [], []
    for topic, data in topics:
        if topic == "/tick":
            tick = orjson.loads(data)["number"]
        elif topic == "/mavlink/255_190/raw" and arms(data):
            armed.append(tick)
        elif topic == "/mavlink/5_1/raw" and tick > takes_off and beats_disarmed(data):
            booted.append(tick)
    assert booted
    assert max(armed) <= takes_off < min(booted)


def beats_disarmed(raw):
    """Whether this frame is a heartbeat of a vehicle whose rotors stand still."""
    [frame] = Framer().frames(0, raw)
    if frame.message != dialect.MAVLINK_MSG_ID_HEARTBEAT:
        return False
    return not decode(frame).base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED
