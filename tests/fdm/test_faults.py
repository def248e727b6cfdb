"""The scenario's faults on one vehicle, as functions of time since mission start."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fdm.faults import HEALTHY, FaultyAir, Rotor, VehicleFaults, wind_faults
from scenarios import CompassBias, MotorDegradation, RotorFault, StuckVelocity, WindFault

CRUISE = 1.5
CAP, OFFSET = 0.4, 0.47


def drag(**keys):
    return MotorDegradation(**{"vehicle": 5, "kind": "motor_degradation"} | keys)


def rotor(**keys):
    return RotorFault(**{"vehicle": 5, "kind": "rotor", "rotor": 2} | keys)


def compass(**keys):
    return CompassBias(**{"vehicle": 5, "kind": "compass_bias"} | keys)


def stuck(**keys):
    return StuckVelocity(**{"vehicle": 5, "kind": "stuck_velocity"} | keys)


def gale(**keys):
    return WindFault(**{"vehicle": 5, "kind": "wind"} | keys)


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


# --- that grow, and come and go


@pytest.mark.parametrize(("time_s", "share"), [(0, 0), (2.5, 0.25), (5, 0.5), (10, 1), (99, 1)])
def test_a_motor_fault_that_grows_leads_from_what_is_asked_to_what_it_will_be(time_s, share):
    north, east, _ = of_five(drag(grows_over_s=10)).flown((1.5, 0.0, 0.0), time_s)
    assert (north, east) == pytest.approx((1.5 - share * 0.9, -share * 0.705))


@pytest.mark.parametrize(("time_s", "share"), [(0, 0), (5, 0.5), (10, 1)])
def test_a_rotor_loses_its_efficiency_gradually_too(time_s, share):
    faults = of_five(rotor(efficiency=0.4, speed_limit=0.8, grows_over_s=10))
    health = faults.rotors(time_s)[1]
    assert (health.efficiency, health.speed_limit) == pytest.approx((1 - 0.6 * share, 1 - 0.2 * share))


def test_what_comes_and_goes_leaves_nothing_behind_in_between():
    faults = of_five(drag(period_s=2), compass(period_s=2), rotor(efficiency=0.5, period_s=2))
    for time_s in (1.0, 1.5, 3.99, 5.0):
        assert faults.flown((1.5, 0.2, 0.1), time_s) == (1.5, 0.2, 0.1)
        assert faults.rotors(time_s) == {1: HEALTHY}
    for time_s in (0.0, 0.5, 2.0, 4.99):
        assert faults.flown((1.5, 0.2, 0.1), time_s) != (1.5, 0.2, 0.1)
        assert faults.rotors(time_s) == {1: Rotor(efficiency=0.5)}


# --- a wrong compass


@pytest.mark.parametrize(
    ("bias_deg", "flown"), [(90, (0.0, 1.5)), (-90, (0.0, -1.5)), (180, (-1.5, 0.0)), (60, (0.75, 1.299))]
)
def test_a_vehicle_with_a_wrong_compass_flies_clockwise_of_what_is_meant(bias_deg, flown):
    north, east, down = of_five(compass(bias_deg=bias_deg)).flown((1.5, 0.0, -0.4), 0.0)
    assert (north, east, down) == pytest.approx((*flown, -0.4), abs=1e-3)


def test_a_compass_that_goes_wrong_gradually_turns_gradually():
    north, east, _ = of_five(compass(bias_deg=90, grows_over_s=9)).flown((1.0, 0.0, 0.0), 3.0)
    assert (north, east) == pytest.approx((math.cos(math.radians(30)), math.sin(math.radians(30))))


# --- a set-point that stays


def test_a_stuck_vehicle_flies_on_as_it_was_told_at_onset_but_climbs_as_it_is_told():
    faults = of_five(stuck(onset_s=2))
    assert faults.flown((1.0, 0.5, 0.0), 1.9) == (1.0, 0.5, 0.0)
    for time_s in (2.01, 3.0, 50.0):
        assert faults.flown((0.0, -time_s, 0.2), time_s) == (1.0, 0.5, 0.2)


def test_a_stuck_vehicle_obeys_again_after_its_end_and_between_its_periods():
    faults = of_five(stuck(onset_s=2, period_s=4, end_s=9))
    told = [(n / 2, (n / 2, 0.0, 0.0)) for n in range(20)]
    flown = [faults.flown(velocity, time_s)[0] for time_s, velocity in told]
    assert flown[:4] == [0, 0.5, 1, 1.5]
    assert flown[4:8] == [2, 2, 2, 2]
    assert flown[8:12] == [4, 4.5, 5, 5.5]
    assert flown[12:16] == [6, 6, 6, 6]
    assert flown[16:] == [8, 8.5, 9, 9.5]


def test_before_the_mission_nothing_is_stuck():
    faults = of_five(stuck())
    assert faults.flown((0.3, 0.0, 0.0), -math.inf) == (0.3, 0.0, 0.0)
    assert faults.flown((0.5, 0.0, 0.0), -0.1) == (0.5, 0.0, 0.0)
    assert faults.flown((1.5, 0.0, 0.0), 0.1) == (0.5, 0.0, 0.0)


def test_a_set_point_is_stuck_first_then_turned_by_the_compass_then_bent_by_the_motors():
    faults = of_five(drag(), compass(bias_deg=90), stuck(onset_s=1))
    faults.flown((1.5, 0.0, 0.0), 1.0)
    assert faults.flown((0.0, 0.0, 0.0), 2.0) == pytest.approx((0.705, 0.6, 0.0))  # eastwards, sliding to its left


# --- wind


def air(*faults, seed=1, vehicle=5):
    return FaultyAir(wind_faults(faults, vehicle=vehicle), vehicle=vehicle, seed=seed)


@pytest.mark.parametrize(("from_deg", "towards"), [(0, (-3, 0)), (90, (0, -3)), (225, (2.1213, 2.1213))])
def test_a_steady_wind_blows_from_onset_from_where_it_is_said_to_come(from_deg, towards):
    wind = air(gale(from_deg=from_deg, onset_s=5, end_s=8))
    assert wind.wind(4.9) == (0.0, 0.0)
    assert wind.wind(5.0) == wind.wind(7.9) == pytest.approx(towards, abs=1e-4)
    assert wind.wind(8.0) == (0.0, 0.0)


def test_wind_freshens_as_it_grows():
    assert air(gale(speed_m_s=8, grows_over_s=20)).wind(5.0) == pytest.approx((-2.0, 0.0))


def test_wind_on_one_strikes_one_and_wind_on_everyone_strikes_all():
    one, all_of_them = gale(), gale(vehicle=2, everyone=True)
    assert wind_faults([one, all_of_them], vehicle=5) == [one, all_of_them]
    assert wind_faults([one, all_of_them], vehicle=1) == [all_of_them]


def test_gusts_of_a_fault_have_their_deviation_and_their_memory():
    n, sigma, correlation_s = 20_000, 1.5, 2.0
    wind = air(gale(speed_m_s=0, gust_m_s=sigma, gust_time_s=correlation_s))
    gusts = np.array([wind.wind(0.1 * (k + 1)) for k in range(n)])
    independent = n * 0.1 / (2 * correlation_s)
    assert gusts.std(axis=0) == pytest.approx(sigma, rel=5 / math.sqrt(2 * independent))
    lagged = (gusts[:-20] * gusts[20:]).mean(axis=0) / gusts.var(axis=0)
    assert lagged == pytest.approx(math.exp(-1), abs=5 / math.sqrt(independent))


def test_gusts_depend_on_time_and_not_on_how_often_they_are_asked_for():
    fault = gale(gust_m_s=1.0, onset_s=1, grows_over_s=2)
    often, rarely = air(fault), air(fault)
    dense = {n: often.wind(n * 0.02) for n in range(500)}
    assert all(rarely.wind(n * 0.02) == dense[n] for n in range(0, 500, 35))


def test_every_vehicle_seed_and_fault_has_gusts_of_its_own():
    fault = gale(gust_m_s=1.0, speed_m_s=0.0, everyone=True)
    winds = [
        air(fault).wind(1.0),
        air(fault, seed=2).wind(1.0),
        air(fault, vehicle=4).wind(1.0),
        tuple(np.subtract(air(fault, fault).wind(1.0), air(fault).wind(1.0))),
    ]
    assert len({round(north, 9) for north, _ in winds}) == 4


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
