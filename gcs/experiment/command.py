"""`gcs experiment`: a file in, runs flown, tables and pictures out."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from contextlib import closing
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from gcs.choices import BadUsageError
from gcs.experiment.conduct import conduct
from gcs.experiment.journal import JOURNAL
from gcs.experiment.plot import draw
from gcs.experiment.results import FILES, Asked, Results
from gcs.experiment.run import Task, tasks
from gcs.experiment.terminal import show
from gcs.experiment.workers import Cluster, Local, Workers, WorkersLost
from gcs.guard import DONE, INTERRUPTED, NOT_DONE
from gcs.output import output_folder
from gcs.recording.files import RecordingError
from scenarios import ScenarioError
from scenarios.experiment import load_experiment

ALL_CORES = -1
"""Jobs, unless somebody says otherwise."""
MOST_NAMED = 5
"""Runs with a problem that are named on the terminal; the table names all."""


def experiment(
    name: str,
    *,
    seeds: int | None,
    jobs: int,
    dask: str | None,
    only: Sequence[str],
    out: Path | None,
    stdout: Any,
    stderr: Any,
) -> int:
    """Exit code. stdout: a console for the table; without one, it gets an object of JSON.

    Raises BadUsageError, ScenarioError, RuleError, RecordingError, NoCluster and UnusableJournal: each one sentence.
    """
    if dask is not None and jobs != ALL_CORES:
        raise BadUsageError(f"--jobs {jobs}: with --dask, the cluster's workers fly, as many as it has")
    loaded = load_experiment(name)
    count = loaded.seeds if seeds is None else seeds
    chosen = _chosen(tasks(loaded, seeds=count), only)
    asked = Asked(_command_line(name, seeds, only), tuple(only), count, loaded.seeds)

    def say(words: str) -> None:
        stderr.print(words, highlight=False, markup=False, soft_wrap=True)

    workers: Workers = Local(jobs) if dask is None else Cluster(dask)  # a cluster that is not there leaves no folder
    with closing(workers):
        folder = output_folder(Path("runs") / f"experiment-{Path(name).stem}" if out is None else out, name)
        try:
            conducted = conduct(chosen, workers, folder=folder, console=stderr)
        except KeyboardInterrupt:
            say(f"gcs: interrupted; finished runs are in {folder / JOURNAL}, and the same command goes on from there")
            return INTERRUPTED
        except WorkersLost as error:
            say(f"gcs: {error}; finished runs are in {folder / JOURNAL}, and the same command goes on from there")
            return NOT_DONE
    results = Results.of(conducted, title=loaded.title, reference=loaded.reference, asked=asked)
    try:
        results.save(folder)
        pictures = draw(results, folder)
    except OSError as error:
        raise RecordingError(f"{folder}: the results cannot be written: {error.strerror or error}") from None
    if stdout is None:
        sys.stdout.write(results.json().decode() + "\n")
    else:
        show(results, stdout)
    _tell(results, say)
    if conducted.others:
        say(f"{folder / JOURNAL} holds {conducted.others} runs more, which were not asked for: they are in no table")
    say(f"written: {', '.join(str(folder / file) for file in (*FILES, *pictures))}")
    return NOT_DONE if any(run.crashed for run in results.runs) else DONE


def _command_line(name: str, seeds: int | None, only: Sequence[str]) -> str:
    """All of it that decides what is flown."""
    words = ["gcs", "experiment", name, *(() if seeds is None else ("--seeds", str(seeds)))]
    return shlex.join([*words, *(word for pattern in only for word in ("--only", pattern))])


def _chosen(every: list[Task], patterns: Sequence[str]) -> list[Task]:
    """Tasks whose suite, condition, or suite/condition is one of these. Raises ScenarioError."""
    places = dict.fromkeys((task.suite, task.condition) for task in every)
    wanted = set(places) if not patterns else set()
    for pattern in patterns:
        matching = {place for place in places if any(fnmatchcase(n, pattern) for n in (*place, "/".join(place)))}
        if not matching:
            known = ", ".join("/".join(place) for place in places)
            raise ScenarioError(f"--only {pattern}: there is no such suite or condition; there are {known}")
        wanted |= matching
    return [task for task in every if (task.suite, task.condition) in wanted]


def _tell(results: Results, say: Any) -> None:
    """What went wrong, and how long it took."""
    incomplete, timing = results.incomplete, results.timing
    for run in incomplete[:MOST_NAMED]:
        say(f"not completed: {run.suite}, {run.condition}, {run.arm}, seed {run.seed}: {run.problem}")
    if len(incomplete) > MOST_NAMED:
        say(f"not completed: {len(incomplete) - MOST_NAMED} more runs, all in table.md")
    crashed = sum(run.crashed for run in results.runs)
    if crashed:
        say(f"gcs: {crashed} runs ended in an error of this program; they are in no figure, and are flown again")
    if timing.runs_per_hour is not None:
        say(
            f"{timing.flown} runs in {timing.wall_s:.1f} s: {timing.runs_per_hour:.0f} runs/h, "
            f"workers: {timing.workers}"
        )
