"""What a flight is to be, besides its scenario: the options that `run` and `fly` share."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from gcs.console import asked

if TYPE_CHECKING:
    from scenarios import Scenario

Overrides = Annotated[
    tuple[str, ...],
    Parameter(
        name="--set",
        negative=(),
        show_default=False,
        help="section.key=value; changes one key of the scenario. Repeatable.",
    ),
]


MOST_SEED = 2**63 - 1
"""JSON's integers end there for most who read them, and for those who write our summaries."""


class BadUsageError(ValueError):
    """An option that cannot be obeyed, in one sentence."""


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Choices:
    """What a flight is to be, besides its scenario."""

    controller: Annotated[
        str | None,
        Parameter(
            help="Update rule: average, trust-r, median, wmsr-1, wmsr-2, confidence-decay, or your own as "
            "package.module:function; the scenario's, if absent."
        ),
    ] = None
    trust: Annotated[
        Literal["truth", "ratings", "auto", "fused"] | None,
        Parameter(
            help="Where trust comes from: the simulation's knowledge, people (the study's means if nobody rates), "
            "the swarm's own behaviour, or behaviour and people."
        ),
    ] = None
    severity: Annotated[
        float | None, Parameter(help="Speed left to degraded motors, 0 to 1 of cruise: the paper flies 0.4 and 0.7.")
    ] = None
    no_fault: Annotated[bool, Parameter(negative=(), show_default=False, help="Fly with everything healthy.")] = False
    set_: Overrides = ()

    def scenario(self, name: str) -> Scenario:
        """The scenario of this name, or in this file, as chosen. Raises ScenarioError, RuleError and BadUsageError."""
        from scenarios import load

        return self._with_its_faults(load(name, overrides=self._overrides))

    def revised(self, scenario: Scenario, *, source: str) -> Scenario:
        """A scenario that is at hand, as chosen; source: how errors call it. Raises as `scenario` does."""
        from scenarios import revised

        return self._with_its_faults(revised(scenario, source=source, overrides=self._overrides))

    @property
    def _overrides(self) -> list[str]:
        overrides = list(self.set_)
        if self.controller is not None:
            overrides.append(f'control.rule="{self.controller}"')
        if self.trust is not None:
            overrides.append(f'trust.source="{self.trust}"')
        return overrides

    def _with_its_faults(self, loaded: Scenario) -> Scenario:
        from gcs.control import settings
        from scenarios import MotorDegradation

        settings(loaded)  # tries its rule, which may be anybody's, before anything is made or flown
        if self.no_fault:
            loaded = loaded.without_faults()
        if self.severity is None:
            return loaded
        if not 0 <= self.severity <= 1:
            raise BadUsageError(f"--severity {self.severity}: must be 0 to 1, the fraction of cruise that is left")
        if not any(isinstance(fault, MotorDegradation) for fault in loaded.fault):
            raise BadUsageError(f"--severity {self.severity}: there is no degraded motor in this flight")
        return loaded.with_severity(self.severity)


AS_IT_IS = Choices()
"""The scenario unchanged."""


def check_seed(seed: int | None) -> None:
    """Raises BadUsageError for a seed that no generator takes, or no summary holds."""
    if seed is not None and seed < 0:
        raise BadUsageError(f"--seed {seed}: must not be negative")
    if seed is not None and seed > MOST_SEED:
        raise BadUsageError(f"--seed {seed}: must not be above {MOST_SEED}")


def check_speed(speed: float) -> None:
    """Raises BadUsageError for a clock that stands, or goes backwards."""
    if not 0.0 < speed < math.inf:
        raise BadUsageError(f"--speed {speed}: must be a number above 0")


def checked_ids(systems: Sequence[int]) -> tuple[int, ...]:
    """System ids as named, each once. Raises BadUsageError."""
    for system in systems:
        if not 1 <= system <= 255:
            raise BadUsageError(f"--vehicle {system}: must be a system id, 1 to 255")
    return tuple(dict.fromkeys(systems))


def check_many(seeds: int | None, jobs: int) -> None:
    """Raises BadUsageError for no flights, or nobody to fly them."""
    if seeds is not None and seeds < 1:
        raise BadUsageError(f"--seeds {seeds}: must be at least 1")
    if jobs == 0:
        raise BadUsageError("--jobs 0: must be a number of processes, or -1 for one a core")


def confirmed(yes: bool, *, say: Callable[[str], None]) -> bool:
    """Arming moves rotors: a person types ARM, or a script says --yes."""
    if yes:
        return True
    typed = asked("Rotors will turn. Type ARM to go on: ")
    if typed == "ARM":
        return True
    say("gcs: --arm without a terminal needs --yes" if typed is None else "gcs: not armed")
    return False
