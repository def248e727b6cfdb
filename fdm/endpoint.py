"""A simulated vehicle as the wire sees it: bytes in, bytes out, physics between. No socket, no clock."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as dialect

from fdm.answers import Answers
from fdm.commands import MESSAGES as COMMANDS
from fdm.commands import obey, request
from fdm.helm import Helm
from fdm.modes import ON_TIME, Outcome, Pilot, Result, Severity, Situation
from fdm.parameter_service import LISTING
from fdm.parameters import Parameters, table
from fdm.personality import PX4, Personality
from fdm.rules import Rules, rules
from fdm.sensors import SAMPLE_S
from fdm.setpoints import Inlet
from fdm.shaping import SHAPING_S, Level, Motion
from fdm.streams import NEVER, Schedule
from fdm.surroundings import PERIOD_S, Surroundings
from fdm.telemetry import MEASUREMENTS, Reporter
from fdm.vehicle import FlightModelDiverged, Geodetic, Vehicle
from scenarios.models import Noise
from wire.frames import Frame, Framer
from wire.ids import AUTOPILOT
from wire.payloads import SET_POSITION_TARGET_LOCAL_NED, unpack_position_target

SAMPLING, SHAPING, GUIDANCE, WATCHDOG, TRUTH = -5, -4, -3, -2, -1
"""Keys of the schedule that are no message ids, in the order in which they are served: noting what stale telemetry
will tell, taking up a velocity slowly, flying, the end of patience with silent links, the truth."""
TRUTH_PERIOD_S = 0.1

SKIPS = 0.05
"""m above the ground, where legs that bounce or scrape count as standing: contacts come and go at low step rates."""

TYPE_AT = 4
"""Where MAV_TYPE is in the payload of a HEARTBEAT."""


class Endpoint:
    """One vehicle behind MAVLink."""

    def __init__(
        self,
        vehicle: Vehicle,
        surroundings: Surroundings,
        *,
        system: int,
        home: Geodetic,
        physics_hz: int,
        personality: Personality = PX4,
        parameters: Parameters | None = None,
        origin_ne: Level = (0.0, 0.0),
        noise: Noise | None = None,
        shape: Callable[[Motion, Level], Motion] | None = None,
    ) -> None:
        """home: the pad;  parameters: ours unless told;  origin_ne: m from the pad to where its positions count from.

        noise: of its measurements, for the accuracy that it claims
        """
        self.vehicle = vehicle
        self.system = system
        self.personality = personality
        self.parameters = parameters or table(personality.name, system=system)
        self.framer = Framer()
        self.lost = False
        """The flight model diverged: from now on the vehicle is silent, and the others fly on."""
        self.first_motion_step: int | None = None
        """Step at which the vehicle was first asked to move sideways from outside."""
        self._surroundings = surroundings
        self._machine = personality.machine
        self._rules = rules(self.parameters)
        self._inlet = Inlet(personality.frames)
        self._helm = Helm(vehicle, surroundings, personality.machine, shape)
        self._hz = physics_hz
        self._home = home
        self._reporter = Reporter(
            vehicle,
            system=system,
            origin=home,
            personality=personality,
            origin_ne=origin_ne,
            noise=noise,
        )
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
        self._answers = Answers(
            self._reporter.sender,
            self.parameters,
            self._schedule,
            autopilot=personality.autopilot,
            physics_hz=physics_hz,
        )
        self._pilot = self._machine.boot()
        self._watch_step = NEVER
        self._known, self._known_step = self._look(), 0
        self._measured: tuple[float, ...] = vehicle.position_velocity()
        self._measured_step = 0
        surroundings.settle(vehicle)

    @property
    def pilot(self) -> Pilot:
        """State of the mode machine."""
        return self._pilot

    @property
    def refused_setpoints(self) -> Counter[str]:
        """Reason → how many set-points were not flown for it."""
        return self._inlet.refused

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
                self._position_target(frame)
            elif frame.message in COMMANDS:
                self._command(frame)
            elif frame.message == dialect.MAVLINK_MSG_ID_HEARTBEAT:
                self._heartbeat(frame)
            else:
                self._answer(frame)

    def step(self, steps: int) -> None:
        """Fly this many physics steps, in bursts from one thing that is due to the next."""
        vehicle, schedule = self.vehicle, self._schedule
        target = vehicle.steps + steps
        while vehicle.steps < target and not self.lost:
            try:
                vehicle.step(min(target, schedule.next_step) - vehicle.steps)
            except FlightModelDiverged:
                self.lost, self._pilot = True, self._machine.boot()
                return
            if vehicle.steps >= schedule.next_step:
                self._serve(schedule.take_due(vehicle.steps))

    def data_to_send(self) -> list[tuple[int, bytes]]:
        """Frames since the last call, each with the physics step at which it was sent."""
        frames, self._outbox = self._outbox, []
        return frames

    def act(self, event: Callable[[Pilot, Situation, Rules], Outcome]) -> Result:
        """Let the mode machine answer an event; tell the ground at once of a new mode, and in words."""
        now, before = self._situation(), self._pilot
        outcome = event(before, now, self._rules)
        self._pilot = outcome.pilot
        if (before.armed, before.mode) != (self._pilot.armed, self._pilot.mode):
            self.tell(dialect.MAVLINK_MSG_ID_HEARTBEAT)
        if before.armed != self._pilot.armed:
            self.vehicle.arm() if self._pilot.armed else self.vehicle.disarm()
        for severity, text in outcome.words:
            self._say(severity, text)
        self._be_patient()
        return outcome.result

    def knows(self, message: float) -> bool:
        """Whether it can report this message id."""
        return self._reporter.knows(message)

    def tell(self, message: int) -> None:
        """Report this message now."""
        now = self._situation()
        if message in MEASUREMENTS and self._measured_step != self.vehicle.steps:
            self._measured = self._surroundings.sensors.measured((*now.position_ned, *now.velocity_ned), now.time_s)
            self._measured_step = self.vehicle.steps
        self._send(self._reporter.report(message, self._pilot, now, self._measured))

    def tell_interval(self, message: int) -> None:
        """Report how often this message is sent."""
        self._send(self._reporter.message_interval(message, self._schedule.interval_s(message)))

    def stream(self, message: int, interval_s: float) -> None:
        """Send this message so often; 0 is off."""
        self._schedule.set_interval(message, interval_s, step=self.vehicle.steps)

    def height(self, altitude_m: float) -> float:
        """m above home, of an altitude above sea level."""
        return altitude_m - self._home.altitude_m

    def _send(self, *frames: bytes) -> None:
        self._outbox += [(self.vehicle.steps, frame) for frame in frames]

    def _say(self, severity: Severity, text: str) -> None:
        self._send(*self._reporter.words(severity, text))

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
                self.act(self._machine.advance)
                self._fly(dt=PERIOD_S)
            elif key == SAMPLING:
                self._surroundings.sensors.note((*now.position_ned, *now.velocity_ned), now.time_s)
            elif key == SHAPING:
                self._helm.take_up(self._pilot)
            elif key == WATCHDOG:
                self._watch()
            elif key == LISTING:
                self._send(*self._answers.parameters.next_listed(step=self.vehicle.steps))
            elif key == TRUTH:
                self._send(self._reporter.truth())
            else:
                self.tell(key)

    def _fly(self, *, dt: float) -> None:
        self._pilot = self._helm.fly(self._pilot, self._situation(), self._rules, dt=dt)

    def _position_target(self, frame: Frame) -> None:
        target = unpack_position_target(frame.payload)
        if target.target_system not in (0, self.system) or target.target_component not in (0, AUTOPILOT):
            return
        if not self._machine.hears(self._pilot):
            self._inlet.refused["mode"] += 1
            return
        setpoint, words = self._inlet.admit(
            target,
            (frame.system, frame.component),
            time_s=self.time_s,
            yaw=self.vehicle.yaw,
            flown=self._machine.steered(self._pilot),
            keep_alive_s=self._rules.setpoint_silence_s,
        )
        if words:
            self._say(Severity.WARNING, words)
        if setpoint is None:
            return
        if self.first_motion_step is None and target.moves_sideways:
            self.first_motion_step = self.vehicle.steps
        self._pilot = self._machine.hear(self._pilot, setpoint)
        self._be_patient()
        if self._machine.steered(self._pilot):
            self._fly(dt=0.0)

    def _be_patient(self) -> None:
        """Look again at the step at which patience ends, unless that will be done before."""
        soonest = self._machine.deadline(self._pilot, self._rules)
        if soonest * self._hz >= self._watch_step:
            return
        step = max(math.ceil((soonest - ON_TIME) * self._hz), self.vehicle.steps + 1)
        self._watch_step = step
        self._schedule.once(WATCHDOG, step=step)

    def _watch(self) -> None:
        """A link that was waited for is silent, or was heard meanwhile."""
        self._watch_step = NEVER
        if self._machine.deadline(self._pilot, self._rules) > self.time_s + ON_TIME:
            self._be_patient()
            return
        self.act(self._machine.advance)
        self._fly(dt=0.0)

    def _command(self, frame: Frame) -> None:
        asked = request(frame, self.system, self.personality)
        if asked is None:
            return
        result = obey(asked, self)
        self._send(
            self._reporter.acknowledge(asked.acknowledged, result, to_system=frame.system, to_component=frame.component)
        )

    def _heartbeat(self, frame: Frame) -> None:
        if _is_station(frame, self.parameters):
            self.act(lambda pilot, now, _: self._machine.hear_station(pilot, now))

    def _answer(self, frame: Frame) -> None:
        changes = self.parameters.changes
        self._send(*self._answers.answer(frame, step=self.vehicle.steps))
        if self.parameters.changes != changes:
            self._rules = rules(self.parameters)
            self._be_patient()


def _is_station(frame: Frame, parameters: Parameters) -> bool:
    """Whether a heartbeat is our ground station's: for ArduPilot the system that it is told, for PX4 any."""
    if "SYSID_MYGCS" in parameters:
        return frame.system == parameters.get("SYSID_MYGCS")
    return frame.payload[TYPE_AT : TYPE_AT + 1] == bytes([dialect.MAV_TYPE_GCS])
