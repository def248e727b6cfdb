"""The swarm as arrays, in the order of system ids: where each robot stands in the formation, and who stays healthy."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenarios.models import Scenario, direction


def offsets_ne(scenario: Scenario) -> npt.NDArray[np.float64]:
    """Offsets of all vehicles from the formation's mean, (N, 2) m north, east, fixed in the world frame.

    Row 1 is the front as seen along the first leg, columns run left to right, vehicles are in the order of their ids.
    """
    swarm = scenario.swarm
    forward = np.array(direction(scenario.mission.leg[0].heading_deg))
    right = np.array([-forward[1], forward[0]])
    ahead = -np.repeat(np.arange(swarm.rows), swarm.columns) * swarm.spacing_m
    across = np.tile(np.arange(swarm.columns), swarm.rows) * swarm.spacing_m
    places = np.outer(ahead, forward) + np.outer(across, right)
    centred: npt.NDArray[np.float64] = places - places.mean(axis=0)
    return centred


def healthy_robots(scenario: Scenario) -> npt.NDArray[np.bool_]:
    """(N,) robots that no fault is ever blamed on."""
    healthy = np.ones(scenario.swarm.count, bool)
    for fault in scenario.fault:
        if fault.blamed is not None:
            healthy[fault.blamed - 1] = False
    return healthy
