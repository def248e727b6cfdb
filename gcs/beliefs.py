"""Where trust comes from: functions of the time since mission start that return one trust a robot.

`truth` is the simulation's own knowledge of the faults, `ratings` the user study's mean ratings. Before the mission
every robot is trusted.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from scenarios import Scenario, healthy_robots
from trustr.rating import study_trust

Array = npt.NDArray[np.float64]
TrustSource = Callable[[float], Array]
"""Time since mission start [s] → trust (N,) in [0, 1]."""


def trust_source(scenario: Scenario) -> TrustSource:
    """The source a scenario names."""
    return {"truth": _truth, "ratings": _ratings}[scenario.trust.source](scenario)


def _truth(scenario: Scenario) -> TrustSource:
    """0 for a robot while one of its faults is active, else 1."""

    def trust(time_s: float) -> Array:
        believed = np.ones(scenario.swarm.count)
        for fault in scenario.fault:
            if fault.active(time_s):
                believed[fault.vehicle - 1] = 0.0
        return believed

    return trust


def _ratings(scenario: Scenario) -> TrustSource:
    """The study's means, all the flight long: one for robots that fail at any time in it, one for the others."""
    rating = scenario.trust
    faulty = ~healthy_robots(scenario)
    fixed = study_trust(faulty, faulty_rating=rating.faulty_rating, others_rating=rating.others_rating)
    return lambda _time_s: fixed
