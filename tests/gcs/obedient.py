"""A fleet that is a few arrays and does as it is told, what may happen to it, and whole flights of it, tick by tick."""

from dataclasses import replace

import numpy as np

from gcs.autopilots.ardupilot import ESTIMATES
from gcs.commands import Arm, Beat, ChangeMode, Kill, Land, RequestMessage, SetVelocity, TakeOff, TakeOffAboveHome
from gcs.flight import Flight
from gcs.telemetry import Swarm
from scenarios import load
from wire.modes import ARDUCOPTER_MODES, ARDUPILOT, PX4, PX4_MODES

START = 1_577_836_800_000_000_000
PERIOD_S, PERIOD_NS = 0.1, 100_000_000
MODE = {name: mode.custom_mode for name, mode in PX4_MODES.items()}
MODES = {"px4": MODE, "ardupilot": ARDUCOPTER_MODES}
OURS = {"px4": ("offboard", "hold"), "ardupilot": ("guided", "brake")}
"""Modes in which each autopilot flies set-points, and holds."""
HEIGHT = 10.0
PROTECTED = {"COM_OF_LOSS_T": 0.5, "COM_OBL_RC_ACT": 4, "NAV_DLL_ACT": 3, "COM_DL_LOSS_T": 10, "MPC_XY_VEL_MAX": 12.0}
PROTECTED_COPTER = {"GUID_TIMEOUT": 0.5, "FS_GCS_ENABLE": 5, "FS_GCS_TIMEOUT": 5, "SYSID_MYGCS": 255, "WP_SPD": 12.0}
EVERYBODY = range(1, 7)
UNFED_NS, LANDS_NS = 500_000_000, 5_500_000_000
"""Without set-points PX4 holds, and then lands."""
FED = 2**62
"""ns: for ever."""
TAKING_OFF, IN_THE_AIR = 3, 2
"""MAV_LANDED_STATE."""


class Fleet:
    """Six vehicles that obey within a tick: no dynamics but a climb, a descent, and velocities taken as they come.

    It is made of what can go wrong with it. silent: vehicle → the tick from which nothing of it is heard, or the first
    and the last of them;  mute: the same of its heartbeat alone;  apart: the first and the last tick at which nothing
    gets through, to nobody and from nobody;  deaf: those who never arm;  landlocked: those who never come down;
    happens: tick → what others do to the fleet then, a function of it, before its telemetry of that tick;  misses: kind
    of command → the tick from which it is lost on its way, or the first and the last of them;  beat: ticks between two
    heartbeats of a vehicle, each at another tick;  autopilot: of them all. PX4 holds, then lands, without set-points.
    """

    def __init__(
        self, *, silent=None, mute=None, apart=None, deaf=(), landlocked=(), happens=None, misses=None, beat=1,
        autopilot="px4",
    ):  # fmt: skip
        n = len(EVERYBODY)
        px4 = autopilot == "px4"
        places = [(0.0, 3.0 * column, 0.0) for column in range(n)]
        self._deaf, self._landlocked, self._happens = deaf, landlocked, happens or {}
        self._silent, self._mute, self._misses, self._apart = silent or {}, mute or {}, misses or {}, {0: apart}
        self._tick, self._now_ns, self._beat = 0, START, beat
        self._modes = MODES[autopilot]
        self._flies, self._holds = (self._modes[name] for name in OURS[autopilot])
        self._px4, self._climbs = px4, np.zeros(n, bool)
        self._fed_ns, self._failed = np.full(n, START), np.zeros(n, bool)
        self._heard = self._swarm = replace(
            Swarm.of(EVERYBODY),
            position_ned=np.array(places),
            velocity_ned=np.zeros((n, 3)),
            ready=np.ones(n, bool),
            estimator=np.full(n, ESTIMATES),
            autopilot=np.full(n, PX4 if px4 else ARDUPILOT),
            custom_mode=np.full(n, self._holds),
            landed_state=np.ones(n, int),
            boot_ms=np.full(n, 40_000),
            interval_s=np.full(n, PERIOD_S),
            battery=np.full(n, 0.9),
            home_m=np.full(n, 320.0),
            accuracy_m=np.full(n, 0.3),
            parameters=(PROTECTED if px4 else PROTECTED_COPTER,) * n,
        )

    def heard(self, tick, now_ns):
        """Telemetry of this tick: whoever is silent stays as last heard."""
        self._tick, self._now_ns = tick, now_ns
        self._happens.get(tick, lambda _fleet: None)(self)
        self._fail_safe(now_ns)
        n = len(EVERYBODY)
        news = replace(
            self._swarm,
            position_ns=np.full(n, now_ns),
            heartbeat_ns=np.full(n, now_ns),
            boot_ms=self._swarm.boot_ms + round(PERIOD_S * 1e3),
        )
        self._swarm = news
        silent = np.array([self._now(self._silent, system) for system in EVERYBODY]) | self._now(self._apart, 0)
        beats = [tick == 0 or (tick + system) % self._beat == 0 for system in EVERYBODY]
        mute = silent | ~np.array(beats) | np.array([self._now(self._mute, system) for system in EVERYBODY])
        kept = {name: _where(silent, getattr(self._heard, name), getattr(news, name)) for name in PLACED}
        kept |= {name: _where(mute, getattr(self._heard, name), getattr(news, name)) for name in BEATEN}
        self._heard = replace(news, **kept)
        return self._heard

    def _now(self, spans, key):
        """Whether this tick is in a span: from a tick on, or from one to another."""
        span = spans.get(key)
        if span is None:
            return False
        first, last = span if isinstance(span, tuple) else (span, np.inf)
        return first <= self._tick <= last

    def _fail_safe(self, now_ns):
        mode, unfed_ns = self._swarm.custom_mode, now_ns - self._fed_ns
        fails = self._px4 & self._swarm.armed & (mode == self._flies) & (unfed_ns > UNFED_NS)
        self._failed = fails | (self._failed & (mode == self._holds))
        after = np.where(unfed_ns > LANDS_NS, self._modes["land"], self._holds)
        self._swarm = replace(self._swarm, custom_mode=np.where(self._failed, after, mode))

    def pilot(self, system, mode):
        """Somebody else changes a vehicle's mode, and feeds it where it must be fed."""
        self._fed_ns[system - 1] = FED
        self.set("custom_mode", system, self._modes[mode])

    def disarm(self, system):
        """Somebody else, or the vehicle itself, stops its rotors."""
        self.set("armed", system, False)

    def reboot(self, system):
        """A vehicle begins anew: disarmed, in no mode of ours, its clock at 0."""
        self.disarm(system)
        self.pilot(system, "manual" if self._px4 else "stabilize")
        self.set("boot_ms", system, 0)

    def set(self, name, system, value):
        """Make one thing of one vehicle another."""
        array = getattr(self._swarm, name).copy()
        array[system - 1] = value
        self._swarm = replace(self._swarm, **{name: array})

    def set_parameters(self, system, told):
        """What a vehicle told of its parameters."""
        kept = self._swarm.parameters
        self._swarm = replace(self._swarm, parameters=(*kept[: system - 1], told, *kept[system:]))

    def obey(self, commands):
        for system, command in commands:
            row = system - 1
            if self._now(self._misses, type(command)) or self._now(self._apart, 0):
                continue
            match command:
                case RequestMessage():
                    self.set("origin", system, (41.1512, -81.4161, 320.0))
                case Arm() if system not in self._deaf:
                    self.set("armed", system, True)
                case TakeOff():
                    self.pilot(system, "takeoff")
                    self._climbs[row] = True
                case TakeOffAboveHome():
                    self._climbs[row] = True
                case ChangeMode(main, sub):
                    self.set("custom_mode", system, main << 16 | sub << 24 if self._px4 else main)
                case Kill():
                    self.disarm(system)
                case Land() if system not in self._landlocked:
                    self.pilot(system, "land")
                case SetVelocity(north, east, down):
                    self._fed_ns[row] = self._now_ns
                    if self._swarm.custom_mode[row] == self._flies:
                        self.set("velocity_ned", system, (north, east, down))
        self._move()

    def _move(self):
        mode, velocity = self._swarm.custom_mode, self._swarm.velocity_ned.copy()
        lands = (mode == self._modes["land"]) & ~np.isin(EVERYBODY, self._landlocked)
        self._climbs &= mode == (self._modes["takeoff"] if self._px4 else self._flies)
        velocity[mode != self._flies] = 0.0
        velocity[self._climbs, 2] = -2.0
        velocity[lands, 2] = 2.0
        position = self._swarm.position_ned + velocity * PERIOD_S
        position[:, 2] = np.clip(position[:, 2], -HEIGHT, 0.0)
        there = self._climbs & (position[:, 2] <= -HEIGHT + 1e-9)
        down = lands & (position[:, 2] >= 0.0)
        velocity[there | down] = 0.0
        self._climbs &= ~there
        up = np.where(self._climbs, TAKING_OFF, IN_THE_AIR)
        self._swarm = replace(
            self._swarm,
            position_ned=position,
            velocity_ned=velocity,
            custom_mode=np.where(there & self._px4, self._holds, mode),
            armed=self._swarm.armed & ~down,
            landed_state=np.where(position[:, 2] > -0.05, 1, up),
        )


PLACED = ("position_ned", "velocity_ned", "position_ns", "boot_ms")
BEATEN = ("heartbeat_ns", "custom_mode", "armed")
"""What positions tell, and what heartbeats do."""


def _where(silent, before, now):
    return np.where(silent[:, None] if now.ndim == 2 else silent, before, now)


class Log:
    """A whole flight. events: what people say at a tick, in a phase;  late: tick → s by which it comes too late."""

    def __init__(self, fleet, *, events=None, ticks=2000, late=None, **changes):
        overrides = ("mission.leg.0.length_m=3", "mission.leg.1.length_m=6", "mission.run_up_s=2")
        self.flight = Flight(load("demo", overrides=(*overrides, *(f"{k}={v}" for k, v in changes.items()))))
        self.states, self.commands, self.diagnoses, self.swarms = [], [], [], []
        state, tick, now_ns = self.flight.start(), 0, START - 1_000_000
        while not state.done and tick < ticks:
            deadline_ns = START + tick * PERIOD_NS
            now_ns = max(deadline_ns, now_ns + 1_000_000) + round((late or {}).get(tick, 0.0) * 1e9)
            asked = (events or (lambda _tick, _phase: ()))(tick, state.phase)
            swarm = fleet.heard(tick, now_ns)
            state, commands, diagnosis = self.flight(state, swarm, asked, now_ns)
            fleet.obey(commands)
            self.states.append(state)
            self.commands.append(commands)
            self.diagnoses.append(diagnosis)
            self.swarms.append(swarm)
            tick += 1
        self.end = state

    def phases(self):
        """In their order, each once."""
        return list(dict.fromkeys(d.phase for d in self.diagnoses))

    def first(self, phase):
        """The first tick of a phase."""
        return next(tick for tick, d in enumerate(self.diagnoses) if d.phase is phase)

    def ticks_of(self, kind, system=None):
        """At which ticks a kind of command went out, to anybody or to one vehicle."""
        return [
            tick
            for tick, commands in enumerate(self.commands)
            if any(isinstance(command, kind) and system in (None, to) for to, command in commands)
        ]

    def to(self, system):
        """(tick, command) of everything that one vehicle was sent, heartbeats aside."""
        return [
            (tick, command)
            for tick, commands in enumerate(self.commands)
            for to, command in commands
            if to == system and not isinstance(command, Beat)
        ]
