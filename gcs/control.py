"""From a scenario to the settings of `trustr`: degrees to radians, ids to rows, fractions of cruise to m/s."""

from __future__ import annotations

import numpy as np

from gcs.rules import rehearse, rule
from scenarios import Scenario, offsets_ne
from scenarios.models import RULES
from trustr.controller import Settings

BERTH = 3.0
"""m: how `recommended` keeps clear of robots it does not trust."""
REFERENCE_RESPONSE_S = 0.25
"""Response for which c1, c2 and the cap were found; `recommended` scales them by the fleet's own against it."""
FORMATION_GAIN = 0.3
"""1/s: how fast `recommended` lets robots return to their place among those they trust."""


BASELINES = frozenset(RULES) - {"trust-r"}
"""What trust does besides weighing (hand-over, leaving behind, a wide berth) is no part of the rules of others."""


def settings(scenario: Scenario) -> Settings:
    """What the controller of this scenario's flight is bound to. Raises RuleError where its rule cannot be flown."""
    control, network, cruise = scenario.control, scenario.network, scenario.mission.cruise_m_s
    swarm = scenario.swarm
    recommended = control.profile == "recommended"
    slower = control.response_time_s / REFERENCE_RESPONSE_S if recommended else 1.0
    chosen = Settings(
        rule=rule(control.rule),
        offset_ne=offsets_ne(scenario),
        files=tuple(np.arange(swarm.count).reshape(swarm.rows, swarm.columns).T),
        leaders=np.array(swarm.leaders) - 1,
        hand_over=scenario.trust.hand_over and control.rule not in BASELINES,
        leave_behind=scenario.trust.beyond_repair != "keep" and control.rule not in BASELINES,
        c1=control.c1 * slower,
        c2=control.c2 * slower,
        feedback_cap=control.feedback_cap * slower * cruise,
        response_s=control.response_time_s if recommended else 0.0,
        swarm_feedback=recommended,
        formation_gain=FORMATION_GAIN if recommended else 0.0,
        range_m=network.range_m,
        best_range_m=network.best_range_m,
        decay=network.decay,
        weights=control.weights,
        eta=control.eta,
        threshold=control.threshold,
        confidence=control.confidence,
        confidence_decay=control.confidence_decay,
        separation_radius=control.separation_radius_m,
        separation_gain=control.separation_gain,
        berth=_berth(scenario),
        berth_gain=control.berth_gain,
    )
    rehearse(chosen)
    return chosen


def _berth(scenario: Scenario) -> float:
    """The berth of distrusted robots [m]; baselines give none."""
    if scenario.control.rule in BASELINES:
        return 0.0
    if scenario.control.berth_m is not None:
        return scenario.control.berth_m
    return BERTH if scenario.control.profile == "recommended" else 0.0
