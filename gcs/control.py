"""From a scenario to the settings of `trustr`: degrees to radians, ids to rows, fractions of cruise to m/s."""

from __future__ import annotations

import numpy as np

from scenarios import Scenario, offsets_ne
from trustr.controller import Settings

REFERENCE_RESPONSE_S = 0.25
"""The velocity response for which the paper profile's gains were found."""
RECOMMENDED_C1, RECOMMENDED_C2, RECOMMENDED_CAP = 0.25, 1.0, 0.6
"""Gains of the recommended profile at that response, c1 [1/s], c2, cap [of cruise]: `docs/recommended-profile.md`."""


def settings(scenario: Scenario) -> Settings:
    """What the controller of this scenario's flight is bound to."""
    control, network, cruise = scenario.control, scenario.network, scenario.mission.cruise_m_s
    c1, c2, cap, response_s = control.c1, control.c2, control.feedback_cap, 0.0
    if control.profile == "recommended":
        slower = control.response_time_s / REFERENCE_RESPONSE_S
        c1, c2, cap = RECOMMENDED_C1 * slower, RECOMMENDED_C2 * slower, RECOMMENDED_CAP * slower
        response_s = control.response_time_s
    return Settings(
        rule=control.rule,
        offset_ne=offsets_ne(scenario),
        leaders=np.array(scenario.swarm.leaders) - 1,
        c1=c1,
        c2=c2,
        feedback_cap=cap * cruise,
        response_s=response_s,
        range_m=network.range_m,
        best_range_m=network.best_range_m,
        decay=network.decay,
        weights=control.weights,
        eta=control.eta,
        threshold=control.threshold,
        separation_radius=control.separation_radius_m,
        separation_gain=control.separation_gain,
    )
