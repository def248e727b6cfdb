"""What one tick of the controller costs for 6, 100 and 1000 robots, in range of all and in range of few."""

from __future__ import annotations

import statistics
import time
from unittest.mock import patch

import numpy as np

from trustr import network
from trustr.consensus import RULES
from trustr.controller import Observation, Settings, decide
from trustr.leader import VirtualLeader


def main() -> None:
    """Print a table."""
    print("one controller tick, Trust-R, robots on a 3 m grid; median wall time")
    print("robots  range   edges    as flown   all pairs at once   k-d tree")
    for range_m in (28.0, 9.0):
        for count in (6, 50, 100, 200, 1000):
            flown, edges = _tick_ms(count, range_m, network.DENSE_BELOW)
            dense, _ = _tick_ms(count, range_m, 10**9)
            tree, _ = _tick_ms(count, range_m, 0)
            print(f"{count:6d} {range_m:4.0f} m {edges:7d} {flown:8.2f} ms {dense:16.2f} ms {tree:7.2f} ms")


def _tick_ms(count: int, range_m: float, dense_below: int) -> tuple[float, int]:
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
    settings = Settings(
        rule=RULES["trust-r"], offset_ne=offset, leaders=np.array([0, side - 1]), c1=0.1, c2=0.6, feedback_cap=0.375,
        response_s=0.0, swarm_feedback=False, formation_gain=0.0, range_m=range_m, best_range_m=6.0, decay=2.0,
        weights="sender", eta=0.05, threshold=0.5, separation_radius=2.0, separation_gain=0.3,
    )  # fmt: skip
    virtual = VirtualLeader(np.zeros(2), np.array([1.5, 0.0]), np.zeros(2))
    with patch.object(network, "DENSE_BELOW", dense_below):
        memory, decision = decide(None, observation, virtual, settings)
        took = []
        for _ in range(max(5, 3000 // count)):
            start = time.perf_counter()
            decide(memory, observation, virtual, settings)
            took.append(time.perf_counter() - start)
    return statistics.median(took) * 1e3, len(decision.weights)


if __name__ == "__main__":
    main()
