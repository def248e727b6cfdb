"""One flight, decided tick by tick: join, take off, take control, run up, fly the mission, land.

`Flight` holds what never changes; everything that does is in `FlightState`, which goes in and comes out. So a recorded
flight can be decided again from its frames. Nothing here knows whether the fleet is simulated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from gcs import leaving, losses, mission, preflight
from gcs.asking import Asking, some
from gcs.autopilots import Fleet
from gcs.autopilots.fleet import HEARD_NS
from gcs.beliefs import Beliefs, Seen
from gcs.commands import Beat, Command
from gcs.control import settings
from gcs.events import Event, Rating
from gcs.flight_state import Asked, Commands, Diagnosis, FlightState, Phase, Step, abandoned, entered, failed
from gcs.gate import LOST_NS
from gcs.hands import Hands
from gcs.rates import OUR_BEAT_S
from gcs.rules import RuleError
from gcs.steering import Steering
from gcs.swarm_frame import swarm_frame
from gcs.telemetry import Flags, Swarm
from gcs.watch import Watch
from scenarios import Scenario, offsets_ne
from trustr.controller import Decision, Observation, decide
from trustr.leader import capped
from trustr.roles import taken_back

Array = npt.NDArray[np.float64]

STALE_NS = 300_000_000
"""Age of telemetry from which a vehicle has weight 0."""
PATIENCE_S = 60.0
"""All vehicles must be heard and ready by then; so long a climb may take beside a second for each metre, and so long
taking control."""
LANDING_S, GIVEN_UP_NS = 90.0, 30_000_000_000
"""All vehicles must have landed by then; who is silent for longer is not waited for."""
STREAM_FIRST_S = 1.0
"""Set-points flow this long before we ask for OFFBOARD."""
STILL, LEVEL = 0.15, 0.2
"""m/s and m: the fleet hovers in formation, and the run-up may begin."""
TOLD_S = 2.0
"""A heartbeat is a second apart: what it says is believed this long after it may have changed."""
RUN_UP_GAIN, RUN_UP_CAP = 0.5, 0.5
"""1/s and m/s: every robot to its place beside the moving origin."""


class Flight:
    """Decides one flight of a scenario."""

    def __init__(self, scenario: Scenario, *, ratings: Iterable[Rating] | None = None) -> None:
        """ratings: what people will say, with time_s each; () if they may say something live, None if nobody does."""
        self.scenario = scenario
        self._schedule = _by_tick(scenario, ratings or ())
        self.ids = tuple(range(1, scenario.swarm.count + 1))
        self.plan = mission.plan(scenario)
        self._settings = settings(scenario)
        self._offset_ne = offsets_ne(scenario)
        self._beliefs = Beliefs(scenario, self._settings, rated=ratings is not None)
        self._ahead = self.plan.segments[0].velocity_ne / scenario.mission.cruise_m_s
        self._leader = mission.PROFILES[scenario.control.profile]
        position_s = scenario.time.period_s / (scenario.time.positions_per_tick or 1)
        self._fleet = Fleet(height_m=scenario.swarm.altitude_m, position_s=position_s)
        self._period_s = scenario.time.period_s
        self._run_up_ticks = scenario.time.ticks(scenario.mission.run_up_s)
        take_off_ne = -self._run_up_m(self._run_up_ticks) * self._ahead
        self._steering = Steering(scenario, self.plan, self._fleet, centre_ne=take_off_ne)
        self._watch = Watch(scenario, self._fleet, centre_ne=take_off_ne)
        self._ask = Asking(scenario)
        self._phases: dict[Phase, Callable[[FlightState, Swarm, int], Step]] = {
            Phase.JOIN: self._join,
            Phase.CLIMB: self._climb,
            Phase.TAKE_CONTROL: self._take_control,
            Phase.RUN_UP: self._run_up,
            Phase.MISSION: self._mission,
            Phase.HOLD: self._hold,
            Phase.LAND: self._land,
            Phase.DONE: self._land,
        }

    def start(self) -> FlightState:
        """Before the first tick."""
        n = len(self.ids)
        return FlightState(
            tick=0,
            phase=Phase.JOIN,
            phase_tick=0,
            asked=(Asked(),) * n,
            sent_ned=np.zeros((n, 3)),
            commanded=np.zeros(n, bool),
            belief=self._beliefs.start(),
            hands=Hands.of(n),
        )

    def __call__(self, state: FlightState, swarm: Swarm, events: Iterable[Event], now_ns: int) -> Step:
        """One tick. events: what people said since the last; `gcs.events` has their words."""
        events = tuple(events)
        state = replace(state, start_ns=now_ns if state.start_ns is None else state.start_ns)
        state = self._watch.heed(state, swarm, events, now_ns)
        state = self._watch(state, swarm, now_ns)
        said = (*self._due(state), *(event for event in events if isinstance(event, Rating)))
        state = self._believe(state, swarm, said, now_ns)
        state, kills = self._ask.kill(state, swarm)
        state, commands, diagnosis = self._phases[state.phase](state, swarm, now_ns)
        if state.tick % self.scenario.time.ticks(OUR_BEAT_S) == 0:
            commands = commands + [(system, Beat()) for system in self.ids]
        if state.tick % self.scenario.time.ticks(1.0) == 0:
            commands = commands + self._listen(state, swarm, now_ns)
        state = replace(state, tick=state.tick + 1, now_ns=now_ns)
        return state, kills + commands, replace(diagnosis, ratings=said)

    def _due(self, state: FlightState) -> tuple[Rating, ...]:
        """Ratings known beforehand that count at this tick."""
        if self._opens_the_mission(state):
            return self._schedule.get(0, ())
        return () if state.mission_tick is None else self._schedule.get(state.tick - state.mission_tick, ())

    def _opens_the_mission(self, state: FlightState) -> bool:
        return state.phase is Phase.RUN_UP and state.tick - state.phase_tick >= self._run_up_ticks

    def _believe(self, state: FlightState, swarm: Swarm, said: tuple[Rating, ...], now_ns: int) -> FlightState:
        """Weigh what the tick shows; who was left behind is taken back where the supervisor says so."""
        seen = Seen(
            mission_s=self._mission_s(state),
            commanded_ne=state.sent_ned[:, :2],
            position_ne=state.position_ne(swarm),
            velocity_ne=swarm.velocity_ned[:, :2],
            position_ns=swarm.position_ns,
            heard=self._obeying(state, swarm) & _sure(swarm, now_ns),
            left=state.memory.roles.left if state.memory else np.zeros(len(swarm.ids), bool),
            ratings=said,
        )
        state = replace(state, belief=self._beliefs.update(state.belief, seen))
        if state.memory is None or state.phase is not Phase.MISSION:
            return state
        wanted = leaving.wanted_back(said, state.memory.roles, swarm, seen.heard)
        if not wanted.any():
            return state
        memory = replace(state.memory, roles=taken_back(state.memory.roles, wanted))
        return replace(state, memory=memory, belief=self._beliefs.forgive(state.belief, wanted))

    def _obeying(self, state: FlightState, swarm: Swarm) -> Flags:
        """(N,) who flies our set-points, and nobody else's."""
        return np.asarray(self._fleet.obeying(swarm) & ~state.released & ~state.hands.mute)

    def lacking(self, swarm: Swarm, now_ns: int) -> tuple[str, ...]:
        """Whom a flight still waits for before it takes off, and for what; empty where it may."""
        rows = range(len(swarm.ids))
        said = ((swarm.ids[row], what) for row in rows for what in self._fleet.lacking(swarm, row, now_ns))
        return preflight.by_vehicles(said)

    def _join(self, state: FlightState, swarm: Swarm, now_ns: int) -> Step:
        lacking = self.lacking(swarm, now_ns)
        if not lacking:
            return self._cleared(state, swarm, now_ns)
        if self._phase_s(state) > PATIENCE_S:
            problem = f"not every vehicle was ready to arm within {PATIENCE_S:g} s, for lack of: {'; '.join(lacking)}"
            return self._land(failed(state, problem, Phase.DONE), swarm, now_ns)
        state, ask = self._ask(state, swarm, lambda row: self._fleet.next_to_know(swarm, row, now_ns))
        return state, ask, self._overview(state, swarm)

    def _cleared(self, state: FlightState, swarm: Swarm, now_ns: int) -> Step:
        """Everything is known: nobody is armed if anything speaks against it."""
        refusals = (*losses.in_use(swarm), *preflight.refusals(swarm, self.scenario))
        if refusals:
            return self._land(failed(state, "; ".join(refusals), Phase.DONE), swarm, now_ns)
        run_up_ne = self._run_up_m(self._run_up_ticks) * self._ahead
        frame = swarm_frame(swarm.origin, swarm.position_ned[:, :2], self._offset_ne, run_up_ne)
        shift = frame.to_ne(swarm.origin[:, 0], swarm.origin[:, 1])
        return self._climb(replace(entered(state, Phase.CLIMB), frame=frame, shift_ne=shift), swarm, now_ns)

    def _climb(self, state: FlightState, swarm: Swarm, now_ns: int) -> Step:
        hovering = self._fleet.hovering(swarm)
        if hovering.all():
            return self._take_control(entered(state, Phase.TAKE_CONTROL), swarm, now_ns)
        patience_s = PATIENCE_S + self.scenario.swarm.altitude_m
        if self._phase_s(state) > patience_s:
            told = ((~swarm.armed, "not armed"), (swarm.armed & ~hovering, "not hovering at height"))
            return self._land(self._in_vain(state, swarm, told, patience_s), swarm, now_ns)
        state, ask = self._ask(state, swarm, lambda row: some(self._fleet.next_to_fly(swarm, row)))
        return state, ask, self._overview(state, swarm)

    def _take_control(self, state: FlightState, swarm: Swarm, now_ns: int) -> Step:
        streaming_s = self._phase_s(state)
        height_error = np.abs(swarm.position_ned[:, 2] + self.scenario.swarm.altitude_m)
        hovering = (np.linalg.norm(swarm.velocity_ned, axis=1) < STILL) & (height_error < LEVEL)
        obeying = self._fleet.obeying(swarm)
        if streaming_s > STREAM_FIRST_S and obeying.all() and hovering.all():
            return self._run_up(entered(state, Phase.RUN_UP), swarm, now_ns)
        if streaming_s > PATIENCE_S:
            told = ((~obeying, "not flying our set-points"), (obeying & ~hovering, "not hovering at height"))
            return self._land(self._in_vain(state, swarm, told, PATIENCE_S), swarm, now_ns)
        ask: Commands = []
        if streaming_s >= STREAM_FIRST_S:
            state, ask = self._ask(state, swarm, lambda row: some(self._fleet.next_to_obey(swarm, row)))
        asked = self._steering.at_height(swarm, np.zeros((len(swarm.ids), 2)))
        state, commands, diagnosis = self._steering.send(state, swarm, now_ns, asked, self._overview(state, swarm))
        return state, ask + commands, diagnosis

    def _run_up(self, state: FlightState, swarm: Swarm, now_ns: int) -> Step:
        """Bring the formation to cruise: time 0 finds it where the first leg begins, each robot in its place."""
        into = state.tick - state.phase_tick
        if self._opens_the_mission(state):
            state = replace(entered(state, Phase.MISSION), mission_tick=state.tick)
            return self._mission(state, swarm, now_ns)
        cruise, ahead = self.scenario.mission.cruise_m_s, self._ahead
        _, speed = mission.run_up(cruise, self.scenario.mission.run_up_s, (into + 1) * self._period_s)
        place = self._offset_ne - (self._run_up_m(self._run_up_ticks) - self._run_up_m(into)) * ahead
        diagnosis = self._overview(state, swarm)
        back = RUN_UP_GAIN * (place - diagnosis.position_ne)
        asked = speed * ahead + capped(np.where(np.isfinite(back), back, 0.0), RUN_UP_CAP)
        return self._steering.send(state, swarm, now_ns, self._steering.at_height(swarm, asked), diagnosis)

    def _mission(self, state: FlightState, swarm: Swarm, now_ns: int) -> Step:
        time_s = self._mission_s(state)
        if time_s >= self.plan.read_out_s - 1e-9:
            return self._land(entered(state, Phase.LAND), swarm, now_ns)
        flying = self._obeying(state, swarm) & ~losses.down(swarm, self.scenario.swarm.altitude_m)
        diagnosis = self._overview(state, swarm)
        heard = flying & _sure(swarm, now_ns)
        beside = losses.beside_ne(
            swarm, diagnosis.position_ne, heard, now_ns, altitude_m=self.scenario.swarm.altitude_m
        )
        observation = Observation(
            diagnosis.position_ne, swarm.velocity_ned[:, :2], heard, diagnosis.trust, time_s, beside
        )
        assert diagnosis.virtual is not None
        try:
            memory, decision = decide(state.memory, observation, diagnosis.virtual, self._settings)
        except RuleError as error:  # a researcher's own; who flies it is in the air
            return self._land(failed(abandoned(state, Phase.LAND), str(error), Phase.LAND), swarm, now_ns)
        state = self._note_the_lost(replace(state, memory=memory), swarm, flying, now_ns)
        return self._fly(state, swarm, now_ns, decision, diagnosis, flying)

    def _fly(
        self,
        state: FlightState,
        swarm: Swarm,
        now_ns: int,
        decision: Decision,
        diagnosis: Diagnosis,
        flying: Flags,
    ) -> Step:
        """Steer the swarm, those who leave it or come back to it out of its way, and those whom others give back."""
        roles, coming = decision.roles, state.hands.coming
        descends = roles.gone & (self.scenario.trust.beyond_repair == "land")
        state, commands = self._ask(state, swarm, lambda row: self._next_in_mission(swarm, row, descends, coming))
        leaves = self.scenario.trust.beyond_repair != "keep"
        lower = leaving.lowered(roles, swarm, diagnosis.position_ne) if leaves else 0.0
        asked = self._steering.at_height(swarm, decision.velocity_ne, lower=lower)
        if roles.gone.any():
            asked = leaving.settled(asked, roles)
        among = (flying | coming) & ~descends
        state, steering, diagnosis = self._steering.send(state, swarm, now_ns, asked, diagnosis, among=among)
        return state, commands + steering, replace(diagnosis, decision=decision)

    def _next_in_mission(self, swarm: Swarm, row: int, descends: Flags, coming: Flags) -> tuple[Command, ...]:
        """What one vehicle is asked for beside set-points."""
        if descends[row]:
            return some(self._fleet.next_to_land(swarm, row))
        return some(self._fleet.next_to_obey(swarm, row)) if coming[row] else ()

    def _hold(self, state: FlightState, swarm: Swarm, now_ns: int) -> Step:
        """Stay in the air; who comes down by itself is not stopped, and the flight is over when all have.

        Who was taken back while it came down was meant to stay.
        """
        if self._told(state) and not (swarm.armed & ~state.released).any():
            return self._land(entered(state, Phase.DONE), swarm, now_ns)
        landing = self._fleet.landing(swarm) & ~state.hands.coming
        state, commands = self._ask(
            state, swarm, lambda row: () if landing[row] else some(self._fleet.next_to_hold(swarm, row))
        )
        still, obeying = np.zeros((len(swarm.ids), 3)), self._obeying(state, swarm)
        overview = self._overview(state, swarm)
        state, steering, diagnosis = self._steering.send(state, swarm, now_ns, still, overview, among=obeying)
        return state, commands + steering, diagnosis

    def _land(self, state: FlightState, swarm: Swarm, now_ns: int) -> Step:
        """Ask until all are down. Where all were taken from us, those in modes of ours may be in nobody's hands."""
        if state.phase is Phase.DONE:
            return state, [], self._overview(state, swarm)
        ours = ~state.released | state.hands.killing
        up = swarm.armed & (ours if ours.any() else self._fleet.ours(swarm))
        awaited = up & swarm.fresh(now_ns, within_ns=GIVEN_UP_NS)
        if self._told(state) and (not awaited.any() or self._phase_s(state) > LANDING_S):
            silent = ~swarm.fresh(now_ns, within_ns=LOST_NS)
            problems = (state.problem, losses.not_down(swarm, up, silent, within_s=LANDING_S))
            state = replace(entered(state, Phase.DONE), problem="; ".join(filter(None, problems)) or None)
            return state, [], self._overview(state, swarm)
        state, ask = self._ask(state, swarm, lambda row: some(self._fleet.next_to_land(swarm, row)))
        return state, ask, self._overview(state, swarm)

    def _told(self, state: FlightState) -> bool:
        """Heartbeats have had the time to show what this phase asked for."""
        return self._phase_s(state) >= TOLD_S

    def _phase_s(self, state: FlightState) -> float:
        return (state.tick - state.phase_tick) * self._period_s

    def _listen(self, state: FlightState, swarm: Swarm, now_ns: int) -> Commands:
        """Ask vehicles in the air again for positions that come too seldom: that request may have been lost."""
        if state.phase in (Phase.JOIN, Phase.DONE):
            return []
        asked = ((row, self._fleet.next_to_hear(swarm, row, now_ns)) for row in range(len(swarm.ids)))
        return [(swarm.ids[row], again) for row, again in asked if again is not None and not state.released[row]]

    def _in_vain(
        self, state: FlightState, swarm: Swarm, told: Iterable[tuple[Flags, str]], patience_s: float
    ) -> FlightState:
        """On to landing, with (N,) who is the cause of it, and how."""
        who = "; ".join(f"{losses.named(swarm, rows)}: {how}" for rows, how in told if rows.any())
        return failed(state, f"{state.phase.value} took longer than {patience_s:g} s: {who}", Phase.LAND)

    def _note_the_lost(self, state: FlightState, swarm: Swarm, flying: Flags, now_ns: int) -> FlightState:
        """The first vehicle to be lost is why the flight is incomplete; those that were left behind are not missed."""
        if state.problem is not None or state.memory is None:
            return state
        silent = ~swarm.fresh(now_ns, within_ns=LOST_NS)
        missed = (silent | ~flying) & ~state.memory.roles.left
        if not missed.any():
            return state
        row = int(np.argmax(missed))
        mute, altitude_m = bool(state.hands.mute[row]), self.scenario.swarm.altitude_m
        how = losses.how(swarm, row, silent=bool(silent[row]), mute=mute, altitude_m=altitude_m)
        return replace(state, problem=f"vehicle {swarm.ids[row]} {how} {state.when(self._period_s)}")

    def _overview(self, state: FlightState, swarm: Swarm) -> Diagnosis:
        """What every phase has to say."""
        position, time_s = state.position_ne(swarm), self._mission_s(state)
        trust = self._beliefs.trust(state.belief, time_s)
        if math.isnan(time_s):
            return Diagnosis(state.phase, time_s, self.plan.segments[0].task, None, trust, None, position)
        return Diagnosis(
            phase=state.phase,
            mission_s=time_s,
            task=self.plan.segment_at(time_s).task,
            virtual=self._leader(self.plan, time_s),
            trust=trust,
            decision=None,
            position_ne=position,
            belief=state.belief,
        )

    def _mission_s(self, state: FlightState) -> float:
        return state.mission_s(self._period_s)

    def _run_up_m(self, ticks: int) -> float:
        if self._run_up_ticks == 0:
            return 0.0
        run_up_s = self.scenario.mission.run_up_s
        return mission.run_up(self.scenario.mission.cruise_m_s, run_up_s, ticks * self._period_s)[0]


def _by_tick(scenario: Scenario, ratings: Iterable[Rating]) -> dict[int, tuple[Rating, ...]]:
    """Ratings by the tick of the mission at which they count: the first at or after their time."""
    due: dict[int, tuple[Rating, ...]] = {}
    for rating in ratings:
        tick = scenario.time.ticks(max(0.0, rating.time_s or 0.0))
        due[tick] = (*due.get(tick, ()), rating)
    return due


def _sure(swarm: Swarm, now_ns: int) -> Flags:
    """(N,) of whom we know well enough where they are, and in what mode."""
    beats = now_ns - swarm.heartbeat_ns <= HEARD_NS
    return np.asarray(beats & swarm.fresh(now_ns, within_ns=STALE_NS))
