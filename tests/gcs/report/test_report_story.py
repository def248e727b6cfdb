"""What happened, in plain words: known flights, known sentences."""

from dataclasses import replace

import numpy as np
import pytest
from pages import AUTO, AVERAGE, dragged, flown, unreached

from gcs.report.story import MOST, story
from gcs.report.told import Told
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
        replace(history, trust=trust)
    )


def test_who_failed_and_was_trusted_to_the_end_is_named():
    history = dragged(2, 3)
    assert "Trust in robot 5 never fell below one half." in told(replace(history, trust=np.ones_like(history.trust)))


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


@pytest.mark.parametrize("changes", [0, 5, 40])
def test_it_takes_a_dozen_sentences_at_most_and_the_end_is_among_them(changes):
    parts = [Parts(0.1 * number, (1 + number % 2, 3), ()) for number in range(changes + 1)]
    paragraphs = story(Told("a flight", replace(dragged(2, 3), parts=tuple(parts))))
    assert sum(paragraph.count(". ") + 1 for paragraph in paragraphs) <= MOST
    assert "As results were read" in paragraphs[-1]
    assert "emergency call" in paragraphs[1]
