"""Where set-points may take vehicles: a cylinder over the take-off place, and whether a mission fits into it."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from scenarios.section import Section

if TYPE_CHECKING:
    from scenarios.models import Scenario

MARGIN_M, CEILING_MARGIN_M, FLOOR_M = 15.0, 5.0, 1.0
"""A fence that nobody described: so much farther than the mission goes, so much higher, and no lower than this."""
ROOM_M, ROOM_ABOVE_M = 3.0, 1.0
"""The least between the mission and its fence, on the level and in height: robots near it are braked."""
BELOW = 3.0
"""m under the others: where robots go that are left behind."""

Metres = Annotated[float, Field(gt=0, le=100_000)]


class Fence(Section):
    """A bound that is absent is none; `gcs fly` gives each vehicle all three."""

    radius_m: Metres | None = None
    """Horizontal, round the mean of the formation where it takes off."""
    ceiling_m: Metres | None = None
    """Height above each vehicle's take-off place that it may not exceed."""
    floor_m: Annotated[float, Field(ge=0, le=100_000)] | None = None
    """Height below which no set-point takes it: landing is the autopilot's own."""


def all_bounds(scenario: Scenario) -> dict[str, float]:
    """The bounds of a scenario's fence; those that are absent hold its mission, and a margin."""
    told = {key: value for key, value in scenario.limits.fence if value is not None}
    return {
        "radius_m": float(math.ceil(reach_m(scenario) + MARGIN_M)),
        "ceiling_m": scenario.swarm.altitude_m + CEILING_MARGIN_M,
        "floor_m": FLOOR_M,
    } | told


def check_it_holds(scenario: Scenario) -> None:
    """Raises ValueError where the mission would leave its own fence."""
    fence, reach = scenario.limits.fence, reach_m(scenario)
    highest, lowest = scenario.swarm.altitude_m, _lowest_m(scenario)
    if fence.radius_m is not None and fence.radius_m < reach + ROOM_M:
        raise ValueError(
            f"limits.fence.radius_m = {fence.radius_m:g}: the mission goes {reach:.1f} m from where it takes off, and "
            f"needs {ROOM_M:g} m more to stop; it must be {math.ceil(10 * (reach + ROOM_M)) / 10:g} or more"
        )
    if fence.ceiling_m is not None and fence.ceiling_m < highest + ROOM_ABOVE_M:
        raise ValueError(
            f"limits.fence.ceiling_m = {fence.ceiling_m:g}: the mission flies at {highest:g} m; it must be "
            f"{highest + ROOM_ABOVE_M:g} or more"
        )
    if fence.floor_m is not None and fence.floor_m > lowest - ROOM_ABOVE_M:
        raise ValueError(
            f"limits.fence.floor_m = {fence.floor_m:g}: the mission goes down to {lowest:g} m; it must be "
            f"{lowest - ROOM_ABOVE_M:g} or less"
        )


def reach_m(scenario: Scenario) -> float:
    """How far from where the formation takes off any robot's place ever is, horizontally."""
    return max(abs(corner + place) for corner in _corners(scenario) for place in _outermost(scenario))


def _lowest_m(scenario: Scenario) -> float:
    """The lowest height that the mission flies at."""
    return scenario.swarm.altitude_m - (0.0 if scenario.trust.beyond_repair == "keep" else BELOW)


def _corners(scenario: Scenario) -> Iterator[complex]:
    """Where the virtual leader's path begins, turns and ends, north + east i [m]; distances peak at corners.

    The run-up speeds up evenly for half its time and cruises for the other half.
    """
    mission = scenario.mission
    straights = [(leg.heading_deg, leg.length_m) for leg in mission.leg]
    run_up = (mission.leg[0].heading_deg, 0.75 * mission.run_up_s * mission.cruise_m_s)
    for event in scenario.event:
        straights = [*_as_far_as(event.at_length_m, straights), (event.heading_deg, event.length_m)]
    at = 0j
    yield at
    for heading_deg, length_m in (run_up, *straights):
        at += cmath.rect(length_m, math.radians(heading_deg))
        yield at


def _as_far_as(length_m: float, straights: list[tuple[float, float]]) -> Iterator[tuple[float, float]]:
    """The first so many metres of a path."""
    for heading_deg, straight_m in straights:
        if length_m > 0.0:
            yield heading_deg, min(straight_m, length_m)
        length_m -= straight_m


def _outermost(scenario: Scenario) -> list[complex]:
    """The places of the formation's corners from its mean, as `layout.offsets_ne` has them."""
    swarm = scenario.swarm
    deep, wide = (0.5 * (many - 1) * swarm.spacing_m for many in (swarm.rows, swarm.columns))
    forward = cmath.rect(1.0, math.radians(scenario.mission.leg[0].heading_deg))
    return [forward * complex(ahead, right) for ahead in (deep, -deep) for right in (wide, -wide)]
