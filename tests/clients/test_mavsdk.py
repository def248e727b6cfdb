"""MAVSDK, in its present binding and in the one before, meets and flies both autopilots' vehicles over UDP."""

import math

import pytest
from client_flight import CRUISE
from in_flight import flown

from fdm.parameters import table
from fdm.world import SITE

pytestmark = pytest.mark.wall_clock
both = pytest.mark.parametrize("autopilot", ["px4", "ardupilot"])

WITHIN = 0.1  # m/s

VERSIONS = {"px4": [1, 16], "ardupilot": [4, 6]}
MODES = {"px4": ["TAKEOFF", "HOLD", "OFFBOARD", "HOLD", "LAND"], "ardupilot": ["OFFBOARD", "HOLD", "LAND"]}
"""As MAVSDK names them: GUIDED is OFFBOARD to it, BRAKE and LOITER are HOLD."""
FLIGHT = ["ON_GROUND", "TAKING_OFF", "IN_AIR", "LANDING", "ON_GROUND"]


def is_in(modes, seen):
    """Whether all of these came, in this order; what passes in a moment may come between, or not be seen twice."""
    left = iter(seen)
    return all(mode in left for mode in modes)


@both
def test_it_learns_all_about_a_vehicle_on_the_ground_and_is_refused_what_cannot_be(autopilot, tmp_path):
    facts = flown("fly_mavsdk.py", "meet", autopilot=autopilot, folder=tmp_path, speed=2.0)
    assert (facts.system, facts.autopilot, facts.vehicle) == (1, autopilot.upper(), "MULTICOPTER")
    assert (facts.version, facts.unique_id) == (VERSIONS[autopilot], 1)
    if autopilot == "ardupilot":
        assert facts.arming_too_early == "FAILED"
    assert facts.take_off_disarmed == {"px4": None, "ardupilot": "FAILED"}[autopilot]
    assert facts.offboard_without_setpoint == "NO_SETPOINT_SET"

    assert facts.health == [True, True, True]
    assert facts.all_ok
    for place in (facts.place, facts.home, facts.origin):
        assert place == pytest.approx([SITE.latitude_deg, SITE.longitude_deg], abs=1e-6)
    assert facts.height == pytest.approx(0.0, abs=0.1)
    assert facts.attitude == pytest.approx([0.0, 0.0, 90.0], abs=0.5)
    w, x, y, z = facts.quaternion
    assert [w * z / abs(w), x, y] == pytest.approx([math.sqrt(0.5), 0.0, 0.0], abs=0.01)
    assert facts.volts == pytest.approx(16.8, abs=0.4)
    assert facts.charge == pytest.approx(100.0, abs=2.0)
    assert facts.satellites >= 6
    assert facts.fix >= 3
    assert (facts.landed, facts.in_air) == ("ON_GROUND", False)

    told = table(autopilot)
    assert facts.before == [10, 0.5]
    assert facts.after == facts.listed == [20, 1.25]
    assert facts.count == len(told)


def check(facts, autopilot, *, holds_in):
    """Whatever the client."""
    assert set(facts.refusals) <= {"FAILED"}
    for north, east, down in facts.cruise:
        assert (north, east, down) == pytest.approx((CRUISE, 0.0, 0.0), abs=WITHIN)
    assert facts.truth == pytest.approx([CRUISE, 0.0, 0.0], abs=WITHIN)
    for velocity in facts.stopped:
        assert velocity == pytest.approx([0.0, 0.0, 0.0], abs=WITHIN)
    assert facts.disarming_in_the_air == {"px4": "COMMAND_DENIED", "ardupilot": "FAILED"}[autopilot]
    assert is_in(MODES[autopilot], facts.modes)
    assert is_in(FLIGHT, facts.landed)
    assert facts.arming_after_landing == ("FAILED" if holds_in == "BRAKE" else None)


@both
def test_it_flies_a_vehicle_from_arming_to_disarming(autopilot, tmp_path):
    facts = flown("fly_mavsdk.py", "fly", autopilot=autopilot, folder=tmp_path)
    check(facts, autopilot, holds_in="BRAKE" if autopilot == "ardupilot" else "HOLD")


@both
def test_its_binding_over_grpc_flies_a_vehicle_from_arming_to_disarming(autopilot, tmp_path):
    facts = flown("fly_mavsdk_grpc.py", autopilot=autopilot, folder=tmp_path)
    if autopilot == "px4":
        assert facts.home == pytest.approx([SITE.latitude_deg, SITE.longitude_deg], abs=1e-6)
    check(facts, autopilot, holds_in="LOITER" if autopilot == "ardupilot" else "HOLD")
