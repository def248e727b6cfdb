"""What a run reports: one object, on stdout with --json and in summary.json."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

import orjson

from gcs.link_quality import LinkQuality
from gcs.scoring import CONTACT
from scenarios import MotorDegradation, Scenario
from scenarios.models import RULES as ASKS_FOR_TRUST


@dataclass(frozen=True, slots=True)
class Reception:
    """How the vehicles were heard; empty where the link does not tell."""

    rejections: Mapping[str, int] = field(default_factory=dict)
    """Reason → how many frames were refused for it."""
    quality: Mapping[int, LinkQuality] = field(default_factory=dict)
    """System id → how well its autopilot is heard."""

    @staticmethod
    def of(rejections: Mapping[str, int], quality: Mapping[int, LinkQuality]) -> Reception:
        """As a live link tells."""
        return Reception(
            {reason: count for reason, count in sorted(rejections.items()) if count}, dict(sorted(quality.items()))
        )

    @property
    def loss(self) -> dict[str, float]:
        """System id → share of its autopilot's frames that did not come, of those that the link could tell."""
        shares = ((system, heard.loss) for system, heard in self.quality.items())
        return {str(system): loss for system, loss in shares if loss is not None}


@dataclass(frozen=True, slots=True)
class Summary:
    """One flight in figures; null where it did not get so far."""

    scenario: str
    controller: str
    trust: str | None
    """Where trust came from; null for rules that use none."""
    severity: float | None
    """max_speed_fraction of the degraded motor; null without one."""
    seed: int | None
    """null where nothing was simulated by us."""
    heading_error_deg: float | None
    distance_to_target_m: float | None
    min_separation_m: float | None
    passed: bool
    detected: dict[str, float]
    """System id → seconds from the fault's onset until its trust fell below 0.5."""
    false_alarms: int
    left_behind: list[int]
    """System ids of robots beyond repair that the swarm went on without."""
    simulated_s: float
    real_time_factor: float
    recording: str
    """Absolute path."""
    profile: str
    scored_on: str
    """"truth", or "telemetry" where no simulation told it."""
    faults: list[str]
    """What the scenario has go wrong with whom, in words."""
    swarm_heading_error_deg: float | None
    """As heading_error_deg, of all robots."""
    rejected_frames: int
    """What came over the link and was no good frame."""
    rejections: dict[str, int]
    """Why it was none → how many; empty where the link does not tell."""
    loss: dict[str, float]
    """System id → share of its autopilot's frames that did not come, 0 … 1; of those that the link could tell."""
    problem: str | None
    """Why the flight could not be completed."""

    @property
    def completed(self) -> bool:
        """Whether the flight was flown to its end, well or badly."""
        return self.problem is None

    def json(self) -> bytes:
        """As one line of JSON."""
        return orjson.dumps(asdict(self))

    def save(self, folder: Path) -> None:
        """Write summary.json."""
        (folder / "summary.json").write_bytes(orjson.dumps(asdict(self), option=orjson.OPT_INDENT_2) + b"\n")


def severity_of(scenario: Scenario) -> float | None:
    """How much is left to the first degraded motor."""
    return next((f.max_speed_fraction for f in scenario.fault if isinstance(f, MotorDegradation)), None)


def trust_of(scenario: Scenario) -> str | None:
    """Where trust comes from, if the rule uses it."""
    return scenario.trust.source if ASKS_FOR_TRUST.get(scenario.control.rule, True) else None


def collision(closest_m: float | None) -> str | None:
    """The sentence for two vehicles that touched."""
    if closest_m is None or closest_m >= CONTACT:
        return None
    return f"two vehicles came within {closest_m:.2f} m of each other: their rotors would have touched"
