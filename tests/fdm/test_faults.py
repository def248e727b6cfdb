"""The scenario's faults on one vehicle, as functions of time since mission start."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fdm.faults import HEALTHY, Rotor, VehicleFaults
from scenarios import MotorDegradation, RotorFault

CRUISE = 1.5
CAP, OFFSET = 0.4, 0.47


def drag(**keys):
    return MotorDegradation(**{"vehicle": 5, "kind": "motor_degradation"} | keys)


def rotor(**keys):
    return RotorFault(**{"vehicle": 5, "kind": "rotor", "rotor": 2} | keys)


def of_five(*faults):
    return VehicleFaults(faults, vehicle=5, cruise=CRUISE)


@pytest.mark.parametrize("heading_deg", [0, 60, 90, 180, 250, 359])
def test_a_dragging_vehicle_flies_two_fifths_of_cruise_and_slides_left(heading_deg):
    heading = math.radians(heading_deg)
    asked = (CRUISE * math.cos(heading), CRUISE * math.sin(heading), -0.3)
    north, east, down = of_five(drag()).flown(asked, 0.0)
    forward = north * math.cos(heading) + east * math.sin(heading)
    right = -north * math.sin(heading) + east * math.cos(heading)
    assert (forward, right, down) == pytest.approx((CAP * CRUISE, -OFFSET * CRUISE, -0.3))


def test_the_cap_takes_speed_away_and_never_adds_any():
    slow = 0.9 * CAP * CRUISE
    assert of_five(drag(offset_fraction=0.0)).flown((slow, 0.0, 0.0), 0.0) == pytest.approx((slow, 0.0, 0.0))


@pytest.mark.parametrize(("share_of_cruise", "share_of_offset"), [(0.0, 0.0), (0.15, 0.5), (0.3, 1.0), (2.0, 1.0)])
def test_the_offset_fades_when_the_vehicle_is_asked_to_stop(share_of_cruise, share_of_offset):
    _, east, _ = of_five(drag()).flown((share_of_cruise * CRUISE, 0.0, 0.0), 0.0)
    assert east == pytest.approx(-OFFSET * CRUISE * share_of_offset)


@pytest.mark.parametrize(
    ("time_s", "active"),
    [(-math.inf, False), (-1.0, False), (2.99, False), (3.0, True), (6.99, True), (7.0, False), (1e6, False)],
)
def test_faults_act_from_onset_until_their_end(time_s, active):
    faults = of_five(drag(onset_s=3, end_s=7), rotor(onset_s=3, end_s=7, efficiency=0.5))
    assert (faults.flown((1.5, 0.0, 0.0), time_s) != (1.5, 0.0, 0.0)) is active
    assert faults.rotors(time_s) == {1: Rotor(efficiency=0.5) if active else HEALTHY}


def test_a_fault_without_end_begins_with_the_mission_and_lasts():
    faults = of_five(drag())
    assert faults.flown((1.5, 0.0, 0.0), -0.01) == (1.5, 0.0, 0.0)
    assert faults.flown((1.5, 0.0, 0.0), 0.0) == faults.flown((1.5, 0.0, 0.0), 1e9) != (1.5, 0.0, 0.0)


def test_a_fault_strikes_nobody_else():
    others = VehicleFaults([drag(), rotor(efficiency=0.1)], vehicle=4, cruise=CRUISE)
    assert others.flown((1.5, 0.2, 0.1), 10.0) == (1.5, 0.2, 0.1)
    assert others.rotors(10.0) == {}


@pytest.mark.parametrize("order", [1, -1])
def test_of_two_faults_of_one_rotor_the_worse_counts_in_each_respect(order):
    told = [
        rotor(efficiency=0.6, speed_limit=0.9, end_s=10),
        rotor(efficiency=0.8, speed_limit=0.5, onset_s=5),
        rotor(rotor=4, efficiency=0.3, onset_s=8, end_s=9),
    ]
    faults = of_five(*told[::order])
    assert faults.rotors(2.0) == {1: Rotor(0.6, 0.9), 3: HEALTHY}
    assert faults.rotors(8.5) == {1: Rotor(0.6, 0.5), 3: Rotor(0.3, 1.0)}
    assert faults.rotors(20.0) == {1: Rotor(0.8, 0.5), 3: HEALTHY}


def test_two_motor_faults_act_one_after_the_other():
    first, second = drag(max_speed_fraction=0.8, offset_fraction=0.0), drag(max_speed_fraction=0.5, offset_fraction=0.2)
    assert of_five(first, second).flown((1.5, 0.0, 0.0), 0.0) == pytest.approx((0.75, -0.3, 0.0))
    later = drag(max_speed_fraction=0.5, offset_fraction=0.2, onset_s=5)
    assert of_five(first, later).flown((1.5, 0.0, 0.0), 4.0) == pytest.approx((1.2, 0.0, 0.0))


speeds = st.floats(-20.0, 20.0)
fractions = st.floats(0.0, 1.0)


@given(speeds, speeds, st.floats(-math.pi, math.pi), fractions, fractions)
def test_a_fault_knows_no_compass(north, east, turn, cap, offset):
    faults = of_five(drag(max_speed_fraction=cap, offset_fraction=offset))

    def turned(n, e):
        return n * math.cos(turn) - e * math.sin(turn), n * math.sin(turn) + e * math.cos(turn)

    one = turned(*faults.flown((north, east, 0.0), 0.0)[:2])
    other = faults.flown((*turned(north, east), 0.0), 0.0)[:2]
    assert one == pytest.approx(other, abs=1e-9)
    assert math.hypot(*one) <= CRUISE * math.hypot(cap, offset) + 1e-9
