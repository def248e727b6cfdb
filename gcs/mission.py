"""Legs, hand-over and emergency re-direct: where the virtual leader is, t seconds after mission start.

Profile "paper": it runs along the legs at cruise speed, turns on the spot and stops at once.
Profile "recommended": it rounds corners that are known beforehand, by a parabola that leaves and meets the legs on the
beat; it brakes over the target the same way; and after an emergency call, which nobody knows beforehand, it swings onto
the new leg instead of jumping to it. `docs/recommended-profile.md` has the figures.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

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
    planned_end_ne: Array
    """(2,) m: where it would have gone had nothing interrupted it."""

    @property
    def end_ne(self) -> Array:
        """(2,) m: where it ends as flown."""
        return self.start_ne + self.velocity_ne * (self.ends_s - self.begins_s)


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """The whole path, events included, and what was known of it when."""

    segments: tuple[Segment, ...]
    """As flown."""
    known: tuple[tuple[Segment, ...], ...]
    """What lay ahead at mission start, then what lay ahead after each event, uncut by events still to come."""

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

    def calls_by(self, time_s: float) -> int:
        """How many events have come by then."""
        return sum(ahead[0].begins_s <= time_s + 1e-9 for ahead in self.known[1:])

    def legs(self, calls: int) -> tuple[tuple[Segment, ...], tuple[Segment, ...]]:
        """What was flown before so many events, as they cut it, and what lies ahead then as far as anybody knows."""
        ahead = self.known[calls]
        return tuple(segment for segment in self.segments if segment.begins_s < ahead[0].begins_s), ahead

    def segment_at(self, time_s: float) -> Segment:
        """The segment being flown; before the first it is the first, after the last the last."""
        return _at(self.segments, time_s)


def plan(scenario: Scenario) -> Plan:
    """The path of a scenario, from the swarm's origin."""
    cruise = scenario.mission.cruise_m_s
    ahead = _straight(scenario.mission.leg, np.zeros(2), 0.0, cruise)
    flown, known = list[Segment](), [ahead]
    for event in scenario.event:
        call_s = event.at_length_m / cruise
        cut = [replace(leg, ends_s=min(leg.ends_s, call_s)) for leg in ahead if leg.begins_s < call_s - 1e-9]
        flown += cut
        ahead = _straight([event], cut[-1].end_ne, call_s, cruise)
        known.append(ahead)
    return Plan((*flown, *ahead), tuple(known))


def _straight(legs: Sequence[Leg | Redirect], start_ne: Array, begins_s: float, cruise: float) -> tuple[Segment, ...]:
    """Legs one after another, each beginning where the one before it ends."""
    segments = []
    for leg in legs:
        along = np.array(direction(leg.heading_deg))
        ends_s, end_ne = begins_s + leg.length_m / cruise, start_ne + along * leg.length_m
        segments.append(Segment(leg.task, start_ne, along * cruise, begins_s, ends_s, end_ne))
        start_ne, begins_s = end_ne, ends_s
    return tuple(segments)


def _at(segments: Sequence[Segment], time_s: float) -> Segment:
    current = segments[0]
    for segment in segments:
        if segment.begins_s <= time_s + 1e-9:
            current = segment
    return current


def run_up(cruise: float, duration_s: float, time_s: float) -> tuple[float, float]:
    """(distance [m], speed [m/s]) along the first leg, `time_s` into the run-up: half speeding up, half at cruise."""
    half = 0.5 * duration_s
    if time_s >= half:
        return cruise * (0.5 * half + time_s - half), cruise
    return 0.5 * cruise * time_s * time_s / half, cruise * time_s / half


def paper_leader(plan: Plan, time_s: float) -> VirtualLeader:
    """Along the legs at cruise speed; turns on the spot, stops at once."""
    return _on_the_legs(plan.segments, time_s)


def recommended_leader(plan: Plan, time_s: float) -> VirtualLeader:
    """Rounds and brakes by what is known at the time, and swings onto what nobody could know."""
    return _after_calls(plan, plan.calls_by(time_s), time_s)


PROFILES = {"paper": paper_leader, "recommended": recommended_leader}


def _on_the_legs(segments: Sequence[Segment], time_s: float) -> VirtualLeader:
    last = segments[-1]
    if time_s >= last.ends_s:
        return VirtualLeader(last.end_ne, np.zeros(2), np.zeros(2))
    segment = _at(segments, time_s)
    at = segment.start_ne + segment.velocity_ne * (time_s - segment.begins_s)
    return VirtualLeader(at, segment.velocity_ne, np.zeros(2))


def _after_calls(plan: Plan, called: int, time_s: float) -> VirtualLeader:
    """The virtual leader after so many emergency calls: its new leg, and what is left of how it came there."""
    smooth = _rounded(plan.known[called], time_s)
    if called == 0:
        return smooth
    leg = plan.known[called][0]
    call_s, span_s = leg.begins_s, min(SWING_S, leg.ends_s - leg.begins_s + 0.5 * TURN_S)
    came, begun = _after_calls(plan, called - 1, call_s), _rounded(plan.known[called], call_s)
    offset, rate = came.position_ne - begun.position_ne, came.velocity_ne - begun.velocity_ne
    left = _fading(offset, rate, time_s - call_s, span_s)
    return VirtualLeader(
        smooth.position_ne + left.position_ne,
        smooth.velocity_ne + left.velocity_ne,
        smooth.acceleration_ne + left.acceleration_ne,
    )


def _rounded(segments: tuple[Segment, ...], time_s: float) -> VirtualLeader:
    """Along the legs, each change of velocity spread over TURN_S: half before the corner, half behind it."""
    for before, after in zip(segments, (*segments[1:], None), strict=True):
        legs = [before] if after is None else [before, after]
        turn_s = min(TURN_S, *(leg.ends_s - leg.begins_s for leg in legs))
        since = time_s - before.ends_s
        if abs(since) < 0.5 * turn_s:
            change = (np.zeros(2) if after is None else after.velocity_ne) - before.velocity_ne
            into = since + 0.5 * turn_s
            return VirtualLeader(
                before.end_ne + before.velocity_ne * since + change * into * into / (2.0 * turn_s),
                before.velocity_ne + change * into / turn_s,
                change / turn_s,
            )
    return _on_the_legs(segments, time_s)


def _fading(offset: Array, rate: Array, since: float, span: float) -> VirtualLeader:
    """An offset [m] and its rate [m/s] that are both gone after `span` seconds: the cubic between (Hermite)."""
    if since >= span:
        return VirtualLeader(np.zeros(2), np.zeros(2), np.zeros(2))
    s = since / span
    return VirtualLeader(
        offset * (1.0 + s * s * (2.0 * s - 3.0)) + rate * span * s * (1.0 - s) ** 2,
        offset * 6.0 * s * (s - 1.0) / span + rate * (1.0 - s) * (1.0 - 3.0 * s),
        (offset * (12.0 * s - 6.0) / span + rate * (6.0 * s - 4.0)) / span,
    )
