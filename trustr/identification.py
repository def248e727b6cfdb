"""What healthy vehicles are like, found from flights without a fault: their response, and how far they stray."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trustr.evidence import Evidence, Watch, spreads, weigh
from trustr.network import Array
from trustr.response import Response, followed

LONGEST_S = 3.0
"""Delays and lags are looked for up to here."""
STARTS = ((0.15, 0.3), (0.4, 1.0))
"""Delay and lag [s] from which the fit begins: quick vehicles, and slow ones."""
BOUNDED_START = (0.3, 2.5, 5.0)
LEAST, MOST = (0.02, 0.2, 0.2), (LONGEST_S, 20.0, 50.0)
"""Lag [s], acceleration [m/s²] and jerk [m/s³] of vehicles with bounds: where the fit begins, and its limits."""
ROUGHLY = 0.01
"""Of cost and parameters: good enough to see which delay is the best."""
WORTH_IT = 0.9
"""Of the squared error: bounds that take off less than a tenth are no bounds."""
SETTLING_S = 3.0
"""Of each flight, until noise has been estimated; not judged."""
TAIL = 0.001
"""Spreads are taken from the largest residual of a thousand: what is rare is no normal distribution's."""
MARGIN = 1.5
"""For weather that the flights did not meet."""
FINEST = 0.02
"""m/s and m: nothing flies more exactly than it is worth asking for."""


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """One stretch of flight, T ticks of N healthy vehicles."""

    commanded_ne: Array
    """(T, N, 2) m/s, sent at each tick."""
    velocity_ne: Array
    """(T, N, 2) m/s, measured at each tick."""
    position_ne: Array
    """(T, N, 2) m, measured at each tick."""


@dataclass(frozen=True, slots=True)
class Identified:
    """What was found."""

    response: Response
    tolerance: float
    """m/s, σ_h of the response residual."""
    place_tolerance: float
    """m, of the consistency residual."""
    unexplained: float
    """m/s: root mean square of what the response leaves unexplained, an axis, telemetry noise included."""
    moved: float
    """m/s: root mean square of the velocity about its mean, an axis: little motion identifies little."""


def identify(samples: Sequence[Sample], *, dt: float) -> Identified:
    """The response by least squares over delay and lag, then the tolerances that go with it.

    dt: s, a tick;  samples: at least one, of at least SETTLING_S and some.
    """
    response, errors = _best(samples, dt)
    tolerance, place_tolerance = _tolerances(samples, response, dt)
    velocities = [sample.velocity_ne - sample.velocity_ne.mean(axis=0) for sample in samples]
    return Identified(
        response=response,
        tolerance=tolerance,
        place_tolerance=place_tolerance,
        unexplained=float(np.sqrt(np.mean(errors**2))),
        moved=float(np.sqrt(np.mean(np.concatenate([velocity.ravel() for velocity in velocities]) ** 2))),
    )


def _best(samples: Sequence[Sample], dt: float) -> tuple[Response, Array]:
    """The response that leaves the least unexplained, and what that is; with bounds only where they explain more."""
    from scipy.optimize import least_squares  # a third of a second to import, for one command

    def errors(parameters: Array) -> Array:
        response = Response(*map(float, parameters))
        return np.concatenate([_unexplained(sample, response, dt).ravel() for sample in samples])

    free = [least_squares(errors, start, bounds=(0.0, LONGEST_S), diff_step=1e-3) for start in STARTS]
    without = min(free, key=lambda fit: float(fit.cost))
    if np.mean(without.fun**2) * WORTH_IT < _white(samples, Response(*map(float, without.x)), dt):
        return Response(*map(float, without.x)), np.asarray(without.fun)

    def bounded(delay_s: float) -> tuple[float, Array]:
        """Cost, and delay, lag, acceleration and jerk, of the best vehicle with bounds and this delay."""
        fit = least_squares(
            lambda rest: errors(np.array([delay_s, *rest])),
            BOUNDED_START,
            bounds=(LEAST, MOST),
            diff_step=1e-2,
            x_scale=BOUNDED_START,
            ftol=ROUGHLY,
            xtol=ROUGHLY,
        )
        return float(fit.cost), np.array([delay_s, *fit.x])

    # within every tick of delay the cost has a minimum of its own; over whole ticks it has one
    late = range(1 + int(sum(without.x) / dt))
    _, start = min((bounded(ticks * dt) for ticks in late), key=lambda found: found[0])
    limits = (0.0, *LEAST), (LONGEST_S, *MOST)
    with_bounds = least_squares(errors, start, bounds=limits, diff_step=1e-2, x_scale=(0.3, *BOUNDED_START))
    best = with_bounds if with_bounds.cost < WORTH_IT * without.cost else without
    return Response(*map(float, best.x)), np.asarray(best.fun)


def _white(samples: Sequence[Sample], response: Response, dt: float) -> float:
    """m²/s²: the part of what is unexplained that changes from tick to tick, which no response explains."""
    steps = np.concatenate([np.diff(_unexplained(sample, response, dt), axis=0).ravel() for sample in samples])
    return 0.5 * float(np.mean(steps**2))


def _unexplained(sample: Sample, response: Response, dt: float) -> Array:
    return sample.velocity_ne - followed(response, sample.velocity_ne[0], sample.commanded_ne, dt=dt)


def _tolerances(samples: Sequence[Sample], response: Response, dt: float) -> tuple[float, float]:
    """Spread of the residuals' tails, less what telemetry's noise makes of it, with MARGIN."""
    watch = Watch(response, FINEST, FINEST, FINEST, dt)
    excess: tuple[list[Array], list[Array]] = ([], [])
    for sample in samples:
        told = np.ones(sample.velocity_ne.shape[1], bool)
        evidence = Evidence.start(
            watch,
            commanded_ne=sample.commanded_ne[0],
            position_ne=sample.position_ne[0],
            velocity_ne=sample.velocity_ne[0],
        )
        for tick in range(1, len(sample.velocity_ne)):
            evidence = weigh(
                evidence,
                watch,
                commanded_ne=sample.commanded_ne[tick - 1],
                position_ne=sample.position_ne[tick],
                velocity_ne=sample.velocity_ne[tick],
                told=told,
                graph=None,
            )
            if tick * dt >= SETTLING_S:
                noise = spreads(evidence, watch)
                residuals = evidence.residual_ne, evidence.inconsistency_ne
                for kept, residual, variance in zip(excess, residuals, noise, strict=False):
                    squared = (residual**2).sum(axis=1) / (-2.0 * math.log(TAIL))  # χ² of two degrees of freedom
                    kept.append(squared - variance + FINEST**2)
    wanted = [math.sqrt(max(0.0, float(np.quantile(np.concatenate(kept), 1.0 - TAIL)))) for kept in excess]
    return max(FINEST, MARGIN * wanted[0]), max(FINEST, MARGIN * wanted[1])
