"""What a link hides from a flight: heartbeats a second apart, words lost, vehicles and whole fleets cut off."""

from dataclasses import replace

import pytest
from obedient import EVERYBODY, HEIGHT, MODES, PERIOD_NS, PERIOD_S, Fleet, Log

from gcs.asking import RETRY_S
from gcs.autopilots.fleet import HEARD_NS
from gcs.commands import Arm, ChangeMode, Kill, Land, SetVelocity
from gcs.events import HOLD, LAND, kill, take_back
from gcs.flight import GIVEN_UP_NS, LANDING_S, PATIENCE_S
from gcs.flight_state import Phase
from gcs.gate import LOST_NS, WITHHELD
from gcs.hands import FAR, MUTE_NS, RETURNS_S
from gcs.watch import BREACH_M

BEAT = 10
"""Ticks between two heartbeats of a vehicle: a second."""
NOMINAL = {autopilot: Log(Fleet(beat=BEAT, autopilot=autopilot)) for autopilot in MODES}
AT = {phase: NOMINAL["px4"].first(phase) for phase in Phase if phase is not Phase.HOLD}
MIDDLE, LANDS = AT[Phase.MISSION] + 20, AT[Phase.LAND]
RETRY = round(RETRY_S / PERIOD_S)
LONG = {"mission.leg.1.length_m": 15}
FENCE = {"limits.fence.radius_m": 25, "limits.fence.ceiling_m": 14, "limits.fence.floor_m": 2}
OTHERS = [0, 1, 2, 4, 5]


def said(*words):
    at = dict(words)
    return lambda tick, _phase: (at[tick],) if tick in at else ()


def pilot(mode, system=4):
    return lambda fleet: fleet.pilot(system, mode)


def sent_after(log, tick, system=4):
    return [sent for sent in log.to(system) if sent[0] >= tick]


def heeded(log, tick, system=4):
    decision = log.diagnoses[tick].decision
    return bool((decision.graph.dense(decision.weights)[OTHERS, system - 1] > 0).any())


def landed(log):
    return not log.swarms[-1].armed.any()


@pytest.mark.parametrize("autopilot", MODES)
def test_a_flight_with_heartbeats_a_second_apart_takes_its_course(autopilot):
    log = NOMINAL[autopilot]
    assert log.phases() == [phase for phase in Phase if phase is not Phase.HOLD]
    assert log.end.problem is None
    assert landed(log)


# --- landing is asked for until it is done


def test_a_landing_is_asked_for_until_the_link_is_back():
    log = Log(Fleet(beat=BEAT, apart=(MIDDLE, MIDDLE + 45)), events=said((MIDDLE + 5, LAND)))
    assert log.ticks_of(Land, 4)[:5] == [MIDDLE + 5 + RETRY * turn for turn in range(5)]
    assert landed(log)
    assert log.end.problem is None


def test_one_that_is_silent_in_landing_is_waited_for_half_a_minute_and_then_named():
    back = LANDS + 200
    found = Log(Fleet(beat=BEAT, silent={4: (LANDS, back)}))
    assert found.end.problem is None
    assert found.first(Phase.DONE) - back <= BEAT
    lost = Log(Fleet(beat=BEAT, silent={4: LANDS}))
    assert lost.end.problem == "vehicle 4 fell silent before landing"
    assert lost.first(Phase.DONE) - LANDS == GIVEN_UP_NS // PERIOD_NS
    assert GIVEN_UP_NS < LANDING_S * 1e9


def test_who_was_not_seen_to_land_is_named_beside_what_went_wrong_before():
    log = Log(Fleet(beat=BEAT, silent={2: LANDS}, happens={MIDDLE: pilot("position")}))
    assert log.end.problem.startswith("vehicle 4 was taken over by another (position) ")
    assert log.end.problem.endswith("; vehicle 2 fell silent before landing")


def test_a_kill_that_is_lost_on_its_way_in_landing_is_repeated():
    tick, heard = LANDS + 3, LANDS + 95
    log = Log(Fleet(landlocked=(4,), misses={Kill: (0, heard)}), events=said((tick, kill(4))))
    assert log.ticks_of(Kill) == list(range(tick, heard + RETRY + 1, RETRY))
    assert landed(log)


# --- taken back, from wherever it was taken

TAKEN = {
    "px4": ("position", "hold", "land", "return"),
    "ardupilot": ("loiter", "brake", "land", "return"),
}
FROM = [(autopilot, mode) for autopilot, modes in TAKEN.items() for mode in modes]


@pytest.mark.parametrize(("autopilot", "mode"), FROM)
def test_a_vehicle_is_taken_back_from_any_mode(autopilot, mode):
    back = MIDDLE + 15
    fleet = Fleet(beat=BEAT, autopilot=autopilot, happens={MIDDLE: pilot(mode)})
    log = Log(fleet, events=said((back, take_back(4))), **LONG)
    assert log.states[back - 1].released[3]
    assert not any(state.released[3] for state in log.states[back:])
    assert not heeded(log, back - 1)
    assert heeded(log, back + BEAT + 2)
    assert log.ticks_of(ChangeMode, 4)[-1] == back
    assert log.ticks_of(SetVelocity, 4)[-1] == log.first(Phase.LAND) - 1
    assert landed(log)


@pytest.mark.parametrize("mode", ["position", "hold", "land"])
def test_what_a_pilot_keeps_is_his_after_five_seconds(mode):
    back = MIDDLE + 5
    keeps = {tick: pilot(mode) for tick in range(MIDDLE, MIDDLE + 200)}
    keeps |= {MIDDLE + 1: lambda fleet: (pilot(mode)(fleet), fleet.set("position_ned", 4, (3.0, 9.0, -10.0)))}
    log = Log(Fleet(happens=keeps), events=said((back, take_back(4))), **LONG)
    his = back + round(RETURNS_S / PERIOD_S) - 1
    assert [state.released[3] for state in log.states[his - 1 : his + 2]] == [False, True, True]
    assert sent_after(log, his) == []


def test_a_vehicle_that_stops_its_rotors_while_it_is_taken_back_is_let_go_at_once():
    back = MIDDLE + 5
    keeps = {tick: pilot("position") for tick in range(MIDDLE, back + 6)}
    log = Log(Fleet(happens=keeps | {back + 6: lambda fleet: fleet.disarm(4)}), events=said((back, take_back(4))))
    assert sent_after(log, back + 6) == []


def test_a_vehicle_taken_back_on_its_way_down_holds_with_the_others():
    words = said((MIDDLE + 12, HOLD), (MIDDLE + 20, take_back(4)), (MIDDLE + 60, LAND))
    log = Log(Fleet(beat=BEAT, happens={MIDDLE: pilot("land")}), events=words)
    assert log.ticks_of(ChangeMode, 4)[-1] == MIDDLE + 20
    assert log.swarms[MIDDLE + 59].position_ned[3, 2] < -5.0
    assert landed(log)


# --- before anybody flies


@pytest.mark.parametrize("word", [kill(4), LAND, HOLD])
def test_words_that_end_a_flight_end_it_at_once_while_it_joins_and_land_nobody(word):
    """Whoever is armed by then has a pilot."""
    armed = {2: lambda fleet: fleet.set("armed", 3, True)}
    log = Log(Fleet(silent={6: 0}, happens=armed), events=said((5, word)))
    assert log.phases() == [Phase.JOIN, Phase.DONE]
    assert len(log.states) == 6
    assert not [command for _, command in sent_after(log, 5, 3) if isinstance(command, (Land, ChangeMode))]
    assert ("vehicle 4 while joining" in (log.end.problem or "")) == (word == kill(4))


@pytest.mark.parametrize(("autopilot", "mode"), [("px4", "position"), ("ardupilot", "stabilize")])
def test_a_pilot_who_arms_before_we_do_keeps_his_vehicle(autopilot, mode):
    tick = NOMINAL[autopilot].first(Phase.CLIMB) + 5

    def arms(fleet):
        fleet.pilot(4, mode)
        fleet.set("armed", 4, True)

    log = Log(Fleet(autopilot=autopilot, deaf=(4,), happens={tick: arms}))
    assert sent_after(log, tick) == []
    assert log.end.problem == f"vehicle 4 was taken over by another ({mode}) while taking off"


@pytest.mark.parametrize(("low_m", "his"), [(FAR - 0.2, False), (FAR + 0.2, True)])
def test_only_a_climb_that_ends_far_below_was_stopped_by_somebody(low_m, his):
    height = [-swarm.position_ned[3, 2] for swarm in Log(Fleet(), ticks=MIDDLE).swarms]
    tick = next(tick for tick, at in enumerate(height) if at > HEIGHT - low_m - 0.1)
    assert height[tick] == pytest.approx(HEIGHT - low_m)
    log = Log(Fleet(happens={tick: pilot("hold")}))
    assert log.states[tick].released[3] == his
    assert (Phase.MISSION in log.phases()) != his


def test_a_climb_that_takes_too_long_ends_and_tells_whose():
    log = Log(Fleet(deaf=(2,)))
    assert (log.first(Phase.LAND) - AT[Phase.CLIMB]) * PERIOD_S == pytest.approx(PATIENCE_S + HEIGHT, abs=0.2)
    assert log.end.problem == f"taking off took longer than {PATIENCE_S + HEIGHT:g} s: vehicle 2: not armed"
    assert landed(log)


def test_taking_control_in_vain_ends_and_tells_of_whom():
    log = Log(Fleet(misses={ChangeMode: AT[Phase.TAKE_CONTROL]}))
    assert log.end.problem == (
        f"taking control took longer than {PATIENCE_S:g} s: vehicles 1, 2, 3, 4, 5, 6: not flying our set-points"
    )
    assert landed(log)


# --- hold


@pytest.mark.parametrize(("autopilot", "mode"), [("px4", "offboard"), ("ardupilot", "guided")])
def test_what_another_station_steers_while_we_hold_is_its_own(autopilot, mode):
    taken = MIDDLE + 25
    fleet = Fleet(beat=BEAT, autopilot=autopilot, happens={taken: pilot(mode)})
    log = Log(fleet, events=said((MIDDLE, HOLD), (MIDDLE + 60, LAND)))
    assert sent_after(log, taken) == []
    assert log.end.problem == f"vehicle 4 left the ground station's control ({mode}) while holding"


# --- heartbeats and positions are two things


def test_who_does_not_tell_its_mode_weighs_nothing_and_then_gets_nothing():
    log = Log(Fleet(mute={4: MIDDLE}), **LONG)
    unsure, mute = MIDDLE - 1 + HEARD_NS // PERIOD_NS, MIDDLE - 1 + MUTE_NS // PERIOD_NS
    assert [heeded(log, tick) for tick in (unsure, unsure + 1)] == [True, False]
    assert sent_after(log, mute + 1) == []
    assert log.ticks_of(SetVelocity, 4)[-1] == mute
    assert log.end.problem.startswith("vehicle 4 does not tell its mode any more ")


def test_heartbeats_lost_for_a_while_are_no_event():
    log = Log(Fleet(beat=BEAT, mute={4: (MIDDLE, MIDDLE + 40)}), **LONG)
    assert log.end.problem is None
    assert heeded(log, MIDDLE + 60)


def test_before_the_mission_one_that_does_not_tell_its_mode_brings_the_others_down():
    log = Log(Fleet(mute={4: AT[Phase.CLIMB] + 20}))
    assert log.first(Phase.LAND) == AT[Phase.CLIMB] + 20 + MUTE_NS // PERIOD_NS
    assert Phase.MISSION not in log.phases()


@pytest.mark.parametrize("meanwhile", ["land", "return", "offboard"])
def test_who_is_heard_again_is_not_ours_before_its_heartbeat(meanwhile):
    silence = MIDDLE, MIDDLE + 22
    log = Log(Fleet(beat=BEAT, silent={4: silence}, happens={MIDDLE + 5: pilot(meanwhile)}), **LONG)
    beats = next(t for t in range(silence[1] + 1, MIDDLE + 60) if (t + 4) % BEAT == 0)
    assert beats > silence[1] + 1
    for tick in range(MIDDLE + 3, beats):
        assert not heeded(log, tick)
        assert tick <= MIDDLE + LOST_NS // PERIOD_NS or log.diagnoses[tick].verdict[3] == WITHHELD
    assert sent_after(log, silence[1]) == []


def test_a_vehicle_that_a_pilot_flies_is_no_evidence_for_its_trust():
    def strays(fleet):
        fleet.set("velocity_ned", 4, (-4.0, -4.0, 0.0))

    happens = {MIDDLE: pilot("position")} | dict.fromkeys(range(MIDDLE + 1, MIDDLE + 80), strays)
    log = Log(Fleet(happens=happens), **LONG, **{"trust.source": "auto"})
    before, after = (log.diagnoses[tick].trust[3] for tick in (MIDDLE, MIDDLE + 60))
    assert after == before


@pytest.mark.parametrize(("age_ns", "lands"), [(0, True), (2 * LOST_NS, False)])
def test_a_place_outside_the_fence_that_is_long_ago_ends_nothing(age_ns, lands):
    log = Log(Fleet(), **FENCE)
    swarm, now_ns = log.swarms[MIDDLE], log.states[MIDDLE].now_ns
    place, told = swarm.position_ned.copy(), swarm.position_ns.copy()
    place[3, 0], told[3] = 25.0 + 2 * BREACH_M, now_ns - age_ns
    state, _, _ = log.flight(
        log.states[MIDDLE - 1], replace(swarm, position_ned=place, position_ns=told), (), now_ns
    )  # fmt: skip
    assert (state.phase is Phase.LAND) == lands


# --- a gap of our own is nobody's hand


GAPS = {
    "the loop stood still": {"late": {MIDDLE: 1.0}},
    "nobody was heard": {"apart": (MIDDLE, MIDDLE + 5)},
    "nobody was heard for long": {"apart": (MIDDLE, MIDDLE + 30)},
}


def cut_off(how, **more):
    changes = {"beat": BEAT, **GAPS[how], **more}
    late, events = changes.pop("late", None), said((MIDDLE + 48, LAND))
    return Log(Fleet(**changes), late=late, events=events, **LONG)


@pytest.mark.parametrize("how", GAPS)
def test_vehicles_that_hold_because_we_were_cut_off_are_still_ours(how):
    log = cut_off(how)
    assert not log.end.released.any()
    assert log.phases()[-3:] == [Phase.HOLD, Phase.LAND, Phase.DONE]
    assert {to for tick in log.ticks_of(Land) for to, c in log.commands[tick] if isinstance(c, Land)} == set(EVERYBODY)
    assert log.end.problem.count("vehicle") == 1
    assert landed(log)


def test_where_nobody_says_land_they_do_it_by_themselves_and_the_flight_waits():
    log = Log(Fleet(beat=BEAT, apart=(MIDDLE, MIDDLE + 5)), **LONG)
    assert log.phases()[-2:] == [Phase.HOLD, Phase.DONE]
    assert landed(log)


def test_they_are_named_once_with_the_reason():
    log = Log(Fleet(), late={MIDDLE: 1.0}, events=said((MIDDLE + 100, LAND)))
    into_s = (MIDDLE - log.first(Phase.MISSION)) * PERIOD_S
    assert log.end.problem == (
        f"vehicles 1, 2, 3, 4, 5, 6 did without us, who were cut off, {into_s:.1f} s into the mission: "
        "the swarm was told to hold, and who lands by itself is not stopped"
    )


def test_a_pilot_who_takes_a_vehicle_in_the_gap_keeps_it():
    log = cut_off("nobody was heard", beat=1, happens={MIDDLE + 3: pilot("position")})
    assert log.end.released.tolist() == [False, False, False, True, False, False]
    assert sent_after(log, MIDDLE + 20) == []


def test_where_all_are_lost_for_no_reason_that_we_know_the_flight_waits_until_they_are_down():
    """Set-points do not arrive, and all else does."""
    log = Log(Fleet(beat=BEAT, misses={SetVelocity: MIDDLE}), **LONG)
    assert log.end.released.all()
    assert "none is left to us: gcs land lands whom nobody flies" in log.end.problem
    assert landed(log)
    assert not [tick for tick in log.ticks_of(Land) if tick > MIDDLE]


def test_holding_is_given_as_long_again_as_a_flight():
    log = Log(Fleet(), events=said((MIDDLE, HOLD)), **{"time.timeout_s": 20})
    assert (log.first(Phase.LAND) - MIDDLE) * PERIOD_S == pytest.approx(20.0, abs=0.2)
    assert "holding took longer than time.timeout_s = 20 s" in log.end.problem


def test_nobody_is_armed_who_waits_for_heartbeats_a_second_apart():
    for log in NOMINAL.values():
        assert len(log.ticks_of(Arm, 1)) == 1
