"""A simulated vehicle as the wire sees it: bytes in, bytes out, physics between. No socket, no clock."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

from pymavlink.dialects.v20 import ardupilotmega as dialect

from fdm import modes
from fdm.modes import Failsafe, Mode, Outcome, Pilot, Setpoint, Situation
from fdm.personality import PX4, Personality
from fdm.sensors import SAMPLE_S
from fdm.shaping import SHAPING_S, Level, Motion
from fdm.streams import NEVER, Schedule
from fdm.surroundings import PERIOD_S, Surroundings
from fdm.telemetry import MEASUREMENTS, Reporter
from fdm.vehicle import FlightModelDiverged, Geodetic, Vector, Vehicle
from wire.frames import Frame, Framer, decode
from wire.ids import AUTOPILOT
from wire.payloads import SET_POSITION_TARGET_LOCAL_NED, PositionTarget, unpack_position_target

SAMPLING, SHAPING, GUIDANCE, WATCHDOG, TRUTH = -5, -4, -3, -2, -1
"""Keys of the schedule that are no message ids, in the order in which they are served: noting what stale telemetry
will tell, taking up a velocity slowly, flying, the end of patience with silent set-points, the truth."""
TRUTH_PERIOD_S = 0.1

VELOCITY_MASKS = frozenset({0x0DC7, 0x09C7, 0x05C7, 0x0FC7})
"""type_mask of a velocity set-point: alone, with yaw, with yaw rate, alone as MAVProxy writes it (force bit)."""
IGNORE_YAW, IGNORE_YAW_RATE = 0x0400, 0x0800
LOCAL_NED, BODY_NED = dialect.MAV_FRAME_LOCAL_NED, dialect.MAV_FRAME_BODY_NED

FORCE_DISARM = 21196
"""param2 of MAV_CMD_COMPONENT_ARM_DISARM that disarms in the air."""
SKIPS = 0.05
"""m above the ground, where legs that bounce or scrape count as standing: contacts come and go at low step rates."""
STANDS_STILL = 1e-9
"""m/s: a horizontal set-point above it asks the vehicle to move."""

ACCEPTED: Final[int] = dialect.MAV_RESULT_ACCEPTED
REJECTED: Final[int] = dialect.MAV_RESULT_TEMPORARILY_REJECTED
DENIED: Final[int] = dialect.MAV_RESULT_DENIED
UNSUPPORTED: Final[int] = dialect.MAV_RESULT_UNSUPPORTED


class Endpoint:
    """One vehicle behind MAVLink."""

    def __init__(
        self,
        vehicle: Vehicle,
        surroundings: Surroundings,
        *,
        system: int,
        origin: Geodetic,
        physics_hz: int,
        personality: Personality = PX4,
        failsafe: Failsafe = Failsafe(),  # noqa: B008 - frozen
        shape: Callable[[Motion, Level], Motion] | None = None,
    ) -> None:
        self.vehicle = vehicle
        self.system = system
        self.framer = Framer()
        self.refused_setpoints = 0
        """Set-points that named a frame or a mask we do not fly, or a number that is none."""
        self.lost = False
        """The flight model diverged: from now on the vehicle is silent, and the others fly on."""
        self.first_motion_step: int | None = None
        """Step at which the vehicle was first asked to move sideways from outside."""
        self._surroundings = surroundings
        self._personality = personality
        self._failsafe = failsafe
        self._shape = shape
        self._motion: Motion | None = None
        """What is asked of the flight controller, where set-points are shaped and flown."""
        self._wanted_ned = (0.0, 0.0, 0.0)
        self._hz = physics_hz
        self._reporter = Reporter(vehicle, system=system, origin=origin, personality=personality)
        self._outbox: list[tuple[int, bytes]] = []
        self._schedule = Schedule(physics_hz)
        self._schedule.set_interval(GUIDANCE, PERIOD_S, step=0)
        self._schedule.set_interval(TRUTH, TRUTH_PERIOD_S, step=0)
        if surroundings.sensors.go_stale:
            self._schedule.set_interval(SAMPLING, SAMPLE_S, step=0)
        if shape is not None:
            self._schedule.set_interval(SHAPING, SHAPING_S, step=0)
        for message, rate_hz in personality.streams_hz.items():
            self._schedule.set_interval(message, 1.0 / rate_hz, step=0)
        self._pilot = Pilot()
        self._known, self._known_step = self._look(), 0
        self._measured: tuple[float, ...] = vehicle.position_velocity()
        self._measured_step = 0
        self._commands: dict[int, Callable[[Any], int]] = {
            dialect.MAV_CMD_COMPONENT_ARM_DISARM: self._arm_disarm,
            dialect.MAV_CMD_NAV_TAKEOFF: self._take_off,
            dialect.MAV_CMD_NAV_LAND: lambda _: self._change_mode(Mode.LAND),
            dialect.MAV_CMD_DO_SET_MODE: self._do_set_mode,
            dialect.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_message_interval,
            dialect.MAV_CMD_REQUEST_MESSAGE: self._request_message,
        }
        self._origin = origin
        surroundings.settle(vehicle)

    @property
    def pilot(self) -> Pilot:
        """State of the mode machine."""
        return self._pilot

    @property
    def time_s(self) -> float:
        """Seconds since boot."""
        return self.vehicle.steps / self._hz

    def begin_mission(self) -> None:
        """Time 0 of the scenario is now: faults, noise, gusts and turbulence count from here."""
        self._surroundings.begin(self.vehicle, self.time_s)

    def end_mission(self) -> None:
        """The flight is over: the next movement from outside begins another."""
        self.first_motion_step = None
        self._surroundings.end(self.vehicle)

    @property
    def next_event_step(self) -> int:
        """The next step at which there is something to do or to send."""
        return NEVER if self.lost else self._schedule.next_step

    def receive(self, datagram: bytes) -> None:
        """Take in what came over the link, now."""
        if self.lost:
            return
        for frame in self.framer.frames(0, datagram):
            if frame.message == SET_POSITION_TARGET_LOCAL_NED:
                self._position_target(unpack_position_target(frame.payload))
            elif frame.message == dialect.MAVLINK_MSG_ID_COMMAND_LONG:
                self._command(frame)

    def step(self, steps: int) -> None:
        """Fly this many physics steps, in bursts from one thing that is due to the next."""
        vehicle, schedule = self.vehicle, self._schedule
        target = vehicle.steps + steps
        while vehicle.steps < target and not self.lost:
            try:
                vehicle.step(min(target, schedule.next_step) - vehicle.steps)
            except FlightModelDiverged:
                self.lost, self._pilot = True, Pilot()
                return
            if vehicle.steps >= schedule.next_step:
                self._serve(schedule.take_due(vehicle.steps))

    def data_to_send(self) -> list[tuple[int, bytes]]:
        """Frames since the last call, each with the physics step at which it was sent."""
        frames, self._outbox = self._outbox, []
        return frames

    def _send(self, frame: bytes) -> None:
        self._outbox.append((self.vehicle.steps, frame))

    def _situation(self) -> Situation:
        """Where the vehicle is now; a set-point that comes at a step just served finds it known."""
        if self._known_step != self.vehicle.steps:
            self._known, self._known_step = self._look(), self.vehicle.steps
        return self._known

    def _look(self) -> Situation:
        n, e, d, vn, ve, vd = self.vehicle.position_velocity()
        on_ground = self.vehicle.landed or d > -SKIPS
        return Situation(self.time_s, (n, e, d), (vn, ve, vd), self.vehicle.yaw, on_ground)

    def _serve(self, due: list[int]) -> None:
        now = self._situation()
        for key in due:
            if key == GUIDANCE:
                self._surroundings.renew(self.vehicle, now.time_s)
                self._take(modes.advance(self._pilot, now, self._failsafe), now)
                self._fly(now, dt=PERIOD_S)
            elif key == SAMPLING:
                self._surroundings.sensors.note((*now.position_ned, *now.velocity_ned), now.time_s)
            elif key == SHAPING:
                self._take_up()
            elif key == WATCHDOG:
                self._watch(now)
            elif key == TRUTH:
                self._send(self._reporter.truth())
            else:
                self._report(key, now)

    def _report(self, message: int, now: Situation) -> None:
        if message in MEASUREMENTS and self._measured_step != self.vehicle.steps:
            self._measured = self._surroundings.sensors.measured((*now.position_ned, *now.velocity_ned), now.time_s)
            self._measured_step = self.vehicle.steps
        self._send(self._reporter.report(message, self._pilot, now, self._measured))

    def _take(self, outcome: Outcome, now: Situation) -> int:
        """Adopt the outcome of an event; tell the ground at once of a new mode, and in words."""
        before, self._pilot = self._pilot, outcome.pilot
        if (before.armed, before.mode) != (self._pilot.armed, self._pilot.mode):
            self._report(dialect.MAVLINK_MSG_ID_HEARTBEAT, now)
        if before.armed != self._pilot.armed:
            self.vehicle.arm() if self._pilot.armed else self.vehicle.disarm()
        for severity, text in outcome.words:
            for frame in self._reporter.words(severity, text):
                self._send(frame)
        return ACCEPTED if outcome.accepted else REJECTED

    def _fly(self, now: Situation, *, dt: float) -> None:
        """Hand the mode's velocity to the flight controller, through whatever is wrong with it; dt: s of yaw rate."""
        pilot = self._pilot
        velocity = modes.command(pilot, now)
        if pilot.mode is Mode.OFFBOARD:
            velocity = self._shaped(self._surroundings.flown(velocity, now.time_s), now)
        else:
            self._motion = None
        yaw = modes.heading(pilot, dt)
        if yaw != pilot.yaw:
            self._pilot = pilot._replace(yaw=yaw)
        self.vehicle.set_velocity(velocity, yaw)

    def _shaped(self, velocity_ned: Vector, now: Situation) -> Vector:
        """Where a slow vehicle is on its way to this velocity. OFFBOARD begins with the one it has."""
        if self._shape is None:
            return velocity_ned
        self._wanted_ned = velocity_ned
        if self._motion is None:
            self._motion = Motion((now.velocity_ned[0], now.velocity_ned[1]))
        return (*self._motion.velocity_ne, velocity_ned[2])

    def _take_up(self) -> None:
        """Every SHAPING_S: a little nearer to what is wanted."""
        if self._shape is None or self._motion is None or self._pilot.mode is not Mode.OFFBOARD:
            return
        north, east, down = self._wanted_ned
        self._motion = self._shape(self._motion, (north, east))
        self.vehicle.set_velocity((*self._motion.velocity_ne, down), self._pilot.yaw)

    def _position_target(self, target: PositionTarget) -> None:
        if target.target_system not in (0, self.system) or target.target_component not in (0, AUTOPILOT):
            return
        setpoint = self._setpoint(target)
        if setpoint is None:
            self.refused_setpoints += 1
            return
        north, east, _ = setpoint.velocity_ned
        if self.first_motion_step is None and math.hypot(north, east) > STANDS_STILL:
            self.first_motion_step = self.vehicle.steps
        self._pilot = modes.hear(self._pilot, setpoint)
        if not self._schedule.has(WATCHDOG):
            self._be_patient(setpoint)
        if self._pilot.mode is Mode.OFFBOARD:
            self._fly(self._situation(), dt=0.0)

    def _be_patient(self, setpoint: Setpoint) -> None:
        """Look again at the step at which this set-point will be too old."""
        silence = math.ceil(self._failsafe.setpoint_silence_s * self._hz)
        self._schedule.once(WATCHDOG, step=round(setpoint.time_s * self._hz) + silence)

    def _watch(self, now: Situation) -> None:
        """The set-point waited for is too old, or a newer one has come meanwhile."""
        setpoint = self._pilot.setpoint
        if setpoint is not None and modes.hears_setpoints(self._pilot, now, self._failsafe):
            self._be_patient(setpoint)
            return
        self._take(modes.advance(self._pilot, now, self._failsafe), now)
        self._fly(now, dt=0.0)

    def _setpoint(self, target: PositionTarget) -> Setpoint | None:
        """The velocity set-point in a message; None where it is none that we fly."""
        mask = target.type_mask
        yaw = None if mask & IGNORE_YAW else target.yaw
        yaw_rate = 0.0 if mask & IGNORE_YAW_RATE else target.yaw_rate
        numbers = (target.vx, target.vy, target.vz, yaw_rate, yaw or 0.0)
        if mask not in VELOCITY_MASKS or not all(map(math.isfinite, numbers)):
            return None
        velocity = target.vx, target.vy, target.vz
        if target.coordinate_frame == BODY_NED:
            velocity = _turned(velocity, self.vehicle.yaw)
            yaw = None if yaw is None else yaw + self.vehicle.yaw
        elif target.coordinate_frame != LOCAL_NED:
            return None
        return Setpoint(self.time_s, velocity, yaw, yaw_rate)

    def _command(self, frame: Frame) -> None:
        try:
            command = decode(frame)
        except dialect.MAVError:
            return
        if command.target_system not in (0, self.system) or command.target_component not in (0, AUTOPILOT):
            return
        handler = self._commands.get(command.command)
        result = UNSUPPORTED if handler is None else handler(command)
        self._send(
            self._reporter.acknowledge(command.command, result, to_system=frame.system, to_component=frame.component)
        )

    def _arm_disarm(self, command: Any) -> int:
        now = self._situation()
        if command.param1 == 1.0:
            return self._take(modes.arm(self._pilot, now), now)
        if command.param1 == 0.0:
            return self._take(modes.disarm(self._pilot, now, force=command.param2 == FORCE_DISARM), now)
        return DENIED

    def _take_off(self, command: Any) -> int:
        """param7 is the altitude above mean sea level, as PX4 reads it; NaN leaves it to the vehicle."""
        height = modes.DEFAULT_TAKEOFF_HEIGHT
        if math.isfinite(command.param7):
            height = command.param7 - self._origin.altitude_m
        now = self._situation()
        return self._take(modes.take_off(self._pilot, now, height), now)

    def _do_set_mode(self, command: Any) -> int:
        if not math.isfinite(command.param2) or not math.isfinite(command.param3):
            return DENIED
        mode = self._personality.mode_of(int(command.param2), int(command.param3))
        if mode is None or mode is Mode.TAKEOFF:  # a take-off needs an altitude: NAV_TAKEOFF carries it
            return UNSUPPORTED
        return self._change_mode(mode)

    def _change_mode(self, mode: Mode) -> int:
        now = self._situation()
        return self._take(modes.set_mode(self._pilot, now, mode, self._failsafe), now)

    def _set_message_interval(self, command: Any) -> int:
        """param1 message id, param2 interval in µs: 0 the default rate, −1 off."""
        message, interval_us = command.param1, command.param2
        if not math.isfinite(interval_us) or not self._reporter.knows(message):
            return DENIED
        default_hz = self._personality.streams_hz.get(int(message), 0.0)
        default_s = 1.0 / default_hz if default_hz else 0.0
        interval_s = interval_us / 1e6 if interval_us else default_s
        self._schedule.set_interval(int(message), interval_s, step=self.vehicle.steps)
        return ACCEPTED

    def _request_message(self, command: Any) -> int:
        if command.param1 == dialect.MAVLINK_MSG_ID_MESSAGE_INTERVAL and self._reporter.knows(command.param2):
            asked = int(command.param2)
            self._send(self._reporter.message_interval(asked, self._schedule.interval_s(asked)))
            return ACCEPTED
        if not self._reporter.knows(command.param1):
            return DENIED
        self._report(int(command.param1), self._situation())
        return ACCEPTED


def _turned(velocity: tuple[float, float, float], yaw: float) -> tuple[float, float, float]:
    """From forward-right-down to north-east-down, level."""
    forward, right, down = velocity
    return (
        forward * math.cos(yaw) - right * math.sin(yaw),
        forward * math.sin(yaw) + right * math.cos(yaw),
        down,
    )
