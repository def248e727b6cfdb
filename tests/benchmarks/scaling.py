"""How runs an hour grow from one worker to two: `python -m tests.benchmarks.scaling [--runs N] [--repetitions N]`.

The same flights as `gcs experiment` flies them, alternately with one process and with two; their start is left out.
Not part of `make bench`: it takes minutes, and says nothing where other work shares the cores.
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
import time
from pathlib import Path

from rich.console import Console

from gcs.experiment.conduct import conduct
from gcs.experiment.run import Task, tasks
from gcs.experiment.workers import Local
from scenarios.experiment import parse_experiment

EXPERIMENT = """
title = "Scaling"
scenarios = ["transit", "emergency"]
severities = [0.4, 0.7]
[[suite]]
name = "base"
[[arm]]
name = "truth"
controller = "trust-r"
trust = "truth"
"""


def main() -> None:
    """Print a line a repetition, then the medians."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=40, help="flights a measurement")
    parser.add_argument("--repetitions", type=int, default=5)
    chosen = parser.parse_args()
    experiment = parse_experiment(EXPERIMENT, source="scaling", folder=Path())
    flights = tasks(experiment, seeds=-(-chosen.runs // 4))[: chosen.runs]
    print(f"{len(flights)} flights of `transit` and `emergency`; {os.cpu_count()} cores")
    took: dict[int, list[float]] = {1: [], 2: []}
    for repetition in range(1, chosen.repetitions + 1):
        for jobs in (1, 2) if repetition % 2 else (2, 1):  # a machine that gets slower favours neither
            took[jobs].append(_fly(flights, jobs))
        one, two = took[1][-1], took[2][-1]
        print(
            f"{repetition}: {_pace(flights, one)} and {_pace(flights, two)}, efficiency {one / (2 * two):.2f}",
            flush=True,
        )
    one, two = statistics.median(took[1]), statistics.median(took[2])
    efficiency = statistics.median(a / (2 * b) for a, b in zip(took[1], took[2], strict=True))
    print(f"medians: {_pace(flights, one)} with one worker, {_pace(flights, two)} with two")
    print(f"T1 / (2 T2) of the medians {one / (2 * two):.3f}; median of the repetitions' {efficiency:.3f}")


def _fly(flights: list[Task], jobs: int) -> float:
    """Wall seconds."""
    _conduct(flights[: 2 * jobs], jobs)  # the processes stay for a while: they are warm now
    began = time.perf_counter()
    _conduct(flights, jobs)
    return time.perf_counter() - began


def _conduct(flights: list[Task], jobs: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        conduct(flights, Local(jobs), folder=Path(folder), console=Console(quiet=True))


def _pace(flights: list[Task], seconds: float) -> str:
    return f"{3600 * len(flights) / seconds:.0f} runs/h"


if __name__ == "__main__":
    main()
