"""What comes between a flight and its vehicles: other hands, operators, silence, a fence, a loop that stood still."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from obedient import EVERYBODY, MODE, PERIOD_S, PROTECTED, START, Fleet, Log

from gcs import losses
from gcs.asking import RETRY_S
from gcs.autopilots import Fleet as Autopilots
from gcs.commands import Arm, ChangeMode, Kill, Land, RequestStream, SetVelocity, TakeOff
from gcs.events import HOLD, LAND, kill, take_back
from gcs.flight import TOLD_S
from gcs.flight_state import Phase
from gcs.gate import LATE_PERIODS, REFUSED, WITHHELD
from gcs.hands import RETURNS_S, killed
from gcs.mission import plan
from gcs.steering import Steering
from gcs.watch import BREACH_M, STOOD_NS
from scenarios import load

NOMINAL = Log(Fleet())
AT = {phase: NOMINAL.first(phase) for phase in Phase if phase is not Phase.HOLD}
MIDDLE = AT[Phase.MISSION] + 20
"""A tick of the mission."""
BEFORE = [Phase.CLIMB, Phase.TAKE_CONTROL, Phase.RUN_UP]
OTHERS = [system for system in EVERYBODY if system != 4]


def by_name(phase):
    return phase.name


def said(*words):
    """Events: words at ticks."""
    at = dict(words)
    return lambda tick, _phase: (at[tick],) if tick in at else ()


def pilot(mode, system=4):
    return lambda fleet: fleet.pilot(system, mode)


def weights(log, tick):
    decision = log.diagnoses[tick].decision
    return decision.graph.dense(decision.weights)


def sent_after(log, system, tick):
    return [sent for sent in log.to(system) if sent[0] >= tick]


# --- a pilot's hand wins

TAKEN = {
    "position": (pilot("position"), "was taken over by another (position)"),
    "return": (pilot("return"), "was taken over by another (return)"),
    "manual": (pilot("manual"), "was taken over by another (manual)"),
    "hold": (pilot("hold"), "left the ground station's control (hold)"),
    "land": (pilot("land"), "left the ground station's control (land)"),
    "disarmed": (lambda fleet: fleet.disarm(4), "stopped its rotors"),
    "rebooted": (lambda fleet: fleet.reboot(4), "booted again"),
}


@cache
def taken(how):
    return Log(Fleet(happens={MIDDLE: TAKEN[how][0]}))


@pytest.mark.parametrize("how", TAKEN)
def test_a_vehicle_that_others_take_is_released_at_once_and_for_good(how):
    log = taken(how)
    assert sent_after(log, 4, MIDDLE) == []
    assert (weights(log, MIDDLE)[[0, 1, 2, 4, 5], 3] == 0).all()
    assert log.states[MIDDLE].released.tolist() == [False, False, False, True, False, False]
    assert log.diagnoses[MIDDLE].verdict[3] == WITHHELD
    when = (MIDDLE - AT[Phase.MISSION]) * PERIOD_S
    assert log.end.problem == f"vehicle 4 {TAKEN[how][1]} {when:.1f} s into the mission"


@pytest.mark.parametrize("how", TAKEN)
def test_the_others_fly_on_without_it_and_land(how):
    log = taken(how)
    assert log.first(Phase.LAND) == AT[Phase.LAND]
    for system in OTHERS:
        assert log.ticks_of(SetVelocity, system)[-1] == AT[Phase.LAND] - 1
        assert log.ticks_of(Land, system)[0] == AT[Phase.LAND]
    assert log.end.done


def test_a_vehicle_that_comes_back_from_a_reboot_is_not_armed_again():
    """It was silent while it booted: weight 0 from three tenths of a second on, and then no command, ever."""
    back = MIDDLE + 40
    log = Log(Fleet(silent={4: (MIDDLE, back - 1)}, happens={MIDDLE + 5: lambda fleet: fleet.reboot(4)}))
    assert (weights(log, MIDDLE + 2)[[0, 1, 2, 4, 5], 3] > 0).all()
    assert (weights(log, MIDDLE + 3)[[0, 1, 2, 4, 5], 3] == 0).all()
    assert (weights(log, back + 5)[[0, 1, 2, 4, 5], 3] == 0).all()
    assert sent_after(log, 4, back) == []
    assert "vehicle 4 fell silent" in log.end.problem
    assert log.first(Phase.LAND) == AT[Phase.LAND]


def test_an_obedient_mode_that_somebody_else_set_later_is_still_not_ours():
    log = Log(Fleet(happens={MIDDLE: pilot("position"), MIDDLE + 10: pilot("offboard")}))
    assert sent_after(log, 4, MIDDLE) == []
    assert (weights(log, MIDDLE + 15)[[0, 1, 2, 4, 5], 3] == 0).all()


@pytest.mark.parametrize("phase", BEFORE, ids=by_name)
@pytest.mark.parametrize("mode", ["position", "land"])
def test_before_the_mission_a_vehicle_taken_brings_the_others_down_and_is_itself_left_alone(phase, mode):
    tick = AT[phase] + 8
    log = Log(Fleet(happens={tick: pilot(mode)}))
    assert log.diagnoses[tick].phase is Phase.LAND
    assert sent_after(log, 4, tick) == []
    assert {to for to, command in log.commands[tick] if isinstance(command, Land)} == set(OTHERS)
    assert log.end.problem.startswith("vehicle 4 ")
    assert log.end.problem.endswith(f"while {phase.value}")
    assert Phase.MISSION not in log.phases()
    assert log.end.done


def test_a_pilot_who_stops_the_climb_is_not_asked_to_take_off_again():
    tick = AT[Phase.CLIMB] + 20
    log = Log(Fleet(happens={tick: pilot("hold")}))
    assert sent_after(log, 4, tick) == []
    assert "vehicle 4 left the ground station's control (hold) while taking off" in log.end.problem


def test_a_landing_that_somebody_begins_at_the_top_of_the_climb_is_his():
    tick = AT[Phase.TAKE_CONTROL] - 1
    log = Log(Fleet(happens={tick: pilot("land")}))
    assert sent_after(log, 4, tick) == []
    assert "vehicle 4 left the ground station's control (land) while taking off" in log.end.problem


def test_a_vehicle_that_boots_again_before_it_was_armed_is_not_armed():
    """What was read of its parameters was read before."""
    tick = AT[Phase.CLIMB] + 5
    log = Log(Fleet(deaf=(4,), happens={tick: lambda fleet: fleet.reboot(4)}))
    assert sent_after(log, 4, tick) == []
    assert log.end.problem == "vehicle 4 booted again while taking off"


def test_a_vehicle_that_was_disarmed_on_the_ground_is_not_armed_again():
    """A hand may be near its rotors."""
    tick = AT[Phase.CLIMB] + 2
    log = Log(Fleet(happens={tick: lambda fleet: fleet.disarm(4)}))
    assert sent_after(log, 4, tick) == []
    assert log.end.problem == "vehicle 4 stopped its rotors while taking off"


@pytest.mark.parametrize("mode", ["position", "hold"])
def test_a_landing_that_a_pilot_takes_over_is_his(mode):
    tick = AT[Phase.LAND] + 10
    log = Log(Fleet(happens={tick: pilot(mode)}))
    assert sent_after(log, 4, tick) == []
    assert log.end.done
    assert len(log.states) == len(NOMINAL.states)
    assert "while landing" in log.end.problem


def test_with_nobody_left_the_mission_is_over():
    def everybody(fleet):
        for system in EVERYBODY:
            fleet.pilot(system, "position")

    log = Log(Fleet(happens={MIDDLE: everybody}))
    assert log.diagnoses[MIDDLE].phase is Phase.LAND
    assert [commands for system in EVERYBODY for commands in sent_after(log, system, MIDDLE)] == []
    assert all(f"vehicle {system} was taken over" in log.end.problem for system in EVERYBODY)
    assert len(log.states) - MIDDLE <= TOLD_S / PERIOD_S + 1


def test_a_vehicle_that_is_in_somebodys_hands_already_keeps_all_on_the_ground():
    log = Log(Fleet(happens={0: lambda fleet: fleet.set("armed", 2, True)}))
    assert log.end.problem == "vehicle 2 is armed already: whoever flies it lands it first"
    assert log.phases() == [Phase.JOIN, Phase.DONE]
    assert not log.ticks_of(Arm)


def test_nobody_is_armed_where_preflight_refuses():
    fleet = Fleet()
    fleet.set_parameters(3, PROTECTED | {"NAV_DLL_ACT": 0, "COM_OBL_RC_ACT": 0})
    log = Log(fleet)
    assert "vehicle 3: COM_OBL_RC_ACT = 0" in log.end.problem
    assert log.phases() == [Phase.JOIN, Phase.DONE]
    assert not log.ticks_of(Arm)


@pytest.mark.parametrize("how", ["released", "in another mode", "mute"])
def test_steering_itself_sends_nothing_to_who_is_not_ours(how):
    """Whoever asks it to."""
    scenario = load("demo")
    steering = Steering(scenario, plan(scenario), Autopilots(height_m=10.0, position_s=0.1), centre_ne=np.zeros(2))
    swarm = Fleet().heard(0, START)
    state = replace(NOMINAL.states[MIDDLE], start_ns=START, tick=0)
    if how == "released":
        state = replace(state, hands=killed(state.hands, 3, 0))
    elif how == "mute":
        state = replace(state, hands=replace(state.hands, mute=np.arange(6) == 3))
    else:
        swarm = replace(swarm, custom_mode=np.where(np.arange(6) == 3, MODE["position"], swarm.custom_mode))
    _, commands, told = steering.send(state, swarm, START, np.ones((6, 3)), NOMINAL.diagnoses[MIDDLE])
    assert [to for to, _ in commands] == OTHERS
    assert told.verdict[3] == WITHHELD


# --- taken back by the operator


def test_the_operator_takes_a_vehicle_back_and_it_flies_with_the_others_again():
    back = MIDDLE + 10
    log = Log(Fleet(happens={MIDDLE: pilot("position")}), events=said((back, take_back(4))))
    assert sent_after(log, 4, MIDDLE)[0][0] == back
    assert {type(command) for _, command in sent_after(log, 4, back)} == {ChangeMode, SetVelocity, Land}
    first = next(command for tick, command in log.to(4) if tick == back and isinstance(command, SetVelocity))
    assert np.hypot(first.north, first.east) <= 1.0
    assert not log.states[back + 5].released.any()
    assert (weights(log, back + 5)[[0, 1, 2, 4, 5], 3] > 0).all()
    assert "vehicle 4 was taken over" in log.end.problem


def test_what_is_taken_back_in_flight_goes_on_from_how_fast_it_is():
    back = MIDDLE + 10
    dashes = {MIDDLE: pilot("position"), back: lambda fleet: fleet.set("velocity_ned", 4, (4.0, 0.0, 0.0))}
    log = Log(Fleet(happens=dashes), events=said((back, take_back(4))))
    first = next(command for tick, command in log.to(4) if tick == back and isinstance(command, SetVelocity))
    assert np.hypot(first.north - 4.0, first.east) <= 1.001


def test_nobody_asks_a_vehicle_of_somebody_elses_for_more_positions():
    thin = {MIDDLE: pilot("position"), MIDDLE + 1: lambda fleet: fleet.set("interval_s", 4, 1.0)}
    assert sent_after(Log(Fleet(happens=thin)), 4, MIDDLE) == []
    ours = {MIDDLE + 1: lambda fleet: fleet.set("interval_s", 4, 1.0)}
    assert RequestStream in {type(command) for _, command in sent_after(Log(Fleet(happens=ours)), 4, MIDDLE)}


def test_what_a_pilot_does_not_give_is_not_taken():
    """For some seconds it is asked; then it is his."""
    back = MIDDLE + 5
    keeps = {tick: pilot("position") for tick in range(MIDDLE, MIDDLE + 200)}
    log = Log(Fleet(happens=keeps), events=said((back, take_back(4))), **{"mission.leg.1.length_m": 12})
    asked = sent_after(log, 4, back)
    assert asked[-1][0] < back + RETURNS_S / PERIOD_S
    assert log.states[-1].released[3]


@pytest.mark.parametrize(
    "happens",
    [lambda fleet: fleet.disarm(4), lambda fleet: fleet.reboot(4)],
    ids=["disarmed", "rebooted"],
)
def test_a_vehicle_on_the_ground_is_not_taken_back(happens):
    log = Log(Fleet(happens={MIDDLE: happens}), events=said((MIDDLE + 5, take_back(4))))
    assert sent_after(log, 4, MIDDLE) == []


@pytest.mark.parametrize("word", [take_back(4), take_back(9), "take back 4 please", kill(9)])
def test_words_that_concern_nobody_change_nothing(word):
    assert Log(Fleet(), events=said((MIDDLE, word))).commands == NOMINAL.commands


@pytest.mark.parametrize("tick", range(AT[Phase.CLIMB] + 3, AT[Phase.DONE] - 20, 13))
def test_whenever_a_pilot_takes_a_vehicle_nothing_is_asked_of_it_any_more(tick):
    log = Log(Fleet(happens={tick: pilot("altitude")}))
    assert sent_after(log, 4, tick) == []
    assert "vehicle 4 was taken over by another (altitude)" in log.end.problem
    assert log.end.done


# --- hold, land, kill


@pytest.mark.parametrize("phase", [*BEFORE, Phase.MISSION], ids=by_name)
def test_hold_ends_the_flight_where_it_is_until_somebody_says_land(phase):
    held, landed = AT[phase] + 8, AT[phase] + 60
    log = Log(Fleet(), events=said((held, HOLD), (landed, LAND)))
    assert {d.phase for d in log.diagnoses[held:landed]} == {Phase.HOLD}
    assert all(np.isnan(d.mission_s) for d in log.diagnoses[held:])
    moving = set() if phase is Phase.TAKE_CONTROL else set(EVERYBODY)
    assert {to for to, command in log.commands[held] if isinstance(command, ChangeMode)} == moving
    sent = [c for commands in log.commands[held:landed] for _, c in commands if isinstance(c, SetVelocity)]
    assert all(velocity.down <= 0 for velocity in sent)
    assert not [c for commands in log.commands[held:landed] for _, c in commands if isinstance(c, (Land, TakeOff))]
    assert {to for to, command in log.commands[landed] if isinstance(command, Land)} == set(EVERYBODY)
    assert log.end.done
    assert log.end.problem is None


def test_a_vehicle_that_does_not_hear_of_hold_is_asked_to_stand_still():
    log = Log(Fleet(misses={ChangeMode: MIDDLE}), events=said((MIDDLE, HOLD), (MIDDLE + 30, LAND)))
    assert log.ticks_of(ChangeMode, 4)[-3:] == [MIDDLE, MIDDLE + 10, MIDDLE + 20]
    still = [c[:3] for commands in log.commands[MIDDLE + 3 :] for _, c in commands if isinstance(c, SetVelocity)]
    assert len(still) == 27 * 6
    assert set(still) == {(0.0, 0.0, 0.0)}


def test_holding_ends_when_its_time_is_up():
    log = Log(Fleet(), events=said((MIDDLE, HOLD)), **{"time.timeout_s": 30})
    assert log.phases()[-3:] == [Phase.HOLD, Phase.LAND, Phase.DONE]
    assert "time.timeout_s = 30 s" in log.end.problem


def test_a_vehicle_that_comes_down_by_itself_while_others_hold_is_not_stopped():
    log = Log(Fleet(happens={MIDDLE + 20: pilot("land")}), events=said((MIDDLE, HOLD), (MIDDLE + 100, LAND)))
    assert sent_after(log, 4, MIDDLE + 20) == []
    assert log.end.problem is None


@pytest.mark.parametrize("first", [HOLD, LAND])
def test_land_wins_over_hold(first):
    second = LAND if first == HOLD else HOLD
    log = Log(Fleet(), events=lambda tick, _phase: (first, second) if tick == MIDDLE else ())
    assert log.diagnoses[MIDDLE].phase is Phase.LAND
    later = Log(Fleet(), events=said((MIDDLE, LAND), (MIDDLE + 3, HOLD)))
    assert Phase.HOLD not in later.phases()


@pytest.mark.parametrize("phase", [*BEFORE, Phase.MISSION], ids=by_name)
def test_at_the_tick_of_a_landing_there_is_nothing_before_it(phase):
    tick = -(-(AT[phase] + 1) // 10) * 10  # a whole second, at which heartbeats go too
    log = Log(Fleet(), events=said((tick, LAND)))
    assert [type(command) for _, command in log.commands[tick]][:6] == [Land] * 6
    assert not [command for _, command in log.commands[tick] if isinstance(command, SetVelocity)]


@pytest.mark.parametrize("phase", [Phase.JOIN, *BEFORE, Phase.MISSION, Phase.LAND], ids=by_name)
def test_kill_goes_out_at_once_and_first_in_every_phase(phase):
    tick = AT[phase] + (3 if phase is not Phase.JOIN else 0)
    log = Log(Fleet(), events=said((tick, kill(4))))
    assert log.commands[tick][0] == (4, Kill())
    assert log.ticks_of(Kill) == [tick]
    assert [to for commands in log.commands for to, command in commands if isinstance(command, Kill)] == [4]
    assert [sent for sent in sent_after(log, 4, tick) if not isinstance(sent[1], Kill)] == []
    assert "the operator stopped the rotors of vehicle 4" in log.end.problem
    assert log.end.done


def test_kill_is_said_again_until_the_rotors_stand():
    stands = {MIDDLE + 35: lambda fleet: fleet.disarm(4)}
    log = Log(Fleet(happens=stands, misses={Kill: 0}), events=said((MIDDLE, kill(4))))
    patience = round(RETRY_S / PERIOD_S)
    assert log.ticks_of(Kill) == [MIDDLE, MIDDLE + patience, MIDDLE + 2 * patience, MIDDLE + 3 * patience]


def test_who_was_killed_may_be_armed_by_others_later_and_is_left_alone():
    again = {MIDDLE + 20: lambda fleet: fleet.set("armed", 4, True)}
    log = Log(Fleet(happens=again), events=said((MIDDLE, kill(4))))
    assert log.ticks_of(Kill) == [MIDDLE]
    assert sent_after(log, 4, MIDDLE + 1) == []


def test_the_others_fly_on_without_who_was_killed():
    log = Log(Fleet(), events=said((MIDDLE, kill(4))))
    assert log.first(Phase.LAND) == AT[Phase.LAND]
    assert (weights(log, MIDDLE)[[0, 1, 2, 4, 5], 3] == 0).all()


# --- a loop that is late, or stood still


@pytest.mark.parametrize("late_s", [LATE_PERIODS * PERIOD_S, LATE_PERIODS * PERIOD_S + 0.01])
def test_a_tick_that_comes_two_periods_late_asks_nobody_to_move(late_s):
    log = Log(Fleet(), late={MIDDLE: late_s})
    verdict = log.diagnoses[MIDDLE].verdict
    speed, before = (np.hypot(*log.states[tick].sent_ned[:, :2].T) for tick in (MIDDLE, MIDDLE - 1))
    if late_s > LATE_PERIODS * PERIOD_S:
        assert (verdict == REFUSED).all()
        assert speed == pytest.approx(np.maximum(before - 1.0, 0.0), abs=1e-5)
    else:
        assert not (verdict == REFUSED).any()
    assert log.end.problem is None
    assert log.first(Phase.LAND) == AT[Phase.LAND]


@pytest.mark.parametrize("phase", [*BEFORE, Phase.MISSION], ids=by_name)
def test_a_loop_that_stood_still_for_two_seconds_holds_and_does_not_go_on_by_itself(phase):
    tick = AT[phase] + 8
    log = Log(Fleet(), late={tick: STOOD_NS / 1e9 + 0.5}, events=said((tick + 80, LAND)))
    assert {d.phase for d in log.diagnoses[tick : tick + 80]} == {Phase.HOLD}
    assert "the ground station stood still for 2." in log.end.problem
    assert "the swarm was told to hold" in log.end.problem
    assert log.end.done


def test_what_vehicles_do_by_themselves_while_we_stood_still_is_not_held_against_them():
    def failsafe(fleet):
        for system in EVERYBODY:
            fleet.pilot(system, "hold")

    log = Log(Fleet(happens={MIDDLE: failsafe}), late={MIDDLE: 3.0}, events=said((MIDDLE + 80, LAND)))
    assert not log.end.released.any()
    assert {to for to, command in log.commands[MIDDLE + 80] if isinstance(command, Land)} == set(EVERYBODY)


def test_a_loop_that_stood_still_on_the_ground_or_in_landing_goes_on():
    for phase in (Phase.JOIN, Phase.LAND):
        log = Log(Fleet(), late={AT[phase] + 1: 5.0}) if phase is Phase.LAND else Log(Fleet(), late={0: 5.0})
        assert log.end.problem is None
        assert log.phases() == NOMINAL.phases()


# --- the fence

FENCE = {"limits.fence.radius_m": 25, "limits.fence.ceiling_m": 14, "limits.fence.floor_m": 2}


def blown(system, position):
    return lambda fleet: fleet.set("position_ned", system, position)


def test_a_fence_that_holds_the_mission_changes_nothing():
    assert Log(Fleet(), **FENCE).commands == NOMINAL.commands


@pytest.mark.parametrize(
    ("place", "lands"),
    [
        ((25.0 + BREACH_M + 0.1, 7.5, -10.0), True),
        ((25.0 + BREACH_M - 0.5, 7.5, -10.0), False),
        ((3.0, 7.5, -14.0 - BREACH_M - 0.1), True),
        ((3.0, 7.5, -14.0 - BREACH_M + 0.1), False),
    ],
    ids=["far out", "out by little", "high", "high by little"],
)
def test_a_vehicle_outside_its_fence_brings_all_down(place, lands):
    log = Log(Fleet(happens={MIDDLE: blown(4, place)}), **FENCE)
    assert (log.diagnoses[MIDDLE].phase is Phase.LAND) == lands
    if lands:
        assert "vehicle 4 was " in log.end.problem
        assert "m outside the fence" in log.end.problem
        assert log.end.done


def test_a_vehicle_outside_the_fence_that_is_a_pilots_is_his_affair():
    there = blown(4, (60.0, 0.0, -10.0))
    log = Log(Fleet(happens={MIDDLE: pilot("position"), MIDDLE + 5: there}), **FENCE)
    assert log.first(Phase.LAND) == AT[Phase.LAND]


@pytest.mark.parametrize("system", [1, 5])
def test_who_is_pushed_outwards_is_never_asked_to_leave_its_fence(system):
    """It flies at 1 m/s or more: as hard as the limits allow, it turns back."""
    log = Log(Fleet(happens={MIDDLE: blown(system, (24.9, 7.5, -10.0))}), **FENCE)
    before, after = (log.states[tick].sent_ned[system - 1, :2] for tick in (MIDDLE - 1, MIDDLE))
    assert np.hypot(*before) > 1.0
    assert np.hypot(*(after - before)) == pytest.approx(1.0, abs=0.01)
    places = np.array([d.position_ne[system - 1] for d in log.diagnoses[MIDDLE:]])
    take_off = np.array([-0.75 * 2 * 1.5, 0.0])  # from where the first leg begins, a run-up of 2 s later
    assert np.hypot(*(places - take_off).T).max() < 25.0


# --- silence


def test_weight_goes_after_three_tenths_of_a_second_and_set_points_after_one():
    log = Log(Fleet(silent={4: MIDDLE}))
    for age in range(1, 16):
        tick = MIDDLE - 1 + age
        heeded = weights(log, tick)[[0, 1, 2, 4, 5], 3]
        assert (heeded > 0).all() == (age <= 3)
        assert (heeded == 0).all() == (age > 3)
        assert (4 in {to for to, command in log.commands[tick] if isinstance(command, SetVelocity)}) == (age <= 10)
        assert (log.states[tick].problem is not None) == (age > 10)


def test_a_word_lost_for_a_moment_is_no_event():
    log = Log(Fleet(silent={4: (MIDDLE, MIDDLE + 5)}))
    assert log.end.problem is None
    assert (weights(log, MIDDLE + 6)[[0, 1, 2, 4, 5], 3] > 0).all()


# --- who takes no part is still in the way


def closest(log, system, since):
    """m, horizontal, between one vehicle and the nearest other at each tick: the fleet's own places."""
    places = np.array([d.position_ne for d in log.diagnoses[since : AT[Phase.LAND]]])
    apart = np.hypot(*np.moveaxis(places - places[:, [system - 1]], 2, 0))
    return np.delete(apart, system - 1, axis=1).min(axis=1)


def test_the_swarm_keeps_clear_of_a_vehicle_that_a_pilot_holds_in_its_way():
    """Vehicle 2 hovers where vehicle 3 is about to fly, which would pass it at 0.63 m if it did not heed it."""

    def hovers(fleet):
        fleet.pilot(2, "position")
        fleet.set("position_ned", 2, (4.6 + 2.25, 5.3 + 7.5, -10.0))  # north and east of the pads' origin

    log = Log(Fleet(happens={MIDDLE: hovers}))
    assert (weights(log, MIDDLE + 5)[[0, 2, 3, 4, 5], 1] == 0).all()
    assert closest(log, 2, MIDDLE + 1).min() > 0.7


def test_a_silent_vehicle_is_thought_to_fly_on_for_half_a_second_and_is_forgotten_after_ten():
    fleet = Fleet().heard(0, START)
    armed = replace(fleet, armed=np.ones(6, bool), velocity_ned=np.tile((1.0, 2.0, 0.0), (6, 1)))
    up = replace(armed, position_ned=fleet.position_ned - np.array([0.0, 0.0, 10.0]))
    heard, place = np.arange(6) != 3, fleet.position_ned[:, :2]

    def thought(swarm, age_s):
        return losses.beside_ne(swarm, place, heard, START + round(age_s * 1e9), altitude_m=10.0)

    for age_s, on_s in ((0.3, 0.3), (0.5, 0.5), (2.0, 0.5), (10.0, 0.5)):
        there = thought(up, age_s)
        assert there[3] == pytest.approx(place[3] + on_s * np.array([1.0, 2.0]))
        assert np.isnan(np.delete(there, 3, axis=0)).all()
    assert thought(up, 10.1) is None
    assert thought(armed, 0.4) is None  # it has come down
    assert thought(replace(up, armed=np.zeros(6, bool)), 0.4) is None
