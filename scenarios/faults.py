"""What can go wrong with one vehicle: a kind of `[[fault]]` each, with onset, end and severity."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from scenarios.section import Fraction, NotNegative, Positive, Section


class Fault(Section):
    """What every fault has: whom it strikes, and when."""

    vehicle: Annotated[int, Field(ge=1)]
    onset_s: NotNegative = 0.0
    end_s: Positive | None = None
    """Never, if absent."""

    @model_validator(mode="after")
    def _ends_after_onset(self) -> Fault:
        if self.end_s is not None and self.end_s <= self.onset_s:
            raise ValueError(f"end_s = {self.end_s} is not after onset_s = {self.onset_s}")
        return self

    def active(self, time_s: float) -> bool:
        """Whether the fault acts at this time since mission start [s]."""
        return self.onset_s <= time_s and (self.end_s is None or time_s < self.end_s)


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


AnyFault = Annotated[MotorDegradation | RotorFault, Field(discriminator="kind")]
