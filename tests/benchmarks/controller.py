"""What one tick of the controller costs for 6, 100 and 1000 robots, in range of all and in range of few."""

from __future__ import annotations

import statistics
import time
from dataclasses import replace
from unittest.mock import patch

import numpy as np

from gcs.control import settings
from scenarios import load
from trustr import network
from trustr.consensus import RULES
from trustr.controller import Observation, decide
from trustr.leader import VirtualLeader


def main() -> None:
    """Print two tables."""
    print("one controller tick, Trust-R, robots on a 3 m grid; median wall time")
    print("robots  range   edges    as flown   all pairs at once   k-d tree")
    for range_m in (28.0, 9.0):
        for count in (6, 50, 100, 200, 1000):
            flown, edges = _tick_ms("trust-r", count, range_m, network.DENSE_BELOW)
            dense, _ = _tick_ms("trust-r", count, range_m, 10**9)
            tree, _ = _tick_ms("trust-r", count, range_m, 0)
            print(f"{count:6d} {range_m:4.0f} m {edges:7d} {flown:8.2f} ms {dense:16.2f} ms {tree:7.2f} ms")
    print("\nthe same by rule, in range of 28 m")
    print("robots   edges" + "".join(f"{rule:>19}" for rule in RULES))
    for count in (6, 100, 1000):
        ticks = [_tick_ms(rule, count, 28.0, network.DENSE_BELOW) for rule in RULES]
        print(f"{count:6d} {ticks[0][1]:7d}" + "".join(f"{took:16.2f} ms" for took, _ in ticks))


def _tick_ms(rule: str, count: int, range_m: float, dense_below: int) -> tuple[float, int]:
    """(ms a tick, edges) with the neighbour search switched over at `dense_below` robots."""
    side = int(np.ceil(np.sqrt(count)))
    offset = 3.0 * np.stack(np.divmod(np.arange(count), side), axis=1).astype(float)
    rng = np.random.default_rng(1)
    observation = Observation(
        offset + rng.normal(0, 0.1, offset.shape),
        rng.normal(0, 0.5, offset.shape),
        np.ones(count, bool),
        np.where(rng.random(count) < 0.1, 0.0, 1.0),
    )
    chosen = replace(
        settings(load("transit")),
        rule=RULES[rule],
        offset_ne=offset,
        files=(),
        leaders=np.array([0, side - 1]),
        range_m=range_m,
    )
    virtual = VirtualLeader(np.zeros(2), np.array([1.5, 0.0]), np.zeros(2))
    with patch.object(network, "DENSE_BELOW", dense_below):
        memory, decision = decide(None, observation, virtual, chosen)
        took = []
        for _ in range(max(5, 3000 // count)):
            start = time.perf_counter()
            decide(memory, observation, virtual, chosen)
            took.append(time.perf_counter() - start)
    return statistics.median(took) * 1e3, len(decision.weights)


if __name__ == "__main__":
    main()
