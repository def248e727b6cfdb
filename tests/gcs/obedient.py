"""A fleet that is a few arrays and does as it is told, what may happen to it, and whole flights of it, tick by tick."""

from dataclasses import replace

import numpy as np

from gcs.commands import Arm, Beat, ChangeMode, Kill, Land, RequestMessage, SetVelocity, TakeOff
from gcs.flight import Flight
from gcs.telemetry import Swarm
from scenarios import load
from wire.modes import PX4_MODES

START = 1_577_836_800_000_000_000
PERIOD_S, PERIOD_NS = 0.1, 100_000_000
MODE = {name: mode.custom_mode for name, mode in PX4_MODES.items()}
HEIGHT = 10.0
PROTECTED = {"COM_OF_LOSS_T": 0.5, "COM_OBL_RC_ACT": 4, "NAV_DLL_ACT": 3, "COM_DL_LOSS_T": 10, "MPC_XY_VEL_MAX": 12.0}
EVERYBODY = range(1, 7)


class Fleet:
    """Six vehicles that obey within a tick: no dynamics but a climb, a descent, and velocities taken as they come.

    It is made of what can go wrong with it. silent: vehicle → the tick from which nothing of it is heard, or the first
    and the last of them;  deaf: those who never arm;  landlocked: those who never come down;  happens: tick → what
    others do to the fleet then, a function of it, before its telemetry of that tick;  misses: kind of command → the
    tick from which it is lost on its way.
    """

    def __init__(self, *, silent=None, deaf=(), landlocked=(), happens=None, misses=None):
        n = len(EVERYBODY)
        places = [(0.0, 3.0 * column, 0.0) for column in range(n)]
        self._deaf, self._landlocked, self._happens = deaf, landlocked, happens or {}
        self._misses, self._tick = misses or {}, 0
        spans = {system: span if isinstance(span, tuple) else (span, np.inf) for system, span in (silent or {}).items()}
        self._silent = spans
        self._heard = self._swarm = replace(
            Swarm.of(EVERYBODY),
            position_ned=np.array(places),
            velocity_ned=np.zeros((n, 3)),
            ready=np.ones(n, bool),
            autopilot=np.full(n, 12),
            custom_mode=np.full(n, MODE["hold"]),
            landed_state=np.ones(n, int),
            boot_ms=np.full(n, 40_000),
            interval_s=np.full(n, PERIOD_S),
            battery=np.full(n, 0.9),
            home_m=np.full(n, 320.0),
            accuracy_m=np.full(n, 0.3),
            parameters=(PROTECTED,) * n,
        )

    def heard(self, tick, now_ns):
        """Telemetry of this tick: whoever is silent stays as last heard."""
        self._tick = tick
        self._happens.get(tick, lambda _fleet: None)(self)
        silent = np.array([first <= tick <= last for first, last in map(self._span, EVERYBODY)])
        news = replace(
            self._swarm,
            position_ns=np.full(len(EVERYBODY), now_ns),
            heartbeat_ns=np.full(len(EVERYBODY), now_ns),
            boot_ms=self._swarm.boot_ms + round(PERIOD_S * 1e3),
        )
        self._swarm = news
        told = ("position_ned", "velocity_ned", "position_ns", "heartbeat_ns", "custom_mode", "armed", "boot_ms")
        kept = {name: _where(silent, getattr(self._heard, name), getattr(news, name)) for name in told}
        self._heard = replace(news, **kept)
        return self._heard

    def pilot(self, system, mode):
        """Somebody else changes a vehicle's mode."""
        self.set("custom_mode", system, MODE[mode])

    def disarm(self, system):
        """Somebody else, or the vehicle itself, stops its rotors."""
        self.set("armed", system, False)

    def reboot(self, system):
        """A vehicle begins anew: disarmed, in no mode of ours, its clock at 0."""
        self.disarm(system)
        self.pilot(system, "manual")
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

    def _span(self, system):
        return self._silent.get(system, (np.inf, np.inf))

    def obey(self, commands):
        for system, command in commands:
            row = system - 1
            if self._tick >= self._misses.get(type(command), np.inf):
                continue
            match command:
                case RequestMessage():
                    self.set("origin", system, (41.1512, -81.4161, 320.0))
                case Arm() if system not in self._deaf:
                    self.set("armed", system, True)
                case TakeOff():
                    self.set("custom_mode", system, MODE["takeoff"])
                case ChangeMode(6):
                    self.set("custom_mode", system, MODE["offboard"])
                case ChangeMode(4, 3):
                    self.pilot(system, "hold")
                case Kill():
                    self.disarm(system)
                case Land() if system not in self._landlocked:
                    self.set("custom_mode", system, MODE["land"])
                case SetVelocity(north, east, down) if self._swarm.custom_mode[row] == MODE["offboard"]:
                    self.set("velocity_ned", system, (north, east, down))
        self._move()

    def _move(self):
        mode, velocity = self._swarm.custom_mode, self._swarm.velocity_ned.copy()
        down = self._swarm.position_ned[:, 2]
        velocity[mode != MODE["offboard"]] = 0.0
        velocity[mode == MODE["takeoff"], 2] = -2.0
        velocity[mode == MODE["land"], 2] = 2.0
        position = self._swarm.position_ned + velocity * PERIOD_S
        position[:, 2] = np.clip(position[:, 2], -HEIGHT, 0.0)
        there = (mode == MODE["takeoff"]) & (position[:, 2] <= -HEIGHT + 1e-9)
        down = (mode == MODE["land"]) & (position[:, 2] >= 0.0)
        velocity[there | down] = 0.0
        self._swarm = replace(
            self._swarm,
            position_ned=position,
            velocity_ned=velocity,
            custom_mode=np.where(there, MODE["hold"], mode),
            armed=self._swarm.armed & ~down,
            landed_state=np.where(position[:, 2] > -0.05, 1, 2),
        )


def _where(silent, before, now):
    return np.where(silent[:, None] if now.ndim == 2 else silent, before, now)


class Log:
    """A whole flight. events: what people say at a tick, in a phase;  late: tick → s by which it comes too late."""

    def __init__(self, fleet, *, events=None, ticks=2000, late=None, **changes):
        overrides = ("mission.leg.0.length_m=3", "mission.leg.1.length_m=6", "mission.run_up_s=2")
        self.flight = Flight(load("demo", overrides=(*overrides, *(f"{k}={v}" for k, v in changes.items()))))
        self.states, self.commands, self.diagnoses = [], [], []
        state, tick, now_ns = self.flight.start(), 0, START - 1_000_000
        while not state.done and tick < ticks:
            deadline_ns = START + tick * PERIOD_NS
            now_ns = max(deadline_ns, now_ns + 1_000_000) + round((late or {}).get(tick, 0.0) * 1e9)
            asked = (events or (lambda _tick, _phase: ()))(tick, state.phase)
            state, commands, diagnosis = self.flight(state, fleet.heard(tick, now_ns), asked, now_ns)
            fleet.obey(commands)
            self.states.append(state)
            self.commands.append(commands)
            self.diagnoses.append(diagnosis)
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
