"""How well a mission went: the metrics of the paper's Table II, on the truth where there is one."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gcs.mission import plan
from gcs.track import Track
from scenarios import Scenario, offsets_ne

Array = npt.NDArray[np.float64]

AIRBORNE = 0.3
"""m above home: lower robots do not count for separation."""
CONTACT = 0.75
"""m between centres: rotor discs of two vehicles touch."""
DISTRUSTED = 0.5


@dataclass(frozen=True, slots=True)
class Score:
    """What a flight is judged by."""

    heading_error_deg: float
    """Absolute angle between the last leg and the way the healthy robots' mean went, hand-over to read-out."""
    distance_to_target_m: float
    """From the target to the mean of the healthy robots' places, formation taken off, at read-out."""
    min_separation_m: float
    """Closest that two airborne robots came, mission start to read-out."""
    swarm_heading_error_deg: float
    """As the first, of all robots."""
    passed: bool
    detected: dict[int, float]
    """Seconds from its first fault's onset until the vehicle's trust fell below 0.5, of those that were found."""
    false_alarms: int
    """Vehicles whose trust was below 0.5 at any time before a fault of theirs, if they had one; none where nobody knows
    who had.
    """


def score(track: Track, scenario: Scenario) -> Score | None:
    """Judge a mission; None if it ended before its read-out.

    A robot that telemetry had lost at hand-over or read-out is in no mean; where it had lost all, there is no score.
    """
    path = plan(scenario)
    if track.time_s[-1] < path.read_out_s - 1e-9:
        return None
    hand_over, read_out = (int(np.searchsorted(track.time_s, t - 1e-9)) for t in (path.hand_over_s, path.read_out_s))
    scored = scored_robots(scenario, known=track.faults_known)
    onset_s = onsets(scenario, until_s=path.read_out_s)
    place = track.position[..., :2] - offsets_ne(scenario)
    heard = np.isfinite(place[[hand_over, read_out]]).all(axis=(0, 2))
    scored &= heard
    if not scored.any():
        return None
    leg = path.segments[-1].velocity_ne
    error = abs(heading_error(place[hand_over, scored].mean(0), place[read_out, scored].mean(0), leg))
    distance = float(np.linalg.norm(place[read_out, scored].mean(0) - path.target_ne))
    separation = min_separation(track.position[: read_out + 1])
    expect = scenario.expect
    return Score(
        heading_error_deg=error,
        distance_to_target_m=distance,
        min_separation_m=separation,
        swarm_heading_error_deg=abs(
            heading_error(place[hand_over, heard].mean(0), place[read_out, heard].mean(0), leg)
        ),
        passed=bool(
            error <= expect.heading_error_deg
            and distance <= expect.distance_to_target_m
            and separation >= expect.min_separation_m
        ),
        detected=_detected(track, onset_s) if track.faults_known else {},
        false_alarms=_false_alarms(track, onset_s) if track.faults_known else 0,
    )


def onsets(scenario: Scenario, *, until_s: float = math.inf) -> dict[int, float]:
    """System id → seconds since mission start at which the first of its faults began to act, of those before `until_s`.

    Faults that are blamed on nobody, as wind on everyone, are left out.
    """
    first_s: dict[int, float] = {}
    for fault in scenario.fault:
        if fault.blamed is not None and fault.onset_s < until_s - 1e-9:
            first_s[fault.blamed] = min(first_s.get(fault.blamed, math.inf), fault.onset_s)
    return first_s


def struck(track: Track, scenario: Scenario) -> dict[int, float]:
    """The same of a mission as far as it was flown, to its read-out at most; nobody where nobody knows."""
    return onsets(scenario, until_s=float(track.time_s[-1])) if track.faults_known else {}


def scored_robots(scenario: Scenario, *, known: bool = True) -> npt.NDArray[np.bool_]:
    """(N,) whom a flight is judged by: those without a fault up to the read-out; where nobody is, all.

    known: whether the scenario's faults are known to be the vehicles'; where nobody knows, all are judged alike.
    """
    healthy = np.ones(scenario.swarm.count, bool)
    if known:
        healthy[[system - 1 for system in onsets(scenario, until_s=plan(scenario).read_out_s)]] = False
    return healthy if healthy.any() else ~healthy


def _false_alarms(track: Track, onset_s: Mapping[int, float]) -> int:
    """Who was distrusted while it had had no fault yet."""
    first_s = np.array([onset_s.get(system, math.inf) for system in range(1, track.trust.shape[1] + 1)])
    sound = track.time_s[:, None] < first_s - 1e-9
    return int(((track.trust < DISTRUSTED) & sound).any(axis=0).sum())


def heading_error(start_ne: Array, end_ne: Array, wanted_ne: Array) -> float:
    """Signed angle from the wanted direction to the chord, degrees, clockwise, in [−180, 180]."""
    north, east = end_ne - start_ne
    flown, wanted = math.atan2(east, north), math.atan2(wanted_ne[1], wanted_ne[0])
    return math.degrees(math.remainder(flown - wanted, math.tau))


def min_separation(position: Array) -> float:
    """Smallest 3-D distance [m] of any two airborne robots over (T, N, 3) positions; infinite where there are none.

    A robot whose place is not known, NaN, is none.
    """
    return float(separation(position).min())


def separation(position: Array) -> Array:
    """(T,) m between the closest two airborne robots of (T, N, 3) positions; infinite where there are none."""
    grounded = ~(position[..., 2] >= AIRBORNE)  # or not known
    closest = np.full(len(position), np.inf)
    for first in range(position.shape[1] - 1):
        gap = np.linalg.norm(position[:, first + 1 :] - position[:, first, None], axis=-1)
        gap[grounded[:, first + 1 :] | grounded[:, first, None]] = np.inf
        closest = np.minimum(closest, gap.min(axis=1))
    return closest


def _detected(track: Track, onset_s: Mapping[int, float]) -> dict[int, float]:
    found: dict[int, float] = {}
    for system, first_s in onset_s.items():
        below = track.time_s[(track.trust[:, system - 1] < DISTRUSTED) & (track.time_s >= first_s - 1e-9)]
        if below.size:
            found[system] = round(float(below[0]) - first_s, 6)
    return found
