"""What happened, in plain words: known flights, known sentences."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pages import AUTO, AVERAGE, believing, dragged, flown, live, unreached

from gcs.recording.history import FaultSpan, Happening, Kind
from gcs.recording.reader import CUT_SHORT
from gcs.report.story import story
from gcs.report.telling import MOST, Sentence, Strand, fitted
from gcs.report.told import Told
from gcs.report.verdicts import verdicts
from gcs.track import Parts


def told(history):
    return " ".join(story(Told("a flight", history)))


def test_the_emergency_under_trust_r_is_told_from_take_off_to_landing():
    said = told(flown(AUTO))
    for sentence in (
        "Six robots took off; 7.6 s later all were 10 m up.",
        "whom to trust, the swarm had to find out from behaviour alone.",
        "The mission began: “parking lot inspection”.",
        "Something was wrong from the start, and no controller was told: robot 5 at 40% speed.",
        "At 1.3 s, trust in robot 5 fell below one half.",
        "At 6.0 s an emergency call broke off “parking lot inspection”: on to “car accident area”.",
        "2.4 m from its target (allowed 3.2 m): the mission passed.",
        "everyone back on the ground.",
    ):
        assert sentence in said


def test_the_emergency_under_the_average_names_why_it_failed():
    said = told(flown(AVERAGE))
    assert "the averaged update (eq. 1), which asks for no trust." in said
    assert "robot 5 counted for as much as anybody" in said
    assert "14.0° off its heading (allowed 4°)" in said
    assert "the mission failed." in said
    assert "distrusted" not in said


def test_a_flight_that_never_reached_its_mission_says_why():
    said = told(unreached())
    assert "The mission" not in said
    assert "It did not end as planned: the flight took longer than time.timeout_s = 4 s." in said


def test_a_false_alarm_is_told_as_one():
    history = dragged(2, 3)
    trust = history.trust.copy()
    trust[50:60, 1] = 0.2
    assert "At 5.0 s robot 2 was distrusted though nothing was wrong with it and trusted again later." in told(
        believing(history, trust)
    )


def test_who_failed_and_was_trusted_again_is_told_so():
    history = dragged(2, 3)
    trust = np.where(history.mission_s[:, None] < 9.0, history.trust, 1.0)
    assert "At 2.0 s, trust in robot 5 fell below one half; it was trusted again later." in told(
        believing(history, trust)
    )


def test_who_failed_and_was_trusted_to_the_end_is_named():
    history = dragged(2, 3)
    assert "Trust in robot 5 never fell below one half." in told(believing(history, np.ones_like(history.trust)))


def test_leaders_that_change_and_robots_that_are_left_behind_are_named():
    parts = Parts(0.0, (1, 3), ()), Parts(4.0, (2, 3), ()), Parts(7.0, (2, 3), (5,))
    said = told(replace(dragged(2, 3), parts=parts))
    assert "At 4.0 s robot 2 took the lead from robot 1." in said
    assert "At 7.0 s the swarm left robot 5 behind." in said


def test_few_ratings_are_told_one_by_one_and_many_in_sum():
    few = [("op1", 5, 2, 3.0), ("op1", 5, 1, 9.0), ("op2", None, 4, 12.0)]
    assert "op1 gave 2 of 5 to robot 5 at 3.0 s and 1 of 5 to robot 5 at 9.0 s." in told(dragged(2, 3, said=few))
    many = [("op1", system, 1 if system == 5 else 4, float(second)) for second in range(9) for system in (4, 5)]
    assert "From 0.0 s on op1 gave 18 ratings; robot 5 came off worst, 1.0 of 5 on average." in told(
        dragged(2, 3, said=many)
    )
    alike = [("op1", system, 1, float(second)) for second in range(9) for system in (1, 2, 6)]
    assert "27 ratings; robots 1, 2, 6 came off alike, 1.0 of 5 on average." in told(dragged(2, 3, said=alike))
    tied = [*alike, *(("op1", system, 3, float(second)) for second in range(9) for system in (3, 4))]
    assert "45 ratings; robots 1, 2, 6 came off worst, 1.0 of 5 on average." in told(dragged(2, 3, said=tied))


def test_a_fault_that_never_acted_is_no_fault():
    said = told(dragged(2, 3, "fault.0.onset_s=100"))
    assert "Nothing was wrong with anybody." in said
    assert "At 2.0 s robot 5 was distrusted though nothing was wrong with it." in said
    assert "counted for" not in said


def test_who_was_told_the_truth_is_not_said_to_know_nothing():
    said = told(dragged(2, 3, 'trust.source="truth"'))
    assert "it was told by the simulation who fails." in said
    assert "Something was wrong from the start: robot 5 at 40% speed." in said
    assert "no controller was told" not in said


def test_a_fault_that_nobody_saw_act_is_the_scenarios_alone():
    said = told(live(dragged(2, 3)))
    assert "The scenario has robot 5 at 40% speed; whether it was so, nobody told." in said
    assert "At 2.0 s robot 5 was distrusted." in said
    assert "wrong" not in said.replace("went wrong", "")
    planned = told(replace(dragged(2, 3), faults_by="planned"))
    assert "By the scenario something was wrong from the start: robot 5 at 40% speed; whether the vehicles" in planned


def test_what_the_failed_count_for_is_told_of_all_of_them_together():
    both = 'fault=[{vehicle=5, kind="motor_degradation"}, {vehicle=6, kind="motor_degradation"}]'
    history = dragged(2, 3, both)
    assert "robots 5, 6 counted for as much as anybody: 33.3% of what is heeded together." in told(history)
    weights = history.weights.copy()
    weights[..., 4], weights[..., 5] = 0.01, 0.03
    assert "robots 5, 6 counted for 4.0% of what is heeded together, where an equal share is 33.3%." in told(
        replace(history, weights=weights)
    )


def test_who_fell_silent_for_good_is_said_to_be_where_it_was_heard_last():
    history = live(dragged(2, 3), silent=[3])
    said = told(replace(history, phase=("climb", *history.phase[1:-1], "done")))
    assert "robot 3 fell silent." in said
    assert "robot 3 was last heard 23 s before, 10.0 m up." in said
    assert "robots 1, 2, 4, 5, 6 still in the air" in said


def word(history, row, words, kind=Kind.WORD, vehicle=None):
    return Happening(int(history.time_ns[row]), row, float(history.mission_s[row]), kind, vehicle, words)


def test_who_was_taken_over_is_told_and_is_not_called_silent():
    history = dragged(2, 3)
    words = "vehicle 3 is not ours any more: nothing is sent to it"
    said = told(replace(history, happenings=(word(history, 40, words, Kind.HANDS, 3),)))
    assert f"At 4.0 s {words}." in said
    assert "silent" not in said


def test_what_the_operator_said_before_the_mission_is_told_and_why_there_is_no_score():
    history = replace(unreached(), problem=None)
    landed = Told("a flight", replace(history, happenings=(word(history, 30, "the operator says: land"),)))
    assert "into the recording the operator says: land." in " ".join(story(landed))
    assert verdicts([landed]).rows[0].cells[0].note.endswith("the operator says: land")


def test_a_recording_that_breaks_off_and_was_rebuilt_says_both():
    figures = {"seconds_lost": "0.300", "frames_added": "12"}
    said = told(replace(dragged(2, 3), problem=CUT_SHORT, recovered=figures))
    assert "The recording breaks off 28.0 s after its start, in the phase “mission”." in said
    assert "rebuilt from a damaged one: 0.3 s of it are lost; 12 frames are from its journal alone." in said


@pytest.mark.parametrize("changes", [0, 5, 40])
def test_it_takes_a_dozen_sentences_at_most_and_the_end_is_among_them(changes):
    parts = [Parts(0.1 * number, (1 + number % 2, 3), ()) for number in range(changes + 1)]
    paragraphs = story(Told("a flight", replace(dragged(2, 3), parts=tuple(parts))))
    assert _sentences(paragraphs) <= MOST
    assert "As results were read" in paragraphs[-1]
    assert "emergency call" in paragraphs[1]
    assert ("lead" in paragraphs[1]) is (changes > 0)


def test_where_much_goes_wrong_like_things_are_summed_up_and_what_matters_is_never_dropped():
    """Nine faults, each found; three false alarms; three changes of the lead; ratings; a word of the operator."""
    late = ", ".join(f'{{vehicle={system}, kind="motor_degradation", onset_s={system}}}' for system in range(1, 10))
    said = [("op1", 5, 2, 0.1 * second) for second in range(30)]
    history = dragged(3, 4, f"fault=[{late}]", said=said)
    trust = np.ones_like(history.trust)
    for system in range(1, 10):
        trust[history.mission_s >= system + 0.5, system - 1] = 0.1
    trust[20:30, 9:] = 0.2
    history = believing(history, trust)
    spans = tuple(
        FaultSpan(system, "motor_degradation", float(system), np.inf, f"robot {system} at 40% speed")
        for system in range(1, 10)
    )
    parts = tuple(Parts(float(number), (1 + number % 2, 3), ()) for number in range(4))
    words = (word(history, 60, "the operator says: land"),)
    paragraphs = story(Told("a flight", replace(history, faults=spans, parts=parts, happenings=words)))
    for sentence in (
        "At 6.0 s the operator says: land.",
        "From 1.0 s to 9.0 s 9 things went wrong: ",
        "From 1.5 s to 9.5 s 9 robots were rightly distrusted, 0.5 s after their faults began.",
        "At 2.0 s robots 10, 11, 12 were distrusted though nothing was wrong with them.",
    ):
        assert sentence in paragraphs[1]
    assert _sentences(paragraphs) <= MOST


@given(
    st.lists(st.tuples(st.integers(1, 9), st.booleans(), st.booleans()), min_size=1, max_size=12), st.integers(1, 12)
)
def test_nothing_that_always_matters_goes_and_whatever_goes_is_named(kinds, room):
    strands = [
        Strand(
            tuple(Sentence(float(at), f"{number}.") for at in range(many)),
            Sentence(0.0, f"{number}.") if sums else None,
            spared=f"<{number}>" if spared else "",
        )
        for number, (many, sums, spared) in enumerate(kinds)
    ]
    said = [sentence.said for sentence in fitted(strands, room)]
    for number, (_, _, spared) in enumerate(kinds):
        assert f"{number}." in said or (spared and f"<{number}>" in said[-1])
    if sum(1 if sums else many for many, sums, _ in kinds) <= room:
        assert "Left out" not in said[-1]


def _sentences(paragraphs):
    return sum(paragraph.count(". ") + 1 for paragraph in paragraphs)
