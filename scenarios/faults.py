"""What can go wrong with one vehicle: a kind of `[[fault]]` each, with onset, end and severity.

Directions are headings, clockwise from north. Commands are bent on the level and in OFFBOARD only. What is reported
wrongly deceives whoever listens; the vehicle itself takes off, holds and lands by the truth.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from scenarios.section import Fraction, Heading, NotNegative, Positive, Section


class Fault(Section):
    """What every fault has: whom it strikes, and when, and how it comes and goes."""

    vehicle: Annotated[int, Field(ge=1)]
    onset_s: NotNegative = 0.0
    end_s: Positive | None = None
    """Never, if absent."""
    grows_over_s: NotNegative = 0.0
    """Its severity grows evenly from nothing at onset to the full one so many seconds later; 0 strikes at once. What
    cannot be halved (frozen telemetry, a stuck velocity) is there as soon as it begins to grow."""
    period_s: Positive | None = None
    """It comes and goes with this period, counted from onset; it stays, if absent. Whatever builds up (a drift, a false
    place, what is frozen) begins anew each time."""
    on_fraction: Annotated[float, Field(gt=0, le=1)] = 0.5
    """The first part of each period, in which it acts; without period_s it means nothing."""

    @model_validator(mode="after")
    def _ends_after_onset(self) -> Fault:
        if self.end_s is not None and self.end_s <= self.onset_s:
            raise ValueError(f"end_s = {self.end_s} is not after onset_s = {self.onset_s}")
        return self

    @property
    def blamed(self) -> int | None:
        """The vehicle that deserves distrust while this acts; None where it is nobody's doing."""
        return self.vehicle

    def on_since(self, time_s: float) -> float:
        """Since when it has acted without a break at this time since mission start [s]; infinity if it does not act."""
        if time_s < self.onset_s or (self.end_s is not None and time_s >= self.end_s):
            return math.inf
        if self.period_s is None or self.on_fraction == 1.0:
            return self.onset_s
        periods, into = divmod(time_s - self.onset_s + 1e-9, self.period_s)
        return self.onset_s + periods * self.period_s if into < self.on_fraction * self.period_s else math.inf

    def active(self, time_s: float) -> bool:
        """Whether the fault acts at this time since mission start [s]."""
        return self.on_since(time_s) < math.inf

    def is_yet_to_act(self, time_s: float) -> bool:
        """Whether it does not act, or begins to at this very moment: what stays is what was there at such times."""
        return time_s <= self.on_since(time_s) + 1e-9

    def strength(self, time_s: float) -> float:
        """How much of its severity it has at this time since mission start [s], in [0, 1]."""
        if not self.active(time_s):
            return 0.0
        age_s = time_s - self.onset_s
        return 1.0 if age_s >= self.grows_over_s else age_s / self.grows_over_s

    def built_up_s(self, time_s: float) -> float:
        """∫ strength dt [s] since it last began to act: what a rate times this has come to."""
        since_s = self.on_since(time_s)
        return 0.0 if since_s == math.inf else max(0.0, self._grown_s(time_s) - self._grown_s(since_s))

    def _grown_s(self, time_s: float) -> float:
        """∫ of a strength that grows and never pauses, from onset [s]."""
        age_s, grows_s = time_s - self.onset_s, self.grows_over_s
        return age_s - grows_s / 2 if age_s >= grows_s else age_s * age_s / (2 * grows_s)


class MotorDegradation(Fault):
    """The paper's fault: a restricted maximum speed and a fixed offset across the direction of flight."""

    kind: Literal["motor_degradation"]
    max_speed_fraction: Fraction = 0.4
    """Of cruise: the paper flies 0.4 and 0.7."""
    offset_fraction: Fraction = 0.47
    """Of cruise, to the left of the commanded direction."""


class RotorFault(Fault):
    """A physical fault of one rotor: what it does to the flight is up to the flight model."""

    kind: Literal["rotor"]
    rotor: Annotated[int, Field(ge=1, le=4)]
    efficiency: Fraction = 1.0
    """Of the healthy thrust at the same speed."""
    speed_limit: Fraction = 1.0
    """Of the healthy maximum speed."""


class CompassBias(Fault):
    """A vehicle that dead-reckons its velocity believes north elsewhere.

    It flies every set-point turned by the bias and reports the velocity that it believes, the true one turned back. Its
    GPS position stays true, so that what it says of its velocity and of its place disagree.
    """

    kind: Literal["compass_bias"]
    bias_deg: Annotated[float, Field(ge=-180, le=180)] = 30.0
    """Clockwise seen from above: asked to fly north with 90, it flies east."""


class StuckVelocity(Fault):
    """It keeps flying the set-point that it had at onset, whatever it is told; it reports truly."""

    kind: Literal["stuck_velocity"]


class WindFault(Fault):
    """Air that moves around one vehicle, or around all: on top of `[wind]` and of the gusts of `[noise]`."""

    kind: Literal["wind"]
    speed_m_s: Annotated[float, Field(ge=0, le=50)] = 3.0
    """Steady wind."""
    from_deg: Heading = 0.0
    """Where it blows from, as a weather report says it."""
    gust_m_s: Annotated[float, Field(ge=0, le=30)] = 0.0
    """Standard deviation an axis of a first-order Gauss–Markov wind, each vehicle's own."""
    gust_time_s: Positive = 2.0
    """Its correlation time."""
    everyone: bool = False
    """It strikes the whole swarm, `vehicle` or not, and nobody is to blame."""

    @property
    def blamed(self) -> int | None:
        """Nobody, where all are struck alike."""
        return None if self.everyone else self.vehicle


class GpsDrift(Fault):
    """The reported position drifts away from the true one; the reported velocity stays true."""

    kind: Literal["gps_drift"]
    rate_m_s: Annotated[float, Field(ge=0, le=20)] = 0.5
    """Of the drift at full strength: the error is the integral of what it has grown to."""
    towards_deg: Heading = 0.0
    """Where the reported position goes."""


class GpsJump(Fault):
    """The reported position is beside the true one by a step; the reported velocity stays true."""

    kind: Literal["gps_jump"]
    distance_m: Annotated[float, Field(ge=0, le=1000)] = 5.0
    towards_deg: Heading = 0.0
    """Where the reported position lies, seen from the true one."""


class FalseReport(Fault):
    """It obeys, and lies: it reports its velocity with an offset, and the place where that would have brought it.

    So the two agree: the reported position is off by the integral of the offset since onset.
    """

    kind: Literal["false_report"]
    offset_m_s: Annotated[float, Field(ge=0, le=20)] = 0.75
    """Reported minus true velocity."""
    towards_deg: Heading = 0.0
    """Where the offset points."""


class LaggingTelemetry(Fault):
    """It reports where it was and how it flew a while ago, under the time stamp of now."""

    kind: Literal["lagging_telemetry"]
    lag_s: Annotated[float, Field(gt=0, le=10)] = 1.0
    """Age of what is reported."""


class FrozenTelemetry(Fault):
    """It reports the position and the velocity it had at onset, again and again, under ever new time stamps."""

    kind: Literal["frozen_telemetry"]


AnyFault = Annotated[
    MotorDegradation
    | RotorFault
    | CompassBias
    | StuckVelocity
    | WindFault
    | GpsDrift
    | GpsJump
    | FalseReport
    | LaggingTelemetry
    | FrozenTelemetry,
    Field(discriminator="kind"),
]
