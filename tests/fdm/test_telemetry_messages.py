"""Every message of a vehicle, read by pymavlink and held against the truth."""

import itertools
import math
import random
import struct

import numpy as np
import pymap3d
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from fdm.modes import Link, Loss, Mode, Pilot, Setpoint, Severity, Situation
from fdm.personality import PERSONALITIES
from fdm.position_reports import MEASUREMENTS
from fdm.sensors import BLUR_S, Sensors
from fdm.telemetry import Reporter
from fdm.vehicle import Geodetic, Vehicle
from fdm.world import World
from scenarios.models import Noise
from tests.fdm.clients import ACCEPTED, ARM, LAND, MODE, REQUEST, SET_INTERVAL, TAKE_OFF, Station, command, scenario
from wire.parameters import decode

PLACE = Geodetic(47.3977, 8.5456, 488.0)
HZ = 250
HEARTBEAT, SYS_STATUS, SYSTEM_TIME, GPS_RAW, ATTITUDE, QUATERNION = 0, 1, 2, 24, 30, 31
LOCAL, GLOBAL, ORIGIN, HUD, TARGET, VERSION, BATTERY, HOME, EXTENDED = 32, 33, 49, 74, 85, 148, 147, 242, 245
EKF, ESTIMATOR, ACK = 193, 230, 77
ALL = (HEARTBEAT, SYS_STATUS, SYSTEM_TIME, GPS_RAW, ATTITUDE, QUATERNION, LOCAL, GLOBAL, ORIGIN, HUD, TARGET, VERSION)
ALL += (BATTERY, HOME, EXTENDED)
OWN = {"px4": ESTIMATOR, "ardupilot": EKF}
NEEDED = 0x1 | 0x2 | 0x4 | 0x20 | 0x10000000
PREARM, GEOFENCE = 0x10000000, 0x100000

both = pytest.mark.parametrize("name", ["px4", "ardupilot"])


class Rig:
    """A vehicle and what it says, without anybody who flies it."""

    def __init__(self, name="px4", *, height=0.0, yaw=0.0, system=1, **options):
        self.personality = PERSONALITIES[name]
        self.vehicle = Vehicle(home=PLACE, yaw=yaw, physics_hz=HZ, height_m=height)
        self.reporter = Reporter(self.vehicle, system=system, origin=PLACE, personality=self.personality, **options)
        self.pilot = self.personality.machine.boot()

    def fly(self, velocity, seconds):
        """In the air, under way for so long."""
        self.vehicle.arm()
        self.vehicle.set_velocity(velocity, self.vehicle.yaw)
        self.vehicle.step(round(seconds * HZ))
        self.pilot = self.pilot._replace(armed=True)
        return self

    @property
    def now(self):
        *state, yaw = (*self.vehicle.position_velocity(), self.vehicle.yaw)
        time_s = self.vehicle.steps / HZ
        return Situation(time_s, tuple(state[:3]), tuple(state[3:]), yaw, self.vehicle.landed)

    def say(self, message, pilot=None, *, measured=None, now=None):
        """As pymavlink reads it."""
        told = self.reporter.report(
            message, pilot or self.pilot, now or self.now, measured or self.vehicle.position_velocity()
        )
        read = heard(told)
        assert (read.get_srcSystem(), read.get_srcComponent(), read.get_msgId()) == (self.system, 1, message)
        return read

    @property
    def system(self):
        return self.reporter.sender.system


def heard(frame):
    (message,) = dialect.MAVLink(None).parse_buffer(frame)
    return message


@both
@pytest.mark.parametrize("system", [1, 6])
def test_every_message_of_the_table_is_told_from_the_first_step_on_and_in_flight(name, system):
    standing = Rig(name, system=system)
    flying = Rig(name, height=10.0, system=system).fly((2.0, 0.0, 0.0), 1.0)
    for message in (*ALL, OWN[name]):
        for rig in (standing, flying):
            assert rig.reporter.knows(message)
            assert rig.reporter.knows(float(message))
            rig.say(message)


@both
def test_what_only_the_other_autopilot_says_is_not_known(name):
    other = next(message for told, message in OWN.items() if told != name)
    assert not Rig(name).reporter.knows(other)
    assert not Rig(name).reporter.knows(math.nan)


@both
def test_a_heartbeat_is_a_quadrotors_with_the_number_of_its_mode(name):
    rig = Rig(name)
    for mode, number in rig.personality.custom_modes.items():
        for armed in (False, True):
            beat = rig.say(HEARTBEAT, Pilot(armed=armed, mode=mode))
            assert (beat.type, beat.autopilot, beat.mavlink_version) == (2, rig.personality.autopilot, 3)
            assert beat.custom_mode == number
            assert beat.base_mode == 1 | 128 * armed


LOST = Pilot(armed=True, mode=Mode.LAND, loss=Loss(Link.SETPOINTS, 1.0))


@both
@pytest.mark.parametrize(
    ("pilot", "state"),
    [
        (Pilot(mode=Mode.LAND), "STANDBY"),
        (Pilot(armed=True, mode=Mode.LAND), "ACTIVE"),
        (LOST, "CRITICAL"),
        (Pilot(armed=True, mode=Mode.LAND, station_lost=True), "CRITICAL"),
        (LOST._replace(armed=False), "STANDBY"),
    ],
)
def test_a_heartbeat_says_standby_active_or_critical(name, pilot, state):
    assert Rig(name).say(HEARTBEAT, pilot).system_status == getattr(dialect, f"MAV_STATE_{state}")


@both
def test_sensors_are_there_at_once_and_healthy_to_arm_when_they_have_settled(name):
    rig = Rig(name)
    ready_s = rig.personality.machine.READY_AFTER
    for time_s, settled in [(0.0, False), (ready_s - 0.01, False), (ready_s, True), (1e4, True)]:
        status = rig.say(SYS_STATUS, now=rig.now._replace(time_s=time_s))
        assert status.onboard_control_sensors_present & NEEDED == NEEDED
        assert status.onboard_control_sensors_enabled & NEEDED == NEEDED
        healthy = status.onboard_control_sensors_health & NEEDED
        assert healthy == (NEEDED if settled else NEEDED & ~PREARM)
        assert status.onboard_control_sensors_health & ~status.onboard_control_sensors_present == 0
        fence = [getattr(status, f"onboard_control_sensors_{word}") & GEOFENCE for word in ("enabled", "health")]
        assert fence == [0, GEOFENCE if name == "ardupilot" else 0], "not in use, and not breached"


@pytest.mark.parametrize(("time_s", "flags"), [(0.0, 0xA5), (3600.0, 0x33F)])
def test_each_estimator_says_when_it_knows_its_position(time_s, flags):
    for name, message in OWN.items():
        rig = Rig(name)
        assert rig.say(message, now=rig.now._replace(time_s=time_s)).flags == flags


@both
def test_the_battery_is_told_in_millivolts_centiamperes_and_percent(name):
    rig = Rig(name, height=10.0).fly((0.0, 0.0, 0.0), 60.0)
    battery = rig.vehicle.battery
    status, detail = rig.say(SYS_STATUS), rig.say(BATTERY)
    assert status.voltage_battery == detail.voltages[0] == round(battery.volts * 1000)
    assert 12_000 < status.voltage_battery < 16_800
    assert status.current_battery == detail.current_battery == round(battery.amps * 100)
    assert status.battery_remaining == detail.battery_remaining == round(battery.remaining * 100) < 100
    assert detail.current_consumed == pytest.approx(battery.amps * 1000 / 60, rel=0.05), "mAh in a minute of hover"


@both
def test_standing_at_home_it_is_at_home(name):
    rig = Rig(name, yaw=math.radians(30))
    rig.vehicle.step(HZ)
    lat, lon, alt = round(PLACE.latitude_deg * 1e7), round(PLACE.longitude_deg * 1e7), 488_000
    local, place = rig.say(LOCAL), rig.say(GLOBAL)
    assert (local.x, local.y, local.z, local.vx, local.vy, local.vz) == pytest.approx((0,) * 6, abs=1e-3)
    assert (place.lat, place.lon) == pytest.approx((lat, lon), abs=1)
    assert (place.alt, place.relative_alt) == pytest.approx((alt, 0), abs=2)
    assert (place.vx, place.vy, place.vz, place.hdg) == (0, 0, 0, 3000)
    assert local.time_boot_ms == place.time_boot_ms == 1000
    origin, home = rig.say(ORIGIN), rig.say(HOME)
    assert (origin.latitude, origin.longitude, origin.altitude) == (lat, lon, alt)
    assert (home.latitude, home.longitude, home.altitude, home.x, home.y, home.z) == (lat, lon, alt, 0, 0, 0)
    gps = rig.say(GPS_RAW)
    assert (gps.lat, gps.lon, gps.alt, gps.vel) == (place.lat, place.lon, place.alt, 0)
    assert gps.cog == 0xFFFF, "nobody knows the course of what stands"
    assert gps.fix_type >= 3
    assert gps.satellites_visible >= 6
    hud = rig.say(HUD)
    assert (hud.airspeed, hud.groundspeed, hud.heading, hud.throttle) == pytest.approx((0, 0, 30, 0), abs=1e-6)
    assert hud.alt == pytest.approx(488.0, abs=0.01)
    attitude = rig.say(ATTITUDE)
    assert (attitude.roll, attitude.pitch, attitude.yaw) == pytest.approx((0, 0, math.radians(30)), abs=1e-3)


@both
def test_flying_north_at_two_metres_a_second_every_message_says_so(name):
    rig = Rig(name, height=10.0).fly((2.0, 0.0, 0.0), 10.0)
    truth = rig.vehicle.state()
    local, place, gps, hud = map(rig.say, (LOCAL, GLOBAL, GPS_RAW, HUD))
    assert (local.vx, local.vy, local.vz) == pytest.approx((2.0, 0.0, 0.0), abs=0.05)
    assert (local.x, local.y, local.z) == pytest.approx(truth.position_ned, abs=1e-5)
    assert 15.0 < local.x < 20.0
    assert (place.vx, place.vy, place.vz) == pytest.approx((200, 0, 0), abs=5)
    assert (place.lat, place.lon) == (round(truth.latitude_deg * 1e7), round(truth.longitude_deg * 1e7))
    assert place.relative_alt == pytest.approx(-1000 * local.z, abs=1)
    assert place.alt - place.relative_alt == 488_000
    assert gps.vel == pytest.approx(200, abs=5)
    assert math.remainder(gps.cog / 100, 360) == pytest.approx(0, abs=1)
    assert (gps.lat, gps.lon, gps.alt) == (place.lat, place.lon, place.alt)
    assert hud.groundspeed == pytest.approx(2.0, abs=0.05)
    assert hud.climb == pytest.approx(0.0, abs=0.05)
    assert hud.airspeed == (hud.groundspeed if name == "ardupilot" else 0.0)
    assert 20 < hud.throttle < 80


@both
def test_climbing_at_one_metre_a_second_is_up_in_one_and_down_in_the_others(name):
    rig = Rig(name, height=10.0).fly((0.0, 0.0, -1.0), 5.0)
    assert rig.say(HUD).climb == pytest.approx(1.0, abs=0.05)
    assert rig.say(LOCAL).vz == pytest.approx(-1.0, abs=0.05)
    assert rig.say(GLOBAL).vz == pytest.approx(-100, abs=5)
    assert rig.say(GLOBAL).relative_alt == pytest.approx(14_500, abs=700)


@both
def test_angles_and_quaternion_are_one_attitude(name):
    rig = Rig(name, height=10.0, yaw=2.0).fly((4.0, -3.0, 0.0), 0.7)
    angles, quaternion = rig.say(ATTITUDE), rig.say(QUATERNION)
    assert abs(angles.pitch) + abs(angles.roll) > 0.1, "it leans into its acceleration"
    r, p, y = angles.roll / 2, angles.pitch / 2, angles.yaw / 2
    expected = (
        math.cos(r) * math.cos(p) * math.cos(y) + math.sin(r) * math.sin(p) * math.sin(y),
        math.sin(r) * math.cos(p) * math.cos(y) - math.cos(r) * math.sin(p) * math.sin(y),
        math.cos(r) * math.sin(p) * math.cos(y) + math.sin(r) * math.cos(p) * math.sin(y),
        math.cos(r) * math.cos(p) * math.sin(y) - math.sin(r) * math.sin(p) * math.cos(y),
    )
    told = (quaternion.q1, quaternion.q2, quaternion.q3, quaternion.q4)
    assert abs(np.dot(told, expected)) == pytest.approx(1.0, abs=1e-6)
    for field in ("time_boot_ms", "rollspeed", "pitchspeed", "yawspeed"):
        assert getattr(angles, field) == getattr(quaternion, field)


@both
@given(north=st.floats(-500, 500), east=st.floats(-500, 500))
def test_positions_count_from_the_estimators_own_origin_and_places_do_not_care(name, north, east):
    rig = Rig(name, origin_ne=(north, east))
    local, origin, home, place = map(rig.say, (LOCAL, ORIGIN, HOME, GLOBAL))
    assert (local.x, local.y) == pytest.approx((-north, -east), abs=1e-3)
    assert (home.x, home.y, home.z) == pytest.approx((-north, -east, 0.0), abs=1e-3)
    assert home.latitude == round(PLACE.latitude_deg * 1e7)
    assert place.lat == pytest.approx(home.latitude, abs=1)
    told = (origin.latitude / 1e7, origin.longitude / 1e7)
    there = pymap3d.geodetic2ned(*told, PLACE.altitude_m, PLACE.latitude_deg, PLACE.longitude_deg, PLACE.altitude_m)
    assert there[:2] == pytest.approx((north, east), abs=0.05)


@both
def test_home_is_where_it_was_armed(name):
    rig = Rig(name)
    home = rig.say(HOME, rig.pilot._replace(home_ned=(30.0, -40.0, 0.0)))
    assert (home.x, home.y, home.z) == (30.0, -40.0, 0.0)
    told = (home.latitude / 1e7, home.longitude / 1e7, home.altitude / 1e3)
    there = pymap3d.geodetic2ned(*told, PLACE.latitude_deg, PLACE.longitude_deg, PLACE.altitude_m)
    assert there == pytest.approx((30.0, -40.0, 0.0), abs=0.02)


@both
def test_every_position_is_the_measured_one(name):
    rig = Rig(name)
    measured = (3.0, 4.0, -5.0, 0.6, 0.8, -0.5)
    local, place, gps, hud = (rig.say(message, measured=measured) for message in (LOCAL, GLOBAL, GPS_RAW, HUD))
    assert {LOCAL, GLOBAL, GPS_RAW, HUD} == MEASUREMENTS
    assert (local.x, local.y, local.z) == (3.0, 4.0, -5.0)
    for told in (place, gps):
        there = pymap3d.geodetic2ned(
            told.lat / 1e7, told.lon / 1e7, 488.0, PLACE.latitude_deg, PLACE.longitude_deg, PLACE.altitude_m
        )
        assert there[:2] == pytest.approx((3.0, 4.0), abs=0.02)
        assert told.alt == 493_000
    assert (place.vx, place.vy, place.vz) == (60, 80, -50)
    assert gps.vel == 100
    assert gps.cog / 100 == pytest.approx(math.degrees(math.atan2(0.8, 0.6)), abs=0.01)
    assert (hud.alt, hud.climb) == (493.0, 0.5)
    assert hud.groundspeed == pytest.approx(1.0)


@both
def test_a_speed_beyond_the_field_is_told_as_the_greatest(name):
    rig = Rig(name)
    wild = (1e5, -1e5, -1e5, 1e6, -1e6, 1e6)
    place, gps = rig.say(GLOBAL, measured=wild), rig.say(GPS_RAW, measured=wild)
    assert (place.vx, place.vy, place.vz) == (32767, -32767, 32767)
    assert gps.vel == 65534, "65535 would be unknown"


def noisy(position_m, velocity_m_s=0.0):
    return Noise(position_m=position_m, velocity_m_s=velocity_m_s)


@both
@pytest.mark.parametrize(("sigma", "mm", "fix"), [(0.0, 10, 6), (0.1, 141, 5), (1.0, 1414, 3), (5.0, 7071, 3)])
def test_the_accuracy_it_claims_follows_the_noise(name, sigma, mm, fix):
    gps = Rig(name, noise=noisy(sigma, sigma)).say(GPS_RAW)
    assert (gps.h_acc, gps.vel_acc, gps.fix_type) == (mm, mm, fix)
    assert gps.v_acc == 10, "heights are not blurred"


def test_px4_says_its_accuracy_in_metres_too():
    status = Rig("px4", noise=noisy(1.0)).say(ESTIMATOR)
    assert (status.pos_horiz_accuracy, status.pos_vert_accuracy) == pytest.approx((math.sqrt(2.0), 0.01))


def test_the_accuracy_it_claims_is_the_root_mean_square_of_its_errors():
    told = scenario(noise={"position_m": 0.7})
    sensors = Sensors(told, vehicle=1, seed=1)
    sensors.begin(0.0)
    still = (0.0,) * 6
    errors = np.array([sensors.measured(still, (n + 0.5) * BLUR_S)[:2] for n in range(5000)])
    rms = math.sqrt((errors**2).sum(axis=1).mean())
    assert Rig(noise=told.noise).say(GPS_RAW).h_acc / 1000 == pytest.approx(rms, rel=0.04)


STEERED = {"px4": Mode.OFFBOARD, "ardupilot": Mode.GUIDED}


@both
@pytest.mark.parametrize(
    ("yaw", "rate", "mask"), [(None, 0.0, 0xDC7), (0.5, 0.0, 0x9C7), (None, 0.25, 0x5C7), (0.5, 0.25, 0x1C7)]
)
def test_the_accepted_set_point_is_told_back_with_the_mask_that_fits(name, yaw, rate, mask):
    setpoint = Setpoint(1.0, (1.0, -2.0, 0.5), yaw, rate)
    target = Rig(name).say(TARGET, Pilot(armed=True, mode=STEERED[name], setpoint=setpoint))
    assert (target.coordinate_frame, target.type_mask) == (dialect.MAV_FRAME_LOCAL_NED, mask)
    assert (target.vx, target.vy, target.vz) == (1.0, -2.0, 0.5)
    assert (target.yaw, target.yaw_rate) == (yaw or 0.0, rate)


@both
def test_without_a_set_point_the_place_it_stays_at_is_its_target(name):
    rig = Rig(name, origin_ne=(10.0, 20.0))
    target = rig.say(TARGET, Pilot(armed=True, mode=Mode.LAND, anchor_ned=(1.0, 2.0, -3.0), yaw=0.5))
    assert (target.x, target.y, target.z, target.yaw, target.type_mask) == (-9.0, -18.0, -3.0, 0.5, 0x9F8)


@both
def test_a_vehicle_that_only_stops_has_no_velocity_for_a_target(name):
    target = Rig(name).say(TARGET, Pilot(armed=True, mode=Mode.LAND, yaw=0.5))
    assert (target.vx, target.vy, target.vz, target.yaw, target.type_mask) == (0.0, 0.0, 0.0, 0.5, 0x9C7)


@both
def test_the_landed_state_goes_from_the_ground_through_take_off_and_air_to_landing(name):
    rig = Rig(name)
    mode = {"px4": Mode.TAKEOFF, "ardupilot": Mode.GUIDED}[name]
    climbing = Pilot(armed=True, mode=mode, climbing=True)
    ground, air = rig.now._replace(on_ground=True), rig.now._replace(on_ground=False)
    flying = Pilot(armed=True, mode=STEERED[name])
    seen = [(climbing, ground), (climbing, air), (flying, air), (Pilot(armed=True, mode=Mode.LAND), air)]
    assert [rig.say(EXTENDED, pilot, now=now).landed_state for pilot, now in seen] == [1, 3, 2, 4]


@both
def test_a_version_says_what_it_can_who_it_is_and_how_parameters_are_encoded(name):
    version = Rig(name, system=6).say(VERSION)
    can = version.capabilities
    for word in ("MAVLINK2", "COMMAND_INT", "SET_POSITION_TARGET_LOCAL_NED", "PARAM_FLOAT"):
        assert can & getattr(dialect, f"MAV_PROTOCOL_CAPABILITY_{word}")
    bytewise = bool(can & dialect.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE)
    cast = bool(can & dialect.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST)
    assert (bytewise, cast) == (name == "px4", name == "ardupilot")
    assert (version.uid, int.from_bytes(version.uid2, "little")) == (6, 6)
    major, minor, _patch, kind = version.flight_sw_version.to_bytes(4, "big")
    assert (major, minor) == {"px4": (1, 16), "ardupilot": (4, 6)}[name]
    assert kind == 255


@both
def test_its_clock_began_with_the_year_2020(name):
    rig = Rig(name)
    rig.vehicle.step(HZ // 2)
    clock = rig.say(SYSTEM_TIME)
    assert (clock.time_unix_usec, clock.time_boot_ms) == (1_577_836_800_500_000, 500)
    assert rig.say(GPS_RAW).time_usec == clock.time_unix_usec


def told_words(reporter, text):
    return [heard(frame) for frame in reporter.words(Severity.WARNING, text)]


@pytest.mark.parametrize("length", [0, 1, 50])
def test_a_short_text_is_one_message_without_a_number(length):
    (told,) = told_words(Rig().reporter, "x" * length)
    assert (told.text, told.severity, told.id, told.chunk_seq) == ("x" * length, 4, 0, 0)


@given(text=st.text(st.characters(min_codepoint=32, max_codepoint=126), min_size=51, max_size=400))
def test_a_long_text_comes_in_numbered_pieces_of_which_the_last_is_not_full(text):
    told = told_words(Rig().reporter, text)
    assert "".join(piece.text for piece in told) == text
    assert [piece.chunk_seq for piece in told] == list(range(len(told)))
    assert {piece.id for piece in told} == {1}
    assert [len(piece.text) == 50 for piece in told] == [True] * (len(told) - 1) + [False]


def test_two_long_texts_have_different_numbers():
    reporter = Rig().reporter
    assert [told_words(reporter, "y" * 60)[0].id for _ in range(3)] == [1, 2, 3]


def test_an_acknowledgement_goes_to_who_asked():
    told = heard(Rig().reporter.acknowledge(400, 4, to_system=254, to_component=191))
    assert (told.command, told.result, told.target_system, told.target_component) == (400, 4, 254, 191)


class Wired(Station):
    """A ground station beside one vehicle of a world."""

    def __init__(self, name):
        super().__init__()
        self.world = World(scenario(), autopilot=name)

    def send(self, *messages):
        self.world.deliver(1, b"".join(map(self.pack, messages)))
        return self.wait(0.0)

    def wait(self, seconds):
        """What was heard of the autopilot meanwhile."""
        before = len(self.heard)
        self.world.step(round(seconds * self.world.physics_hz))
        for step, _, frame in self.world.collect():
            self.read(frame, step)
        return [message for _, message in self.heard[before:] if message.get_srcComponent() == 1]


@both
def test_every_message_comes_as_often_as_asked_and_once_on_request(name):
    station = Wired(name)
    wanted = (*ALL, OWN[name])
    for message in wanted:
        (ack,) = station.send(command(SET_INTERVAL, message, 100_000))
        assert ack.result == ACCEPTED
    station.wait(0.2)
    kinds = [message.get_msgId() for message in station.wait(2.0)]
    assert {kind: kinds.count(kind) for kind in wanted} == dict.fromkeys(wanted, 20)
    for message in wanted:
        assert [told.get_msgId() for told in station.send(command(REQUEST, message))] == [message, ACK]
        station.send(command(SET_INTERVAL, message, -1))
    assert station.wait(3.0) == []


def test_unasked_arducopter_only_beats_and_px4_tells_slowly_what_a_person_needs():
    beats = [message.get_type() for message in Wired("ardupilot").wait(4.0)]
    assert beats == ["HEARTBEAT"] * 4
    told = [message.get_msgId() for message in Wired("px4").wait(4.0)]
    each_second = {HEARTBEAT, SYS_STATUS, EXTENDED, ATTITUDE, LOCAL, GLOBAL, GPS_RAW}
    every_other = {BATTERY, HOME, ORIGIN}
    assert {kind: told.count(kind) for kind in set(told)} == dict.fromkeys(each_second, 4) | dict.fromkeys(
        every_other, 2
    )


@both
def test_a_client_on_a_lossy_link_gets_all_parameters_by_list_and_by_index(name):
    station, lost = Wired(name), random.Random(1)
    station.send(dialect.MAVLink_param_request_list_message(1, 1))
    values = [m for m in station.wait(2.0) if m.get_type() == "PARAM_VALUE"]
    got = {m.param_index: m for m in values if lost.random() > 0.2}
    assert len(got) < values[0].param_count == len(values)
    while missing := set(range(values[0].param_count)) - set(got):
        for index in missing:
            (value,) = station.send(dialect.MAVLink_param_request_read_message(1, 1, b"", index))
            if lost.random() > 0.2:
                got[value.param_index] = value
    table = station.world.endpoints[0].parameters
    autopilot = PERSONALITIES[name].autopilot
    read = {m.param_id: decode(struct.pack("<f", m.param_value), m.param_type, autopilot) for m in got.values()}
    assert read == {parameter.name: parameter.value for parameter in table}


@both
def test_a_flight_is_seen_on_the_ground_taking_off_in_the_air_landing_and_on_the_ground(name):
    station = Wired(name)
    station.send(command(SET_INTERVAL, EXTENDED, 100_000))
    station.wait(3.5)
    height = 3.0 if name == "ardupilot" else 3.0 + station.world.endpoints[0].vehicle.state().altitude_m
    if name == "ardupilot":
        station.send(command(MODE, 1, 4))
    station.send(command(ARM, 1), command(TAKE_OFF, 0, 0, 0, 0, 0, 0, height))
    station.wait(6.0)
    station.send(command(LAND))
    station.wait(12.0)
    states = [message.landed_state for message in station.all("EXTENDED_SYS_STATE")]
    assert [state for state, _ in itertools.groupby(states)] == [1, 3, 2, 4, 1]
    assert not station.last("HEARTBEAT").base_mode & 128
