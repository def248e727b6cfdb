"""Scenarios: what is flown, by whom, what goes wrong, what counts as success. Data and a loader."""

from scenarios.faults import (
    CompassBias,
    FalseReport,
    Fault,
    FrozenTelemetry,
    GpsDrift,
    GpsJump,
    LaggingTelemetry,
    MotorDegradation,
    RotorFault,
    StuckVelocity,
    WindFault,
)
from scenarios.layout import healthy_robots, offsets_ne
from scenarios.loading import ScenarioError, find, load, names, parse, revised
from scenarios.models import Leg, Redirect, Scenario, direction

__all__ = [
    "CompassBias",
    "FalseReport",
    "Fault",
    "FrozenTelemetry",
    "GpsDrift",
    "GpsJump",
    "LaggingTelemetry",
    "Leg",
    "MotorDegradation",
    "Redirect",
    "RotorFault",
    "Scenario",
    "ScenarioError",
    "StuckVelocity",
    "WindFault",
    "direction",
    "find",
    "healthy_robots",
    "load",
    "names",
    "offsets_ne",
    "parse",
    "revised",
]
