"""Where trust comes from: a fold, tick by tick, of what was commanded, measured and said, into one trust a robot.

`truth` is the simulation's own knowledge of the faults; `auto` what the swarm's behaviour shows; `ratings` what people
say of it, and where nobody says anything the user study's mean ratings; `fused` is `auto` and `ratings` together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gcs.events import Rating
from gcs.telemetry import NEVER
from scenarios import Scenario, healthy_robots
from trustr.controller import Settings
from trustr.evidence import INNOCENT, PRIOR, Evidence, Watch, forgiven, trust_of, weigh
from trustr.network import neighbours
from trustr.rating import CAP, aged, study_trust, told
from trustr.response import Response

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

SAYS_ALL = 6.0
"""Log odds that ratings may come to where nothing else is asked."""
UNTOLD = -math.log(5.0)
"""Log odds of being faulty where only people are asked and nobody has said anything: one robot in six, as in the paper.
One bad rating shakes such trust, a second one breaks it."""
A_WAY_BACK = 1.0
"""m off its place, that a robot may be on its way back from."""


@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """What is believed of N robots, and from what."""

    spoken: Array
    """(N,) log odds of being faulty, from ratings alone."""
    position_ns: npt.NDArray[np.int64]
    """(N,) when the newest telemetry that was weighed arrived."""
    evidence: Evidence | None = None
    """From behaviour; None until set-points flow, and where the source does not ask for it."""


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """What a tick shows."""

    mission_s: float
    """Since mission start; NaN before."""
    commanded_ne: Array
    """(N, 2) m/s: the set-points sent at the tick before."""
    position_ne: Array
    """(N, 2) m, measured."""
    velocity_ne: Array
    """(N, 2) m/s, measured."""
    position_ns: npt.NDArray[np.int64]
    """(N,) when both arrived."""
    heard: Flags
    """(N,) fresh, and under our control."""
    left: Flags
    """(N,) left behind: nobody learns from them or judges them any more."""
    ratings: Sequence[Rating]
    """What was said since."""


class Beliefs:
    """The trust source of one flight."""

    def __init__(self, scenario: Scenario, control: Settings, *, rated: bool) -> None:
        trust = scenario.trust
        self._scenario = scenario
        self._source = trust.source
        self._watches = trust.source in ("auto", "fused")
        self._listens = trust.source == "fused" or (trust.source == "ratings" and rated)
        self._cap = CAP if self._watches else SAYS_ALL
        self._watch = watch(scenario, control)
        self._study = study_trust(
            ~healthy_robots(scenario), faulty_rating=trust.faulty_rating, others_rating=trust.others_rating
        )

    def start(self) -> Belief:
        """Nothing has been seen."""
        count = self._scenario.swarm.count
        return Belief(np.zeros(count), np.full(count, NEVER))

    def update(self, belief: Belief, seen: Seen) -> Belief:
        """What is believed after one more tick."""
        spoken = aged(belief.spoken, dt=self._watch.dt, age_out_s=self._scenario.trust.age_out_s)
        belief = replace(belief, spoken=spoken)
        for rating in seen.ratings if self._listens else ():
            row = None if rating.vehicle is None else rating.vehicle - 1
            suspicion = 1.0 - trust_of(self._odds(belief))
            belief = replace(belief, spoken=told(belief.spoken, suspicion, rating.rating, row, cap=self._cap))
        return self._watched(belief, seen) if self._watches else belief

    def trust(self, belief: Belief, mission_s: float) -> Array:
        """(N,) in [0, 1] at this time since mission start; NaN is before it."""
        if self._source == "truth":
            return self._truth(mission_s)
        if self._source == "ratings" and not self._listens:
            return np.ones_like(self._study) if np.isnan(mission_s) else self._study
        return trust_of(self._odds(belief))

    def forgive(self, belief: Belief, robots: Flags) -> Belief:
        """Of these robots (N,), think as of robots nothing is known of, and nothing was said."""
        belief = replace(belief, spoken=np.where(robots, 0.0, belief.spoken))
        if belief.evidence is None:
            return belief
        return replace(belief, evidence=forgiven(belief.evidence, robots))

    def _odds(self, belief: Belief) -> Array:
        """(N,) log odds of being faulty, all told."""
        if belief.evidence is not None:
            return belief.spoken + belief.evidence.log_odds
        return belief.spoken + (PRIOR if self._watches else UNTOLD)

    def _watched(self, belief: Belief, seen: Seen) -> Belief:
        here = seen.heard & ~seen.left & np.isfinite(seen.position_ne).all(1) & np.isfinite(seen.velocity_ne).all(1)
        if belief.evidence is None:
            if not here.all():
                return belief
            evidence = Evidence.start(
                self._watch,
                commanded_ne=seen.commanded_ne,
                position_ne=seen.position_ne,
                velocity_ne=seen.velocity_ne,
            )
            return replace(belief, evidence=evidence, position_ns=seen.position_ns)
        position, velocity = (np.where(here[:, None], x, 0.0) for x in (seen.position_ne, seen.velocity_ne))
        graph = None
        if not np.isnan(seen.mission_s):
            graph = neighbours(position, here, range_m=self._scenario.network.range_m)
        evidence = weigh(
            belief.evidence,
            self._watch,
            commanded_ne=seen.commanded_ne,
            position_ne=position,
            velocity_ne=velocity,
            told=here & (seen.position_ns != belief.position_ns),
            graph=graph,
        )
        return replace(belief, evidence=evidence, position_ns=seen.position_ns)

    def _truth(self, mission_s: float) -> Array:
        """0 for a robot while one of its faults is active, else 1."""
        believed = np.ones(self._scenario.swarm.count)
        for fault in self._scenario.fault:
            if fault.blamed is not None and fault.active(mission_s):
                believed[fault.blamed - 1] = 0.0
        return believed


def watch(scenario: Scenario, control: Settings) -> Watch:
    """How healthy robots of a scenario behave."""
    trust = scenario.trust
    back = control.formation_gain * A_WAY_BACK
    apart = max(control.separation_gain * control.separation_radius, 0.5 * control.berth_gain * control.berth)
    return Watch(
        response=Response(
            trust.response_delay_s,
            trust.response_lag_s,
            trust.response_acceleration_m_s2 or math.inf,
            trust.response_jerk_m_s3 or math.inf,
        ),
        tolerance=trust.tolerance_m_s,
        place_tolerance=trust.place_tolerance_m,
        disagreement=(control.feedback_cap + apart + back) / INNOCENT,
        dt=scenario.time.period_s,
    )
