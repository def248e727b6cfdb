"""What an experiment is: suites of conditions, and the arms that fly them all with the same seeds. Models and a loader.

title = "Noise, and no fault"
reference = "truth"                        # the arm that the others are compared with
scenarios = ["transit", "emergency"]       # of every suite that does not name its own; so severities

[[suite]]                                  # scenarios × severities × cases
name = "noise"
severities = [0.4, 0.7]
[suite.cases]                              # name = overrides, as of --set
"0.1 m/s" = ["noise.velocity_m_s=0.1"]
"0.3 m/s" = ["noise.velocity_m_s=0.3"]

[[arm]]
name = "truth"
controller = "trust-r"
trust = "truth"
"""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, Field, ValidationError, ValidationInfo, field_validator, model_validator

from scenarios.faults import MotorDegradation
from scenarios.loading import FOLDER, ScenarioError, explain, load, names
from scenarios.models import RULES, Scenario
from scenarios.section import Fraction, Section

EXPERIMENTS = FOLDER / "experiments"
LISTENING = ("ratings", "fused")
"""Trust sources that take ratings."""

Name = Annotated[str, Field(min_length=1, max_length=60, pattern=r"^[^|\n]*$")]
Overrides = tuple[str, ...]
"""section.key=value each, as of --set."""


def _found(scenario: str, info: ValidationInfo) -> str:
    """A name that ships stays; a path becomes whole."""
    folder: Path = (info.context or {}).get("folder", Path())
    path = folder / scenario
    with suppress(OSError):  # too long a name, say
        if scenario in names() or path.is_file():
            return scenario if scenario in names() else str(path)
    raise ValueError(f"no scenario {scenario!r}: neither a file nor one of those that ship ({', '.join(names())})")


Scenarios = tuple[Annotated[str, AfterValidator(_found)], ...]
"""Names of those that ship, or paths, seen from the experiment's file."""


class Suite(Section):
    """Conditions that belong together: every scenario at every severity in every case."""

    name: Name
    scenarios: Scenarios | None = None
    """The experiment's own, if absent."""
    severities: tuple[Fraction, ...] | None = None
    """Speed left to degraded motors; the experiment's own, if absent. An empty list is as the scenario has it."""
    no_fault: bool = False
    set: Overrides = ()
    cases: dict[Name, Overrides] = Field(default_factory=dict)
    """More overrides, and how they are called."""

    @model_validator(mode="after")
    def _consistent(self) -> Suite:
        if self.no_fault and self.severities:
            raise ValueError(f"severities = {list(self.severities)} with no_fault = true: nothing is left to be severe")
        return self


class Arm(Section):
    """What is compared: a controller, and where its trust comes from."""

    name: Name
    controller: str | None = None
    """The scenario's own, if absent; so trust."""
    trust: str | None = None
    ratings: str | None = None
    """A model of raters, for trust that listens to people."""
    set: Overrides = ()
    suites: tuple[str, ...] | None = None
    """Flown only there; everywhere, if absent."""

    @property
    def overrides(self) -> Overrides:
        """All that this arm changes in a scenario."""
        chosen = {"control.rule": self.controller, "trust.source": self.trust}
        return (*self.set, *(f'{key}="{value}"' for key, value in chosen.items() if value is not None))


@dataclass(frozen=True, slots=True)
class Condition:
    """One cell of a suite."""

    suite: str
    name: str
    scenario: str
    """A shipped one's name, or a path."""
    severity: float | None
    """As the scenario has it, if None."""
    no_fault: bool
    overrides: Overrides

    def build(self, arm: Arm) -> Scenario:
        """What an arm flies here. Raises ScenarioError."""
        try:
            scenario = load(self.scenario, overrides=(*self.overrides, *arm.overrides))
        except ScenarioError as error:
            raise ScenarioError(f"{self}, arm {arm.name}: {str(error).removeprefix('--')}") from None
        if arm.ratings is not None and (deaf := _deaf(scenario)) is not None:
            raise ScenarioError(f"{self}, arm {arm.name}: ratings = {arm.ratings!r}: {deaf}")
        if self.no_fault:
            return scenario.without_faults()
        if self.severity is None:
            return scenario
        if not any(isinstance(fault, MotorDegradation) for fault in scenario.fault):
            raise ScenarioError(f"{self}: severity {self.severity}: there is no degraded motor in this flight")
        return scenario.with_severity(self.severity)

    def __str__(self) -> str:
        return f"{self.suite}/{self.name}"


def _deaf(scenario: Scenario) -> str | None:
    """Why ratings would say nothing here."""
    rule, source = scenario.control.rule, scenario.trust.source
    if not RULES.get(rule, True):
        return f"the rule {rule} asks for no trust"
    return None if source in LISTENING else f"trust from {source} takes none; allowed are {', '.join(LISTENING)}"


class Experiment(Section):
    """Conditions × arms × seeds."""

    title: str
    seeds: Annotated[int, Field(ge=1)] = 30
    """Seeds 1 to this, the same for every arm."""
    reference: str | None = None
    """The arm that all others are compared with, seed by seed."""
    scenarios: Scenarios = ()
    severities: tuple[Fraction, ...] = ()
    set: Overrides = ()
    """Of every suite."""
    suite: tuple[Suite, ...]
    arm: tuple[Arm, ...]

    @field_validator("suite", "arm")
    @classmethod
    def _named_apart(cls, entries: tuple[Any, ...]) -> tuple[Any, ...]:
        if not entries:
            raise ValueError("[]: at least one is needed")
        _once((entry.name for entry in entries), "name")
        return entries

    @model_validator(mode="after")
    def _consistent(self) -> Experiment:
        arms, suites = [arm.name for arm in self.arm], [suite.name for suite in self.suite]
        if self.reference is not None and self.reference not in arms:
            raise ValueError(f"reference = {self.reference!r}: there is no such arm; allowed are {', '.join(arms)}")
        for place, arm in enumerate(self.arm):
            if arm.suites == ():
                raise ValueError(f"arm.{place}.suites = []: {arm.name} would fly nowhere; without the key, everywhere")
            for name in arm.suites or ():
                if name not in suites:
                    raise ValueError(
                        f"arm.{place}.suites names {name!r}: there is no such suite; allowed are {', '.join(suites)}"
                    )
        for place, suite in enumerate(self.suite):
            if not (self.scenarios if suite.scenarios is None else suite.scenarios):
                raise ValueError(f"suite.{place} ({suite.name}): no scenarios, neither here nor for all suites")
            if not any(arm.suites is None or suite.name in arm.suites for arm in self.arm):
                raise ValueError(f"suite.{place} ({suite.name}): no arm flies there")
            _once((condition.name for condition in self._conditions_of(suite)), f"condition of suite.{place}")
        return self

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """Of all suites, in the file's order."""
        return tuple(condition for suite in self.suite for condition in self._conditions_of(suite))

    def arms_of(self, condition: Condition) -> tuple[Arm, ...]:
        """Who flies it."""
        return tuple(arm for arm in self.arm if arm.suites is None or condition.suite in arm.suites)

    def _conditions_of(self, suite: Suite) -> Iterator[Condition]:
        flown = self.scenarios if suite.scenarios is None else suite.scenarios
        severities = self.severities if suite.severities is None else suite.severities
        levels = (None,) if suite.no_fault or not severities else severities
        for scenario, severity, (case, overrides) in product(flown, levels, (suite.cases or {"": ()}).items()):
            level = "" if severity is None else f" {100 * severity:g} %"
            yield Condition(
                suite=suite.name,
                name=Path(scenario).stem + level + (f", {case}" if case else ""),
                scenario=scenario,
                severity=severity,
                no_fault=suite.no_fault,
                overrides=(*self.set, *suite.set, *overrides),
            )


def experiment_names() -> list[str]:
    """Names of the experiments that ship, in alphabetical order."""
    return sorted(path.stem for path in EXPERIMENTS.glob("*.toml"))


def load_experiment(name_or_path: str | Path) -> Experiment:
    """Load an experiment by name ("base") or path; every flight of it can be built. Raises ScenarioError."""
    path = _find(name_or_path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{path}: cannot be read: {error}") from None
    return parse_experiment(text, source=path.name, folder=path.parent)


def parse_experiment(text: str, *, source: str, folder: Path = Path()) -> Experiment:
    """Build an experiment from the text of a TOML file; `folder` is where its paths begin. Raises ScenarioError."""
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(f"{source}: not valid TOML: {error}") from None
    try:
        experiment = Experiment.model_validate(tables, context={"folder": folder})
    except ValidationError as error:
        raise ScenarioError(f"{source}: {'; '.join(explain(error, tables, Experiment))}") from None
    try:
        for condition in experiment.conditions:
            for arm in experiment.arms_of(condition):
                condition.build(arm)
    except ScenarioError as error:
        raise ScenarioError(f"{source}: {error}") from None
    return experiment


def _find(name_or_path: str | Path) -> Path:
    if str(name_or_path) in experiment_names():
        return EXPERIMENTS / f"{name_or_path}.toml"
    path = Path(name_or_path)
    with suppress(OSError):
        if path.is_file():
            return path
    shipped = ", ".join(experiment_names())
    raise ScenarioError(f"no experiment {str(name_or_path)!r}: neither a file nor one of those that ship ({shipped})")


def _once(entries: Iterable[str], what: str) -> None:
    for entry, times in Counter(entries).items():
        if times > 1:
            raise ValueError(f"{what} {entry!r} is there {times} times: once is enough")
