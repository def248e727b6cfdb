"""A recording as arrays over its ticks, and what happened in it."""

import math
import time
from dataclasses import replace

import numpy as np
import orjson
import pytest
from flights import SHORT, Beside, Severed, failing, fly_and_record, recorded, rewritten, told, unended
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gcs.events import LAND, Rating
from gcs.mission import plan
from gcs.recording.happenings import FaultSpan, distrust, phases, row_at, silences
from gcs.recording.history import Kind, load
from gcs.recording.reader import CUT_SHORT, UnreadableRecording, read
from gcs.scoring import score, separation
from scenarios import load as load_scenario
from wire.ids import TRUTH

EMERGENCY = "emergency"


@pytest.fixture(scope="module")
def history():
    return load(recorded(EMERGENCY).path)


def words(history, kind):
    """(row, words) of every happening of a kind."""
    return [(happening.tick, happening.words) for happening in history.happenings if happening.kind is kind]


def test_six_vehicles_are_read_back_in_less_than_a_third_of_a_second():
    path = recorded(EMERGENCY).path
    load(path)
    began = time.process_time()
    load(path)
    assert time.process_time() - began < 0.3


def test_there_is_a_row_for_each_tick(history):
    ticks = told(recorded(EMERGENCY), "/tick")
    assert history.number.tolist() == [tick["number"] for tick in ticks] == list(range(len(ticks)))
    assert history.phase == tuple(tick["phase"] for tick in ticks)
    assert history.frames.tolist() == [tick["frames"] for tick in ticks]
    assert set(np.diff(history.time_ns)) == {100_000_000}
    assert not history.lateness_s.any()


@pytest.mark.parametrize(
    ("topic", "key", "name"),
    [("/truth/pose", "position_m", "position"), ("/trust", "trust", "trust"), ("/weights", "weights", "weights")],
)
def test_what_a_topic_told_stands_at_its_tick_and_nothing_where_it_told_nothing(history, topic, key, name):
    rows = {row["tick"]: row[key] for row in told(recorded(EMERGENCY), topic)}
    values = getattr(history, name)
    for tick, value in rows.items():
        np.testing.assert_array_equal(values[tick], value)
    silent = [tick for tick in range(len(values)) if tick not in rows]
    assert silent
    assert np.isnan(values[silent]).all() or name == "position"


def test_positions_are_the_truth_and_telemetry_is_beside_it(history):
    flying = np.isfinite(history.mission_s)
    apart = np.linalg.norm(history.position - history.reported, axis=-1)[flying]
    assert not history.measured
    assert 0.0 < np.median(apart) < 0.5
    assert (history.position[flying][..., 2] > 0).all()


def test_set_points_are_those_that_were_sent(history):
    flowing = np.isfinite(history.sent_ned).all(axis=(1, 2))
    assert flowing.sum() == len(told(recorded(EMERGENCY), "/setpoint"))
    assert (history.verdict[flowing] >= 0).all()
    assert (history.verdict[~flowing] == -1).all()
    assert np.isnan(history.asked_ned[~flowing]).all()


def test_what_is_told_twice_a_second_is_held_until_it_is_told_again(history):
    battery = history.battery[:, 0]
    states = {row["tick"]: row for row in told(recorded(EMERGENCY), "/uav/1/state")}
    assert battery[13] == battery[10] == states[10]["battery"]
    assert history.armed[:, 0].tolist() == [states[tick - tick % 5]["armed"] for tick in history.number.tolist()]
    assert history.autopilot.tolist() == [12] * 6


def test_its_mission_is_scored_as_the_run_scored_it(history):
    summary = recorded(EMERGENCY).summary
    result = score(history.track, history.scenario)
    assert result.heading_error_deg == summary.heading_error_deg
    assert result.min_separation_m == summary.min_separation_m
    np.testing.assert_array_equal(history.track.position, read(history.path).track.position)
    assert history.summary["passed"] == summary.passed
    assert history.problem is None


def test_phases_the_call_and_the_fault_are_what_one_would_jump_to(history):
    said = [happening.words for happening in history.happenings if happening.kind in (Kind.PHASE, Kind.FAULT)]
    assert said == [
        "joining",
        "taking off",
        "taking control",
        "running up",
        "mission: parking lot inspection",
        "a fault begins: robot 5 at 40% speed",
        "next task: car accident area",
        "landing",
        "done",
    ]
    call = next(happening for happening in history.happenings if "car accident" in happening.words)
    assert call.mission_s == pytest.approx(6.0)
    assert history.time_ns[call.tick] == call.time_ns
    assert history.faults == (FaultSpan(5, "motor_degradation", 0.0, math.inf, "robot 5 at 40% speed"),)


@pytest.fixture(scope="module")
def eventful():
    """A flight in which much happens: people distrust robot 5, robot 2 drags for a while, the operator says land."""

    def severed(link, world):
        return Severed(link, world, system=3, from_s=13.4, to_s=15.6)

    ratings = tuple(Rating(f"op{number}", 5, 1, 0.4 + number / 10) for number in range(1, 4))
    said = iter([(LAND,) if tick == 165 else () for tick in range(10_000)])
    keys = ('trust.source="ratings"', 'fault=[{vehicle=2, kind="motor_degradation", onset_s=1, end_s=2.5}]')
    how = {"through": severed, "ratings": ratings, "events": lambda: next(said), "faults_made": False}
    return fly_and_record("demo", *SHORT, *keys, **how)


@pytest.fixture(scope="module")
def much(eventful):
    return load(eventful.path)


def test_a_fault_that_ends_has_an_end(much):
    assert [(span.vehicle, span.from_s, span.to_s) for span in much.faults] == [(2, 1.0, 2.5)]
    assert [text.split(":")[0] for _, text in words(much, Kind.FAULT)] == ["a fault begins", "a fault ends"]


class Untold(Beside):
    """A link to vehicles that do not tell where they really are, as real ones do not."""

    def receive(self):
        return [frame for frame in super().receive() if frame.component != TRUTH]


def untold(link, world):
    """The same, and robot 4 is not heard from the middle of the mission on."""
    return Untold(Severed(link, world, system=4, from_s=13.0))


DRAGS = ("trust.source=auto", 'fault=[{vehicle=5, kind="motor_degradation", onset_s=1}]')


@pytest.fixture(scope="module")
def blind():
    return fly_and_record("demo", *SHORT, *DRAGS, through=untold, faults_made=False)


def test_where_no_vehicle_tells_its_truth_nobody_knows_what_was_wrong(blind):
    history = load(blind.path)
    assert history.faults_by == "unknown"
    assert (history.faults, history.acted, history.onsets) == ((), (), {})
    assert told(blind, "/truth/fault") == []
    assert (blind.summary.detected, blind.summary.false_alarms) == ({}, 0)


def test_a_fault_that_we_make_ourselves_is_known_whatever_the_vehicles_tell():
    history = load(fly_and_record("demo", *SHORT, *DRAGS, through=untold).path)
    assert (history.measured, history.faults_by) == (True, "made")
    assert history.onsets == {5: 1.0}
    assert [span.words for span in history.acted] == ["robot 5 at 40% speed (from 1 s on)"]


def test_a_simulation_behind_a_link_is_taken_to_fly_the_same_scenario(much):
    assert (much.measured, much.faults_by, much.onsets) == (False, "planned", {2: 1.0})


def test_a_fault_that_begins_after_the_read_out_never_acted(history):
    read_out_s = plan(history.scenario).read_out_s
    late = FaultSpan(2, "frozen_telemetry", read_out_s + 0.05, math.inf, "telemetry of robot 2 frozen")
    assert replace(history, faults=(*history.faults, late)).acted == history.faults
    assert history.onsets == {5: 0.0}
    scenario = load_scenario(EMERGENCY, overrides=[f"fault.0.onset_s={late.from_s}"])
    assert replace(history, scenario=scenario).onsets == {}


def test_where_telemetry_is_all_there_is_a_silent_robot_is_nowhere(blind):
    history = load(blind.path)
    silent = history.age_s[np.isfinite(history.mission_s)][: len(history.track.time_s)] > 1.0
    assert silent[:, 3].any()
    assert not silent[0].any()
    assert np.array_equal(np.isnan(history.track.position).any(axis=2), silent)
    result = score(history.track, history.scenario)
    assert result == score(read(blind.path).track, history.scenario)
    assert result.swarm_heading_error_deg == blind.summary.swarm_heading_error_deg


def test_distrust_is_found_at_the_tick_at_which_trust_was_below_one_half(eventful, much):
    (fell,) = (happening for happening in much.happenings if happening.kind is Kind.DISTRUST)
    assert (fell.vehicle, fell.words) == (5, "robot 5 is distrusted")
    below = [row["tick"] for row in told(eventful, "/trust") if row["trust"][4] < 0.5]
    assert fell.tick == below[0]


def test_ratings_stand_where_they_counted(much):
    rated = [happening for happening in much.happenings if happening.kind is Kind.RATING]
    assert [happening.vehicle for happening in rated] == [5, 5, 5]
    assert [happening.mission_s for happening in rated] == pytest.approx([0.5, 0.6, 0.7])
    assert [rating.rater for rating in much.ratings] == ["op1", "op2", "op3"]


def test_the_operators_word_and_the_autopilots_are_there(much):
    heard = words(much, Kind.WORD)
    assert (165, "the operator says: land") in heard
    assert any("Armed" in text for row, text in heard if row < 60)


def test_a_vehicle_that_falls_silent_is_told_and_when_it_is_heard_again(much):
    (lost, fell), (back, heard) = words(much, Kind.LINK)
    assert (fell, heard) == ("vehicle 3 is silent", "vehicle 3 is heard again")
    silent_s, heard_s = ((much.time_ns[row] - much.time_ns[0]) / 1e9 for row in (lost, back))
    assert silent_s == pytest.approx(14.4, abs=0.21)
    assert heard_s == pytest.approx(15.6, abs=0.21)


def test_a_vehicle_that_is_not_ours_any_more_is_told(much):
    ((row, said),) = words(much, Kind.HANDS)
    assert said == "vehicle 3 is not ours any more: nothing is sent to it"
    assert row >= words(much, Kind.LINK)[0][0]


def test_happenings_are_in_the_order_of_time_and_of_one_tick_causes_come_first(much, history):
    rows = [happening.tick for happening in much.happenings]
    assert rows == sorted(rows)
    for told_of, first, then in (
        (much, "the operator says: land", "landing"),
        (much, "op2 rates robot 5 1 of 5: complete distrust", "robot 5 is distrusted"),
        (history, "mission: parking lot inspection", "a fault begins: robot 5 at 40% speed"),
        (history, "a fault begins: robot 5 at 40% speed", "robot 5 is distrusted"),
    ):
        said = [happening.words for happening in told_of.happenings]
        before, after = said.index(first), said.index(then)
        assert told_of.happenings[before].tick == told_of.happenings[after].tick
        assert before < after


def account(history):
    """What happened, but for what only /log tells: who flies whom, and when the flight knew of its problem."""
    told_by_log = (Kind.HANDS, Kind.PROBLEM)
    return [(one.tick, one.kind, one.vehicle, one.words) for one in history.happenings if one.kind not in told_by_log]


def without_log(path):
    return rewritten(path, lambda _at, topic, _time_ns, data: None if topic == "/log" else data)


def test_a_recording_that_is_older_than_the_log_has_the_same_happenings(much, history):
    for told_of in (much, history):
        older = load(without_log(told_of.path))
        assert account(older) == account(told_of)
        assert [text for _, text in words(older, Kind.PROBLEM)] == [text for _, text in words(told_of, Kind.PROBLEM)]


def test_a_problem_stands_where_the_flight_knew_of_it_and_touching_where_it_was_closest(much):
    ((row, text),) = words(much, Kind.PROBLEM)
    assert (much.phase[row], text) == ("mission", "vehicle 3 fell silent 3.6 s into the mission")
    crowded = fly_and_record("demo", *SHORT, "swarm.spacing_m=0.7", "control.separation_gain=0")
    history = load(crowded.path)
    ((row, text),) = words(history, Kind.PROBLEM)
    assert text == crowded.summary.problem
    assert f"{separation(history.position)[row]:.2f} m" in text


def test_a_rule_that_asks_for_no_trust_distrusts_nobody():
    path = recorded(EMERGENCY, 'control.rule="average"').path
    for averaged in (load(path), load(without_log(path))):
        assert averaged.trust[np.isfinite(averaged.mission_s), 4].max() < 0.5
        assert words(averaged, Kind.DISTRUST) == []


def test_a_recording_that_ends_before_its_flight_says_so_at_its_last_tick():
    history = load(unended(recorded("demo", *SHORT).path))
    assert (history.problem, history.summary) == (CUT_SHORT, None)
    assert words(history, Kind.PROBLEM) == [(len(history.number) - 1, CUT_SHORT)]


def test_what_broke_the_flight_off_stands_at_its_last_tick(tmp_path):
    with pytest.raises(ZeroDivisionError):
        fly_and_record("demo", out=tmp_path, events=failing(31, ZeroDivisionError()))
    history = load(tmp_path)
    assert "ZeroDivisionError" in history.problem
    assert words(history, Kind.PROBLEM) == [(30, history.problem)]


def test_a_problem_stands_where_the_flight_turned_to_its_end():
    flight = fly_and_record("demo", "time.timeout_s=1.5", "swarm.rows=1", "swarm.columns=2", "swarm.leaders=[1]")
    history = load(flight.path)
    ((row, text),) = words(history, Kind.PROBLEM)
    assert text == history.problem == flight.summary.problem
    assert history.phase[row] == "landing" != history.phase[row - 1]


def dropped(*topics):
    """A recording without these topics, as versions before them wrote it."""

    def keep(_place, topic, _time_ns, data):
        return None if topic.startswith(topics) else data

    return rewritten(recorded("demo", *SHORT).path, keep)


def test_an_older_recording_without_some_topics_has_nothing_there():
    history = load(dropped("/trust", "/weights", "/setpoint", "/uav/", "/truth/", "/roles"))
    for name in ("trust", "weights", "sent_ned", "asked_ned", "battery", "attitude_rpy"):
        assert np.isnan(getattr(history, name)).all()
    assert history.measured
    np.testing.assert_array_equal(history.position, history.reported)
    assert (history.track, history.parts, history.faults, history.links) == (None, (), (), None)


def test_without_a_tick_there_is_nothing_to_read_back():
    with pytest.raises(UnreadableRecording, match="holds no tick of a flight"):
        load(dropped("/tick"))


def test_where_ticks_are_lost_the_others_keep_their_numbers():
    def without(_place, topic, _time_ns, data):
        return None if topic == "/tick" and 40 <= orjson.loads(data)["number"] < 50 else data

    history = load(rewritten(recorded("demo", *SHORT).path, without))
    assert history.number.tolist()[38:42] == [38, 39, 50, 51]
    assert history.armed[40, 0]
    assert len(history.time_ns) == len(history.phase) == len(history.position) == history.number[-1] - 9


# --- what is found in arrays


@given(arrays(float, st.tuples(st.integers(1, 30), st.just(3)), elements=st.floats(0, 1)))
def test_distrust_falls_and_rises_in_turn_and_ends_where_trust_does(trust):
    found = list(distrust(trust, (1, 2, 3)))
    for column_, system in enumerate((1, 2, 3)):
        turns = [text for _, _, vehicle, text in found if vehicle == system]
        assert turns[::2] == [f"robot {system} is distrusted"] * len(turns[::2])
        assert turns[1::2] == [f"robot {system} is trusted again"] * len(turns[1::2])
        assert len(turns) % 2 == (trust[-1, column_] < 0.5)


def test_who_was_never_heard_is_not_silent():
    age_s = np.array([[np.nan], [np.nan], [0.1], [1.0], [1.1], [2.0], [0.0]])
    assert [(row, text) for row, _, _, text in silences(age_s, (7,))] == [
        (4, "vehicle 7 is silent"),
        (6, "vehicle 7 is heard again"),
    ]


def test_a_task_is_said_while_the_mission_lasts():
    found = phases(("joining", "mission", "mission", "mission", "landing"), ("", "a", "a", "b", "b"))
    assert [(row, text) for row, _, _, text in found] == [
        (0, "joining"),
        (1, "mission: a"),
        (3, "next task: b"),
        (4, "landing"),
    ]


def test_a_time_between_two_rows_is_the_later_one():
    times = np.array([np.nan, 0.0, 0.1, 0.2, np.nan])
    assert [row_at(times, at) for at in (0.0, 0.05, 0.2, 9.0)] == [1, 2, 3, 4]
