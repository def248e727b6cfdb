"""The paper's Table II over many seeds: its eight conditions, fault-free rows, and the recommended profile."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import orjson
from joblib import Parallel, delayed
from rich import box
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from gcs.scoring import Score
from gcs.statistics import Spread
from gcs.trial import attempt
from scenarios import Scenario, load

SCENARIOS = ("transit", "emergency")
SEVERITIES = (0.4, 0.7)
PAPER = {
    ("transit", "average"): (40.0, 20.6),
    ("transit", "trust-r"): (3.0, 2.0),
    ("emergency", "average"): (19.0, 9.8),
    ("emergency", "trust-r"): (4.0, 3.2),
}
"""Table II: absolute heading error [degrees] and distance to target [m]; one row for both severities."""


@dataclass(frozen=True, slots=True)
class Condition:
    """What is flown over all seeds."""

    scenario: str
    severity: float | None
    """None is fault-free."""
    controller: str
    profile: str

    def build(self) -> Scenario:
        """The scenario of this condition, trust from the truth."""
        overrides = (f'control.rule="{self.controller}"', f'control.profile="{self.profile}"', 'trust.source="truth"')
        loaded = load(self.scenario, overrides=overrides)
        return loaded.without_faults() if self.severity is None else loaded.with_severity(self.severity)


@dataclass(frozen=True, slots=True)
class Row:
    """One condition's result."""

    scenario: str
    severity: float | None
    controller: str
    trust: str | None
    seeds: int
    heading_error_deg: Spread
    distance_to_target_m: Spread
    pass_rate: float
    min_separation_m: float
    """Of all flights."""
    paper: dict[str, float] | None


@dataclass(frozen=True, slots=True)
class Reproduction:
    """Everything that was flown."""

    rows: list[Row]
    """The paper's profile."""
    recommended: list[Row]
    """The recommended profile: same cruise, same read-out."""

    def json(self) -> bytes:
        """One object."""
        return orjson.dumps(asdict(self))

    def save(self, folder: Path) -> None:
        """reproduce.json and reproduce.md."""
        (folder / "reproduce.json").write_bytes(orjson.dumps(asdict(self), option=orjson.OPT_INDENT_2) + b"\n")
        text = [
            f"## Paper's profile\n\n{_markdown(self.rows)}",
            f"## Recommended profile\n\n{_markdown(self.recommended)}",
        ]
        (folder / "reproduce.md").write_text("\n\n".join(text) + "\n")

    def show(self, console: Any) -> None:
        """Two tables."""
        for title, rows in (("Paper's profile", self.rows), ("Recommended profile", self.recommended)):
            table = Table(*HEAD, title=title, title_justify="left", title_style="bold", box=box.SIMPLE)
            for row in rows:
                table.add_row(*_cells(row))
            console.print(table)


def conditions() -> list[Condition]:
    """The paper's profile first, then the recommended one."""
    listed = []
    for name in SCENARIOS:
        listed.append(Condition(name, None, "trust-r", "paper"))
        for controller in ("average", "trust-r"):
            listed += [Condition(name, severity, controller, "paper") for severity in SEVERITIES]
    for name in SCENARIOS:
        listed += [Condition(name, severity, "trust-r", "recommended") for severity in (None, *SEVERITIES)]
    return listed


def reproduce(every: Sequence[Condition], *, seeds: int, jobs: int, console: Any) -> Reproduction:
    """Fly these conditions with seeds 1 to `seeds`, on `jobs` processes; the result does not depend on their number."""
    tasks = [(condition, seed) for condition in every for seed in range(1, seeds + 1)]
    results: list[Score] = []
    with _progress(console) as progress:
        bar = progress.add_task("flights", total=len(tasks))
        flights = Parallel(n_jobs=jobs, return_as="generator", inner_max_num_threads=1, backend="loky")(
            delayed(one_flight)(condition, seed) for condition, seed in tasks
        )
        for result in flights:
            results.append(result)
            progress.advance(bar)
    rows = [
        (condition, _row(condition, results[place * seeds : (place + 1) * seeds]))
        for place, condition in enumerate(every)
    ]
    return Reproduction(
        [row for condition, row in rows if condition.profile == "paper"],
        [row for condition, row in rows if condition.profile == "recommended"],
    )


class FlightNotCompleted(RuntimeError):
    """One of many flights could not be flown to its end, so there is no honest table; in one sentence."""


def one_flight(condition: Condition, seed: int) -> Score:
    """Fly one condition once, to its read-out. Raises FlightNotCompleted."""
    trial = attempt(condition.build(), seed=seed)
    if trial.score is None or trial.problem is not None:
        what = f"{condition.scenario}, {condition.controller}, severity {condition.severity}, {condition.profile}"
        raise FlightNotCompleted(f"{what}, seed {seed}: {trial.problem}")
    return trial.score


def _row(condition: Condition, scores: list[Score]) -> Row:
    paper = PAPER.get((condition.scenario, condition.controller)) if condition.severity is not None else None
    return Row(
        scenario=condition.scenario,
        severity=condition.severity,
        controller=condition.controller,
        trust=None if condition.controller == "average" else "truth",
        seeds=len(scores),
        heading_error_deg=Spread.of([s.heading_error_deg for s in scores]),
        distance_to_target_m=Spread.of([s.distance_to_target_m for s in scores]),
        pass_rate=sum(s.passed for s in scores) / len(scores),
        min_separation_m=min(s.min_separation_m for s in scores),
        paper=None if paper is None else {"heading_error_deg": paper[0], "distance_to_target_m": paper[1]},
    )


HEAD = ("scenario", "fault", "controller", "heading error", "p90", "distance", "p90", "pass", "closest", "paper")


def _cells(row: Row) -> tuple[str, ...]:
    heading, distance, paper = row.heading_error_deg, row.distance_to_target_m, row.paper
    return (
        row.scenario,
        "none" if row.severity is None else f"{row.severity:.0%}",
        row.controller,
        f"{heading.mean:.2f}°{heading.plus_minus}",
        f"{heading.p90:.2f}°",
        f"{distance.mean:.2f} m{distance.plus_minus}",
        f"{distance.p90:.2f} m",
        f"{row.pass_rate:.0%}",
        f"{row.min_separation_m:.1f} m",
        "–" if paper is None else f"{paper['heading_error_deg']:g}°, {paper['distance_to_target_m']:g} m",
    )


def _markdown(rows: Iterable[Row]) -> str:
    lines = [HEAD, ("---",) * len(HEAD), *(_cells(row) for row in rows)]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def _progress(console: Any) -> Progress:
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=console,
        disable=not console.is_terminal,
    )
