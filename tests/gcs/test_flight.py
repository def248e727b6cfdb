"""The flight as a state machine, against a fleet that is a few arrays and does as it is told."""

import numpy as np
import pytest
from obedient import EVERYBODY, HEIGHT, PERIOD_S, START, Fleet, Log

from gcs.commands import Arm, Beat, ChangeMode, Land, RequestStream, SetVelocity, TakeOff
from gcs.flight import LANDING_S, PATIENCE_S
from gcs.flight_state import Phase

NOMINAL = Log(Fleet())


def test_a_flight_goes_through_its_phases_once_and_ends_without_a_problem():
    assert NOMINAL.phases() == [phase for phase in Phase if phase is not Phase.HOLD]
    assert NOMINAL.end.problem is None
    assert NOMINAL.end.done


def test_mission_time_is_zero_at_mission_start_and_the_read_out_ends_it():
    began, landed = NOMINAL.first(Phase.MISSION), NOMINAL.first(Phase.LAND)
    assert NOMINAL.diagnoses[began].mission_s == 0.0
    assert landed - began == pytest.approx(NOMINAL.flight.plan.read_out_s / PERIOD_S, abs=1)


def test_the_ground_station_is_alive_twice_a_second_to_everybody_from_first_to_last():
    beats = NOMINAL.ticks_of(Beat)
    assert beats == list(range(0, len(NOMINAL.commands), 5))
    assert [to for to, command in NOMINAL.commands[0] if isinstance(command, Beat)] == list(EVERYBODY)


def test_one_step_follows_the_other_as_soon_as_it_has_been_obeyed():
    assert NOMINAL.ticks_of(RequestStream) == [0]
    assert NOMINAL.ticks_of(Arm) == [1]
    assert NOMINAL.ticks_of(TakeOff) == [2]


def test_set_points_flow_for_a_second_before_offboard_is_asked_for():
    first, asked = NOMINAL.ticks_of(SetVelocity)[0], NOMINAL.ticks_of(ChangeMode)[0]
    assert (asked - first) * PERIOD_S >= 1.0
    flowing = NOMINAL.ticks_of(SetVelocity)
    assert flowing == list(range(first, NOMINAL.first(Phase.LAND)))


def test_no_set_point_before_control_is_taken_or_while_landing():
    for tick in NOMINAL.ticks_of(SetVelocity):
        assert NOMINAL.diagnoses[tick].phase in (Phase.TAKE_CONTROL, Phase.RUN_UP, Phase.MISSION)


def test_everybody_is_asked_to_land_once_and_the_flight_ends_when_they_are_down():
    (asked,) = NOMINAL.ticks_of(Land)
    assert asked == NOMINAL.first(Phase.LAND)
    assert NOMINAL.first(Phase.DONE) * PERIOD_S == pytest.approx(asked * PERIOD_S + HEIGHT / 2.0, abs=0.3)


def test_vehicles_that_never_speak_are_named_when_joining_has_taken_too_long():
    log = Log(Fleet(silent={3: 0, 6: 0}))
    assert log.phases() == [Phase.JOIN, Phase.DONE]
    assert "vehicles 3, 6: a heartbeat of" in log.end.problem
    assert len(log.states) * PERIOD_S == pytest.approx(PATIENCE_S, abs=0.3)
    assert not log.ticks_of(Arm)


def test_nobody_is_asked_for_telemetry_before_being_heard():
    log = Log(Fleet(silent={3: 0}), ticks=30)
    assert log.ticks_of(RequestStream, system=3) == []


def test_arming_is_asked_again_after_a_second_and_not_before():
    log = Log(Fleet(deaf=(2,)), ticks=100)
    again = np.diff(log.ticks_of(Arm, system=2)) * PERIOD_S
    assert len(again) > 5
    assert again == pytest.approx(1.0)
    assert log.ticks_of(Arm, system=1) == [1]


def test_a_vehicle_that_will_not_arm_ends_the_flight_at_its_timeout_and_the_others_land():
    log = Log(Fleet(deaf=(2,)), **{"time.timeout_s": 20})
    assert "time.timeout_s = 20 s" in log.end.problem
    assert log.first(Phase.LAND) * PERIOD_S == pytest.approx(20.0, abs=0.2)
    assert {to for tick in log.ticks_of(Land) for to, c in log.commands[tick] if isinstance(c, Land)} == {1, 3, 4, 5, 6}
    assert log.end.done


def test_a_vehicle_that_does_not_come_down_is_asked_again_and_given_up_in_the_end():
    log = Log(Fleet(landlocked=(4,)))
    asked = log.ticks_of(Land, system=4)
    assert np.diff(asked) * PERIOD_S == pytest.approx(1.0)
    assert f"within {LANDING_S:g} s" in log.end.problem
    assert len(log.ticks_of(Land, system=1)) == 1


@pytest.fixture(scope="module")
def silenced():
    """Vehicle 4 says its last word at the tick before this one."""
    silent_from = NOMINAL.first(Phase.MISSION) + 20
    return Log(Fleet(silent={4: silent_from})), silent_from - 1


def weights(log, tick):
    decision = log.diagnoses[tick].decision
    return decision.graph.dense(decision.weights)


def test_a_silent_vehicle_weighs_nothing_from_three_tenths_of_a_second_on(silenced):
    log, last_word = silenced
    for age in range(30):
        heeded = weights(log, last_word + age)[[0, 1, 2, 4, 5], 3]
        if age <= 3:
            assert (heeded > 0).all()
        else:
            assert (heeded == 0).all()


def test_a_lost_vehicle_gets_no_set_point_after_a_second_and_the_others_fly_on(silenced):
    log, last_word = silenced
    landing = log.first(Phase.LAND)
    assert log.ticks_of(SetVelocity, system=4)[-1] == last_word + 10
    for system in (1, 2, 3, 5, 6):
        assert log.ticks_of(SetVelocity, system=system)[-1] == landing - 1
    assert landing == NOMINAL.first(Phase.LAND)


def test_the_problem_names_the_lost_vehicle_and_the_rest_land(silenced):
    log, last_word = silenced
    assert "vehicle 4 fell silent" in log.end.problem
    noted = next(tick for tick, state in enumerate(log.states) if state.problem is not None)
    assert noted == last_word + 11
    assert log.end.done


def test_a_lost_vehicle_is_still_asked_to_land(silenced):
    log, _ = silenced
    assert log.ticks_of(Land, system=4)[0] == log.first(Phase.LAND)


@pytest.mark.parametrize("phase", [Phase.CLIMB, Phase.TAKE_CONTROL, Phase.RUN_UP], ids=lambda p: p.name)
def test_a_fleet_that_loses_a_vehicle_before_its_mission_lands(phase):
    silent_from = NOMINAL.first(phase) + 1
    log = Log(Fleet(silent={4: silent_from}))
    assert log.first(Phase.LAND) == silent_from + 10
    assert log.end.problem.startswith(f"vehicle 4 fell silent while {phase.value}")
    assert Phase.MISSION not in log.phases()
    assert log.ticks_of(SetVelocity, system=4)[-1:] < [silent_from + 10]


def test_a_vehicle_that_falls_silent_while_landing_leaves_the_flight_incomplete():
    log = Log(Fleet(silent={4: NOMINAL.first(Phase.LAND) + 10}, landlocked=(4,)))
    assert log.end.problem == "vehicle 4 fell silent before landing"
    assert log.end.done


def test_a_vehicle_that_is_silent_because_it_has_landed_is_no_problem():
    low = {NOMINAL.first(Phase.LAND): lambda fleet: fleet.set("position_ned", 4, (0.0, 9.0, -3.0))}
    log = Log(Fleet(happens=low, silent={4: NOMINAL.first(Phase.DONE) - 15}))
    assert log.end.problem is None


def test_a_vehicle_that_leaves_our_mode_is_released_at_once_and_weighs_nothing():
    leaves = NOMINAL.first(Phase.MISSION) + 20
    log = Log(Fleet(happens={leaves: lambda fleet: fleet.pilot(2, "hold")}))
    assert log.ticks_of(SetVelocity, system=2)[-1] == leaves - 1
    assert (weights(log, leaves)[[0, 2, 3, 4, 5], 1] == 0).all()
    assert "vehicle 2 left the ground station's control" in log.end.problem
    assert [t for t in log.ticks_of(ChangeMode) if t >= leaves] == []
    assert log.phases() == NOMINAL.phases()


@pytest.mark.parametrize(
    "phase", [Phase.JOIN, Phase.CLIMB, Phase.TAKE_CONTROL, Phase.RUN_UP, Phase.MISSION], ids=lambda p: p.name
)
def test_an_operator_lands_the_fleet_from_every_phase(phase):
    fleet = Fleet(silent={6: 0}) if phase is Phase.JOIN else Fleet()
    asked = 5 if phase is Phase.JOIN else NOMINAL.first(phase) + 5
    log = Log(fleet, events=lambda tick, _phase: ("land",) if tick == asked else ())
    assert log.diagnoses[asked - 1].phase is phase
    assert log.diagnoses[asked].phase in (Phase.LAND, Phase.DONE)
    assert log.end.done
    assert log.end.problem is None
    assert not fleet.heard(10_000, START).armed.any()
    assert log.ticks_of(SetVelocity)[-1:] < [asked]


def test_a_mission_given_up_has_no_clock_any_more_and_so_no_score():
    asked = NOMINAL.first(Phase.MISSION) + 5
    log = Log(Fleet(), events=lambda tick, _phase: ("land",) if tick == asked else ())
    assert log.diagnoses[asked - 1].mission_s == pytest.approx(0.4)
    assert all(np.isnan(diagnosis.mission_s) and diagnosis.virtual is None for diagnosis in log.diagnoses[asked:])


def test_landing_asked_for_twice_is_landing_once():
    asked = NOMINAL.first(Phase.MISSION) + 5
    log = Log(Fleet(), events=lambda tick, _phase: ("land",) if tick in (asked, asked + 3) else ())
    assert log.ticks_of(Land) == [asked]


def test_height_is_held_and_every_set_point_is_a_number_within_the_limits():
    for tick in NOMINAL.ticks_of(SetVelocity):
        velocities = np.array(
            [(c.north, c.east, c.down) for _, c in NOMINAL.commands[tick] if isinstance(c, SetVelocity)]
        )
        assert np.isfinite(velocities).all()
        assert np.hypot(velocities[:, 0], velocities[:, 1]).max() <= 5.0 + 1e-9


def test_the_heading_asked_for_is_the_way_the_swarm_goes():
    began, ends = NOMINAL.first(Phase.MISSION), NOMINAL.first(Phase.LAND) - 1

    def yaw(tick):
        return np.degrees(next(c.yaw for _, c in NOMINAL.commands[tick] if isinstance(c, SetVelocity)))

    assert yaw(began) == pytest.approx(0.0, abs=1e-9)
    assert yaw(ends) == pytest.approx(60.0)


def test_a_flight_decides_the_same_from_the_same():
    again = Log(Fleet())
    assert again.commands == NOMINAL.commands
