"""An experiment from its file to its results: fly what has not been flown yet, keep each run as it comes."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from gcs.experiment.journal import Journal
from gcs.experiment.meter import Meter
from gcs.experiment.run import RunResult, Task, code_digest, fly_run
from gcs.experiment.workers import Workers


@dataclass(frozen=True, slots=True)
class Timing:
    """What this call took."""

    flown: int
    kept: int
    """From earlier calls."""
    workers: int
    wall_s: float
    runs_per_hour: float | None
    """None where nothing was left to fly."""


@dataclass(frozen=True, slots=True)
class Conducted:
    """Every run that was asked for."""

    runs: list[RunResult]
    """In the order of the tasks."""
    timing: Timing
    others: int = 0
    """Runs that the journal holds besides."""


def conduct(tasks: list[Task], workers: Workers, *, folder: Path, console: Console) -> Conducted:
    """Fly what the folder's journal lacks.

    Raises UnusableJournal, WorkersLost, and KeyboardInterrupt; whenever it ends, the finished runs are kept.
    """
    began = time.perf_counter()
    with Journal(folder) as journal:
        wanted = {task.key: task for task in tasks}
        missing = [task for key, task in wanted.items() if key not in journal.runs]
        kept, crashed, count = len(wanted) - len(missing), dict[str, RunResult](), 0
        strangers = sum(key in wanted and run.code != code_digest() for key, run in journal.runs.items())
        if strangers:
            words = f"{strangers} runs were flown by other sources than these, under the same version; they count"
            _say(console, f"{journal.path}: {words} all the same. Remove the file to fly them again.")
        if missing:
            count = workers.count
            _say(console, f"{len(wanted)} runs, {kept} of them kept from before; workers: {count}")
            with Meter(console, total=len(wanted), kept=kept) as meter:
                for run in workers.map(fly_run, missing):
                    journal.add(run)
                    if run.crashed:
                        crashed[run.key] = run
                    meter.advance()
        others = len(journal.runs.keys() - wanted)
        outcome = journal.runs | crashed
    wall_s = time.perf_counter() - began
    pace = 3600 * len(missing) / wall_s if missing else None
    timing = Timing(len(missing), kept, count, round(wall_s, 3), pace)
    return Conducted([outcome[task.key].named_as(task) for task in tasks], timing, others)


def _say(console: Console, words: str) -> None:
    console.print(words, highlight=False, markup=False, soft_wrap=True)
