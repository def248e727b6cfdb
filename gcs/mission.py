"""Legs, hand-over and emergency re-direct: where the virtual leader is, t seconds after mission start.

Profile "paper": it runs along the legs at cruise speed, turns on the spot and stops at once.
Profile "recommended": it rounds corners that are known beforehand, by a parabola that leaves and meets the legs on the
beat; it brakes over the target the same way; and after an emergency call, which nobody knows beforehand, it swings onto
the new leg instead of jumping to it. `docs/recommended-profile.md` has the figures.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scenarios import Leg, Redirect, Scenario, direction
from trustr.leader import VirtualLeader

Array = npt.NDArray[np.float64]

READ_OUT_AFTER_S = 2.0
"""Results are read this long after the virtual leader would reach the target at cruise."""
TURN_S = 1.6
"""Recommended profile: time from one velocity to the next, at corners and at the target."""
SWING_S = 3.0
"""Recommended profile: time from an emergency call until the virtual leader is on its new leg."""


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """A straight part of the path, as it is flown."""

    task: str
    start_ne: Array
    """(2,) m in the swarm's frame."""
    velocity_ne: Array
    """(2,) m/s."""
    begins_s: float
    """Since mission start."""
    ends_s: float
    announced: bool
    """Known before it began; False for an emergency."""
    planned_end_ne: Array
    """(2,) m: where it would have gone had nothing interrupted it."""

    @property
    def end_ne(self) -> Array:
        """(2,) m: where it ends as flown."""
        return self.start_ne + self.velocity_ne * (self.ends_s - self.begins_s)


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """The whole path, events included."""

    segments: tuple[Segment, ...]

    @property
    def hand_over_s(self) -> float:
        """When the last segment begins."""
        return self.segments[-1].begins_s

    @property
    def target_ne(self) -> Array:
        """(2,) m: where the last segment ends."""
        return self.segments[-1].end_ne

    @property
    def read_out_s(self) -> float:
        """When results are read."""
        return self.segments[-1].ends_s + READ_OUT_AFTER_S

    def segment_at(self, time_s: float) -> Segment:
        """The segment being flown; before the first it is the first, after the last the last."""
        current = self.segments[0]
        for segment in self.segments:
            if segment.begins_s <= time_s + 1e-9:
                current = segment
        return current


def plan(scenario: Scenario) -> Plan:
    """The path of a scenario, from the swarm's origin."""
    cruise = scenario.mission.cruise_m_s
    pending: list[Leg | Redirect] = list(scenario.mission.leg)
    events = list(scenario.event)
    start, flown, segments = np.zeros(2), 0.0, []
    while pending:
        leg = pending.pop(0)
        along, length = np.array(direction(leg.heading_deg)), leg.length_m
        planned_end = start + along * length
        if events and events[0].at_length_m < flown + length:
            length = events[0].at_length_m - flown
            pending = [events.pop(0)]
        segments.append(
            Segment(
                task=leg.task,
                start_ne=start,
                velocity_ne=along * cruise,
                begins_s=flown / cruise,
                ends_s=(flown + length) / cruise,
                announced=isinstance(leg, Leg),
                planned_end_ne=planned_end,
            )
        )
        start, flown = start + along * length, flown + length
    return Plan(tuple(segments))


def run_up(cruise: float, duration_s: float, time_s: float) -> tuple[float, float]:
    """(distance [m], speed [m/s]) along the first leg, `time_s` into the run-up: half speeding up, half at cruise."""
    half = 0.5 * duration_s
    if time_s >= half:
        return cruise * (0.5 * half + time_s - half), cruise
    return 0.5 * cruise * time_s * time_s / half, cruise * time_s / half


def paper_leader(plan: Plan, time_s: float) -> VirtualLeader:
    """Along the legs at cruise speed; turns on the spot, stops at once."""
    segment = plan.segment_at(time_s)
    if time_s >= plan.segments[-1].ends_s:
        return VirtualLeader(plan.target_ne, np.zeros(2), np.zeros(2))
    at = segment.start_ne + segment.velocity_ne * (time_s - segment.begins_s)
    return VirtualLeader(at, segment.velocity_ne, np.zeros(2))


def recommended_leader(plan: Plan, time_s: float) -> VirtualLeader:
    """Rounds what it can foresee, swings onto what it cannot."""
    for before, after in zip(plan.segments, (*plan.segments[1:], None), strict=True):
        turn_s = _turn_s(before, after)
        since = time_s - before.ends_s
        if after is not None and not after.announced:
            if 0.0 <= since < min(SWING_S, after.ends_s - after.begins_s):
                return _swinging(before, after, since)
        elif abs(since) < 0.5 * turn_s:
            change = (np.zeros(2) if after is None else after.velocity_ne) - before.velocity_ne
            into = since + 0.5 * turn_s
            return VirtualLeader(
                before.end_ne + before.velocity_ne * since + change * into * into / (2.0 * turn_s),
                before.velocity_ne + change * into / turn_s,
                change / turn_s,
            )
    return paper_leader(plan, time_s)


def _turn_s(before: Segment, after: Segment | None) -> float:
    """Half of a turn lies on each side of the corner, and must fit there."""
    legs = [before] if after is None else [before, after]
    return min(TURN_S, *(leg.ends_s - leg.begins_s for leg in legs))


def _swinging(before: Segment, after: Segment, since: float) -> VirtualLeader:
    """From the old velocity onto the new leg: a cubic offset whose rate begins as their difference and ends at zero."""
    span = min(SWING_S, after.ends_s - after.begins_s)
    part = since / span
    difference = before.velocity_ne - after.velocity_ne
    return VirtualLeader(
        after.start_ne + after.velocity_ne * since + difference * since * (1.0 - part) ** 2,
        after.velocity_ne + difference * (1.0 - part) * (1.0 - 3.0 * part),
        difference * (6.0 * part - 4.0) / span,
    )


PROFILES = {"paper": paper_leader, "recommended": recommended_leader}
