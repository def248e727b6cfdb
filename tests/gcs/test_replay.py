"""A recorded flight decided again: the same to the bit, or the tick at which it is not."""

import re
import shutil

import numpy as np
import orjson
import pytest
from flights import SEEDS, SHORT, failing, fly_and_record, messages, recorded, rewritten, told, unended

from gcs.recording.reader import SENT, UnreadableRecording, ticks
from gcs.replay.difference import Difference
from gcs.replay.pages import LostTicks
from gcs.replay.verify import decide_again
from gcs.reproduce import conditions
from wire.frames import Framer, Sender, target_system
from wire.payloads import (
    LOCAL_POSITION_NED,
    SET_POSITION_TARGET_LOCAL_NED,
    PositionTarget,
    pack_local_position,
    pack_position_target,
    unpack_local_position,
)

PAPER = [condition for condition in conditions() if condition.severity is not None and condition.profile == "paper"]
BRIEF = ("demo", *SHORT)


def flown(condition, seed):
    """Its flight, with no key named that the scenario has so: others have flown some of them."""
    average = ['control.rule="average"'] if condition.controller == "average" else []
    severe = [f"fault.0.max_speed_fraction={condition.severity}"] if condition.severity != 0.4 else []
    flight = recorded(condition.scenario, *average, *severe, seed=seed)
    assert flight.scenario == condition.build()
    return flight


def check_identical(flight):
    result = decide_again(flight.path)
    assert result.difference is None
    assert result.identical
    assert result.ticks == round(flight.summary.simulated_s / 0.1)
    assert result.setpoints == sum(frame[7] == 84 for _, frame in flight.link.sent) > 0


def test_the_paper_has_eight_conditions():
    assert len(PAPER) == 8


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("condition", PAPER, ids=lambda c: f"{c.scenario} {c.severity:.0%} {c.controller}")
def test_all_set_points_of_the_papers_conditions_are_the_same_to_the_bit(condition, seed):
    check_identical(flown(condition, seed))


def test_so_are_those_of_another_profile():
    check_identical(recorded(*BRIEF))


def test_the_pages_of_a_recording_are_the_frames_that_the_loop_took_and_sent():
    flight = recorded("emergency")
    pages = list(ticks(flight.path))
    assert [frame for page in pages for frame in page.received] == flight.link.received
    assert [frame for page in pages for frame in page.sent] == [frame for _, frame in flight.link.sent]


def telemetry(path, system, tick):
    """The place in the file of the last position of a vehicle that this tick consumed."""
    place = None
    for at, (topic, _, data) in enumerate(messages(path)):
        if topic == f"/mavlink/{system}_1/raw" and data[7] == LOCAL_POSITION_NED:
            place = at
        elif topic == "/tick" and orjson.loads(data)["number"] == tick:
            return place
    raise AssertionError("there is no such tick")


def moved(raw, metres):
    """The same frame, the vehicle further north."""
    (frame,) = Framer().frames(0, raw)
    position = unpack_local_position(frame.payload)
    there = position._replace(x=position.x + metres)
    return Sender(frame.system, 1).frame(LOCAL_POSITION_NED, pack_local_position(there))


def tampered(path, *, system, tick, metres):
    """A copy of a recording in which a vehicle says once that it is somewhere else."""
    place = telemetry(path, system, tick)
    return rewritten(path, lambda at, _topic, _time, data: moved(data, metres) if at == place else data)


@pytest.mark.parametrize(("tick", "metres"), [(121, 0.5), (150, 0.001)])
def test_one_position_tampered_with_is_found_at_the_tick_that_saw_it(tick, metres):
    result = decide_again(tampered(recorded(*BRIEF).path, system=3, tick=tick, metres=metres))
    assert result.difference.tick == tick
    assert result.difference.recorded != result.difference.decided


def test_a_copy_with_nothing_changed_is_no_different():
    flight = recorded(*BRIEF)
    assert decide_again(rewritten(flight.path, lambda _at, _t, _n, data: data)).difference is None


def test_a_set_point_taken_out_is_found():
    flight = recorded(*BRIEF)
    held = messages(flight.path)
    sent = [at for at, (topic, _, data) in enumerate(held) if topic == "/mavlink/255_190/raw" and data[7] == 84]
    gone = sent[len(sent) // 2]
    tick = sum(topic == "/tick" for topic, _, _ in held[:gone])
    changed = rewritten(flight.path, lambda at, _t, _n, data: None if at == gone else data)
    difference = decide_again(changed).difference
    assert (difference.tick, difference.recorded, difference.decided.raw) == (tick, None, held[gone][2])
    assert difference.vehicle == target_system(difference.decided)


def verified(gcs, path, *options):
    """Exit code, and what `gcs replay --verify` says."""
    code, out, _ = gcs("replay", "--verify", path, *options)
    return code, out


def test_it_is_said_in_words_and_in_the_exit_code(gcs):
    flight = recorded(*BRIEF)
    assert verified(gcs, flight.folder) == (
        0,
        f"{len(told(flight, '/tick'))} ticks decided again: all {decide_again(flight.path).setpoints} set-points, and "
        "every other frame sent, identical to the bit\n",
    )
    code, words = verified(gcs, tampered(flight.path, system=1, tick=140, metres=0.5))
    assert code == 3
    assert words.startswith("the decision differs from tick 140 on, ")
    assert "vehicle 1 was sent " in words
    assert words.count(" m/s") == 2


def test_it_is_one_object_for_programs(gcs):
    flight = recorded(*BRIEF)
    code, out = verified(gcs, flight.path, "--json")
    assert code == 0
    same = orjson.loads(out)
    assert (same["identical"], same["difference"], same["gaps"]) == (True, None, [])
    assert (same["setpoints_beyond_gaps"], same["frames_of_unfinished_ticks"]) == (0, 0)
    code, out = verified(gcs, tampered(flight.path, system=1, tick=140, metres=0.5), "--json")
    assert code == 3
    other = orjson.loads(out)
    assert (other["identical"], other["ticks"], other["setpoints"]) == (False, same["ticks"], same["setpoints"])
    found = other["difference"]
    assert (found["tick"], found["vehicle"], found["message"]) == (140, 1, "SET_POSITION_TARGET_LOCAL_NED")
    (mission,) = (row["mission_s"] for row in told(flight, "/mission") if row["tick"] == 140)
    assert found["mission_s"] == pytest.approx(mission)
    assert {key for key in found["was"] if found["was"][key] != found["would_be"][key]} <= {"vx", "vy", "vz"}


# --- another scenario


def first_of_the_mission(flight):
    return told(flight, "/mission")[0]["tick"]


@pytest.mark.parametrize(
    ("options", "after_s"),
    [
        (("--controller", "average"), 0.0),
        (("--set", "fault.0.end_s=7.95"), 8.0),
        (("--set", "event.0.heading_deg=1"), 6.0),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_a_changed_parameter_is_reported_at_the_first_tick_at_which_it_acts(gcs, options, after_s):
    flight = recorded("emergency")
    code, out = verified(gcs, flight.path, "--json", *options)
    assert code == 3
    found = orjson.loads(out)["difference"]
    assert found["tick"] == first_of_the_mission(flight) + round(after_s / 0.1)
    assert found["mission_s"] == pytest.approx(after_s)


def test_what_no_decision_asks_for_may_change_without_a_difference(gcs):
    unasked = ("expect.heading_error_deg=9", "noise.gust_m_s=0", "fault.0.max_speed_fraction=0.9")
    assert verified(gcs, recorded("emergency").path, *(f"--set={key}" for key in unasked))[0] == 0


def test_a_difference_is_told_in_as_many_digits_as_show_it(gcs):
    flight = recorded(*BRIEF)
    _, words = verified(gcs, flight.path, "--set", "limits.speed_m_s=3")
    was, would_be = re.search(r"was sent (.*) m/s, and would be sent (.*) m/s\n", words).groups()
    assert was != would_be
    _, words = verified(gcs, flight.path, "--set", "swarm.altitude_m=20")
    assert re.search(r" on, \d+\.\d s before mission start: vehicle 1 ", words)


@pytest.mark.parametrize("field", ["yaw", "type_mask"])
def test_a_difference_that_is_not_in_the_velocity_is_named(field):
    target = PositionTarget(7, *[0.0] * 11, type_mask=3527, target_system=1, target_component=1, coordinate_frame=1)
    one, other = (
        Sender(255, 190).frame(SET_POSITION_TARGET_LOCAL_NED, pack_position_target(sent))
        for sent in (target, target._replace(**{field: 1}))
    )
    words = Difference.of(5, None, [one], [other]).words()
    assert re.search(rf"vehicle 1 was sent {field}=[\d.]+, and would be sent {field}=1(\.0)?$", words)
    later = Sender(255, 190)
    later.frame(SET_POSITION_TARGET_LOCAL_NED, pack_position_target(target))
    same = later.frame(SET_POSITION_TARGET_LOCAL_NED, pack_position_target(target))
    assert "with the sequence number 0, and would" in Difference.of(5, None, [one], [same]).words()


def test_a_scenario_that_was_tampered_with_in_the_recording_is_found_where_it_acts():
    flight = recorded(*BRIEF)

    def with_another_gain(scenario):
        tables = orjson.loads(scenario)
        tables["control"]["c2"] += 0.1
        return orjson.dumps(tables)

    difference = decide_again(rewritten(flight.path, scenario=with_another_gain)).difference
    assert difference.tick == first_of_the_mission(flight)
    assert difference.vehicle in flight.scenario.swarm.leaders


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("time.period_s=0.2", "time.period_s = 0.2: it was recorded with 0.1"),
        ("swarm.rows=3", "swarm.rows × swarm.columns = 9: it was recorded with 6"),
        ("control.c9=1", "run.mcap: control.c9 = 1: there is no such key"),
    ],
)
def test_what_a_recording_cannot_be_asked_is_refused_in_a_sentence(gcs, key, said):
    code, out, err = gcs("replay", "--verify", recorded(*BRIEF).path, "--set", key)
    assert (code, out) == (2, "")
    assert said in err
    assert err.count("\n") == 1


# --- recordings of which something is lost


def without(path, lost):
    """A copy of a recording without the messages of these ticks. lost: (tick, topic, payload) → whether it is."""
    place, tick = {}, 0
    for at, (topic, _, _data) in enumerate(messages(path)):
        place[at] = tick
        tick += topic == "/tick"
    return rewritten(path, lambda at, topic, _time, data: None if lost(place[at], topic, data) else data)


def test_it_is_verified_as_far_as_the_first_gap_and_no_further(gcs):
    flight = recorded(*BRIEF)
    torn = without(flight.path, lambda tick, _topic, _data: tick in (130, 131, 150))
    result = decide_again(torn)
    assert (result.ticks, result.difference) == (130, None)
    assert result.gaps == (LostTicks(130, 131), LostTicks(150, 150))
    whole = decide_again(flight.path)
    assert whole.setpoints - result.setpoints - result.beyond == 3 * flight.scenario.swarm.count
    assert not result.identical
    code, words = verified(gcs, torn)
    assert code == 3
    assert f"130 ticks decided again: all {result.setpoints} set-points" in words
    assert "the recording lacks frames of ticks 130 to 131, tick 150; what was decided" in words
    assert f"{result.beyond} set-points among it" in words


def test_one_lost_frame_of_what_a_tick_consumed_is_a_gap():
    flight = recorded(*BRIEF)
    place = telemetry(flight.path, 3, 140)
    result = decide_again(rewritten(flight.path, lambda at, _topic, _time, data: None if at == place else data))
    assert (result.ticks, result.gaps, result.difference) == (140, (LostTicks(140, 140),), None)


def test_of_a_recording_without_its_beginning_nothing_is_verified(gcs):
    flight = recorded(*BRIEF)
    headless = without(flight.path, lambda tick, _topic, _data: tick < 20)
    result = decide_again(headless)
    assert (result.ticks, result.setpoints, result.gaps) == (0, 0, (LostTicks(0, 19),))
    code, words = verified(gcs, headless)
    assert code == 3
    assert "identical" not in words


def test_frames_of_ticks_that_were_never_told_are_counted_and_not_verified(gcs):
    flight = recorded(*BRIEF)
    killed = without(flight.path, lambda tick, topic, _data: tick >= 140 and not topic.startswith("/mavlink"))
    result = decide_again(killed)
    assert (result.ticks, result.difference, result.identical) == (140, None, False)
    sent = sum(topic == SENT for topic, _, _ in messages(killed))
    assert result.unfinished == sent - sum(len(page.sent) for page in ticks(killed)) > 0
    code, words = verified(gcs, killed)
    assert code == 3
    assert f"not verified: {result.unfinished} frames at the end: the recording ends in the middle of a tick" in words


def test_a_recording_that_goes_on_in_another_file_is_not_verified(gcs, tmp_path):
    for name in ("run.mcap", "run.part2.mcap", "run.part3.mcap"):
        shutil.copy(recorded(*BRIEF).path, tmp_path / name)
    code, words = verified(gcs, tmp_path)
    assert code == 3
    assert words.endswith(
        "not verified: the recording goes on in run.part2.mcap, run.part3.mcap; "
        f"gcs log recover {tmp_path / 'run.mcap'} joins all\n"
    )
    code, out = verified(gcs, tmp_path, "--json")
    assert (code, orjson.loads(out)["identical"]) == (3, False)
    assert orjson.loads(out)["further_parts"] == ["run.part2.mcap", "run.part3.mcap"]


def test_of_a_recording_that_ends_before_its_flight_all_that_is_there_is_identical_and_that_it_ends_is_said(gcs):
    path = unended(recorded(*BRIEF).path)
    code, words = verified(gcs, path)
    assert code == 0
    assert words.endswith("\nthe recording ends before the flight did: what was sent then is not in it\n")
    code, out = verified(gcs, path, "--json")
    told_of = orjson.loads(out)
    assert (code, told_of["identical"], told_of["ends_before_flight"]) == (0, True, True)
    assert orjson.loads(verified(gcs, recorded(*BRIEF).path, "--json")[1])["ends_before_flight"] is False


def test_a_flight_cut_short_is_decided_again_as_far_as_it_went(tmp_path):
    with pytest.raises(ZeroDivisionError):
        fly_and_record("demo", out=tmp_path, events=failing(201, ZeroDivisionError()))
    result = decide_again(tmp_path / "run.mcap")
    assert result.difference is None
    assert result.ticks == 201


def test_an_operators_word_is_decided_again_at_its_tick():
    asked = iter(["land" if tick == 150 else None for tick in range(10_000)])
    flight = fly_and_record(*BRIEF, events=lambda: tuple(filter(None, [next(asked)])))
    pages = list(ticks(flight.path))
    assert [number for number, page in enumerate(pages) if page.events] == [150]
    assert decide_again(flight.path).difference is None
    assert flight.summary.heading_error_deg is None
    assert flight.summary.completed


def test_a_recording_that_holds_no_tick_has_nothing_to_decide():
    empty = rewritten(recorded(*BRIEF).path, lambda _at, topic, _n, data: None if topic == "/tick" else data)
    with pytest.raises(UnreadableRecording, match="no tick"):
        decide_again(empty)


def test_a_torn_recording_is_refused_in_a_sentence(tmp_path):
    data = recorded(*BRIEF).path.read_bytes()
    for part in np.linspace(0.05, 0.99, 7):
        (tmp_path / "torn.mcap").write_bytes(data[: int(len(data) * part)])
        with pytest.raises(UnreadableRecording, match=r"torn\.mcap: (torn|damaged).*gcs log recover"):
            decide_again(tmp_path / "torn.mcap")


def test_what_is_no_recording_is_not_promised_to_be_recovered(gcs, tmp_path):
    (tmp_path / "run.tlog").write_bytes(b"frames")
    (tmp_path / "picture.png").write_bytes(b"\x89PNG\r\n" * 9)
    log_of_frames = f"gcs: {tmp_path / 'run.tlog'}: a log of frames; gcs log import makes a recording of it\n"
    for words in (("replay",), ("replay", "--verify"), ("replay", "--controller", "average"), ("run",)):
        assert gcs(*words, tmp_path / "run.tlog") == (2, "", log_of_frames)
    not_one = f"gcs: {tmp_path / 'picture.png'}: not an MCAP file, or its beginning is lost\n"
    assert gcs("replay", tmp_path / "picture.png") == (2, "", not_one)
    assert gcs("replay", "--verify", tmp_path / "picture.png") == (2, "", not_one)
