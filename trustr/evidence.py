"""What the swarm's own behaviour says of each robot: residuals → likelihood → log odds of being faulty → trust.

Three residuals are watched, and at each tick the one that accuses most counts:

* response: measured velocity less what a healthy robot would make of the commands it was sent (`response.py`), and
  less what nearly all robots share, a gust for instance;
* consistency: measured position less where the robot's own reported velocities take it;
* disagreement: measured velocity less the median of the trusted robots in its neighbourhood.

Each is measured against how far healthy robots stray, which was identified from flights (`gcs identify`), widened by
the white noise that telemetry shows at the time. A cumulative sum of log-likelihood ratios with bounds on both sides (a
CUSUM that forgets) becomes trust: what is lost can be regained.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from trustr.leader import capped
from trustr.network import Array, Graph
from trustr.response import Motion, Response, follow, held_back

Flags = npt.NDArray[np.bool_]

PRIOR = math.log(0.05 / 0.95)
"""Log odds of being faulty before anything is known: one robot in twenty."""
LOWEST, HIGHEST = -4.0, 6.0
"""Log odds beyond which evidence is not kept: trust stays repairable, and can be lost in time."""
AGAINST, FOR = 0.35, 0.10
"""The most that one tick of 0.1 s may add and take off: trust is lost within 1.2 s, and regained within 6 s."""
TICK_S = 0.1
"""The tick that AGAINST and FOR are meant for; other ticks are worth their share."""
RATIO = 3.75
"""σ_f / σ_h: how much further than healthy robots faulty ones stray."""
SMOOTHING_S = 0.3
"""Low pass of the residuals."""
NOISE_RISE_S, NOISE_FALL_S = 0.3, 1.0
"""Low pass of the estimated variance of telemetry noise: noise that sets in must not be taken for faults meanwhile."""
UNREST_MEMORY_S = 2.0
"""Low pass of the variance that most robots show."""
PLACE_MEMORY_S = 1.0
"""How long positions are predicted from reported velocities before they are believed; after longer silence they are
believed at once."""
WILDEST = 3.0
"""m/s and m: no single residual counts for more, so that one wild message is not ten."""
ENOUGH_TO_SHARE = 3
"""Robots."""
TRUSTED = 0.5
MEDIAN_CHI2 = 2.0 * math.log(2.0)
"""Median of χ² with two degrees of freedom: the squared length of a standard normal vector in the plane."""


@dataclass(frozen=True, slots=True)
class Watch:
    """What stays the same through a flight: how healthy robots behave."""

    response: Response
    tolerance: float
    """m/s, σ_h: spread of a healthy robot's smoothed response residual, an axis, telemetry noise taken off."""
    place_tolerance: float
    """m: the same of the consistency residual."""
    disagreement: float
    """m/s: spread of what sets a healthy robot's velocity apart from its neighbours', an axis."""
    dt: float
    """s, a tick."""


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """What is kept from tick to tick of N robots."""

    commanded_ne: Array
    """(D, N, 2) m/s: the commands of the last ticks, newest last."""
    expected: Motion
    """What healthy robots would fly now."""
    raw_ne: Array
    """(N, 2) m/s: the response residual, as measured."""
    residual_ne: Array
    """(N, 2) m/s: the same, smoothed."""
    predicted_ne: Array
    """(N, 2) m: where reported velocities take each robot."""
    strayed_ne: Array
    """(N, 2) m: the consistency residual, as measured."""
    inconsistency_ne: Array
    """(N, 2) m: the same, smoothed."""
    disagreement_ne: Array
    """(N, 2) m/s, smoothed."""
    velocity_noise: float
    """m²/s²: variance of the white noise of reported velocities, an axis."""
    place_noise: float
    """m²: the same of reported positions."""
    unrest: float
    """m²/s²: variance of the smoothed response residual of most robots, an axis: gusts, or a model that is off."""
    silent_s: Array
    """(N,) s: for how long nothing new has been heard."""
    log_odds: Array
    """(N,) of being faulty."""

    @staticmethod
    def start(watch: Watch, *, commanded_ne: Array, position_ne: Array, velocity_ne: Array) -> Evidence:
        """Nothing is known but where all are, what they fly (N, 2) and what they were told to."""
        nothing = np.zeros_like(velocity_ne)
        return Evidence(
            commanded_ne=np.repeat(commanded_ne[None], held_back(watch.response, watch.dt), axis=0),
            expected=Motion(velocity_ne, nothing),
            raw_ne=nothing,
            residual_ne=nothing,
            predicted_ne=position_ne,
            strayed_ne=nothing,
            inconsistency_ne=nothing,
            disagreement_ne=nothing,
            velocity_noise=watch.tolerance**2,
            place_noise=watch.place_tolerance**2,
            unrest=0.0,
            silent_s=np.zeros(len(velocity_ne)),
            log_odds=np.full(len(velocity_ne), PRIOR),
        )


def weigh(
    evidence: Evidence,
    watch: Watch,
    *,
    commanded_ne: Array,
    position_ne: Array,
    velocity_ne: Array,
    told: Flags,
    graph: Graph | None,
) -> Evidence:
    """The evidence after one more tick.

    commanded_ne: (N, 2) m/s sent at the tick before;  position_ne, velocity_ne: (N, 2) m and m/s measured at this one.
    told: (N,) False where nothing new was heard: that robot's evidence rests.
    graph: who hears whom; without it (before the mission) robots are watched and not yet judged.
    """
    commanded = np.concatenate([evidence.commanded_ne[1:], commanded_ne[None]])
    returns = told & (evidence.silent_s > PLACE_MEMORY_S)
    expected = _begun_anew(follow(watch.response, evidence.expected, commanded, dt=watch.dt), velocity_ne, returns)
    smooth = _share(SMOOTHING_S, watch.dt)

    off = velocity_ne - expected.velocity_ne
    believable = capped(off, WILDEST)
    raw = _update(evidence.raw_ne, believable, told)
    own = raw - shared(raw, told)
    residual = _update(evidence.residual_ne, evidence.residual_ne + smooth * (own - evidence.residual_ne), told)
    velocity_noise = _noise(evidence.velocity_noise, raw - evidence.raw_ne, told, watch.dt)

    # one wild velocity must not carry the prediction off; and who is silent flies on as healthy robots would
    flown = _update(expected.velocity_ne, velocity_ne - (off - believable), told)
    predicted = evidence.predicted_ne + watch.dt * flown
    predicted = _update(predicted, position_ne, returns)
    strayed = _update(evidence.strayed_ne, capped(position_ne - predicted, WILDEST), told)
    predicted = _update(predicted, predicted + _share(PLACE_MEMORY_S, watch.dt) * strayed, told)
    inconsistency = evidence.inconsistency_ne + smooth * (strayed - evidence.inconsistency_ne)
    place_noise = _noise(evidence.place_noise, strayed - evidence.strayed_ne, told, watch.dt)

    watched = replace(
        evidence,
        commanded_ne=commanded,
        expected=expected,
        raw_ne=raw,
        residual_ne=residual,
        predicted_ne=predicted,
        strayed_ne=strayed,
        inconsistency_ne=_update(evidence.inconsistency_ne, inconsistency, told),
        velocity_noise=velocity_noise,
        place_noise=place_noise,
        silent_s=np.where(told, 0.0, evidence.silent_s + watch.dt),
        unrest=evidence.unrest + _share(UNREST_MEMORY_S, watch.dt) * (_unrest(residual, told) - evidence.unrest),
    )
    return watched if graph is None else _judge(watched, watch, velocity_ne, told, graph)


def _judge(evidence: Evidence, watch: Watch, velocity_ne: Array, told: Flags, graph: Graph) -> Evidence:
    smooth = _share(SMOOTHING_S, watch.dt)
    trusted = told & (trust_of(evidence.log_odds) >= TRUSTED)
    apart = capped(velocity_ne - neighbourhood(graph, velocity_ne, trusted), WILDEST)
    disagreement = _update(
        evidence.disagreement_ne, evidence.disagreement_ne + smooth * (apart - evidence.disagreement_ne), told
    )
    judged = replace(evidence, disagreement_ne=disagreement)
    worst = np.maximum.reduce(accusations(judged, watch))
    worth = watch.dt / TICK_S
    change = np.clip(worst * worth, -FOR * worth, AGAINST * worth)
    log_odds = np.clip(evidence.log_odds + np.where(told, change, 0.0), LOWEST, HIGHEST)
    return replace(judged, log_odds=log_odds)


def shared(raw_ne: Array, told: Flags) -> Array:
    """What nearly all residuals (N, 2) have in common, (2,): the doing of the air, or of the model, and nobody's fault.

    Axis by axis, with the outermost left aside, (n − 1) // 3 at either end, it is the residual closest to zero, and
    nothing where those between differ in sign: so no third of the swarm can put its fault upon the others. Of fewer
    than three robots nothing can be said.
    """
    count = int(np.count_nonzero(told))
    if count < ENOUGH_TO_SHARE:
        return np.zeros(2)
    ordered = np.sort(raw_ne[told], axis=0)
    low, high = ordered[(count - 1) // 3], ordered[-1 - (count - 1) // 3]
    return np.asarray(np.maximum(low, 0.0) + np.minimum(high, 0.0))


def neighbourhood(graph: Graph, velocity_ne: Array, trusted: Flags) -> Array:
    """Median velocity (N, 2) m/s, axis by axis, of the trusted robots that each robot hears besides itself.

    A robot that hears none is its own neighbourhood.
    """
    itself = graph.receiver == graph.sender
    others = trusted[graph.sender] & ~itself
    alone = graph.sum_by_receiver(others.astype(np.float64)) == 0.0
    counted = others | (itself & alone[graph.receiver])
    heard = Graph(graph.count, graph.receiver[counted], graph.sender[counted], graph.distance[counted])
    median = np.empty_like(velocity_ne)
    for axis in range(2):
        lower, upper = heard.middle_by_receiver(velocity_ne[:, axis])
        median[:, axis] = 0.5 * (lower + upper)
    return median


def accusations(evidence: Evidence, watch: Watch) -> tuple[Array, Array, Array]:
    """Log-likelihood ratio, faulty against healthy, of response, consistency and disagreement: (N,) each."""
    response, consistency, disagreement = spreads(evidence, watch)
    return (
        _ratio(evidence.residual_ne, response),
        _ratio(evidence.inconsistency_ne, consistency),
        _ratio(evidence.disagreement_ne, disagreement),
    )


def spreads(evidence: Evidence, watch: Watch) -> tuple[float, float, float]:
    """σ² of a healthy robot's response, consistency and disagreement residuals, an axis, telemetry's noise included."""
    passed = _passed(SMOOTHING_S, watch.dt)
    restless = max(passed * evidence.velocity_noise, evidence.unrest)
    walked = evidence.velocity_noise * watch.dt**2 / (2.0 * _share(PLACE_MEMORY_S, watch.dt))
    return (
        watch.tolerance**2 + restless,
        watch.place_tolerance**2 + passed * evidence.place_noise + walked,
        watch.disagreement**2 + passed * evidence.velocity_noise,
    )


def _ratio(residual: Array, variance: float) -> Array:
    """ln p(e | σ_f) / p(e | σ_h) = −2 ln(σ_f/σ_h) + ½ ‖e‖² (1/σ_h² − 1/σ_f²), for normal errors in the plane."""
    squared = np.einsum("ij,ij->i", residual, residual)
    return np.asarray(-2.0 * math.log(RATIO) + 0.5 * squared / variance * (1.0 - RATIO**-2))


INNOCENT = math.sqrt(4.0 * math.log(RATIO) / (1.0 - RATIO**-2))
"""A residual of so many σ_h speaks neither for nor against a robot: 2.39."""


def forgiven(evidence: Evidence, robots: Flags) -> Evidence:
    """The same, and of these robots (N,) nothing is known: no odds, and no residuals to bring them back."""
    some = robots[:, None]
    return replace(
        evidence,
        residual_ne=np.where(some, 0.0, evidence.residual_ne),
        inconsistency_ne=np.where(some, 0.0, evidence.inconsistency_ne),
        disagreement_ne=np.where(some, 0.0, evidence.disagreement_ne),
        log_odds=np.where(robots, PRIOR, evidence.log_odds),
    )


def trust_of(log_odds: Array) -> Array:
    """Trust (N,) in [0, 1] from log odds of being faulty: the probability of being healthy."""
    return np.asarray(1.0 / (1.0 + np.exp(log_odds)))


def _begun_anew(expected: Motion, velocity_ne: Array, returns: Flags) -> Motion:
    """Of robots that come back after a long silence nobody knows which commands reached them."""
    if not returns.any():
        return expected
    known = returns[:, None]
    return Motion(np.where(known, velocity_ne, expected.velocity_ne), np.where(known, 0.0, expected.acceleration_ne))


def _update(before: Array, after: Array, told: Flags) -> Array:
    return after if told.all() else np.where(told[:, None], after, before)


def _noise(before: float, step: Array, told: Flags, dt: float) -> float:
    """Variance of white noise from residuals' steps (N, 2): the median robot's, so that a faulty few do not count."""
    if not told.any():
        return before
    variance = float(np.median(np.einsum("ij,ij->i", step, step)[told])) / (2.0 * MEDIAN_CHI2)
    return before + _share(NOISE_RISE_S if variance > before else NOISE_FALL_S, dt) * (variance - before)


def _unrest(residual_ne: Array, told: Flags) -> float:
    """Variance of residuals (N, 2), an axis, by the lower median of their squared lengths: half the swarm may fail.

    Of n such lengths of normal vectors the k-th smallest is 2σ² (1/n + 1/(n−1) + … + 1/(n−k+1)) in the mean.
    """
    lengths = np.sort(np.einsum("ij,ij->i", residual_ne, residual_ne)[told])
    count = len(lengths)
    if count < ENOUGH_TO_SHARE:
        return 0.0
    rank = (count + 1) // 2
    return float(lengths[rank - 1]) / (2.0 * sum(1.0 / (count - below) for below in range(rank)))


def _share(time_s: float, dt: float) -> float:
    """What a first-order low pass takes over in one tick."""
    return 1.0 - math.exp(-dt / time_s)


def _passed(time_s: float, dt: float) -> float:
    """Share of white noise's variance that passes the low pass."""
    share = _share(time_s, dt)
    return share / (2.0 - share)
