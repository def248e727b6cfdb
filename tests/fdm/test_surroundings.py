"""What the world does to one vehicle, and when."""

import math

import numpy as np
import pytest
from clients import HZ, PLACE, scenario

from fdm.surroundings import PERIOD_S, Surroundings
from fdm.vehicle import Vehicle

NOISE = {"velocity_m_s": 0.05, "position_m": 0.1, "gust_m_s": 0.8, "gust_time_s": 2.0}
TRUTH = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)


class Weathercock:
    """Feels what a vehicle is told of air and rotors, and remembers."""

    def __init__(self):
        self.winds, self.turbulence, self.rotors = [], [], []

    def set_wind(self, wind_ned):
        self.winds.append(wind_ned)

    def set_turbulence(self, wind_at_6m):
        self.turbulence.append(wind_at_6m)

    def set_rotor(self, rotor, *, efficiency=1.0, speed_limit=1.0):
        self.rotors.append((rotor, efficiency, speed_limit))


def settled(told, *, vehicle=1, seed=1):
    surroundings, vane = Surroundings(told, vehicle=vehicle, seed=seed), Weathercock()
    surroundings.settle(vane)
    return surroundings, vane


def renew(surroundings, vane, from_s, seconds):
    """The winds of so many seconds."""
    already = len(vane.winds)
    for n in range(round(seconds / PERIOD_S)):
        surroundings.renew(vane, from_s + n * PERIOD_S)
    return vane.winds[already:]


@pytest.mark.parametrize(
    ("from_deg", "towards"), [(0, (-5, 0, 0)), (90, (0, -5, 0)), (270, (0, 5, 0)), (225, (3.5355, 3.5355, 0))]
)
def test_steady_wind_blows_from_boot_from_where_it_is_said_to_come(from_deg, towards):
    _, vane = settled(scenario(wind={"speed_m_s": 5, "from_deg": from_deg}))
    assert vane.winds == [pytest.approx(towards, abs=1e-4)]


def test_wind_and_turbulence_strike_only_the_vehicles_that_are_named():
    windy = scenario(
        swarm={"rows": 1, "columns": 3, "leaders": [1]}, wind={"speed_m_s": 5, "turbulence": 8, "vehicles": [2]}
    )
    for vehicle in (1, 2, 3):
        surroundings, vane = settled(windy, vehicle=vehicle)
        surroundings.begin(vane, 10.0)
        struck = vehicle == 2
        assert math.hypot(*vane.winds[0]) == pytest.approx(5.0 if struck else 0.0)
        assert vane.turbulence == [8.0 if struck else 0.0]


def test_before_mission_start_the_air_is_steady_and_sensors_are_exact():
    surroundings, vane = settled(scenario(noise=NOISE))
    assert renew(surroundings, vane, 0.0, 5.0) == []
    assert surroundings.sensors.measured(TRUTH, 5.0) == TRUTH


def test_gusts_come_on_top_of_the_wind_every_period_from_mission_start():
    surroundings, vane = settled(scenario(noise=NOISE, wind={"speed_m_s": 5, "from_deg": 180}))
    surroundings.begin(vane, 10.0)
    winds = np.array(renew(surroundings, vane, 10.0, 1000.0))
    assert len(winds) == round(1000.0 / PERIOD_S)
    # A first-order process of T = 2 s forgets in 2T: so many independent samples there are in 1000 s.
    independent = 1000.0 / (2 * 2.0)
    assert winds[:, :2].mean(axis=0) == pytest.approx([5.0, 0.0], abs=5 * 0.8 / math.sqrt(independent))
    assert winds[:, :2].std(axis=0) == pytest.approx(0.8, rel=5 / math.sqrt(2 * independent))
    assert not winds[:, 2].any()


def test_measurements_are_blurred_sideways_and_never_vertically():
    surroundings, vane = settled(scenario(noise=NOISE))
    surroundings.begin(vane, 10.0)
    n = 10_000
    errors = np.array([surroundings.sensors.measured(TRUTH, 10.0 + k) for k in range(n)]) - TRUTH
    assert not errors[:, [2, 5]].any()
    for axis, sigma in ((0, 0.1), (1, 0.1), (3, 0.05), (4, 0.05)):
        assert errors[:, axis].std() == pytest.approx(sigma, rel=5 / math.sqrt(2 * n))
        assert abs(errors[:, axis].mean()) < 5 * sigma / math.sqrt(n)


def test_the_same_seed_meets_the_same_air_however_late_the_mission_begins():
    def weather(start_s, seed=1, vehicle=1):
        told = scenario(noise=NOISE, swarm={"rows": 1, "columns": 2, "leaders": [1]})
        surroundings, vane = settled(told, seed=seed, vehicle=vehicle)
        surroundings.begin(vane, start_s)
        winds = renew(surroundings, vane, start_s, 15.0)
        return winds, [surroundings.sensors.measured(TRUTH, start_s + k) for k in range(300)]

    assert weather(10.0) == weather(73.25)
    assert weather(10.0)[0] != weather(10.0, seed=2)[0]
    assert weather(10.0)[1] != weather(10.0, seed=2)[1]
    assert weather(10.0)[0] != weather(10.0, vehicle=2)[0]


def test_the_next_mission_begins_as_the_first_did():
    fault = {"vehicle": 1, "kind": "rotor", "rotor": 2, "efficiency": 0.7, "onset_s": 1}
    surroundings, vane = settled(scenario(noise=NOISE, fault=[fault], wind={"speed_m_s": 3, "turbulence": 8}))
    steady = vane.winds[0]

    def mission(start_s):
        surroundings.begin(vane, start_s)
        return renew(surroundings, vane, start_s, 5.0), surroundings.sensors.measured(TRUTH, start_s)

    first = mission(10.0)
    surroundings.end(vane)
    assert vane.winds[-1] == steady
    assert vane.rotors[-1] == (1, 1.0, 1.0)
    assert surroundings.sensors.measured(TRUTH, 16.0) == TRUTH
    assert renew(surroundings, vane, 16.0, 5.0) == []
    assert mission(50.0) == first
    assert vane.turbulence == [8.0, 0.0, 8.0]


def test_a_rotor_is_told_of_its_health_when_it_changes_and_only_then():
    fault = {"vehicle": 1, "kind": "rotor", "rotor": 3, "efficiency": 0.7, "speed_limit": 0.9, "onset_s": 2, "end_s": 4}
    surroundings, vane = settled(scenario(fault=[fault]))
    surroundings.begin(vane, 10.0)
    renew(surroundings, vane, 10.0, 1.9)
    assert vane.rotors == []
    renew(surroundings, vane, 12.0, 1.9)
    assert vane.rotors == [(2, 0.7, 0.9)]
    renew(surroundings, vane, 14.0, 5.0)
    assert vane.rotors == [(2, 0.7, 0.9), (2, 1.0, 1.0)]


def test_wind_of_a_fault_comes_on_top_of_the_weather_from_its_onset_to_its_end_and_on_everyone_where_it_says_so():
    weather = {"speed_m_s": 5, "from_deg": 180}
    fault = {"vehicle": 1, "kind": "wind", "speed_m_s": 2, "from_deg": 270, "onset_s": 1, "end_s": 3, "everyone": True}
    pair = {"rows": 1, "columns": 2, "leaders": [1]}
    for vehicle in (1, 2):
        surroundings, vane = settled(scenario(wind=weather, fault=[fault], swarm=pair), vehicle=vehicle)
        surroundings.begin(vane, 10.0)
        winds = renew(surroundings, vane, 10.0, 5.0)
        assert np.array(winds[:10]) == pytest.approx(np.tile([5.0, 0.0, 0.0], (10, 1)), abs=1e-9)
        assert np.array(winds[10:30]) == pytest.approx(np.tile([5.0, 2.0, 0.0], (20, 1)), abs=1e-9)
        assert np.array(winds[30:]) == pytest.approx(np.tile([5.0, 0.0, 0.0], (20, 1)), abs=1e-9)


def test_gusts_of_a_fault_leave_the_airs_own_gusts_as_they_are_and_come_again_in_the_next_mission():
    fault = {"vehicle": 1, "kind": "wind", "speed_m_s": 0, "gust_m_s": 1.0}
    gusty, calm = scenario(noise=NOISE, fault=[fault]), scenario(noise=NOISE)

    def mission(told, start_s):
        surroundings, vane = told
        surroundings.begin(vane, start_s)
        winds = np.array(renew(surroundings, vane, start_s, 60.0))
        surroundings.end(vane)
        assert vane.winds[-1] == vane.winds[0]
        return winds

    struck = settled(gusty)
    both, own = mission(struck, 10.0), mission(settled(calm), 10.0)
    assert (both - own)[:, :2].std() == pytest.approx(1.0, rel=5 / math.sqrt(2 * 2 * 60 / 4))
    assert mission(struck, 90.0) == pytest.approx(both)


def test_a_degraded_motor_acts_from_mission_start():
    fault = {"vehicle": 1, "kind": "motor_degradation"}
    surroundings, vane = settled(scenario(fault=[fault]))
    assert surroundings.flown((1.5, 0.0, 0.1), 100.0) == (1.5, 0.0, 0.1)
    surroundings.begin(vane, 100.0)
    assert surroundings.flown((1.5, 0.0, 0.1), 100.0) == pytest.approx((0.6, -0.705, 0.1))


def hovers(vehicle, seconds=10):
    """Its velocities, ten a second."""
    velocities = []
    for _ in range(10 * seconds):
        vehicle.step(HZ // 10)
        velocities.append(vehicle.position_velocity()[3:])
    return np.array(velocities)


def test_turbulence_shakes_from_mission_start_to_end_the_same_however_late_it_begins():
    shaken = []
    for wait_s in (8, 20):
        surroundings = Surroundings(scenario(wind={"turbulence": 12, "speed_m_s": 4}), vehicle=1, seed=1)
        vehicle = Vehicle(home=PLACE, height_m=30.0, seed=5)
        surroundings.settle(vehicle)
        vehicle.set_velocity((0.0, 0.0, 0.0), 0.0)
        vehicle.arm()
        vehicle.step(wait_s * HZ)
        assert hovers(vehicle).std(axis=0).max() < 1e-3
        surroundings.begin(vehicle, vehicle.steps / HZ)
        shaken.append(hovers(vehicle))
        surroundings.end(vehicle)
        vehicle.step(8 * HZ)
        assert hovers(vehicle).std(axis=0).max() < 1e-3
    assert shaken[0].std(axis=0).max() > 1e-2
    assert shaken[1] == pytest.approx(shaken[0], abs=1e-3)
