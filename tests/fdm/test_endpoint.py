"""One vehicle as a ground station sees it: bytes in, bytes out."""

import math

import numpy as np
import pytest
from clients import (
    ACCEPTED,
    ALONE,
    ARM,
    ATTITUDE,
    BODY_NED,
    DENIED,
    FORCED,
    GLOBAL_POSITION,
    GPS_ORIGIN,
    HEARTBEAT,
    HOLD,
    INTERVAL,
    LAND,
    LOCAL_POSITION,
    MODE,
    OFFBOARD,
    PLACE,
    REJECTED,
    REQUEST,
    SET_INTERVAL,
    TAKE_OFF,
    UNSUPPORTED,
    VERSION,
    VFR_HUD,
    WITH_YAW,
    WITH_YAW_RATE,
    Flight,
    Station,
    command,
    scenario,
    setpoint,
)
from hypothesis import given
from hypothesis import strategies as st

from fdm.commands import FORCE_DISARM
from fdm.modes import Mode

PX4_HOLD, PX4_OFFBOARD, PX4_TAKEOFF, PX4_LAND = 0x03040000, 0x00060000, 0x02040000, 0x06040000
NOISE = {"velocity_m_s": 0.05, "position_m": 0.1}
FLOAT32 = 1e-6
"""Relative error of a number that went through a 32-bit float."""


# Heartbeat and commands


def test_it_is_taken_for_a_px4_quadrotor():
    flight = Flight()
    flight.wait(5.0)
    beats = flight.all("HEARTBEAT")
    assert len(beats) == 5
    for beat in beats:
        assert (beat.type, beat.autopilot, beat.mavlink_version) == (2, 12, 3)
        assert (beat.base_mode, beat.system_status, beat.custom_mode) == (1, 3, PX4_HOLD)


def test_the_heartbeat_tells_at_once_of_arming_and_of_every_mode():
    flight = Flight()
    flight.wait(1.2)
    seen = []
    for step in (
        lambda: flight.ask(ARM, 1),
        lambda: flight.ask(TAKE_OFF, 0, 0, 0, 0, 0, 0, math.nan),
        lambda: flight.wait(6.0),
        lambda: (flight.send(setpoint((0, 0, 0))), flight.ask(MODE, 1, *OFFBOARD)),
        lambda: flight.ask(LAND),
        lambda: flight.wait(10.0),
    ):
        step()
        beat = flight.last("HEARTBEAT")
        seen.append((beat.base_mode, beat.system_status, beat.custom_mode))
    assert seen == [
        (129, 4, PX4_HOLD),
        (129, 4, PX4_TAKEOFF),
        (129, 4, PX4_HOLD),
        (129, 4, PX4_OFFBOARD),
        (129, 4, PX4_LAND),
        (1, 3, PX4_LAND),
    ]


@pytest.mark.parametrize(
    ("number", "params", "result"),
    [
        (ARM, (1,), ACCEPTED),
        (ARM, (0,), ACCEPTED),
        (ARM, (0.5,), UNSUPPORTED),
        (ARM, (math.nan,), UNSUPPORTED),
        (TAKE_OFF, (0, 0, 0, 0, 0, 0, 480), REJECTED),
        (TAKE_OFF, (0, 0, 0, 0, 0, 0, 500), ACCEPTED),
        (LAND, (), ACCEPTED),
        (MODE, (1, *HOLD), ACCEPTED),
        (MODE, (1, *OFFBOARD), REJECTED),
        (MODE, (1, 4, 2), ACCEPTED),
        (MODE, (1, 4, 5), ACCEPTED),
        (MODE, (1, -1, 1e30), REJECTED),
        (MODE, (1, math.nan, 3), DENIED),
        (MODE, (1, 4, math.inf), DENIED),
        (SET_INTERVAL, (LOCAL_POSITION, 50_000), ACCEPTED),
        (SET_INTERVAL, (32.5, 50_000), DENIED),
        (SET_INTERVAL, (math.nan, 50_000), DENIED),
        (SET_INTERVAL, (LOCAL_POSITION, math.nan), DENIED),
        (SET_INTERVAL, (9999, 50_000), DENIED),
        (REQUEST, (VERSION,), ACCEPTED),
        (REQUEST, (9999,), DENIED),
        (REQUEST, (INTERVAL, 9999), DENIED),
        (REQUEST, (-1,), DENIED),
        (31, (), UNSUPPORTED),
        (65535, (1, 2, 3, 4, 5, 6, 7), UNSUPPORTED),
    ],
)
def test_every_command_is_answered(number, params, result):
    flight = Flight()
    flight.wait(1.2)
    assert flight.ask(number, *params) == result
    assert len(flight.all("COMMAND_ACK")) == 1


def test_the_answer_names_the_asker():
    flight = Flight()
    flight.mav.srcSystem, flight.mav.srcComponent = 200, 7
    flight.ask(ARM, 1)
    answer = flight.last("COMMAND_ACK")
    assert (answer.command, answer.target_system, answer.target_component) == (ARM, 200, 7)


@pytest.mark.parametrize(("system", "component"), [(1, 1), (0, 0), (1, 0), (0, 1)])
def test_what_is_meant_for_it_or_for_all_is_heard(system, component):
    check_hearing(system, component, heard=True)


@pytest.mark.parametrize(("system", "component"), [(2, 1), (2, 0), (255, 190), (1, 200), (0, 2)])
def test_what_is_meant_for_others_is_not_heard(system, component):
    check_hearing(system, component, heard=False)


def check_hearing(system, component, *, heard):
    flight = Flight()
    flight.wait(1.2)
    before = flight.pilot
    flight.send(command(ARM, 1, system=system, component=component))
    assert bool(flight.all("COMMAND_ACK")) is heard
    assert flight.pilot.armed is heard
    flight.send(setpoint((1, 0, 0), system=system, component=component))
    assert (flight.pilot.setpoint is not None) is heard
    assert (flight.endpoint.first_motion_step is not None) is heard
    assert heard or flight.pilot == before


def test_arming_in_the_first_second_is_refused_in_words_and_sys_status_says_when():
    flight = Flight()
    assert flight.ask(ARM, 1) == REJECTED
    assert flight.words() == ["Arming denied: sensors are settling"]
    flight.ask(REQUEST, 1)
    assert not flight.last("SYS_STATUS").onboard_control_sensors_health & 0x10000000
    flight.wait(1.0)
    assert flight.last("SYS_STATUS").onboard_control_sensors_health & 0x10000000
    assert flight.ask(ARM, 1) == ACCEPTED


def test_refusals_come_with_words():
    flight = Flight()
    flight.wait(1.2)
    flight.ask(TAKE_OFF, 0, 0, 0, 0, 0, 0, PLACE.altitude_m - 1.0)
    flight.ask(MODE, 1, *OFFBOARD)
    assert flight.words() == ["Take-off denied: altitude is below home", "Offboard denied: no set-points are coming"]


# Streams and requests


@pytest.mark.parametrize("rate_hz", [1, 4, 20, 50, 250])
def test_a_stream_comes_at_the_rate_that_was_asked_for(rate_hz):
    flight = Flight()
    flight.ask(SET_INTERVAL, LOCAL_POSITION, 1e6 / rate_hz)
    flight.wait(10.0)
    steps = [step for step, message in flight.heard if message.get_type() == "LOCAL_POSITION_NED"]
    assert steps == [math.ceil(250 * n / rate_hz) for n in range(1, 10 * rate_hz + 1)]
    times = [message.time_boot_ms for message in flight.all("LOCAL_POSITION_NED")]
    assert times == [step * 4 for step in steps]


@pytest.mark.parametrize(("kind", "message", "default_s"), [("ATTITUDE", ATTITUDE, 1), ("VFR_HUD", VFR_HUD, 0)])
def test_a_stream_can_be_turned_off_and_back_to_its_default(kind, message, default_s):
    flight = Flight()
    counts = []
    for interval_us in (100_000, -1, 0):
        flight.ask(SET_INTERVAL, message, interval_us)
        flight.heard.clear()
        flight.wait(4.0)
        counts.append(len(flight.all(kind)))
        assert flight.ask(REQUEST, INTERVAL, message) == ACCEPTED
        counts.append(flight.last("MESSAGE_INTERVAL").interval_us)
    assert counts == [40, 100_000, 0, -1, 4 if default_s else 0, 1_000_000 if default_s else -1]
    assert flight.last("MESSAGE_INTERVAL").message_id == message


def test_an_interval_of_an_hour_is_told_as_the_longest_that_fits():
    flight = Flight()
    assert flight.ask(SET_INTERVAL, ATTITUDE, 3.6e9) == ACCEPTED
    assert flight.ask(REQUEST, INTERVAL, ATTITUDE) == ACCEPTED
    assert flight.last("MESSAGE_INTERVAL").interval_us == 2**31 - 1


@pytest.mark.parametrize(
    ("number", "kind"),
    [
        (HEARTBEAT, "HEARTBEAT"),
        (1, "SYS_STATUS"),
        (ATTITUDE, "ATTITUDE"),
        (LOCAL_POSITION, "LOCAL_POSITION_NED"),
        (GLOBAL_POSITION, "GLOBAL_POSITION_INT"),
        (GPS_ORIGIN, "GPS_GLOBAL_ORIGIN"),
        (147, "BATTERY_STATUS"),
        (VERSION, "AUTOPILOT_VERSION"),
        (245, "EXTENDED_SYS_STATE"),
    ],
)
def test_every_message_it_knows_comes_at_once_on_request(number, kind):
    flight = Flight()
    assert flight.ask(REQUEST, number) == ACCEPTED
    assert len(flight.all(kind)) == 1


def test_the_origin_is_where_it_stands_and_the_unique_id_tells_vehicles_apart():
    flight = Flight()
    flight.ask(REQUEST, GPS_ORIGIN)
    flight.ask(REQUEST, VERSION)
    origin = flight.last("GPS_GLOBAL_ORIGIN")
    assert (origin.latitude, origin.longitude, origin.altitude) == (473977000, 85456000, 488000)
    assert flight.last("AUTOPILOT_VERSION").uid == 1


def test_extended_sys_state_follows_the_flight():
    flight = Flight()

    def landed_state():
        flight.ask(REQUEST, 245)
        return flight.last("EXTENDED_SYS_STATE").landed_state

    flight.wait(1.2)
    states = [landed_state()]
    flight.ask(ARM, 1)
    flight.ask(TAKE_OFF, 0, 0, 0, 0, 0, 0, PLACE.altitude_m + 4)
    for act in (lambda: flight.wait(1.0), lambda: flight.wait(6.0), lambda: (flight.ask(LAND), flight.wait(2.0))):
        act()
        states.append(landed_state())
    flight.wait(10.0)
    assert [*states, landed_state()] == [1, 3, 2, 4, 1]


# A flight


def test_a_whole_flight_from_arming_to_disarming_by_itself():
    flight = Flight()
    flight.wait(1.2)
    assert flight.ask(ARM, 1) == ACCEPTED
    assert flight.ask(TAKE_OFF, 0, 0, 0, 0, 0, 0, PLACE.altitude_m + 10.0) == ACCEPTED
    flight.wait(12.0)
    assert flight.position == pytest.approx((0.0, 0.0, -10.0), abs=0.1)
    assert flight.pilot.mode is Mode.HOLD

    flight.offboard((2.0, 0.0, 0.0), 5.0)
    assert flight.velocity == pytest.approx((2.0, 0.0, 0.0), abs=0.1)
    assert flight.last("HEARTBEAT").custom_mode == PX4_OFFBOARD

    assert flight.ask(MODE, 1, *HOLD) == ACCEPTED
    flight.wait(4.0)
    held = flight.position
    flight.wait(4.0)
    assert flight.position == pytest.approx(held, abs=0.1)

    assert flight.ask(LAND) == ACCEPTED
    flight.wait(20.0)
    assert not flight.pilot.armed
    assert not flight.vehicle.armed
    assert flight.vehicle.landed
    assert flight.position == pytest.approx((held[0], held[1], 0.0), abs=0.2)
    assert flight.words() == [
        "Armed by external command",
        "Takeoff to 10.0 meters above home",
        "Take-off height reached",
        "Landed, disarmed",
    ]


def test_it_can_fly_again_after_landing():
    flight = Flight().hover(3.0)
    flight.ask(LAND)
    flight.wait(12.0)
    assert not flight.pilot.armed
    flight.hover(3.0)
    assert flight.position == pytest.approx((0.0, 0.0, -3.0), abs=0.2)


def test_a_take_off_without_altitude_goes_to_the_vehicles_own():
    flight = Flight()
    flight.wait(1.2)
    flight.ask(ARM, 1)
    assert flight.ask(TAKE_OFF, *(math.nan,) * 7) == ACCEPTED
    flight.wait(6.0)
    assert flight.position[2] == pytest.approx(-2.5, abs=0.1)


def test_idle_on_the_ground_it_stays_put_and_disarms():
    flight = Flight()
    flight.wait(1.2)
    flight.ask(ARM, 1)
    flight.wait(9.9)
    assert flight.pilot.armed
    assert flight.vehicle.landed
    assert flight.position == pytest.approx((0.0, 0.0, 0.0), abs=0.02)
    flight.wait(0.2)
    assert not flight.pilot.armed
    assert flight.words()[-1] == "Disarmed: no take-off"


def test_in_the_air_only_force_stops_the_rotors():
    flight = Flight().hover()
    assert flight.ask(ARM, 0) == REJECTED
    assert flight.words()[-1] == "Disarming denied: not landed"
    flight.wait(1.0)
    assert flight.position[2] == pytest.approx(-10.0, abs=0.1)
    assert flight.ask(ARM, 0, FORCE_DISARM) == ACCEPTED
    flight.wait(1.0)
    terminal = 23.6  # m/s, of body drag alone: tests/fdm/test_vehicle.py
    assert flight.velocity[2] == pytest.approx(terminal * math.tanh(9.81 / terminal), abs=0.2)
    flight.wait(3.0)
    assert flight.vehicle.landed


def test_landing_from_flight_ends_where_it_came_to_rest_though_the_wind_blows():
    flight = Flight(scenario(wind={"speed_m_s": 5, "from_deg": 90})).hover(20.0).offboard((3.0, 0.0, 0.0), 4.0)
    flight.ask(LAND)
    flight.wait(3.0)
    north, east, _ = flight.pilot.anchor_ned
    flight.wait(20.0)
    assert not flight.pilot.armed
    assert flight.position[:2] == pytest.approx((north, east), abs=0.3)


# Set-points


@pytest.mark.parametrize("mask", [ALONE, WITH_YAW, WITH_YAW_RATE, FORCED])
def test_velocity_masks_are_flown(mask):
    flight = Flight().hover().offboard((0.0, 1.0, -0.5), 3.0, mask=mask)
    assert flight.velocity == pytest.approx((0.0, 1.0, -0.5), abs=0.05)
    assert flight.endpoint.refused_setpoints.total() == 0


@pytest.mark.parametrize("mask", [0x0000, 0x01C7, 0x0DF8, 0x0DC0, 0x0C07, 0x0FFF, 0xFFFF, 0xDDC7])
def test_other_masks_are_refused_and_counted(mask):
    check_refusal(setpoint((2, 0, 0), mask=mask))


@pytest.mark.parametrize("frame", [0, 3, 6, 7, 9, 12, 255])
def test_other_frames_are_refused_and_counted(frame):
    check_refusal(setpoint((2, 0, 0), frame=frame))


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("frame", [1, BODY_NED])
def test_numbers_that_are_none_are_refused_and_counted(bad, axis, frame):
    velocity = [1.0, 1.0, 0.0]
    velocity[axis] = bad
    check_refusal(setpoint(velocity, frame=frame))


@pytest.mark.parametrize(("mask", "field"), [(WITH_YAW, "yaw"), (WITH_YAW_RATE, "yaw_rate")])
def test_a_heading_that_is_no_number_is_refused_where_it_counts(mask, field):
    check_refusal(setpoint((2, 0, 0), mask=mask, **{field: math.nan}))
    flight = Flight()
    flight.send(setpoint((2, 0, 0), mask=ALONE, **{field: math.nan}))
    assert flight.endpoint.refused_setpoints.total() == 0


def check_refusal(message):
    flight = Flight()
    flight.send(message, message)
    assert flight.endpoint.refused_setpoints.total() == 2
    assert flight.pilot.setpoint is None
    assert flight.endpoint.first_motion_step is None


@pytest.mark.parametrize("bad", [math.nan, math.inf, 3e38, -3e38])
def test_a_mad_set_point_in_flight_does_not_spoil_the_next_ones(bad):
    flight = Flight().hover(30.0).offboard((1.0, 0.0, 0.0), 2.0)
    for velocity in ((bad, 0, 0), (0, bad, 0), (0, 0, bad)):
        flight.send(setpoint(velocity), setpoint((0, 0, 0), mask=WITH_YAW, yaw=bad))
        flight.stream(0.3, (1.0, 0.0, 0.0))
    flight.stream(5.0, (0.0, 1.0, 0.0))
    assert flight.velocity == pytest.approx((0.0, 1.0, 0.0), abs=0.05)
    assert flight.endpoint.refused_setpoints.total() == (3 if math.isfinite(bad) else 6)
    assert flight.pilot.mode is Mode.OFFBOARD


@pytest.mark.parametrize("heading_deg", [0, 60, 90, 200])
def test_a_body_velocity_is_forward_right_down(heading_deg):
    heading = math.radians(heading_deg)
    flight = Flight(yaw=heading).hover().offboard((2.0, 0.0, 0.0), 4.0, frame=BODY_NED)
    assert flight.velocity == pytest.approx((2 * math.cos(heading), 2 * math.sin(heading), 0.0), abs=0.05)
    flight.stream(4.0, (0.0, 1.0, -0.5), frame=BODY_NED)
    assert flight.velocity == pytest.approx((-math.sin(heading), math.cos(heading), -0.5), abs=0.05)


def heading_error(flight, expected):
    return abs(math.remainder(flight.vehicle.yaw - expected, math.tau))


def test_a_yaw_is_turned_to_and_kept_without_one():
    flight = Flight(yaw=0.5).hover().offboard((1.0, 0.0, 0.0), 4.0, mask=WITH_YAW, yaw=-2.0)
    assert heading_error(flight, -2.0) < 0.02
    flight.stream(3.0, (1.0, 0.0, 0.0))
    assert heading_error(flight, -2.0) < 0.02
    assert flight.velocity == pytest.approx((1.0, 0.0, 0.0), abs=0.05)


def test_a_body_yaw_is_relative_to_the_heading():
    flight = Flight(yaw=0.5).hover()
    flight.send(setpoint((0, 0, 0), mask=WITH_YAW, frame=BODY_NED, yaw=1.0))
    assert flight.pilot.setpoint.yaw == pytest.approx(flight.vehicle.yaw + 1.0)


@pytest.mark.parametrize("rate_hz", [5, 20, 50])
def test_a_yaw_rate_turns_at_that_rate_however_often_it_is_sent(rate_hz):
    flight = Flight().hover().offboard((0, 0, 0), 2.0, mask=WITH_YAW_RATE, yaw_rate=0.3, rate_hz=rate_hz)
    before = flight.vehicle.yaw
    flight.stream(5.0, (0, 0, 0), mask=WITH_YAW_RATE, yaw_rate=0.3, rate_hz=rate_hz)
    assert flight.vehicle.yaw - before == pytest.approx(1.5, abs=0.03)


@pytest.mark.parametrize(
    ("message", "moves"),
    [
        (setpoint((0, 0, 0)), False),
        (setpoint((0, 0, -2)), False),
        (setpoint((0, 0, 0), mask=WITH_YAW, yaw=1.0), False),
        (setpoint((0, 1e-3, 0)), True),
        (setpoint((-1, 0, 0), frame=BODY_NED), True),
    ],
)
def test_only_a_sideways_set_point_is_the_first_motion(message, moves):
    flight = Flight()
    flight.wait(2.0)
    flight.send(message)
    flight.wait(0.4)
    flight.send(message)
    assert flight.endpoint.first_motion_step == (500 if moves else None)


# Silence


def test_silence_in_flight_stops_lands_and_disarms():
    flight = Flight().hover().offboard((3.0, 0.0, 0.0), 5.0)
    assert flight.speed == pytest.approx(3.0, abs=0.05)
    flight.send(setpoint((3.0, 0.0, 0.0)))
    flight.wait(0.48)
    assert flight.pilot.mode is Mode.OFFBOARD
    flight.wait(0.1)
    assert flight.pilot.mode is Mode.HOLD
    flight.wait(1.9)
    assert math.hypot(*flight.velocity[:2]) < 0.1
    flight.wait(2.9)
    assert flight.pilot.mode is Mode.HOLD
    flight.wait(0.4)
    assert flight.pilot.mode is Mode.LAND
    flight.wait(20.0)
    assert flight.vehicle.landed
    assert not flight.vehicle.armed
    assert flight.words()[3:] == [
        "Set-points lost: holding",
        "Set-points did not come back: landing",
        "Landed, disarmed",
    ]


@pytest.mark.parametrize("wait_steps", [0, 3, 7, 12, 20])
def test_silence_is_noticed_at_the_step_at_which_half_a_second_is_over(wait_steps):
    flight = Flight().hover().offboard((1.0, 0.0, 0.0), 1.0)
    flight.endpoint.step(wait_steps)
    flight.send(setpoint((1.0, 0.0, 0.0)))
    flight.endpoint.step(124)
    assert flight.pilot.mode is Mode.OFFBOARD
    flight.endpoint.step(1)
    assert flight.pilot.mode is Mode.HOLD


@pytest.mark.parametrize(
    "cheapest", [setpoint((math.nan, 0, 0)), setpoint((1, 0, 0), mask=0), command(REQUEST, VERSION)]
)
def test_only_set_points_that_can_be_flown_keep_it_in_offboard(cheapest):
    flight = Flight().hover().offboard((1.0, 0.0, 0.0), 1.0)
    for _ in range(20):
        flight.send(cheapest)
        flight.wait(0.05)
    assert flight.pilot.mode is Mode.HOLD


def test_more_than_two_a_second_are_enough_and_one_is_not():
    flight = Flight().hover().offboard((1.0, 0.0, 0.0))
    flight.stream(5.0, (1.0, 0.0, 0.0), rate_hz=2.5)
    assert flight.pilot.mode is Mode.OFFBOARD
    flight.stream(1.0, (1.0, 0.0, 0.0), rate_hz=1)
    assert flight.pilot.mode is Mode.HOLD


# Telemetry and truth


def readings(flight, seconds, kind, **sender):
    """[(message, truth at that very step)] while time passes."""
    pairs, last = [], flight.vehicle.steps + round(seconds * flight.hz)
    while flight.vehicle.steps < last:
        flight.heard.clear()
        flight.endpoint.step(min(flight.endpoint.next_event_step, last) - flight.vehicle.steps)
        flight.listen()
        pairs += [(m, flight.vehicle.state()) for m in flight.all(kind, **sender)]
    return pairs


def position_velocity(message):
    return (message.x, message.y, message.z, message.vx, message.vy, message.vz)


def climbing(told=None, **options):
    """A flight with something to measure in every field."""
    flight = Flight(told, yaw=2.5, **options)
    flight.ask(SET_INTERVAL, LOCAL_POSITION, 50_000)
    return flight.hover().offboard((1.0, -2.0, -0.5), 1.0)


def test_telemetry_without_noise_is_the_truth():
    flight = climbing()
    flight.ask(MODE, 1, *HOLD)
    pairs = readings(flight, 3.0, "LOCAL_POSITION_NED")
    assert len(pairs) == 60
    for message, truth in pairs:
        assert message.time_boot_ms == round(truth.time_s * 1e3)
        expected = (*truth.position_ned, *truth.velocity_ned)
        assert position_velocity(message) == pytest.approx(expected, rel=FLOAT32, abs=FLOAT32)


def test_telemetry_is_exact_before_mission_start_and_has_the_scenarios_deviation_after():
    flight = climbing(scenario(noise=NOISE))
    flight.ask(MODE, 1, *HOLD)

    def errors(seconds):
        pairs = readings(flight, seconds, "LOCAL_POSITION_NED")
        return np.array([np.subtract(position_velocity(m), (*t.position_ned, *t.velocity_ned)) for m, t in pairs])

    assert np.abs(errors(2.0)).max() < 1e-5
    flight.endpoint.begin_mission()
    blurred = errors(100.0)
    n = len(blurred)
    assert n == 2000
    assert np.abs(blurred[:, [2, 5]]).max() < 1e-5
    for axis, sigma in ((0, 0.1), (1, 0.1), (3, 0.05), (4, 0.05)):
        assert blurred[:, axis].std() == pytest.approx(sigma, rel=5 / math.sqrt(2 * n))
    flight.endpoint.end_mission()
    assert np.abs(errors(2.0)).max() < 1e-5


def test_the_truth_comes_ten_times_a_second_from_component_200_and_is_never_blurred():
    flight = climbing(scenario(noise=NOISE))
    flight.endpoint.begin_mission()
    flight.ask(MODE, 1, *HOLD)
    pairs = readings(flight, 3.0, "SIM_STATE", component=200)
    assert len(pairs) == 30
    for message, truth in pairs:
        assert (message.q1, message.q2, message.q3, message.q4) == pytest.approx(truth.attitude_wxyz, abs=FLOAT32)
        assert (message.roll, message.pitch, message.yaw) == pytest.approx(truth.attitude_rpy, abs=FLOAT32)
        assert (message.xacc, message.yacc, message.zacc) == pytest.approx(truth.acceleration_body, abs=1e-5)
        assert (message.xgyro, message.ygyro, message.zgyro) == pytest.approx(truth.rate_body, abs=FLOAT32)
        assert (message.vn, message.ve, message.vd) == pytest.approx(truth.velocity_ned, rel=FLOAT32, abs=FLOAT32)
        assert message.lat_int == round(truth.latitude_deg * 1e7)
        assert message.lon_int == round(truth.longitude_deg * 1e7)
        assert message.alt == pytest.approx(truth.altitude_m, rel=FLOAT32)


def test_nobody_but_component_200_sends_the_truth_and_it_sends_nothing_else():
    flight = climbing()
    assert {m.get_type() for _, m in flight.heard if m.get_srcComponent() == 200} == {"SIM_STATE"}
    assert {m.get_srcComponent() for _, m in flight.heard} == {1, 200}
    assert not flight.all("SIM_STATE", component=1)


def test_attitude_is_the_truth():
    flight = climbing()
    flight.ask(SET_INTERVAL, ATTITUDE, 100_000)
    for message, truth in readings(flight, 1.0, "ATTITUDE"):
        assert (message.roll, message.pitch, message.yaw) == pytest.approx(truth.attitude_rpy, abs=FLOAT32)
        assert (message.rollspeed, message.pitchspeed, message.yawspeed) == pytest.approx(truth.rate_body, abs=FLOAT32)


def test_global_position_is_fresh_even_where_the_local_one_is_slow():
    flight = Flight(yaw=2.5).hover().offboard((3.0, -4.0, -0.5), 2.0)
    flight.ask(SET_INTERVAL, LOCAL_POSITION, -1)
    flight.ask(SET_INTERVAL, GLOBAL_POSITION, 100_000)
    pairs = readings(flight, 0.4, "GLOBAL_POSITION_INT")
    assert len(pairs) == 4
    for message, truth in pairs:
        assert message.lat == pytest.approx(truth.latitude_deg * 1e7, abs=1)
        assert message.lon == pytest.approx(truth.longitude_deg * 1e7, abs=1)
        assert message.alt == pytest.approx(truth.altitude_m * 1e3, abs=2)
        assert message.relative_alt == pytest.approx((truth.altitude_m - PLACE.altitude_m) * 1e3, abs=2)
        assert (message.vx, message.vy, message.vz) == pytest.approx([v * 100 for v in truth.velocity_ned], abs=0.51)
        assert message.hdg == pytest.approx(math.degrees(truth.attitude_rpy[2]) % 360 * 100, abs=0.51)


def test_local_and_global_position_of_one_instant_are_one_measurement():
    flight = climbing(scenario(noise={"position_m": 5.0, "velocity_m_s": 1.0}))
    flight.ask(SET_INTERVAL, GLOBAL_POSITION, 50_000)
    flight.endpoint.begin_mission()
    flight.heard.clear()
    flight.wait(2.0)
    for local, world in zip(flight.all("LOCAL_POSITION_NED"), flight.all("GLOBAL_POSITION_INT"), strict=True):
        assert local.time_boot_ms == world.time_boot_ms
        assert (world.vx, world.vy) == pytest.approx((local.vx * 100, local.vy * 100), abs=0.51)
        north = (world.lat * 1e-7 - PLACE.latitude_deg) * 111_178  # m a degree at this latitude
        assert north == pytest.approx(local.x, abs=0.2)


def test_any_physics_rate_tells_the_same_flight():
    def end(hz):
        flight = Flight(hz=hz).hover(5.0).offboard((2.0, 0.0, 0.0), 3.0)
        return flight.position

    assert end(100) == pytest.approx(end(500), abs=0.15)


# Whatever comes over the wire


@pytest.fixture(scope="module")
def airborne():
    """One flight for all hostile bytes; it must still answer after each."""
    return Flight().hover(50.0).offboard((0.5, 0.0, 0.0), 1.0)


@pytest.fixture(scope="module")
def obedient():
    """Another, for all set-points that there are."""
    return Flight().hover(100.0)


def still_answers(flight):
    flight.heard.clear()
    assert flight.ask(REQUEST, VERSION) == ACCEPTED
    flight.wait(0.02)


@given(st.binary(max_size=600))
def test_random_bytes_do_no_harm(airborne, noise):
    airborne.endpoint.receive(noise)
    still_answers(airborne)


@given(st.lists(st.binary(max_size=80), max_size=4))
def test_genuine_frames_among_garbage_are_heard(airborne, garbage):
    frames = [airborne.pack(command(REQUEST, VERSION)) for _ in range(len(garbage) + 1)]
    datagram = frames[0] + b"".join(noise + frame for noise, frame in zip(garbage, frames[1:], strict=True))
    airborne.listen()
    airborne.heard.clear()
    airborne.endpoint.receive(datagram)
    airborne.listen()
    assert len(airborne.all("COMMAND_ACK")) == len(frames)


genuine = st.sampled_from([command(ARM, 1), command(LAND), setpoint((1, 2, 3)), command(REQUEST, VERSION)])


@given(message=genuine, at=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
def test_a_flipped_bit_is_noticed(airborne, message, at, bit):
    frame = bytearray(airborne.pack(message))
    # Magic and flags decide how a frame is read, and the signature flag whether it is: the rest is under the checksum.
    frame[1 + int(at * (len(frame) - 1))] ^= 1 << bit
    airborne.listen()
    airborne.heard.clear()
    before = airborne.pilot
    airborne.endpoint.receive(bytes(frame))
    airborne.listen()
    assert not airborne.all("COMMAND_ACK")
    assert airborne.pilot == before


@given(message=genuine, keep=st.floats(0, 1, exclude_max=True))
def test_a_truncated_frame_is_dropped_and_spoils_nothing(airborne, message, keep):
    frame = airborne.pack(message)
    before = airborne.pilot
    airborne.endpoint.receive(frame[: int(keep * len(frame))])
    assert airborne.pilot == before
    still_answers(airborne)


any_float = st.floats(width=32)
commands = st.sampled_from([ARM, TAKE_OFF, LAND, MODE, SET_INTERVAL, REQUEST]) | st.integers(0, 65535)
telling = st.sampled_from([0.0, 1.0, 3.0, 4.0, 6.0, 30.0, 32.0, 33.0, 244.0, 245.0, -1.0, 21196.0])


@given(number=commands, params=st.lists(any_float | telling, min_size=7, max_size=7))
def test_any_parameters_of_any_command_are_answered_once(airborne, number, params):
    airborne.listen()
    airborne.heard.clear()
    airborne.ask(number, *params)
    assert len(airborne.all("COMMAND_ACK")) == 1
    airborne.wait(0.1)
    still_answers(airborne)


@given(
    velocity=st.tuples(any_float, any_float, any_float),
    yaw=any_float,
    yaw_rate=any_float,
    mask=st.sampled_from([ALONE, WITH_YAW, WITH_YAW_RATE, FORCED]) | st.integers(0, 0xFFFF),
    frame=st.sampled_from([1, BODY_NED]) | st.integers(0, 255),
)
def test_any_set_point_is_flown_or_refused(obedient, velocity, yaw, yaw_rate, mask, frame):
    flight = obedient
    flight.send(setpoint(velocity, mask=mask, frame=frame, yaw=yaw, yaw_rate=yaw_rate))
    flight.wait(0.1)
    if flight.pilot.mode is not Mode.OFFBOARD:
        flight.stream(0.1, (0.0, 0.0, 0.0))
        flight.ask(MODE, 1, *OFFBOARD)
    assert math.hypot(*flight.velocity) < 25.0
    flight.heard.clear()


def test_frames_of_other_ground_stations_count_as_well():
    """Whom to obey is the link's business: a simulated vehicle obeys every ground station that reaches it."""
    flight = Flight()
    flight.wait(1.2)
    flight.endpoint.receive(Station(system=7, component=1).pack(command(ARM, 1)))
    assert flight.pilot.armed
