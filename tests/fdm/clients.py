"""Ground stations for tests: pymavlink packs and reads, so that nothing of ours checks itself."""

import math

from pymavlink.dialects.v20 import ardupilotmega as dialect

from fdm.endpoint import Endpoint
from fdm.parameters import table
from fdm.personality import PERSONALITIES
from fdm.shaping import shape_of
from fdm.surroundings import Surroundings
from fdm.vehicle import Geodetic, Vehicle
from fdm.world import World
from scenarios import Scenario

PLACE = Geodetic(47.3977, 8.5456, 488.0)
HZ = 250

LOCAL_NED, BODY_NED = dialect.MAV_FRAME_LOCAL_NED, dialect.MAV_FRAME_BODY_NED
ALONE, WITH_YAW, WITH_YAW_RATE, FORCED = 0x0DC7, 0x09C7, 0x05C7, 0x0FC7
"""The type masks of a velocity set-point."""

ACCEPTED, REJECTED, DENIED, UNSUPPORTED, FAILED = 0, 1, 2, 3, 4
ARM, TAKE_OFF, LAND, RETURN, MODE = 400, 22, 21, 20, 176
SET_INTERVAL, REQUEST = 511, 512
HOLD, OFFBOARD = (4, 3), (6, 0)
"""PX4's modes: main, sub."""
STABILIZE, ALTITUDE_HOLD, GUIDED, LOITER, RTL, LANDING, BRAKE = 0, 2, 4, 5, 6, 9, 17
"""ArduCopter's."""
HEARTBEAT, ATTITUDE, LOCAL_POSITION, GLOBAL_POSITION, INTERVAL = 0, 30, 32, 33, 244
GPS_ORIGIN, VFR_HUD, VERSION = 49, 74, 148


def scenario(**sections):
    """One vehicle that flies north, unless told otherwise."""
    tables = {
        "title": "test",
        "swarm": {"rows": 1, "columns": 1, "leaders": [1]},
        "mission": {"cruise_m_s": 1.5, "leg": [{"task": "north", "heading_deg": 0, "length_m": 30}]},
    }
    return Scenario.model_validate(tables | sections)


class Station:
    """Packs frames as one ground station, and keeps all it hears as (step, message), in order."""

    def __init__(self, system=255, component=190):
        self.mav = dialect.MAVLink(None, srcSystem=system, srcComponent=component)
        self.heard = []

    def pack(self, message):
        return bytes(message.pack(self.mav))

    def read(self, datagram, step=None):
        """A parser a datagram; every byte must belong to a frame that pymavlink likes."""
        messages = dialect.MAVLink(None).parse_buffer(datagram)
        assert messages, f"no frame in {datagram!r}"
        self.heard += [(step, message) for message in messages]

    def all(self, kind, *, component=1, system=1):
        """Messages of a kind that one component sent."""
        wanted = (kind, system, component)
        return [m for _, m in self.heard if (m.get_type(), m.get_srcSystem(), m.get_srcComponent()) == wanted]

    def last(self, kind, **sender):
        return self.all(kind, **sender)[-1]

    def words(self):
        return [message.text for message in self.all("STATUSTEXT")]


def command(number, *params, system=1, component=1):
    """COMMAND_LONG; parameters that are not given are 0."""
    padded = (*params, *(0.0,) * (7 - len(params)))
    return dialect.MAVLink_command_long_message(system, component, number, 0, *padded)


def command_int(number, *params, frame=0, z=0.0):
    """COMMAND_INT; params: 1 to 4."""
    padded = (*params, *(0.0,) * (4 - len(params)))
    return dialect.MAVLink_command_int_message(1, 1, frame, number, 0, 0, *padded, 0, 0, z)


def parameter(name, value):
    """PARAM_SET of a real number."""
    return dialect.MAVLink_param_set_message(1, 1, name.encode(), value, dialect.MAV_PARAM_TYPE_REAL32)


def setpoint(velocity, *, mask=ALONE, frame=LOCAL_NED, yaw=0.0, yaw_rate=0.0, system=1, component=1, time_ms=0):
    """SET_POSITION_TARGET_LOCAL_NED with a velocity [m/s]."""
    return dialect.MAVLink_set_position_target_local_ned_message(
        time_ms, system, component, frame, mask, 0, 0, 0, *velocity, 0, 0, 0, yaw, yaw_rate
    )


class Flight(Station):
    """A ground station beside one endpoint, without a socket."""

    def __init__(self, told=None, *, yaw=0.0, hz=HZ, seed=1, autopilot="px4", stock=False):
        super().__init__()
        self.hz = hz
        vehicle = Vehicle(home=PLACE, yaw=yaw, physics_hz=hz)
        told = told or scenario()
        surroundings = Surroundings(told, vehicle=1, seed=seed)
        self.endpoint = Endpoint(
            vehicle,
            surroundings,
            system=1,
            home=PLACE,
            physics_hz=hz,
            personality=PERSONALITIES[autopilot],
            parameters=table(autopilot, stock),
            noise=told.noise,
            shape=shape_of(told),
        )
        self.vehicle = vehicle

    @property
    def pilot(self):
        return self.endpoint.pilot

    @property
    def velocity(self):
        return self.vehicle.position_velocity()[3:]

    @property
    def position(self):
        return self.vehicle.position_velocity()[:3]

    @property
    def speed(self):
        return math.hypot(*self.velocity)

    def beat(self):
        """A heartbeat of a ground station."""
        self.send(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3))

    def send(self, *messages):
        """In one datagram; what is answered at once is heard at once."""
        self.endpoint.receive(b"".join(map(self.pack, messages)))
        self.listen()

    def listen(self):
        for step, frame in self.endpoint.data_to_send():
            self.read(frame, step)

    def wait(self, seconds):
        self.endpoint.step(round(seconds * self.hz))
        self.listen()

    def ask(self, number, *params):
        """Result of a command."""
        self.send(command(number, *params))
        answer = self.last("COMMAND_ACK")
        assert answer.command == number
        return answer.result

    def stream(self, seconds, velocity, *, rate_hz=20, **options):
        """Send a set-point at this rate while time passes."""
        steps = 0
        for n in range(1, round(seconds * rate_hz) + 1):
            self.send(setpoint(velocity, **options))
            self.endpoint.step(round(n * self.hz / rate_hz) - steps)
            steps = round(n * self.hz / rate_hz)
        self.listen()

    def hover(self, height=10.0):
        """On the ground and disarmed before; in HOLD at this height after."""
        self.wait(max(0.0, 1.2 - self.endpoint.time_s))
        assert self.ask(ARM, 1) == ACCEPTED
        assert self.ask(TAKE_OFF, 0, 0, 0, 0, 0, 0, PLACE.altitude_m + height) == ACCEPTED
        self.wait(height / 1.5 + 4.0)
        return self

    def guided(self, height=10.0):
        """ArduCopter, on the ground and disarmed before; in GUIDED at this height after."""
        self.wait(max(0.0, 3.2 - self.endpoint.time_s))
        assert self.ask(MODE, 1, GUIDED) == ACCEPTED
        assert self.ask(ARM, 1) == ACCEPTED
        assert self.ask(TAKE_OFF, 0, 0, 0, 0, 0, 0, height) == ACCEPTED
        self.wait(height / 2.5 + 6.0)
        return self

    def offboard(self, velocity=(0.0, 0.0, 0.0), seconds=0.2, **options):
        """Flying set-points."""
        self.stream(0.2, velocity, **options)
        assert self.ask(MODE, 1, *OFFBOARD) == ACCEPTED
        self.stream(seconds, velocity, **options)
        return self


class Fleet(Station):
    """A ground station beside a world, without a socket."""

    def __init__(self, told, *, seed=1):
        super().__init__()
        self.world = World(told, seed=seed)
        self.systems = range(1, len(self.world.endpoints) + 1)
        self.hz = self.world.physics_hz
        self.sent = []
        """(step, system, frame), as the world gave them."""

    def send(self, system, *messages):
        self.world.deliver(system, b"".join(map(self.pack, messages)))

    def send_all(self, build):
        """build(system) gives the message for each vehicle."""
        for system in self.systems:
            self.send(system, build(system))

    def step(self, steps, *, at_once=None):
        """Let steps pass, `at_once` at a time."""
        while steps > 0:
            now = min(steps, at_once or steps)
            self.world.step(now)
            self.sent += self.world.collect()
            steps -= now

    def stream(self, seconds, velocity, *, at_once=None):
        """Set-points at 10 Hz for all."""
        for _ in range(round(seconds * 10)):
            self.send_all(lambda system: setpoint(velocity, system=system))
            self.step(self.hz // 10, at_once=at_once)

    def take_off(self, height=5.0, *, at_once=None):
        """All hover at this height, in HOLD."""
        self.step(round(1.2 * self.hz), at_once=at_once)
        altitude = self.world.endpoints[0].vehicle.state().altitude_m + height
        self.send_all(lambda system: command(ARM, 1, system=system))
        self.send_all(lambda system: command(TAKE_OFF, 0, 0, 0, 0, 0, 0, altitude, system=system))
        self.step(round((height / 1.5 + 4.0) * self.hz), at_once=at_once)

    def offboard(self, velocity, *, at_once=None):
        self.stream(0.2, velocity, at_once=at_once)
        self.send_all(lambda system: command(MODE, 1, *OFFBOARD, system=system))

    def messages(self, kind, *, system=1, component=1):
        """(step, message) of one sender so far."""
        heard = Station()
        for step, sender, frame in self.sent:
            if sender == system:
                heard.read(frame, step)
        return [(s, m) for s, m in heard.heard if m.get_type() == kind and m.get_srcComponent() == component]
