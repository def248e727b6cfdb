"""One run of an experiment: what is to be flown, and what came of it."""

from __future__ import annotations

import hashlib
import math
import time
import traceback
from dataclasses import asdict, dataclass, replace
from functools import cache
from importlib.metadata import version
from pathlib import Path

import orjson

from gcs.control import settings
from gcs.events import Rating
from gcs.rules import RuleError, source_digest
from gcs.scoring import Score
from gcs.summary import trust_of
from gcs.trial import Trial, attempt
from scenarios import Scenario, ScenarioError, healthy_robots
from scenarios.experiment import Experiment
from scenarios.models import RULES
from trustr.raters import MODELS


@dataclass(frozen=True, slots=True)
class Task:
    """One arm in one condition with one seed."""

    key: str
    """What decides the outcome, hashed: equal for flights that would be the same, whatever they are called."""
    suite: str
    condition: str
    arm: str
    seed: int
    scenario: Scenario
    """With all that condition and arm change in it."""
    ratings: str | None
    """The model of raters."""


@dataclass(frozen=True, slots=True)
class RunResult:
    """How one run went."""

    key: str
    suite: str
    condition: str
    arm: str
    seed: int
    passed: bool
    heading_error_deg: float | None
    """None where the flight ended before its read-out; so the distance."""
    distance_to_target_m: float | None
    min_separation_m: float | None
    """None too where there were never two in the air."""
    faulty: int
    """Vehicles that a rule which uses trust should find; 0 for rules that use none."""
    detected: dict[int, float]
    """Seconds from a fault's onset until the vehicle's trust fell below 0.5, of those that were found."""
    false_alarms: int
    """Healthy vehicles whose trust was below 0.5 at any time."""
    problem: str | None
    """Why the flight could not be completed: then it has not passed."""
    crashed: bool
    """The problem is an error of the program's, not of the flight's: nothing is known about such a run."""
    wall_s: float
    cpu_s: float
    code: str
    """Digest of the sources that flew it."""

    def named_as(self, task: Task) -> RunResult:
        """The same outcome in another place of the experiment."""
        return replace(self, suite=task.suite, condition=task.condition, arm=task.arm)

    def line(self) -> bytes:
        """One line of JSON."""
        return orjson.dumps(asdict(self), option=orjson.OPT_NON_STR_KEYS | orjson.OPT_APPEND_NEWLINE)

    @staticmethod
    def of_line(line: bytes) -> RunResult:
        """Raises ValueError, TypeError or KeyError."""
        said = orjson.loads(line)
        detected = {int(vehicle): seconds for vehicle, seconds in said.pop("detected").items()}
        return RunResult(detected=detected, **said)


def tasks(experiment: Experiment, *, seeds: int) -> list[Task]:
    """Every run, seed by seed: an experiment that is broken off has flown all arms about equally often.

    Every rule is tried on the ground. Raises ScenarioError and RuleError.
    """
    for arm in experiment.arm:
        if arm.ratings is not None and arm.ratings not in MODELS:
            raise ScenarioError(f"arm {arm.name}: ratings = {arm.ratings!r}: allowed are {', '.join(MODELS)}")
    places, tried = [], set[str]()
    for condition in experiment.conditions:
        for arm in experiment.arms_of(condition):
            scenario = condition.build(arm)
            if scenario.control.rule not in tried:
                settings(scenario)
                tried.add(scenario.control.rule)
            places.append((condition, arm, scenario, _said(scenario)))
    return [
        Task(_key(*said, arm.ratings, seed), condition.suite, condition.name, arm.name, seed, scenario, arm.ratings)
        for seed in range(1, seeds + 1)
        for condition, arm, scenario, said in places
    ]


def _said(scenario: Scenario) -> tuple[str | bytes, ...]:
    """What of a scenario decides a flight; a rule that does not ship by its source too, for nobody counts versions."""
    said = orjson.dumps(scenario.model_dump(mode="json"))
    rule = scenario.control.rule
    return (said,) if rule in RULES else (source_digest(rule), said)


def _key(*decisive: object) -> str:
    return hashlib.sha256(repr((*decisive, version("trustr"))).encode()).hexdigest()[:20]


def fly_run(task: Task) -> RunResult:
    """Fly it, wherever this is called; whatever happens is a result, for one flight must not end thousands."""
    began_wall, began_cpu = time.perf_counter(), time.thread_time()
    crashed = False
    try:
        _check_rule(task)
        trial = attempt(task.scenario, seed=task.seed, ratings=spoken(task))
    except Exception as error:
        if isinstance(error.__cause__, KeyboardInterrupt):  # inside JSBSim, Ctrl-C comes out as a SystemError
            raise error.__cause__ from None
        at = traceback.extract_tb(error.__traceback__)[-1]
        words = " ".join(f"{type(error).__name__}: {error}".split())
        trial = Trial(None, f"{words} ({Path(at.filename).name}:{at.lineno})")
        crashed = True
    score, scenario = trial.score, task.scenario
    heeded = trust_of(scenario) is not None
    return RunResult(
        key=task.key,
        suite=task.suite,
        condition=task.condition,
        arm=task.arm,
        seed=task.seed,
        passed=trial.passed,
        heading_error_deg=None if score is None else score.heading_error_deg,
        distance_to_target_m=None if score is None else score.distance_to_target_m,
        min_separation_m=_finite(score),
        faulty=int((~healthy_robots(scenario)).sum()) if heeded else 0,
        detected=score.detected if score is not None and heeded else {},
        false_alarms=score.false_alarms if score is not None and heeded else 0,
        problem=trial.problem,
        crashed=crashed,
        wall_s=round(time.perf_counter() - began_wall, 4),
        cpu_s=round(time.thread_time() - began_cpu, 4),
        code=code_digest(),
    )


def _check_rule(task: Task) -> None:
    """A worker that has lived for long may hold a rule as it was before. Raises RuleError."""
    rule = task.scenario.control.rule
    if rule not in RULES and _key(*_said(task.scenario), task.ratings, task.seed) != task.key:
        raise RuleError(f"control.rule = {rule!r}: this worker holds another version of it; start it anew")


def spoken(task: Task) -> tuple[Rating, ...] | None:
    """What this task's people say, drawn from its seed; None where it has none."""
    if task.ratings is None:
        return None
    from gcs.ratings import schedule

    return schedule(task.ratings, task.scenario, task.seed)


def _finite(score: Score | None) -> float | None:
    return None if score is None or math.isinf(score.min_separation_m) else score.min_separation_m


@cache
def code_digest(root: Path = Path(__file__).parents[2]) -> str:
    """Of the sources and aircraft that fly in this process, and of what they calculate with.

    Two digests under one version are two programs.
    """
    hashed = hashlib.sha256(repr([version(package) for package in ("jsbsim", "numpy")]).encode())
    for room in ("aircraft", "fdm", "gcs", "scenarios", "trustr", "wire"):
        for path in sorted((root / room).rglob("*")):
            if path.suffix in (".py", ".xml") and path.name != "cli.py":
                hashed.update(str(path.relative_to(root)).encode() + path.read_bytes())
    return hashed.hexdigest()[:12]
