"""Interlocks with vehicles that fly: other ground stations, operators and fences, over the very bytes of the link."""

from functools import cache
from itertools import count

import numpy as np
import pytest
from flights import SHORT, Counting, OtherStation, fly_and_record, mode_command, recorded, told
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs.events import HOLD, LAND, kill
from gcs.flight import Flight
from gcs.lockstep import Lockstep
from gcs.loop import fly
from gcs.replay.verify import decide_again
from scenarios import load

AUTOPILOTS = ("px4", "ardupilot")
SYSTEM = 4
OTHERS = [0, 1, 2, 4, 5]


def mission_starts_s(autopilot):
    """Seconds after the flight's start."""
    flight = recorded("demo", *SHORT, autopilot=autopilot)
    return next(row["tick"] for row in told(flight, "/mission")) * flight.scenario.time.period_s


@cache
def interrupted(autopilot, mode):
    """A demo in which another ground station takes vehicle 4 two seconds into the mission."""
    at_s = mission_starts_s(autopilot) + 2.05

    def beside(link, clock):
        return OtherStation(link, clock, system=SYSTEM, mode=mode_command(autopilot, mode), at_s=at_s)

    return fly_and_record("demo", *SHORT, autopilot=autopilot, through=beside), round(at_s * 10)


TAKEN = [("px4", "return"), ("px4", "hold"), ("ardupilot", "return"), ("ardupilot", "brake")]


@pytest.mark.parametrize(("autopilot", "mode"), TAKEN)
def test_a_vehicle_that_another_station_takes_is_asked_for_nothing_from_its_next_heartbeat_on(autopilot, mode):
    flight, tick = interrupted(autopilot, mode)
    commanded = np.array([row["commanded"] for row in told(flight, "/setpoint")])[:, SYSTEM - 1]
    ticks = np.array([row["tick"] for row in told(flight, "/setpoint")])
    released = ticks[commanded][-1] + 1
    assert tick <= released <= tick + 11
    assert not commanded[ticks >= released].any()
    assert f"vehicle {SYSTEM} " in flight.summary.problem
    assert f"({mode})" in flight.summary.problem


@pytest.mark.parametrize(("autopilot", "mode"), TAKEN)
def test_it_is_not_told_to_land_with_the_others(autopilot, mode):
    flight, _ = interrupted(autopilot, mode)
    lands = [
        system
        for system, frame in flight.link.sent
        for message in [dialect.MAVLink(None).decode(bytearray(frame))]
        if message.get_type() == "COMMAND_LONG" and message.command == dialect.MAV_CMD_NAV_LAND
    ]
    assert SYSTEM not in lands
    assert set(lands) == {1, 2, 3, 5, 6}


@pytest.mark.parametrize(("autopilot", "mode"), TAKEN)
def test_the_others_come_to_their_target_without_it(autopilot, mode):
    flight, _ = interrupted(autopilot, mode)
    assert flight.summary.distance_to_target_m is not None
    final = np.array(told(flight, "/truth/pose")[-1]["position_m"])
    assert (final[OTHERS, 2] < 0.3).all()


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_it_is_decided_again_bit_for_bit(autopilot):
    flight, _ = interrupted(autopilot, "return")
    assert decide_again(flight.path).difference is None


def operated(autopilot, *words):
    """A demo with an operator: (seconds into the mission, word)."""
    start, tick = round(10 * mission_starts_s(autopilot)), count()
    said = {start + round(10 * seconds): (word,) for seconds, word in words}
    return fly_and_record("demo", *SHORT, autopilot=autopilot, events=lambda: said.get(next(tick), ()))


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_a_swarm_that_holds_stays_where_it_is_and_never_descends(autopilot):
    flight = operated(autopilot, (2.0, HOLD), (14.0, LAND))
    phase = {row["number"]: row["phase"] for row in told(flight, "/tick")}
    poses = [row for row in told(flight, "/truth/pose") if phase[row["tick"]] == "holding"]
    assert len(poses) == 120
    place = np.array([row["position_m"] for row in poses])
    assert place[:, :, 2].min() > 9.5
    assert np.ptp(place[40:, :, :2], axis=0).max() < 0.5
    assert flight.summary.problem is None
    assert np.array(told(flight, "/truth/pose")[-1]["position_m"])[:, 2].max() < 0.3


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_a_vehicle_that_is_killed_falls_and_the_others_fly_on(autopilot):
    flight = operated(autopilot, (2.0, kill(SYSTEM)))
    assert f"the operator stopped the rotors of vehicle {SYSTEM} 2.0 s into the mission" in flight.summary.problem
    fallen = next(row for row in told(flight, "/truth/pose") if row["mission_s"] and row["mission_s"] >= 4.5)
    height = np.array(fallen["position_m"])[:, 2]
    assert height[SYSTEM - 1] < 0.5
    assert height[OTHERS].min() > 9.0
    assert flight.summary.distance_to_target_m is not None


def sent_by(scenario):
    world = Lockstep.of(scenario, seed=1)
    link = Counting(world)
    fly(link, world, Flight(scenario), (), period_ns=scenario.time.period_ns)
    return link.sent


def test_the_fence_that_gcs_fly_gives_a_mission_changes_not_a_bit_of_it():
    scenario = load("demo", overrides=SHORT)
    assert sent_by(scenario.fenced()) == sent_by(scenario)


def test_a_swarm_in_a_wind_that_carries_it_off_lands_when_it_is_out():
    """Air too fast for the vehicles: braking does not help, and somebody is told."""
    gale = ("wind.speed_m_s=30", "wind.from_deg=180", "limits.fence.radius_m=20")
    flight = fly_and_record("demo", *SHORT, *gale)
    assert "outside the fence" in flight.summary.problem
