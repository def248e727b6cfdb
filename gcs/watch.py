"""What ends or interrupts a flight: operators, other hands, silence, time, a fence passed, a loop that stood still."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from gcs import hands, losses
from gcs.autopilots import Fleet
from gcs.events import HOLD, LAND, Event, killed, taken_back
from gcs.flight_state import BEFORE_MISSION, IN_THE_AIR, FlightState, Phase, abandoned, failed
from gcs.gate import LOST_NS, Limits
from gcs.hands import Duty
from gcs.telemetry import Integers, Swarm
from scenarios import Scenario

Array = npt.NDArray[np.float64]

STOOD_NS = 2_000_000_000
"""A loop that did not turn for so long does not go on by itself: by now, its vehicles do what they do without it."""
APART_NS, EXCUSED_NS = 300_000_000, 3_000_000_000
"""Who hears nothing of us for so long may do without us, and its next heartbeats show it; no pilot did that."""
BREACH_M = 2.0
"""Outside its fence by more than this, a vehicle is not merely blown, or badly measured."""

TOLD_TO_HOLD = "the swarm was told to hold, and who lands by itself is not stopped"

DUTIES = {
    Phase.CLIMB: Duty.TAKE_OFF,
    Phase.TAKE_CONTROL: Duty.OBEY,
    Phase.RUN_UP: Duty.OBEY,
    Phase.MISSION: Duty.OBEY,
    Phase.HOLD: Duty.HOLD,
    Phase.LAND: Duty.LAND,
}


class Watch:
    """Looks at every tick before it is decided."""

    def __init__(self, scenario: Scenario, fleet: Fleet, *, centre_ne: Array) -> None:
        """centre_ne: (2,) m, the fence's in the swarm's frame."""
        self._scenario = scenario
        self._fleet = fleet
        self._centre_ne = centre_ne
        self._limits = Limits.of(scenario)

    def heed(self, state: FlightState, swarm: Swarm, events: tuple[Event, ...], now_ns: int) -> FlightState:
        """What the operator said comes first."""
        for event in events:
            system, back = killed(event), taken_back(event)
            if system in swarm.ids:
                state = self._killed(state, swarm, swarm.ids.index(system))
            elif back in swarm.ids:
                state = self._taken_back(state, swarm, swarm.ids.index(back), now_ns)
        if LAND in events and state.phase not in (Phase.LAND, Phase.DONE):
            return abandoned(state, state.over)
        if HOLD in events and state.phase not in (Phase.HOLD, Phase.LAND, Phase.DONE):
            return abandoned(state, Phase.DONE if state.phase is Phase.JOIN else Phase.HOLD)
        return state

    def __call__(self, state: FlightState, swarm: Swarm, now_ns: int) -> FlightState:
        """The flight as it goes on, if it does."""
        state = self._stood(state, now_ns)
        state = self._apart(state, swarm, now_ns)
        state = self._hands(state, swarm, now_ns)
        state = self._time(state)
        state = self._silence(state, swarm, now_ns)
        return self._fence(state, swarm, now_ns)

    def _killed(self, state: FlightState, swarm: Swarm, row: int) -> FlightState:
        problem = f"the operator stopped the rotors of vehicle {swarm.ids[row]} {self._when(state)}"
        state = replace(state, hands=hands.killed(state.hands, row, state.tick))
        return self._gone_on_without(state, problem)

    def _taken_back(self, state: FlightState, swarm: Swarm, row: int, now_ns: int) -> FlightState:
        """From a pilot who gives it; not from the ground, nor one that we do not hear."""
        airborne = swarm.armed[row] and not losses.down(swarm, self._scenario.swarm.altitude_m)[row]
        heard = swarm.fresh(now_ns, within_ns=LOST_NS)[row]
        if not (state.released[row] and airborne and heard) or state.hands.killing[row]:
            return state
        ticks = self._scenario.time.ticks(hands.RETURNS_S)
        return replace(state, hands=hands.taken_back(state.hands, row, ticks=ticks))

    def _gone_on_without(self, state: FlightState, problem: str) -> FlightState:
        """Before the mission nobody can be spared; in it, somebody must be left."""
        if state.phase is Phase.JOIN or state.phase in BEFORE_MISSION:
            return failed(state, problem, state.over)
        if state.phase is Phase.MISSION and state.released.all():
            problem = f"{state.problem or problem}; none is left to us: gcs land lands whom nobody flies"
            return replace(abandoned(state, Phase.LAND), problem=problem)
        return replace(state, problem=state.problem or problem)

    def _stood(self, state: FlightState, now_ns: int) -> FlightState:
        stood_ns = 0 if state.now_ns is None else now_ns - state.now_ns
        if stood_ns <= STOOD_NS or state.phase not in IN_THE_AIR:
            return state
        problem = f"the ground station stood still for {stood_ns / 1e9:.1f} s {self._when(state)}: {TOLD_TO_HOLD}"
        return failed(abandoned(state, Phase.HOLD), problem, Phase.HOLD)

    def _apart(self, state: FlightState, swarm: Swarm, now_ns: int) -> FlightState:
        """Where we and the vehicles were apart, and some show that they do without us, all hold: none is a pilot's."""
        unsent_ns = 0 if state.now_ns is None else now_ns - state.now_ns - self._scenario.time.period_ns
        unheard_ns = min(now_ns - swarm.position_ns[~state.released], default=0)
        if max(unsent_ns, unheard_ns) > APART_NS:
            state = replace(state, apart_ns=now_ns)
        if state.apart_ns is None or now_ns - state.apart_ns > EXCUSED_NS:
            return state
        back = hands.fallen_back(state.hands, swarm, self._duty(state), self._fleet)
        if not back.any():
            return state
        problem = f"{losses.named(swarm, back)} did without us, who were cut off, {self._when(state)}: {TOLD_TO_HOLD}"
        return failed(abandoned(state, Phase.HOLD), problem, Phase.HOLD)

    def _hands(self, state: FlightState, swarm: Swarm, now_ns: int) -> FlightState:
        """Let go of whom others took."""
        height_m = self._scenario.swarm.altitude_m
        after, taken = hands.watched(state.hands, swarm, now_ns, self._duty(state), self._fleet, height_m=height_m)
        when = self._when(state)
        state = replace(state, hands=after)
        if not taken:
            return state
        problem = "; ".join(f"vehicle {swarm.ids[row]} {how} {when}" for row, how in taken.items())
        return self._gone_on_without(state, problem)

    def _duty(self, state: FlightState) -> Integers:
        """(N,) what is wanted of each vehicle; in a mission, robots beyond repair may be on their way down."""
        duty = np.full(len(state.hands.released), DUTIES.get(state.phase, Duty.NOTHING))
        if state.phase is Phase.MISSION and state.memory is not None and self._scenario.trust.beyond_repair == "land":
            duty[state.memory.roles.gone] = Duty.LAND
        return duty

    def _time(self, state: FlightState) -> FlightState:
        """Give up what takes too long; who was told to hold is given as long again."""
        time, holds = self._scenario.time, state.phase is Phase.HOLD
        took_s = (state.tick - (state.phase_tick if holds else 0)) * time.period_s
        if took_s <= time.timeout_s or state.phase in (Phase.LAND, Phase.DONE):
            return state
        problem = f"{'holding' if holds else 'the flight'} took longer than time.timeout_s = {time.timeout_s:g} s"
        return failed(abandoned(state, state.over), problem, state.over)

    def _silence(self, state: FlightState, swarm: Swarm, now_ns: int) -> FlightState:
        """A fleet that loses a vehicle before its mission lands."""
        silent = ~swarm.fresh(now_ns, within_ns=LOST_NS) | state.hands.mute
        if state.phase not in BEFORE_MISSION or not silent.any():
            return state
        return failed(state, losses.fell_silent(swarm, silent, state.phase), Phase.LAND)

    def _fence(self, state: FlightState, swarm: Swarm, now_ns: int) -> FlightState:
        """All land where one of ours is out; below the floor is a vehicle that came down, which is told elsewhere."""
        if state.phase not in IN_THE_AIR or not self._limits.fenced:
            return state
        watched = ~state.hands.released & swarm.fresh(now_ns, within_ns=LOST_NS)
        out_m = np.where(watched, self._outside_m(state, swarm), 0.0)
        if not (out_m > BREACH_M).any():
            return state
        row = int(np.argmax(out_m))
        problem = f"vehicle {swarm.ids[row]} was {out_m[row]:.1f} m outside the fence {self._when(state)}: all land"
        return failed(abandoned(state, Phase.LAND), problem, Phase.LAND)

    def _outside_m(self, state: FlightState, swarm: Swarm) -> Array:
        """(N,) m beyond the fence's wall or its ceiling; not above 0 inside, and where nothing is known."""
        place_ne = state.position_ne(swarm) - self._centre_ne
        beyond = np.hypot(place_ne[:, 0], place_ne[:, 1]) - self._limits.radius
        above = -swarm.position_ned[:, 2] - self._limits.ceiling
        return np.asarray(np.nan_to_num(np.maximum(beyond, above), nan=0.0, neginf=0.0))

    def _when(self, state: FlightState) -> str:
        return state.when(self._scenario.time.period_s)
