"""What goes wrong, in plain words."""

from dataclasses import replace

import pytest
from flights import SHORT, recorded

from gcs.scoring import score
from gcs.words import ending, faults, measured, verdict
from scenarios import load


def said(**keys):
    told = ", ".join(f"{key}={value}" for key, value in ({"vehicle": 5} | keys).items())
    (words,) = faults(load("demo", overrides=[f"fault=[{{{told}}}]"]))
    return words


@pytest.mark.parametrize(
    ("kind", "keys", "words"),
    [
        ("motor_degradation", {"max_speed_fraction": 0.7}, "robot 5 at 70% speed"),
        ("rotor", {"rotor": 2, "efficiency": 0.0}, "a broken rotor on robot 5"),
        ("rotor", {"rotor": 2, "efficiency": 0.6}, "a rotor of robot 5 at 60% thrust"),
        ("rotor", {"rotor": 2, "speed_limit": 0.8}, "a rotor of robot 5 at 80% speed"),
        ("compass_bias", {"bias_deg": -30}, "the compass of robot 5 off by -30°"),
        ("stuck_velocity", {}, "robot 5 stuck with its set-point"),
        ("wind", {"speed_m_s": 4}, "wind of 4 m/s on robot 5"),
        ("wind", {"speed_m_s": 4, "gust_m_s": 1, "everyone": "true"}, "wind of 4 m/s and gusts of 1 m/s on everyone"),
        ("gps_drift", {"rate_m_s": 0.25}, "the GPS of robot 5 drifting by 0.25 m/s"),
        ("gps_jump", {"distance_m": 6}, "the GPS of robot 5 off by 6 m"),
        ("false_report", {"offset_m_s": 0.5}, "robot 5 lying about its velocity by 0.5 m/s"),
        ("lagging_telemetry", {"lag_s": 1.5}, "telemetry of robot 5 late by 1.5 s"),
        ("frozen_telemetry", {}, "telemetry of robot 5 frozen"),
    ],
)
def test_each_kind_is_named_with_what_matters_of_its_severity(kind, keys, words):
    assert said(kind=f'"{kind}"', **keys) == words


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"onset_s": 12}, "from 12 s on"),
        ({"end_s": 30}, "until 30 s"),
        ({"onset_s": 12, "end_s": 30.5}, "from 12 s to 30.5 s"),
        ({"grows_over_s": 8}, "growing over 8 s"),
        ({"period_s": 10, "on_fraction": 0.3}, "on for 30% of every 10 s"),
        ({"period_s": 10, "grows_over_s": 8, "onset_s": 2}, "growing over 8 s, on for 50% of every 10 s, from 2 s on"),
    ],
)
def test_when_it_comes_and_goes_is_said_where_it_is_not_always_there(keys, words):
    assert said(kind='"frozen_telemetry"', **keys) == f"telemetry of robot 5 frozen ({words})"


def test_a_verdict_says_whom_the_swarm_went_on_without():
    summary = recorded("demo", *SHORT).summary
    assert "without" not in verdict(summary)
    assert ", without robot 5" in verdict(replace(summary, left_behind=[5]))
    assert ", without robots 2, 5" in verdict(replace(summary, left_behind=[2, 5]))


@pytest.mark.parametrize(
    ("problem", "passed", "words", "good"),
    [
        (None, True, "passed", True),
        (None, False, "failed", False),
        (None, None, "no score: it ended before its read-out", False),
        ("vehicle 3 fell silent", True, "not completed: vehicle 3 fell silent", False),
        ("vehicle 3 fell silent", None, "not completed: vehicle 3 fell silent", False),
    ],
)
def test_a_flight_ends_in_one_of_four_ways(problem, passed, words, good):
    ended = ending(problem, passed)
    assert (str(ended), ended.good) == (words, good)


def test_a_verdict_says_why_there_is_no_score_and_does_not_call_it_failed():
    summary = replace(recorded("demo", *SHORT).summary, heading_error_deg=None, passed=False)
    assert verdict(summary).splitlines()[1] == "no score: it ended before its read-out"
    assert verdict(replace(summary, problem="the disk is full")).splitlines()[1] == "not completed: the disk is full"


def test_what_a_flight_is_judged_by_stands_beside_what_was_allowed():
    flight = recorded("demo", *SHORT)
    result = score(flight.read().track, flight.scenario)
    kept = replace(result, heading_error_deg=1.24, distance_to_target_m=0.5, min_separation_m=2.0)
    assert list(measured(kept, flight.scenario)) == [
        "heading off by 1.2° (allowed 4°)",
        "0.5 m from the target (allowed 3.2 m)",
    ]
    close = list(measured(replace(kept, min_separation_m=0.444), flight.scenario))
    assert close[2:] == ["robots as close as 0.44 m (allowed 1 m)"]
