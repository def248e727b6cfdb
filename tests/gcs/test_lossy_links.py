"""Links that lose a fifth of all frames, each by itself, and requests that are lost for good."""

import random

import numpy as np
import pytest
from flights import SHORT
from obedient import PROTECTED, Fleet, Log
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs.commands import Arm
from gcs.flight import Flight
from gcs.flight_state import Phase
from gcs.lockstep import Lockstep
from gcs.loop import fly
from gcs.messages import LOCAL_POSITION_NED, STATUSTEXT
from scenarios import load
from wire.frames import decode

LOSS = 0.2
OTHER_STATION = dialect.MAVLink(None, srcSystem=254, srcComponent=190)


class Link:
    """A world's link that loses what it is told to, and keeps that; and what vehicles said, lost or not.

    loses: (system, command or None, s since it was made) → whether.
    """

    def __init__(self, world, loses):
        self._world, self._loses, self._began = world, loses, world.now()
        self.lost, self.said = [], set()

    def receive(self):
        frames = self._world.receive()
        self.said |= {(frame.system, decode(frame).text) for frame in frames if frame.message == STATUSTEXT}
        return [frame for frame in frames if not self._loses(frame.system, None, self.now_s)]

    def send(self, system, frame):
        message = dialect.MAVLink(None).decode(bytearray(frame))
        command = message if message.get_type() == "COMMAND_LONG" else None
        if self._loses(system, command, self.now_s):
            self.lost.append((self.now_s, system, message))
        else:
            self._world.send(system, frame)

    @property
    def now_s(self):
        return (self._world.now() - self._began) / 1e9

    @property
    def rejected(self):
        return self._world.rejected


class Watched:
    """A record of one vehicle: the phase of each tick, and how old its position was."""

    def __init__(self, system):
        self._row = system - 1
        self.ticks = []

    def tick(self, tick):
        age_s = (tick.time_ns - int(tick.swarm.position_ns[self._row])) / 1e9
        self.ticks.append((tick.diagnosis.phase, age_s))

    def ages(self, phase):
        return np.array([age_s for its, age_s in self.ticks if its is phase])


def flown(autopilot, loses, *, seed=1, told=(), through=Link):
    """(problem, what was watched of vehicle 4, link) of a short demo. told: messages to all vehicles before it."""
    scenario = load("demo", overrides=SHORT)
    world = Lockstep.of(scenario, seed=seed, autopilot=autopilot)
    for system in range(1, 7):
        for message in told:
            world.send(system, message(system).pack(OTHER_STATION))
    link, watched = through(world, loses), Watched(4)
    state = fly(link, world, Flight(scenario), (watched,), period_ns=scenario.time.period_ns)
    return state.problem, watched, link


# --- loss


def at_random(seed):
    chance = random.Random(seed)
    return lambda _system, _command, _now_s: chance.random() < LOSS


def patient(system):
    """PX4 as it is delivered waits a second for set-points."""
    real = dialect.MAV_PARAM_TYPE_REAL32
    return dialect.MAVLink_param_set_message(system, 1, b"COM_OF_LOSS_T", 1.0, real)


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(("autopilot", "told"), [("px4", (patient,)), ("ardupilot", ())])
def test_a_link_that_loses_a_fifth_of_all_frames_is_flown_over(autopilot, told, seed):
    problem, watched, link = flown(autopilot, at_random(seed), seed=seed, told=told)
    assert problem is None
    assert watched.ticks[-1][0] is Phase.DONE
    assert len(link.lost) > 50


def test_but_a_px4_that_waits_half_a_second_for_set_points_may_leave_and_says_why():
    for seed in (1, 3, 4):
        problem, _, link = flown("px4", at_random(seed), seed=seed)
        assert problem is None or (int(problem.split()[1]), "Set-points lost: holding") in link.said


# --- streams


def lost_to_4(until_s):
    """The request for vehicle 4's positions is lost until then."""

    def loses(system, command, now_s):
        asks = command is not None and command.command == dialect.MAV_CMD_SET_MESSAGE_INTERVAL
        return system == 4 and asks and command.param1 == LOCAL_POSITION_NED and now_s < until_s

    return loses


@pytest.mark.parametrize("autopilot", ["px4", "ardupilot"])
def test_a_request_for_positions_that_is_lost_is_made_again_before_anybody_is_armed(autopilot):
    problem, watched, link = flown(autopilot, lost_to_4(7.0))
    assert problem is None
    assert len(link.lost) >= 6
    assert watched.ages(Phase.JOIN).size > 70
    assert watched.ages(Phase.MISSION).max() < 0.2


class Slowed(Link):
    """A link beside which another station asks vehicle 4, at some time, for one position a second."""

    def receive(self):
        if 13.0 <= self.now_s < 13.05:
            once_a_second = LOCAL_POSITION_NED, 1e6, 0, 0, 0, 0, 0
            message = OTHER_STATION.command_long_encode(4, 1, dialect.MAV_CMD_SET_MESSAGE_INTERVAL, 0, *once_a_second)
            self._world.send(4, message.pack(OTHER_STATION))
        return super().receive()


def test_a_stream_that_becomes_thin_in_the_air_is_asked_for_again():
    problem, watched, _ = flown("px4", lambda *_: False, through=Slowed)
    ages = watched.ages(Phase.MISSION)
    assert problem is None
    assert ages.max() > 0.5
    assert (ages > 0.3).sum() <= 20
    assert ages[-10:].max() < 0.2


# --- silence before arming


def test_nobody_is_armed_while_a_vehicle_that_was_heard_is_silent():
    """Vehicle 6 comes late; by then, 4 has been silent for seventeen seconds."""
    log = Log(Fleet(silent={6: (0, 200), 4: (30, 260)}))
    assert log.ticks_of(Arm)[0] > 260
    assert log.end.problem is None


def test_nor_ever_if_it_stays_silent():
    log = Log(Fleet(silent={6: (0, 200), 4: 30}))
    assert not log.ticks_of(Arm)
    assert log.end.problem.endswith("for lack of: vehicle 4: a heartbeat; vehicle 4: position and velocity")


@pytest.mark.parametrize("name", ["COM_OF_LOSS_T", "COM_OBL_RC_ACT", "NAV_DLL_ACT", "COM_DL_LOSS_T", "MPC_XY_VEL_MAX"])
def test_a_parameter_that_a_vehicle_never_tells_keeps_everybody_on_the_ground_and_is_named(name):
    fleet = Fleet()
    fleet.set_parameters(4, {other: value for other, value in PROTECTED.items() if other != name})
    log = Log(fleet)
    assert not log.ticks_of(Arm)
    assert log.end.problem.endswith(f"for lack of: vehicle 4: {name}")
