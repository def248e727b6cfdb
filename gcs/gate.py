"""The only way for a set-point to come into being: whatever decided, this is what may fly.

Four questions, in this order. May this vehicle be sent anything? Is what was asked a number, and decided in time? Is it
no faster, and no more of a change, than the limits allow? Could the vehicle, flying it, still stop inside the fence?

About the fence: a vehicle that takes up its set-point with any first-order lag up to RESPONSE_S, and whose set-points
are then brought straight to zero at BRAKING, comes to rest at

    p + τ v + û (|u|² / 2a + |u| dt),    0 ≤ τ ≤ RESPONSE_S,

p and v where it is and how fast, u what it is sent, û its direction. A set-point is admitted if that place is inside
for both ends of τ, and so is p + τ v. If it was inside a tick ago, then braking now keeps it inside, so there is always
a set-point to admit, and the way to that place is inside as well: it lies between p, p + τ v and where it ends, and a
cylinder is convex. A vehicle that drifts outwards, or is blown, may have no such set-point: it is braked as hard as the
limits allow, or flies what ends no farther out than braking does. To one that is outside, its own place is the bound.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gcs.commands import SetVelocity
from gcs.telemetry import Flags, Integers
from scenarios import Scenario
from trustr.leader import capped

Array = npt.NDArray[np.float64]
Beyond = Callable[[Array], Array]
"""(N, k) m → (N,) m: how far places lie outside the fence; not above 0 inside."""

PASSED, SLOWED, REFUSED, FENCED, WITHHELD = range(5)
"""Verdicts: as asked; limited in speed or acceleration; no number, or decided too late, so the vehicle is asked to
stop; limited by the fence; nothing sent, because the vehicle is not heard or not ours."""

LOST_NS = 1_000_000_000
"""Age of telemetry from which a vehicle gets no more set-points."""
LATE_PERIODS = 2
"""A decision that is later than this asks nobody to move."""
ABSURD = 1e6
"""m/s: nobody means this, and from 1e154 on its square is no number."""

RESPONSE_S = 1.0
"""The slowest answer to a set-point that the fence reckons with, beside the bound of BRAKING …"""
BRAKING = 2.5, 1.0
"""… and m/s², on the level and in height: how ArduCopter brakes, the slowest autopilot that we know."""
HAIR = 1e-3
"""m: so much smaller is the fence that set-points are held to, for they are rounded on their way."""
HALVINGS = 12
"""Of the way from braking to what was asked, to find how much of it may be flown."""


@dataclass(frozen=True, slots=True)
class Limits:
    """What a set-point may ask for at most."""

    speed: float
    """m/s, horizontal and vertical each."""
    acceleration: float
    """m/s², of one set-point against the one before, or against what the vehicle flies where there was none."""
    radius: float = math.inf
    """m, horizontal, from the fence's centre."""
    ceiling: float = math.inf
    floor: float = -math.inf
    """m above each vehicle's home."""

    @staticmethod
    def of(scenario: Scenario) -> Limits:
        """Those of a scenario; a bound of its fence that is absent is infinitely far."""
        limits, fence = scenario.limits, scenario.limits.fence
        return Limits(
            limits.speed_m_s,
            limits.acceleration_m_s2,
            math.inf if fence.radius_m is None else fence.radius_m,
            math.inf if fence.ceiling_m is None else fence.ceiling_m,
            -math.inf if fence.floor_m is None else fence.floor_m,
        )

    @property
    def fenced(self) -> bool:
        """Whether there is any bound to where vehicles may be."""
        return math.isfinite(self.radius) or math.isfinite(self.ceiling) or math.isfinite(self.floor)


@dataclass(frozen=True, slots=True, eq=False)
class Standing:
    """What the gate must know of the vehicles, and of the tick, before it lets anything pass."""

    ids: tuple[int, ...]
    """System ids."""
    ours: Flags
    """(N,) in a mode of ours, and taken from us by nobody."""
    age_ns: Integers
    """(N,) of the telemetry that tells the next two."""
    place_ned: Array
    """(N, 3) m: north and east of the fence's centre, down from the vehicle's home."""
    velocity_ned: Array
    """(N, 3) m/s."""
    before_ned: Array
    """(N, 3) m/s: the set-points of the last tick, as they were sent; NaN where none was, for whatever reason: the next
    goes on from what the vehicle flies."""
    lateness_ns: int
    """Of the tick, after its deadline."""


@dataclass(frozen=True, slots=True, eq=False)
class Passage:
    """What came through the gate."""

    sent_ned: Array
    """(N, 3) m/s, to the last bit what each vehicle will decode; zero where nothing is sent."""
    verdict: npt.NDArray[np.int8]
    """(N,)"""
    commanded: Flags
    """(N,) whom something is sent to."""
    commands: list[tuple[int, SetVelocity]]
    """System id and set-point."""


def admit(asked_ned: Array, yaw: float, standing: Standing, limits: Limits, *, dt: float) -> Passage:
    """What is sent of what was asked, (N, 3) m/s, with this heading [rad]; dt: s between two ticks."""
    commanded = standing.ours & (standing.age_ns <= LOST_NS)
    before = _before(standing, limits)
    meant = np.asarray((np.abs(asked_ned) <= ABSURD).all(axis=1))
    if limits.fenced:
        meant &= np.isfinite(standing.place_ned).all(axis=1) & np.isfinite(standing.velocity_ned).all(axis=1)
    if standing.lateness_ns > LATE_PERIODS * dt * 1e9:
        meant = np.zeros_like(meant)
    wanted = _shorten(np.where(meant[:, None], asked_ned, 0.0), limits.speed)
    free = _towards(wanted, before, limits, dt=dt)
    flown = _fenced(free, before, standing, limits, dt=dt, rows=meant & commanded) if limits.fenced else free
    sent = _as_sent(flown, before, limits, dt=dt)
    verdict = np.where(np.abs(free - asked_ned).max(axis=1) > 1e-9, SLOWED, PASSED)
    verdict = np.where((flown != free).any(axis=1), FENCED, verdict)
    verdict = np.where(commanded, np.where(meant, verdict, REFUSED), WITHHELD).astype(np.int8)
    sent = np.where(commanded[:, None], sent, 0.0)
    heading = math.remainder(yaw, math.tau) if math.isfinite(yaw) else 0.0
    commands = [
        (system, SetVelocity(north, east, down, heading))
        for system, (north, east, down), fly in zip(standing.ids, sent.tolist(), commanded.tolist(), strict=True)
        if fly
    ]
    return Passage(sent, verdict, commanded, commands)


def _before(standing: Standing, limits: Limits) -> Array:
    """(N, 3) m/s: from where set-points go on, in single precision and no faster than allowed."""
    flown = _single(_shorten(np.nan_to_num(standing.velocity_ned), limits.speed * (1 - 1e-6)))
    return np.where(np.isnan(standing.before_ned), flown, standing.before_ned)


def _towards(wanted: Array, before: Array, limits: Limits, *, dt: float) -> Array:
    """From the set-points before towards those wanted, as far as the acceleration allows.

    Both are no faster than allowed, and so is everything between them: both bounds hold at once.
    """
    return before + _shorten(wanted - before, limits.acceleration * dt)


def _as_sent(flown: Array, before: Array, limits: Limits, *, dt: float) -> Array:
    """Set-points as MAVLink carries them, in single precision; where rounding breaks a bound, a little less."""
    sent = _single(flown)
    broken = _breaks(sent, before, limits, dt=dt)
    if broken.any():
        tighter = Limits(limits.speed * (1 - 1e-6), max(0.0, limits.acceleration - 1e-6 * limits.speed / dt))
        inner = _towards(_shorten(flown, tighter.speed), before, tighter, dt=dt)
        sent = np.where(broken[:, None], _single(inner), sent)
        sent = np.where(_breaks(sent, before, limits, dt=dt)[:, None], before, sent)
    return sent


def _single(vectors: Array) -> Array:
    return vectors.astype(np.float32).astype(np.float64)


def _breaks(sent: Array, before: Array, limits: Limits, *, dt: float) -> Flags:
    """(N,) whose set-point is too fast, or changes too fast."""
    change, most = sent - before, limits.acceleration * dt
    return np.asarray(
        (np.hypot(sent[:, 0], sent[:, 1]) > limits.speed)
        | (np.abs(sent[:, 2]) > limits.speed)
        | (np.hypot(change[:, 0], change[:, 1]) > most)
        | (np.abs(change[:, 2]) > most)
    )


def _shorten(vectors: Array, most: float) -> Array:
    """Vectors (N, 3) with their horizontal and vertical parts no longer than `most`."""
    shorter = np.empty_like(vectors)
    shorter[:, :2] = capped(vectors[:, :2], most)
    shorter[:, 2] = np.minimum(np.maximum(vectors[:, 2], -most), most)
    return shorter


def _fenced(free: Array, before: Array, standing: Standing, limits: Limits, *, dt: float, rows: Flags) -> Array:
    """What may be flown of `free` by those who are to stop inside the fence, (N,) rows; the others as they are."""
    age_s = np.where(rows, standing.age_ns, 0)[:, None] / 1e9
    velocity = np.where(rows[:, None], standing.velocity_ned, 0.0)
    place = np.where(rows[:, None], standing.place_ned, 0.0) + velocity * age_s
    braked = _towards(np.zeros_like(before), before, limits, dt=dt)
    radius = np.maximum(limits.radius - HAIR, np.hypot(place[:, 0], place[:, 1]))
    highest = np.minimum(HAIR - limits.ceiling, place[:, 2])
    lowest = np.maximum(-limits.floor - HAIR, place[:, 2])

    def level(points: Array) -> Array:
        return np.asarray(np.hypot(points[:, 0], points[:, 1]) - radius)

    def height(points: Array) -> Array:
        return np.maximum(highest - points[:, 0], points[:, 0] - lowest)

    flown = free.copy()
    parts: tuple[tuple[slice, Beyond, float], ...] = (
        (slice(0, 2), level, BRAKING[0]),
        (slice(2, 3), height, BRAKING[1]),
    )
    for part, beyond, braking in parts:
        stop = _Stop(place[:, part], velocity[:, part], beyond, min(braking, limits.acceleration), dt)
        flown[:, part] = stop.nearest(free[:, part], braked[:, part])
    return np.where(rows[:, None], flown, free)


@dataclass(frozen=True, slots=True, eq=False)
class _Stop:
    """Where vehicles come to rest, on the level (k = 2) or in height (k = 1)."""

    place: Array
    """(N, k) m, by now."""
    velocity: Array
    """(N, k) m/s."""
    beyond: Beyond
    braking: float
    """m/s²."""
    dt: float
    """s."""

    def nearest(self, wanted: Array, braked: Array) -> Array:
        """The set-points (N, k) next to those wanted that may be flown; braking where there is none."""
        most = self._most_beyond(braked)
        good = self._stops(wanted, most)
        if good.all():
            return wanted
        less, more = np.zeros(len(wanted)), np.ones(len(wanted))
        for _ in range(HALVINGS):
            middle = 0.5 * (less + more)
            inside = self._stops(braked + middle[:, None] * (wanted - braked), most)
            less, more = np.where(inside, middle, less), np.where(inside, more, middle)
        return np.where(good[:, None], wanted, braked + less[:, None] * (wanted - braked))

    def _stops(self, set_points: Array, most_beyond: Array) -> Flags:
        """(N,) who stops inside without any lag, and with the slowest answer no farther out than this [m]."""
        run = self._run(set_points)
        prompt, slow = self.beyond(self.place + run), self.beyond(self._coast + run)
        return np.asarray((prompt <= 0.0) & (slow <= most_beyond))

    def _most_beyond(self, braked: Array) -> Array:
        """(N,) m outside where the slowest answer may end: none, but where braking ends there, or drifts out first."""
        ends = self.beyond(self._coast + self._run(braked))
        return np.where(self.beyond(self._coast) <= 0.0, np.maximum(ends, 0.0), ends)

    @property
    def _coast(self) -> Array:
        """(N, k) m: where the slowest answer drifts to, whatever it is sent."""
        return np.asarray(self.place + RESPONSE_S * self.velocity)

    def _run(self, set_points: Array) -> Array:
        """(N, k) m: the way from there until it stands."""
        speed = np.sqrt((set_points * set_points).sum(axis=1))[:, None]
        return np.asarray(set_points * (0.5 * speed / self.braking + self.dt))
