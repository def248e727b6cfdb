"""What the flight loop costs beside the physics it flies.

CPU of a whole lockstep flight with its recording (imports, loading and the picture left out), against a bare loop that
steps the same six vehicles as many steps in bursts of 25. The two alternate, because machines change their pace: each
flight is compared with the bare loops before and after it, and the median of these comparisons is what counts.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from fdm.vehicle import Geodetic, Vehicle
from fdm.world import World
from gcs.flight import Flight
from gcs.lockstep import Lockstep
from gcs.loop import fly
from gcs.recording.reader import RECORDING
from gcs.recording.writer import Recorder, Tap
from gcs.session import AS_IN_RUN, Recording
from gcs.track import Tracker
from gcs.truth import Truth
from scenarios import Scenario, load
from tests.benchmarks.where import sample

REPEATS = 7
BURST = 25


@dataclass(frozen=True)
class Cost:
    """Medians over REPEATS."""

    physics_hz: int
    simulated_s: float
    bare_s: float
    """CPU seconds."""
    loop_s: float
    overhead: float
    """Everything but the physics, as a fraction of the physics."""
    unrecorded: float
    """The same without a recording."""

    @property
    def vehicle_seconds(self) -> float:
        """Simulated for one CPU second, whole loop."""
        return 6 * self.simulated_s / self.loop_s


def measure(physics_hz: int) -> Cost:
    """Fly `emergency` under Trust-R."""
    scenario = load("emergency", overrides=[f"time.physics_hz={physics_hz}"])
    ticks = flight(scenario, AS_IN_RUN)[1]
    steps = ticks * scenario.time.steps_per_tick
    bare = [_bare(scenario, steps)]
    loops: list[float] = []
    ratios: dict[bool, list[float]] = {True: [], False: []}
    for _ in range(REPEATS):
        for recorded in (True, False):
            seconds = flight(scenario, AS_IN_RUN if recorded else None)[0]
            bare.append(_bare(scenario, steps))
            beside = 0.5 * (bare[-1] + bare[-2])
            ratios[recorded].append((seconds - beside) / beside)
            if recorded:
                loops.append(seconds)
    return Cost(
        physics_hz,
        ticks * scenario.time.period_s,
        statistics.median(bare),
        statistics.median(loops),
        statistics.median(ratios[True]),
        statistics.median(ratios[False]),
    )


def flight(scenario: Scenario, how: Recording | None, folder: Path | None = None) -> tuple[float, int]:
    """(CPU seconds, ticks) of one flight. how: it is recorded; None: not at all;  folder: for its file."""
    decide = Flight(scenario)
    world = Lockstep(World(scenario, seed=1))
    truth = Truth(decide.ids)
    tracker = Tracker(decide, truth)
    period_ns = scenario.time.period_ns
    if how is None:
        return timed(lambda: fly(world, world, decide, (truth, tracker), period_ns=period_ns).tick)
    with tempfile.TemporaryDirectory() as temporary:
        path = (Path(temporary) if folder is None else folder) / RECORDING
        recorder = Recorder(
            path, scenario, truth, start_ns=world.now(), metadata={}, flush_ns=how.flush_ns, decodes=how.decodes
        )

        def fly_and_close() -> int:
            with recorder:
                tap = Tap(world, world, recorder)
                return fly(tap, world, decide, (truth, tracker, recorder), period_ns=period_ns).tick

        return timed(fly_and_close)


def _bare(scenario: Scenario, steps: int) -> float:
    """CPU seconds of six vehicles that climb, cruise and come down as the flight does, and of nothing else."""
    home = Geodetic(41.15, -81.42, 320.0)
    hz = scenario.time.physics_hz
    vehicles = [Vehicle(home=home, physics_hz=hz) for _ in range(6)]
    for vehicle in vehicles:
        vehicle.arm()

    def step() -> int:
        for start in range(0, steps, BURST):
            down = -1.5 if start < 6.7 * hz else 0.0 if steps - start > 9.5 * hz else 1.0
            for vehicle in vehicles:
                vehicle.set_velocity((1.5 if down == 0.0 else 0.0, 0.0, down), 0.0)
                vehicle.step(BURST)
        return steps

    return timed(step)[0]


def timed(work: Callable[[], int]) -> tuple[float, int]:
    """(CPU seconds, what it returned)."""
    start = time.process_time()
    result = work()
    return time.process_time() - start, result


def main() -> None:
    """Print a table."""
    print("flight loop of `emergency`, six vehicles; CPU seconds, medians of", REPEATS)
    print("physics   simulated   bare   loop   overhead   without recording   vehicle-s per CPU-s")
    for hz in (250, 200, 100):
        cost = measure(hz)
        print(
            f"{hz:4d} Hz   {cost.simulated_s:7.1f} s  {cost.bare_s:5.3f}  {cost.loop_s:5.3f}   {cost.overhead:8.2f}"
            f"   {cost.unrecorded:17.2f}   {cost.vehicle_seconds:19.0f}"
        )
    print("\nwhere it goes at 250 Hz, as a fraction of the physics in the loop")
    scenario = load("emergency")
    counted = sample(lambda: [flight(scenario, AS_IN_RUN) for _ in range(8)])
    for part, count in counted.most_common():
        print(f"  {count / counted['physics']:5.2f}  {part}")


if __name__ == "__main__":
    main()
