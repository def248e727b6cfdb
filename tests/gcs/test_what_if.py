"""What another controller, or other parameters, would have commanded on recorded telemetry."""

import shutil
from functools import cache

import orjson
import pytest
from flights import SHORT, fly_and_record, messages, recorded, rewritten, told, unended

from gcs.choices import AS_IT_IS, Choices
from gcs.messages import GROUND_COMPONENT, GROUND_SYSTEM
from gcs.recording.reader import SENT
from gcs.replay.again import again, chosen
from gcs.replay.commanded import compared
from gcs.replay.pages import Pages
from gcs.replay.setpoints import is_setpoint
from scenarios import load, names, revised
from wire.frames import Sender
from wire.payloads import SET_POSITION_TARGET_LOCAL_NED, pack_position_target, unpack_position_target

BRIEF = ("demo", *SHORT)
AVERAGE = 'control.rule="average"'


def asked(path, **choices):
    """The answer."""
    pages = Pages.of(path)
    return compared(pages, chosen(pages, Choices(**choices)))


@cache
def by_the_average():
    return asked(recorded("emergency").path, controller="average")


def target_of(setpoint):
    return unpack_position_target(setpoint[10:-2])


def setpoint(target):
    return Sender(GROUND_SYSTEM, GROUND_COMPONENT).frame(SET_POSITION_TARGET_LOCAL_NED, pack_position_target(target))


def start_of_the_mission(flight):
    return told(flight, "/mission")[0]["tick"]


def test_the_same_choice_would_have_commanded_the_same():
    answer = asked(recorded("emergency").path, controller="trust-r", trust="truth")
    assert (answer.differ, answer.first_tick, answer.first_s, answer.problem) == (0, None, None, None)
    assert {vehicle.rms_m_s for vehicle in answer.vehicles} == {0.0}
    assert not answer.only_the_world_changed
    assert [vehicle.distrusted_s for vehicle in answer.vehicles] == [None] * 4 + [0.0, None]


def test_a_rule_that_would_not_have_distrusted_differs_from_mission_start():
    answer = by_the_average()
    assert answer.first_tick == start_of_the_mission(recorded("emergency"))
    assert answer.first_s == 0.0
    assert 0 < answer.differ < answer.setpoints
    for vehicle in answer.vehicles:
        assert 0.0 < vehicle.rms_m_s < vehicle.largest_m_s < 1.5
        assert 0.0 <= vehicle.largest_s <= 28.0
        assert vehicle.would_be_distrusted_s is None


def test_until_vehicles_would_answer_it_is_what_that_controller_commanded_when_it_flew():
    pages = Pages.of(recorded("emergency").path)
    would_be = again(pages, chosen(pages, Choices(controller="average"))).sent
    flew = [page.sent for page in Pages.of(recorded("emergency", AVERAGE).path).ticks]
    start = start_of_the_mission(recorded("emergency"))
    assert would_be[: start + 1] == flew[: start + 1]
    assert would_be[start + 1] != flew[start + 1]


def test_the_figures_of_one_set_point_that_was_another_are_those_of_that_set_point():
    flight = recorded(*BRIEF)
    start = start_of_the_mission(flight)
    then_ns = Pages.of(flight.path).ticks[start + 20].time_ns

    def faster(_at, topic, time_ns, data):
        if (topic, time_ns) != (SENT, then_ns) or not is_setpoint(data) or target_of(data).target_system != 3:
            return data
        return setpoint(target_of(data)._replace(vy=target_of(data).vy + 0.5))

    answer = compared(Pages.of(rewritten(flight.path, faster)), flight.scenario)
    assert (answer.differ, answer.first_tick, answer.first_s) == (1, start + 20, pytest.approx(2.0))
    third = answer.vehicles[2]
    assert (third.vehicle, third.differ, third.largest_tick) == (3, 1, start + 20)
    assert third.largest_m_s == pytest.approx(0.5, abs=1e-6)
    in_mission = sum(map(is_setpoint, (raw for page in Pages.of(flight.path).ticks[start:] for raw in page.sent))) / 6
    assert third.rms_m_s == pytest.approx(0.5 / in_mission**0.5, abs=1e-6)
    assert in_mission < third.setpoints
    assert answer.setpoints == sum(map(is_setpoint, (raw for _, raw in flight.link.sent))) == 6 * third.setpoints


def test_who_would_have_been_distrusted_is_told_beside_who_was():
    healthy = asked(recorded("emergency").path, no_fault=True)
    nobody = healthy.vehicles[4]
    assert not healthy.only_the_world_changed
    assert (nobody.distrusted_s, nobody.would_be_distrusted_s) == (0.0, None)
    watched = asked(recorded("emergency").path, trust="auto").vehicles[4]
    assert watched.distrusted_s == 0.0
    assert 0.0 < watched.would_be_distrusted_s < 5.0


def test_set_points_that_would_not_have_been_sent_at_all_are_others_without_a_size():
    answer = asked(recorded(*BRIEF).path, set_=("swarm.altitude_m=20",))
    assert answer.differ == answer.setpoints > 0
    assert {vehicle.rms_m_s for vehicle in answer.vehicles} == {None}
    assert "while taking off" in answer.problem
    assert -10.0 < answer.first_s < 0.0


def test_a_set_point_that_differs_in_its_heading_alone_is_another_of_the_same_velocity():
    flight = recorded(*BRIEF)
    place = next(at for at, (topic, _, data) in enumerate(messages(flight.path)) if topic == SENT and is_setpoint(data))

    def turned(at, _topic, _time, data):
        return setpoint(target_of(data)._replace(yaw=1.0)) if at == place else data

    answer = compared(Pages.of(rewritten(flight.path, turned)), flight.scenario)
    assert (answer.differ, answer.vehicles[0].largest_m_s) == (1, 0.0)


def test_commands_that_would_be_others_are_counted_beside_set_points(gcs):
    flight = recorded(*BRIEF)
    asked_oftener = asked(flight.path, set_=("time.positions_per_tick=3",))
    assert (asked_oftener.differ, asked_oftener.other_frames_differ) == (0, flight.scenario.swarm.count)
    assert asked(flight.path, trust="auto").other_frames_differ == 0
    _, out, _ = gcs("replay", flight.path, "--set", "time.positions_per_tick=3")
    assert out.splitlines()[1] == "6 frames besides, commands and requests, would have been others"


def test_of_what_only_the_simulated_world_obeys_it_is_said_that_telemetry_cannot_tell(gcs):
    code, out, err = gcs("replay", recorded(*BRIEF).path, "--set", "noise.gust_m_s=1")
    assert (code, err) == (0, "")
    same, of_the_world, no_answer = out.splitlines()
    assert same.endswith("set-points would have been the same")
    assert "of the simulated world" in of_the_world
    assert "does not answer" in no_answer
    _, out, err = gcs("replay", recorded("emergency").path, "--severity", "0.7", "--json")
    assert orjson.loads(out)["only_the_world_changed"] is True
    assert err == f"{of_the_world}\n{no_answer}\n"


def test_a_flight_that_would_not_have_been_completed_either_is_said_to_be_so(gcs):
    events = iter(["kill 3" if tick == 200 else None for tick in range(10_000)])
    flight = fly_and_record(*BRIEF, events=lambda: tuple(filter(None, [next(events)])))
    assert flight.summary.problem is not None
    assert asked(flight.path, set_=("control.c1=0.2",)).problem == flight.summary.problem
    _, out, _ = gcs("replay", flight.path, "--set", "control.c1=0.2")
    assert f"would not have been completed either: {flight.summary.problem}\n" in out


def test_that_the_recording_is_not_all_of_the_flight_is_said(gcs, tmp_path):
    for name in ("run.mcap", "run.part2.mcap"):
        shutil.copy(recorded(*BRIEF).path, tmp_path / name)
    _, out, err = gcs("replay", tmp_path, "--controller", "average", "--json")
    assert err.startswith(f"the recording goes on in run.part2.mcap; gcs log recover {tmp_path / 'run.mcap'} joins all")
    assert orjson.loads(out)["further_parts"] == ["run.part2.mcap"]
    _, out, err = gcs("replay", unended(recorded(*BRIEF).path), "--controller", "average", "--json")
    assert err.startswith("the recording ends before the flight did")
    assert orjson.loads(out)["ends_before_flight"] is True


def test_behind_a_gap_nothing_is_answered(gcs):
    def without(_at, topic, _time, data):
        return None if topic == "/tick" and orjson.loads(data)["number"] == 130 else data

    path = rewritten(recorded(*BRIEF).path, without)
    answer = asked(path, controller="average")
    assert answer.ticks == 130
    assert answer.ticks_beyond_gaps == len(told(recorded(*BRIEF), "/tick")) - 131
    _, _, err = gcs("replay", path, "--controller", "average")
    assert f"lacks frames from tick 130 on: {answer.ticks_beyond_gaps} ticks" in err


# --- as it is told


def test_a_difference_is_an_answer_and_no_failure(gcs):
    answer = by_the_average()
    code, out, err = gcs("replay", recorded("emergency").folder, "--controller", "average")
    assert (code, err) == (0, "")
    first = f"from tick {answer.first_tick} on, 0.0 s after mission start"
    assert out.startswith(f"{answer.differ} of {answer.setpoints} set-points would have been others, {first}\n")
    (row,) = (line.split() for line in out.splitlines() if line.split()[:1] == ["5"])
    robot = answer.vehicles[4]
    assert row[:4] == ["5", str(robot.setpoints), str(robot.differ), f"{robot.rms_m_s:.3f}"]
    assert "does not answer" in out


def test_it_is_one_object_for_programs(gcs):
    code, out, _ = gcs("replay", recorded("emergency").path, "--controller", "average", "--json")
    assert code == 0
    assert out.encode().rstrip() == by_the_average().json()


def test_where_nothing_told_the_truth_it_is_said_what_trust_is_drawn_from(gcs):
    untold = rewritten(
        recorded(*BRIEF).path, lambda _at, topic, _time, data: None if topic.startswith("/truth") else data
    )
    assert not any(topic == "/truth/pose" for topic, _, _ in messages(untold))
    _, _, err = gcs("replay", untold, "--trust", "truth")
    assert err == (
        "nothing told the truth of this flight; trust is from the faults of its scenario: "
        "it has none, so everybody is trusted\n"
    )
    assert gcs("replay", untold, "--trust", "auto")[2] == ""


def test_a_rule_that_is_not_there_is_refused_in_a_sentence(gcs):
    code, out, err = gcs("replay", recorded(*BRIEF).path, "--controller", "no.such:rule")
    assert (code, out) == (2, "")
    assert "no.such" in err


# --- a scenario that is at hand


@pytest.mark.parametrize("name", names())
def test_a_scenario_at_hand_is_changed_as_one_in_a_file(name):
    keys = ("control.c1=0.2", 'trust.source="auto"', "mission.leg.0.length_m=20")
    assert revised(load(name), source=name, overrides=keys) == load(name, overrides=keys)
    assert AS_IT_IS.revised(load(name).fenced(), source=name) == load(name).fenced()
