"""What one vehicle tells of itself, from the truth to telemetry: wrong senses and lies, noise, a stale report.

    truth ─► what it believes, or pretends ─► measurement noise ─► how old it is ─► telemetry

Telemetry is asked for at any moment and rate, so every stage is a function of time, or of what was noted every
SAMPLE_S, and never of how often somebody asked.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque

from fdm.faults import compass_turn, turned
from fdm.noise import Held, Purpose, generator, white
from scenarios import (
    CompassBias,
    FalseReport,
    FrozenTelemetry,
    GpsDrift,
    GpsJump,
    LaggingTelemetry,
    Scenario,
    direction,
)

State = tuple[float, ...]
"""(n, e, d, vn, ve, vd), m and m/s."""

SAMPLE_S = 0.02
"""How often a vehicle whose telemetry grows stale notes what it would report."""
BLUR_S = 0.1
"""How long one draw of measurement noise lasts."""


class Sensors:
    """Telemetry of the vehicle with this system id. Times are seconds since boot."""

    def __init__(self, scenario: Scenario, *, vehicle: int, seed: int) -> None:
        mine = [fault for fault in scenario.fault if fault.vehicle == vehicle]
        self._noise, self._system, self._seed = scenario.noise, vehicle, seed
        self._compasses = [fault for fault in mine if isinstance(fault, CompassBias)]
        self._misled = [fault for fault in mine if isinstance(fault, FalseReport | GpsDrift | GpsJump)]
        self._stale: list[_Lagging | _Frozen] = [_Lagging(f) for f in mine if isinstance(f, LaggingTelemetry)]
        self._stale += [_Frozen(f) for f in mine if isinstance(f, FrozenTelemetry)]
        self._blur: Held | None = None
        self._start_s = math.inf

    @property
    def go_stale(self) -> bool:
        """Whether `note` is to be called every SAMPLE_S."""
        return bool(self._stale)

    def begin(self, time_s: float) -> None:
        """Mission start: from now on there are noise and faults."""
        self._start_s = time_s
        x, v = self._noise.position_m, self._noise.velocity_m_s
        if x or v:
            rng = generator(self._seed, self._system, Purpose.MEASUREMENT)
            self._blur = Held(white(rng, (x, x, v, v)), period_s=BLUR_S)

    def end(self) -> None:
        """The flight is over: telemetry is exact until the next begins."""
        self._start_s = math.inf

    def measured(self, truth: State, time_s: float) -> State:
        """(n, e, d, vn, ve, vd) as telemetry reports it.

        Noise has a new draw every BLUR_S, so every message of a stream at 10 Hz has its own, and two flights with one
        seed see the same noise even if one asks more often, or at other moments of a tick, than the other.
        """
        measured = self._fresh(truth, time_s)
        for stage in self._stale:
            measured = stage.told(measured, time_s, time_s - self._start_s)
        return measured

    def note(self, truth: State, time_s: float) -> None:
        """Remember what stale telemetry will report later."""
        measured = self._fresh(truth, time_s)
        for stage in self._stale:
            stage.note(measured, time_s, time_s - self._start_s)
            measured = stage.told(measured, time_s, time_s - self._start_s)

    def _fresh(self, truth: State, time_s: float) -> State:
        """What would be reported if nothing were stale."""
        since_s = time_s - self._start_s
        if self._misled or self._compasses:
            truth = self._believed(truth, since_s)
        if since_s <= 0.0 or self._blur is None:
            return truth
        n, e, vn, ve = self._blur.at(since_s)
        return truth[0] + n, truth[1] + e, truth[2], truth[3] + vn, truth[4] + ve, truth[5]

    def _believed(self, truth: State, since_s: float) -> State:
        """What it takes for true, or says it does, this long since mission start [s]."""
        n, e, d, vn, ve, vd = truth
        vn, ve = turned((vn, ve), -compass_turn(self._compasses, since_s))
        for fault in self._misled:
            place, speed = _deceit(fault, since_s)
            north, east = direction(fault.towards_deg)
            n, e, vn, ve = n + place * north, e + place * east, vn + speed * north, ve + speed * east
        return n, e, d, vn, ve, vd


def _deceit(fault: FalseReport | GpsDrift | GpsJump, since_s: float) -> tuple[float, float]:
    """How far [m] and how fast [m/s] the report is beside the truth."""
    if isinstance(fault, FalseReport):
        return fault.offset_m_s * fault.built_up_s(since_s), fault.offset_m_s * fault.strength(since_s)
    if isinstance(fault, GpsDrift):
        return fault.rate_m_s * fault.built_up_s(since_s), 0.0
    return fault.distance_m * fault.strength(since_s), 0.0


class _Lagging:
    """Telemetry of a while ago, between two notes on the line that joins them."""

    def __init__(self, fault: LaggingTelemetry) -> None:
        self._fault = fault
        self._notes: deque[tuple[float, State]] = deque()

    def note(self, measured: State, time_s: float, _since_s: float) -> None:
        self._notes.append((time_s, measured))
        while len(self._notes) > 1 and self._notes[1][0] <= time_s - self._fault.lag_s:
            self._notes.popleft()

    def told(self, measured: State, time_s: float, since_s: float) -> State:
        lag_s = self._fault.lag_s * self._fault.strength(since_s)
        if lag_s == 0.0 or not self._notes:
            return measured
        wanted = time_s - lag_s
        after = bisect_right(self._notes, wanted, key=lambda note: note[0])
        if after == 0:
            return self._notes[0][1]
        t0, before = self._notes[after - 1]
        t1, behind = self._notes[after] if after < len(self._notes) else (time_s, measured)
        share = (wanted - t0) / (t1 - t0)
        return tuple([x + share * (y - x) for x, y in zip(before, behind, strict=True)])


class _Frozen:
    """Telemetry that stays what it was at the last note before it froze."""

    def __init__(self, fault: FrozenTelemetry) -> None:
        self._fault = fault
        self._kept: State | None = None

    def note(self, measured: State, _time_s: float, since_s: float) -> None:
        if self._kept is None or self._fault.is_yet_to_act(since_s):
            self._kept = measured

    def told(self, measured: State, _time_s: float, since_s: float) -> State:
        frozen = self._fault.strength(since_s) > 0.0
        return self._kept if frozen and self._kept is not None else measured
