"""A flight as the page tells it: its history, its score, and how each robot is drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from gcs.gate import LOST_NS
from gcs.mission import Plan, plan
from gcs.recording.history import History
from gcs.scoring import DISTRUSTED, Score, score, scored_robots
from gcs.summary import trust_of
from gcs.track import Parts

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Rows = npt.NDArray[np.intp]

CROWD = 12
"""Robots up to which each has a line of its own; more are drawn as a band, with those that matter beside it."""


@dataclass(frozen=True, eq=False)
class Told:
    """One flight of a report."""

    name: str
    """Unlike the others' of the page."""
    history: History

    @cached_property
    def plan(self) -> Plan:
        """Where it was to go."""
        return plan(self.history.scenario)

    @cached_property
    def score(self) -> Score | None:
        """None where it ended before its read-out."""
        track = self.history.track
        return None if track is None else score(track, self.history.scenario)

    @property
    def passed(self) -> bool:
        """Flown to its end, and well."""
        return self.history.problem is None and self.score is not None and self.score.passed

    @property
    def count(self) -> int:
        """N."""
        return len(self.history.ids)

    @property
    def trust_source(self) -> str | None:
        """None where the rule asks for no trust."""
        return trust_of(self.history.scenario)

    @cached_property
    def since_s(self) -> Array:
        """(T,) since mission start, before and after it too; since the first tick if there was no mission."""
        history = self.history
        known = np.flatnonzero(np.isfinite(history.mission_s))
        start_ns = history.time_ns[0] if len(history.time_ns) else 0
        if known.size:
            start_ns = history.time_ns[known[0]] - round(history.mission_s[known[0]] * 1e9)
        return (history.time_ns - start_ns) / 1e9

    @cached_property
    def mission(self) -> Rows:
        """Rows of the history from mission start to read-out."""
        mission_s = self.history.mission_s
        return np.flatnonzero((mission_s >= 0.0) & (mission_s <= self.plan.read_out_s + 1e-9))

    @cached_property
    def all_rows(self) -> Rows:
        """Every row of the history."""
        return np.arange(len(self.history.number))

    @property
    def faults_known(self) -> bool:
        """Whether it is known what was wrong, be it that the scenario is taken at its word."""
        return self.history.faults_by != "unknown"

    @property
    def planned(self) -> bool:
        """Whether what was wrong is the scenario's word alone, for vehicles that somebody else started."""
        return self.history.faults_by == "planned"

    @cached_property
    def onsets(self) -> Mapping[int, float]:
        """System id → when the first of its faults began, of those that acted; nobody where that is not known."""
        return self.history.onsets

    @cached_property
    def meant(self) -> Flags:
        """(N,) whom it is to be judged by."""
        return scored_robots(self.history.scenario, known=self.faults_known)

    @cached_property
    def scored(self) -> Flags:
        """(N,) whom it is judged by: as meant, but for robots that telemetry had lost at hand-over or read-out."""
        if self.score is None:
            return self.meant
        times_s = self.history.mission_s[self.mission]
        rows = self.mission[np.searchsorted(times_s, [self.plan.hand_over_s - 1e-9, self.plan.read_out_s - 1e-9])]
        return self.meant & np.isfinite(self.position[rows]).all(axis=(0, 2))

    @property
    def judged(self) -> str:
        """How those are called."""
        if self.count == 1:
            return "the robot"
        healthy = self.faults_known and not any(self.meant[system - 1] for system in self.onsets)
        return "the healthy robots" if healthy else "all robots"

    @property
    def mean(self) -> str:
        """How the mean of them is called."""
        return self.judged if self.count == 1 else f"the mean of {self.judged}"

    @cached_property
    def looks(self) -> tuple[str, ...]:
        """(N,) how each is drawn: failed, doubted (distrusted, and no fault of its own is known) or healthy."""
        trusted = np.ones(self.count, bool)
        if self.trust_source is not None:
            trusted = ~np.any(self.history.trust[self.mission] < DISTRUSTED, axis=0)
        robots = zip(self.history.ids, trusted.tolist(), strict=True)
        return tuple(
            "failed" if system in self.onsets else "healthy" if is_trusted else "doubted"
            for system, is_trusted in robots
        )

    @cached_property
    def silent(self) -> Flags:
        """(T, N) whose telemetry was taken for lost."""
        return np.asarray(self.history.age_s > LOST_NS / 1e9)

    @cached_property
    def position(self) -> Array:
        """(T, N, 3) as in the history, but NaN where it is only what a silent robot told before."""
        if not self.history.measured:
            return self.history.position
        return np.where(self.silent[..., None], np.nan, self.history.position)

    @property
    def crowded(self) -> bool:
        """Whether there are too many robots for a line each."""
        return self.count > CROWD

    def parts_at_the_end(self) -> Parts:
        """Who led and who was left behind at last: as told, or as the scenario has it."""
        parts = self.history.parts
        return parts[-1] if parts else Parts(0.0, self.history.scenario.swarm.leaders, ())

    def breaks(self, rows: Rows) -> Rows:
        """Where in these rows ticks are missing, so that no line is drawn across."""
        return np.flatnonzero(np.diff(self.history.number[rows]) > 1) + 1
