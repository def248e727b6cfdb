"""Scenarios: what is flown, by whom, what goes wrong, what counts as success. Data and a loader."""

from scenarios.layout import healthy_robots, offsets_ne
from scenarios.loading import ScenarioError, find, load, names, parse
from scenarios.models import Fault, Leg, MotorDegradation, Redirect, RotorFault, Scenario, direction

__all__ = [
    "Fault",
    "Leg",
    "MotorDegradation",
    "Redirect",
    "RotorFault",
    "Scenario",
    "ScenarioError",
    "direction",
    "find",
    "healthy_robots",
    "load",
    "names",
    "offsets_ne",
    "parse",
]
