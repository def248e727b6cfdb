"""Trust from behaviour, flown: who is found and how soon, who is not, and who leads when a leader is found."""

import numpy as np
import pytest
from flights import column, recorded, told

from gcs.control import settings
from scenarios import load
from scenarios.models import RULES

AUTO = 'trust.source="auto"'
RECOMMENDED = 'control.profile="recommended"'
FIRST_LEADER = "fault.0.vehicle=1"
BOTH_LEADERS = 'fault=[{vehicle=1, kind="motor_degradation"}, {vehicle=3, kind="motor_degradation", onset_s=6}]'


def roles(flight):
    """(seconds, leaders, left behind) at mission start, and whenever it changed."""
    return [(row["mission_s"], row["leaders"], row["left_behind"]) for row in told(flight, "/roles")]


# --- who is found


@pytest.mark.parametrize(
    "flight", [("demo", AUTO), ("emergency", AUTO, "fault=[]"), ("transit", AUTO, "fault=[]")], ids=lambda f: f[0]
)
def test_where_nothing_fails_nobody_is_distrusted_and_the_mission_passes(flight):
    summary = recorded(*flight).summary
    assert (summary.false_alarms, summary.detected) == (0, {})
    assert summary.passed


@pytest.mark.parametrize("name", ["emergency", "transit"])
def test_the_papers_fault_is_found_within_two_and_a_half_seconds_and_the_mission_passes(name):
    summary = recorded(name, AUTO).summary
    assert summary.detected.keys() == {"5"}
    assert 0.0 < summary.detected["5"] <= 2.5
    assert summary.false_alarms == 0
    assert summary.passed


def test_a_small_fault_is_found_within_eight_seconds():
    summary = recorded("emergency", AUTO, "fault.0.offset_fraction=0.2", "fault.0.max_speed_fraction=0.9").summary
    assert 0.0 < summary.detected["5"] <= 8.0
    assert summary.false_alarms == 0


def test_seconds_until_a_robot_is_found_count_from_its_faults_onset():
    flight = recorded("emergency", AUTO, 'fault=[{vehicle=5, kind="gps_drift", onset_s=5}]')
    time_s, trust = column(flight, "/trust", "trust")
    first = time_s[np.flatnonzero(trust[:, 4] < 0.5)[0]]
    assert flight.summary.detected["5"] == pytest.approx(first - 5.0)
    assert (trust[time_s < 5.0, 4] > 0.9).all()
    assert flight.summary.false_alarms == 0


def test_a_wind_on_everyone_is_nobodys_fault():
    wind = 'fault=[{vehicle=1, kind="wind", speed_m_s=6, from_deg=90, everyone=true, onset_s=5}]'
    summary = recorded("emergency", AUTO, wind).summary
    assert (summary.detected, summary.false_alarms) == ({}, 0)
    assert summary.passed


def test_trust_is_what_the_recorded_evidence_comes_to():
    flight = recorded("emergency", AUTO)
    _, trust = column(flight, "/trust", "trust")
    _, odds = column(flight, "/evidence", "log_odds")
    assert trust == pytest.approx(1.0 / (1.0 + np.exp(odds)))


# --- who leads


def test_nobody_takes_over_from_leaders_that_are_trusted():
    assert roles(recorded("emergency", AUTO)) == [(0.0, [1, 3], [])]


def test_a_leader_that_fails_passes_its_role_on_when_it_is_found_and_the_mission_passes():
    flight = recorded("emergency", AUTO, FIRST_LEADER)
    found = flight.summary.detected["1"]
    assert roles(flight) == [(0.0, [1, 3], []), (pytest.approx(found), [2, 3], [])]
    assert flight.summary.passed


def test_without_hand_over_it_leads_on_and_the_mission_fails():
    flight = recorded("emergency", AUTO, FIRST_LEADER, "trust.hand_over=false")
    assert roles(flight) == [(0.0, [1, 3], [])]
    assert not flight.summary.passed


def test_who_knows_the_fault_from_the_start_hands_over_at_the_start():
    assert roles(recorded("emergency", FIRST_LEADER)) == [(0.0, [2, 3], [])]


def test_both_leaders_may_fail_one_after_the_other():
    flight = recorded("emergency", AUTO, RECOMMENDED, BOTH_LEADERS)
    found = flight.summary.detected
    assert roles(flight) == [
        (0.0, [1, 3], []),
        (pytest.approx(found["1"]), [2, 3], []),
        (pytest.approx(6.0 + found["3"]), [2, 6], []),
    ]
    assert flight.summary.passed
    assert flight.summary.false_alarms == 0


@pytest.mark.parametrize("rule", RULES)
def test_what_trust_does_besides_weighing_is_no_part_of_the_rules_of_others(rule):
    chosen = settings(load("transit", overrides=[f"control.rule={rule}", RECOMMENDED, 'trust.beyond_repair="hold"']))
    ours = rule == "trust-r"
    assert (chosen.hand_over, chosen.leave_behind, chosen.berth > 0.0) == (ours, ours, ours)


def test_a_baseline_hands_nothing_over_and_leaves_nobody_behind():
    chosen = ('control.rule="confidence-decay"', 'trust.beyond_repair="hold"', AUTO, FIRST_LEADER)
    assert roles(recorded("emergency", *chosen)) == [(0.0, [1, 3], [])]


def test_hand_over_is_on_unless_a_scenario_says_otherwise():
    assert load("emergency").trust.hand_over
