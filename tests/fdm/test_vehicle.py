"""One vehicle against closed forms, worked out here from the numbers in aircraft/quad/README.md."""

import os
import random
import subprocess
import sys
from math import cos, degrees, hypot, nan, pi, radians, sin, sqrt, tanh
from pathlib import Path

import pymap3d
import pytest

from fdm.vehicle import FlightModelDiverged, Geodetic, Vehicle

AXES = ("north", "east", "down", "yaw")
HOME = Geodetic(47.3977, 8.5456, 488.0)

MASS = 1.5  # kg
ARM = 0.18  # m
DRAG_AREA = (0.020, 0.022, 0.045)  # m²
THRUST, TORQUE, H_FORCE, INFLOW = 8.54858e-6, 0.016, 8.06e-5, 4.5e-4
ROTOR_INERTIA = 2.6e-5  # kg m²


def gravity(place):
    """m/s²: Somigliana's WGS-84 formula (NGA.STND.0036) with the free-air term."""
    s2 = sin(radians(place.latitude_deg)) ** 2
    return 9.7803253359 * (1 + 0.00193185265241 * s2) / sqrt(1 - 0.00669437999013 * s2) - 3.086e-6 * place.altitude_m


def density(altitude_m):
    """kg/m³ of the 1976 standard atmosphere below 11 km."""
    h = altitude_m / (1 + altitude_m / 6356766)
    return 1.225 * (1 - 2.25577e-5 * h) ** 4.25588


G = gravity(HOME)


def flying(height_m=50.0, *, hz=250, seconds=8.0, wind=(0.0, 0.0, 0.0), yaw=0.0, **options):
    """A vehicle in a settled hover. Vehicles fall a little before their rotors are up to speed."""
    vehicle = Vehicle(home=HOME, physics_hz=hz, height_m=height_m, yaw=yaw, **options)
    vehicle.set_wind(wind)
    vehicle.set_velocity((0.0, 0.0, 0.0), yaw)
    vehicle.arm()
    vehicle.step(round(seconds * hz))
    return vehicle


def response(vehicle, hz, seconds, read):
    """50 readings a second while it flies on."""
    readings = []
    for _ in range(round(seconds * 50)):
        vehicle.step(hz // 50)
        readings.append(read(vehicle))
    return readings


def rise_and_overshoot(readings, target):
    """(s from 10 % to 90 %, overshoot as a share) of a step response."""
    share = [value / target for value in readings]

    def passes(level):
        i = next(i for i, value in enumerate(share) if value >= level)
        before = share[i - 1] if i else 0.0
        return (i + (level - before) / (share[i] - before)) / 50

    return passes(0.9) - passes(0.1), max(share) - 1


def test_a_dropped_quad_falls_at_g():
    vehicle = Vehicle(home=HOME, height_m=300.0)
    vehicle.step(50)
    velocity = vehicle.position_velocity()[5]
    terminal = sqrt(2 * MASS * G / (density(788) * DRAG_AREA[2]))
    assert velocity == pytest.approx(terminal * tanh(G * 0.2 / terminal), rel=1e-3)
    assert velocity == pytest.approx(G * 0.2, rel=0.005)


def test_a_long_fall_ends_at_terminal_speed():
    vehicle = Vehicle(home=HOME, height_m=1500.0)
    vehicle.step(250 * 20)
    _, _, down, _, _, sink = vehicle.position_velocity()
    rho = density(HOME.altitude_m - down)
    assert sink == pytest.approx(sqrt(2 * MASS * G / (rho * DRAG_AREA[2])), rel=0.01)


def test_hover_thrust_carries_the_weight():
    vehicle = flying()
    sigma = density(HOME.altitude_m + 50) / 1.225
    thrust = sum(THRUST * sigma * speed**2 for speed in vehicle.rotor_speeds)
    assert thrust == pytest.approx(MASS * G, rel=1e-3)
    assert vehicle.state().acceleration_body == pytest.approx((0, 0, -G), abs=0.02)


def tilt_in_wind(wind, area):
    """rad. Along the body's x (or y) axis weight, drag and H-force balance; thrust carries the rest."""
    rho = density(HOME.altitude_m + 50)
    sigma = rho / 1.225
    tilt = 0.0
    for _ in range(200):
        across, through = wind * cos(tilt), wind * sin(tilt)  # through the rotor disc from above
        thrust = MASS * G * cos(tilt) + 0.5 * rho * DRAG_AREA[2] * through**2
        a, b = THRUST * sigma, INFLOW * sigma * through
        speed = (b + sqrt(b**2 + a * thrust)) / (2 * a)  # 4 ω (a ω − b) = thrust
        drag = 0.5 * rho * area * across**2 + H_FORCE * sigma * 4 * speed * across
        tilt += 0.5 * (drag / (MASS * G) - sin(tilt))
    return tilt


@pytest.mark.parametrize("wind", [5.0, 10.0])
def test_it_leans_into_a_steady_wind_as_drag_and_h_force_ask(wind):
    _, pitch, _ = flying(seconds=16, wind=(wind, 0.0, 0.0)).state().attitude_rpy
    roll, _, _ = flying(seconds=16, wind=(0.0, wind, 0.0)).state().attitude_rpy
    assert degrees(pitch) == pytest.approx(degrees(tilt_in_wind(wind, DRAG_AREA[0])), abs=0.15)
    assert degrees(-roll) == pytest.approx(degrees(tilt_in_wind(wind, DRAG_AREA[1])), abs=0.15)


def test_a_hover_in_ten_metres_a_second_of_wind_does_not_drift():
    vehicle = flying(seconds=16, wind=(6.0, -8.0, 0.0))
    before = vehicle.position_velocity()
    vehicle.step(250 * 20)
    after = vehicle.position_velocity()
    assert max(abs(b - a) for a, b in zip(before[:3], after[:3], strict=True)) < 0.005


@pytest.mark.parametrize("axis", [0, 1])
def test_a_velocity_step_is_quick_and_hardly_overshoots(axis):
    vehicle = flying()
    vehicle.set_velocity((2.0, 0.0, 0.0) if axis == 0 else (0.0, 2.0, 0.0), 0.0)
    rise, overshoot = rise_and_overshoot(response(vehicle, 250, 6, lambda v: v.position_velocity()[3 + axis]), 2.0)
    assert 0.4 < rise < 0.8
    assert overshoot < 0.05


@pytest.mark.parametrize("climb", [-2.0, 2.0])
def test_a_climb_step_is_quick_and_hardly_overshoots(climb):
    vehicle = flying(100.0)
    vehicle.set_velocity((0.0, 0.0, climb), 0.0)
    rise, overshoot = rise_and_overshoot(response(vehicle, 250, 6, lambda v: v.position_velocity()[5]), climb)
    assert 0.4 < rise < 0.8
    assert overshoot < 0.05


def test_it_turns_a_quarter_in_about_a_second():
    vehicle = flying()
    vehicle.set_velocity((0.0, 0.0, 0.0), pi / 2)
    rise, overshoot = rise_and_overshoot(response(vehicle, 250, 5, lambda v: v.state().attitude_rpy[2]), pi / 2)
    assert 0.7 < rise < 1.2
    assert overshoot < 0.05


def test_it_turns_the_short_way_round():
    vehicle = flying(yaw=radians(170))
    vehicle.set_velocity((0.0, 0.0, 0.0), radians(-170))
    yaws = response(vehicle, 250, 4, lambda v: v.state().attitude_rpy[2])
    assert all(abs(yaw) > radians(169) for yaw in yaws)
    assert degrees(yaws[-1]) == pytest.approx(-170, abs=0.5)


@pytest.mark.parametrize("hz", [100, 200, 500, 1000])
def test_step_rates_fly_alike(hz):
    def track(rate):
        vehicle = flying(hz=rate)
        vehicle.set_velocity((2.0, -1.0, -1.0), 0.5)
        return response(vehicle, rate, 6, lambda v: v.position_velocity())

    for expected, flown in zip(track(250), track(hz), strict=True):
        assert flown[3:] == pytest.approx(expected[3:], abs=0.06)
    assert flown[3:] == pytest.approx(expected[3:], abs=0.002)


@pytest.mark.parametrize("seed", range(60))
def test_a_tumbling_drop_ends_at_rest_on_the_ground(seed):
    rng = random.Random(seed)
    vehicle = Vehicle(home=HOME, height_m=rng.uniform(2, 15), yaw=rng.uniform(-pi, pi))
    for rotor in range(4):
        vehicle.set_rotor(rotor, efficiency=rng.uniform(0, 1))
    vehicle.arm()
    vehicle.step(rng.randrange(25, 250))
    vehicle.disarm()
    vehicle.step(250 * 8)
    north, east, down, *velocity = vehicle.position_velocity()
    assert vehicle.landed
    assert velocity == pytest.approx([0, 0, 0], abs=1e-9)
    assert -0.15 < down < 0.15
    assert hypot(north, east) < 20


def test_near_the_ground_rotors_turn_slower_by_cheeseman_and_bennett():
    low, high = flying(0.15, charge=0.9), flying(60.0, charge=0.9)
    height = -low.position_velocity()[2] + 0.1175 + 0.04
    assert 0.1 < height < 0.5
    expected = sqrt(1 - (0.127 / (4 * height)) ** 2) * sqrt(density(548) / density(488))
    assert low.rotor_speeds[0] / high.rotor_speeds[0] == pytest.approx(expected, rel=1e-3)
    assert expected < 0.995


def test_a_steady_climb_costs_rotor_speed_as_the_inflow_says():
    vehicle = flying(20.0)
    vehicle.set_velocity((0.0, 0.0, -3.0), 0.0)
    vehicle.step(250 * 6)
    rho = density(vehicle.state().altitude_m)
    sigma = rho / 1.225
    thrust = MASS * G + 0.5 * rho * DRAG_AREA[2] * 3.0**2
    a, b = THRUST * sigma, INFLOW * sigma * 3.0
    assert vehicle.rotor_speeds[0] == pytest.approx((b + sqrt(b**2 + a * thrust)) / (2 * a), rel=2e-3)


def test_the_wrench_is_the_one_the_readme_describes():
    """Thrust, H-force, damping and gyroscopic torque, worked out again in a violent manoeuvre."""
    vehicle = flying(seed=3, wind=(4.0, -3.0, 1.0))
    vehicle.set_velocity((-8.0, 6.0, -2.0), 2.0)
    vehicle.step(60)
    read = vehicle._fdm.get_property_value
    u, v, w = (read(f"velocities/{axis}-aero-fps") * 0.3048 for axis in "uvw")
    p, q, r = (read(f"velocities/{axis}-aero-rad_sec") for axis in "pqr")
    vehicle.step(1)
    spin_p, spin_q, _ = vehicle.state().rate_body  # JSBSim moves the vehicle first, then works the wrench out
    speeds = vehicle.rotor_speeds
    sigma, ground = read("rotor/density-ratio"), read("rotor/ground-effect")
    t = [sigma * speed * (THRUST * ground * speed + INFLOW * w) for speed in speeds]
    total, momentum = sum(speeds), ROTOR_INERTIA * (speeds[0] + speeds[1] - speeds[2] - speeds[3])
    drag, damping = H_FORCE * sigma * total, INFLOW * sigma * total * ARM**2
    force = (-drag * u, -drag * v, -sum(t))
    torque = (
        ARM * (t[1] + t[2] - t[0] - t[3]) - damping * p + momentum * spin_q,
        ARM * (t[0] + t[2] - t[1] - t[3]) - damping * q - momentum * spin_p,
        TORQUE * (t[0] + t[1] - t[2] - t[3]) - drag * 2 * ARM**2 * r,
    )
    assert abs(momentum * spin_q) > 1e-5, "the gyroscopic torque was not put to the test"
    assert tuple(read(f"external_reactions/rotors/{axis}") for axis in "xyz") == pytest.approx(force, rel=1e-6)
    assert tuple(read(f"external_reactions/torque/{axis}") for axis in "lmn") == pytest.approx(torque, rel=1e-6)


def test_a_weak_rotor_turns_faster_and_the_vehicle_flies_on():
    vehicle = flying()
    healthy = vehicle.rotor_speeds[0]
    vehicle.set_rotor(0, efficiency=0.7)
    tilts = response(vehicle, 250, 10, lambda v: max(map(abs, v.state().attitude_rpy[:2])))
    assert vehicle.rotor_speeds[0] == pytest.approx(healthy / sqrt(0.7), rel=0.01)
    assert degrees(max(tilts)) > 1.0
    assert degrees(tilts[-1]) < 0.2
    assert max(map(abs, vehicle.position_velocity()[3:])) < 0.05


def test_a_limited_rotor_turns_no_faster():
    vehicle = flying()
    vehicle.set_rotor(2, speed_limit=0.72)
    vehicle.set_velocity((0.0, 0.0, -5.0), 0.0)
    fastest = max(response(vehicle, 250, 2, lambda v: v.rotor_speeds[2]))
    assert 715 < fastest <= 720


@pytest.mark.parametrize("fault", [{"efficiency": 1.1}, {"efficiency": nan}, {"speed_limit": -0.1}])
def test_an_impossible_rotor_is_refused(fault):
    with pytest.raises(ValueError, match=next(iter(fault))):
        Vehicle(home=HOME).set_rotor(1, **fault)


@pytest.mark.parametrize("rotor", [-1, 4])
def test_a_fifth_rotor_is_refused(rotor):
    with pytest.raises(ValueError, match="no rotor"):
        Vehicle(home=HOME).set_rotor(rotor)


def test_the_battery_drains_and_sags_as_power_asks():
    vehicle = flying(seconds=2)
    charge, amp_seconds = vehicle.battery.remaining, 0.0
    for _ in range(250 * 30 // 10):
        vehicle.step(10)
        battery = vehicle.battery
        amp_seconds += battery.amps * 10 / 250
    shaft = TORQUE * THRUST * sum(speed**3 for speed in vehicle.rotor_speeds)
    assert battery.volts * battery.amps == pytest.approx(8 + shaft / 0.75, rel=2e-3)
    assert (charge - battery.remaining) * 5.0 * 3600 == pytest.approx(amp_seconds, rel=2e-3)
    open_circuit = 16.0 + (battery.remaining - 0.8) / 0.2 * 0.8
    assert open_circuit - battery.volts == pytest.approx(0.02 * battery.amps, rel=5e-3)


def test_an_empty_battery_does_not_hold_it_up():
    assert flying(charge=0.0, seconds=5).position_velocity()[5] > 0.5


def test_the_mixer_is_free_in_hover_and_says_so_when_it_is_not():
    vehicle = flying()
    assert not vehicle.saturated
    vehicle.set_velocity((0.0, 0.0, -15.0), pi)
    assert any(response(vehicle, 250, 1, lambda v: v.saturated))


def test_standing_on_the_ground_does_not_wind_the_climb_up():
    vehicle = Vehicle(home=HOME)
    vehicle.arm()
    vehicle.set_velocity((0.0, 0.0, 0.5), 0.0)
    vehicle.step(250 * 30)
    assert vehicle.landed
    vehicle.set_velocity((0.0, 0.0, -1.0), 0.0)
    vehicle.step(250 * 3)
    assert -3.0 < vehicle.position_velocity()[2] < -1.8


def test_a_set_point_that_is_not_a_number_is_refused_and_flight_goes_on():
    vehicle = flying()
    vehicle.set_velocity((1.0, 0.0, 0.0), 0.0)
    for velocity, yaw in (((nan, 0.0, 0.0), 0.0), ((0.0, 0.0, 0.0), float("inf"))):
        with pytest.raises(ValueError, match=r"nan|inf"):
            vehicle.set_velocity(velocity, yaw)
    with pytest.raises(ValueError, match="wind"):
        vehicle.set_wind((0.0, nan, 0.0))
    vehicle.step(250 * 4)
    assert vehicle.position_velocity()[3:] == pytest.approx((1, 0, 0), abs=0.02)


@pytest.mark.parametrize("name", [*(f"control/{axis}-sp" for axis in AXES), "atmosphere/gust-east-fps"])
def test_a_poisoned_flight_model_is_reported(name):
    vehicle = flying(seconds=1)
    vehicle._write(name, nan)
    with pytest.raises(FlightModelDiverged, match="not finite"):
        vehicle.step(50)


def test_an_unknown_property_is_an_error_with_its_name():
    with pytest.raises(KeyError, match="control/nroth-sp"):
        Vehicle(home=HOME)._node("control/nroth-sp")


def test_an_unknown_aircraft_is_an_error_with_its_name():
    with pytest.raises(FileNotFoundError, match="zeppelin"):
        Vehicle(home=HOME, aircraft="zeppelin")


def test_the_flight_model_is_silent(capfd):
    vehicle = flying(0.5, seconds=1)
    vehicle.disarm()
    vehicle.step(500)
    assert capfd.readouterr() == ("", "")


def rough_flight(seed, bursts=40):
    vehicle = flying(30.0, seconds=2, wind=(5.0, 2.0, 0.0), seed=seed)
    vehicle.set_turbulence(8.0)
    vehicle.set_velocity((1.5, 0.5, -0.2), 0.3)
    for _ in range(bursts):
        vehicle.step(1000 // bursts)
    return repr(vehicle.state())


def test_one_seed_gives_one_flight_to_the_bit_in_any_process():
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    script = "from test_vehicle import rough_flight; print(rough_flight(7))"
    command = [sys.executable, "-c", script]
    other = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert other.stdout.strip() == rough_flight(7) == rough_flight(7)
    assert rough_flight(7) != rough_flight(8)


@pytest.mark.parametrize("bursts", [1, 8, 1000])
def test_bursts_of_any_length_give_the_same_flight_to_the_bit(bursts):
    assert rough_flight(7, bursts) == rough_flight(7)


def test_turbulence_shakes_harder_in_more_wind():
    def shaking(wind_at_6m):
        vehicle = flying(30.0, wind=(6.0, 0.0, 0.0), seed=1)
        vehicle.set_turbulence(wind_at_6m)
        speeds = response(vehicle, 250, 10, lambda v: v.position_velocity()[3])
        return sqrt(sum(speed**2 for speed in speeds) / len(speeds))

    still, light, moderate = shaking(0.0), shaking(7.7), shaking(15.0)
    assert still < 0.005 < light < moderate


def test_position_is_the_tangent_plane_at_home():
    vehicle = flying(20.0)
    vehicle.set_velocity((12.0, 9.0, -1.0), 0.5)
    vehicle.step(250 * 40)
    state = vehicle.state()
    place = (state.latitude_deg, state.longitude_deg, state.altitude_m)
    home = (HOME.latitude_deg, HOME.longitude_deg, HOME.altitude_m)
    assert state.position_ned == pytest.approx(pymap3d.geodetic2ned(*place, *home), abs=1e-6)
    assert hypot(*state.position_ned) > 500


def test_state_agrees_with_itself():
    vehicle = flying(yaw=-2.0)
    vehicle.set_velocity((5.0, -3.0, 1.0), 1.0)
    vehicle.step(130)
    state = vehicle.state()
    assert state.time_s == vehicle.steps / 250
    assert (*state.position_ned, *state.velocity_ned) == vehicle.position_velocity()
    w, x, y, z = state.attitude_wxyz
    roll, pitch, yaw = state.attitude_rpy
    down_body = (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y))
    assert down_body == pytest.approx((-sin(pitch), sin(roll) * cos(pitch), cos(roll) * cos(pitch)))
    assert 2 * (x * y + w * z) == pytest.approx(sin(yaw) * cos(pitch))


def test_it_starts_standing_still_at_home_facing_its_yaw():
    vehicle = Vehicle(home=HOME, yaw=-2.0)
    state = vehicle.state()
    assert vehicle.landed
    assert state.position_ned == pytest.approx((0, 0, 0), abs=1e-6)
    assert (state.latitude_deg, state.longitude_deg) == pytest.approx((HOME.latitude_deg, HOME.longitude_deg))
    assert state.altitude_m == pytest.approx(HOME.altitude_m)
    assert state.attitude_rpy == pytest.approx((0, 0, -2.0), abs=1e-9)
    assert state.acceleration_body == pytest.approx((0, 0, -G), rel=1e-4)


def test_landed_and_disarmed_it_does_not_creep_in_wind():
    vehicle = flying(1.0, seconds=2, wind=(10.0, 0.0, 0.0))
    vehicle.set_velocity((0.0, 0.0, 0.5), 0.0)
    while not vehicle.landed:
        vehicle.step(10)
    vehicle.disarm()
    vehicle.step(250 * 3)
    before = vehicle.position_velocity()
    vehicle.step(250 * 20)
    assert vehicle.position_velocity() == pytest.approx(before, abs=1e-6)


def test_it_takes_off_again_after_landing():
    vehicle = flying(1.0, seconds=2)
    vehicle.disarm()
    vehicle.step(250 * 3)
    vehicle.arm()
    vehicle.set_velocity((0.0, 0.0, -1.0), 0.0)
    vehicle.step(250 * 4)
    assert not vehicle.landed
    assert vehicle.position_velocity()[2] < -2.5


def test_arming_forgets_the_wind_of_the_last_flight():
    vehicle = flying(1.0, seconds=6, wind=(12.0, 0.0, 0.0))
    vehicle.set_velocity((0.0, 0.0, 0.5), 0.0)
    while not vehicle.landed:
        vehicle.step(10)
    vehicle.disarm()
    vehicle.set_wind((0.0, 0.0, 0.0))
    vehicle.step(250 * 4)
    north = vehicle.position_velocity()[0]
    vehicle.set_velocity((0.0, 0.0, -1.0), 0.0)
    vehicle.arm()
    vehicle.step(250 * 2)
    assert vehicle.position_velocity()[0] == pytest.approx(north, abs=0.01)
