"""`gcs identify`: what a fleet's healthy vehicles are like, from simulated flights or a recording of real ones."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from gcs.loop import Tick, fly
from gcs.recording.reader import SteeredTick, UnreadableRecording, instead_of_scenario, read, shown, steered
from gcs.trial import ToItsReadOut
from scenarios import Scenario, ScenarioError, load
from trustr.identification import SETTLING_S, Identified, Sample, identify
from trustr.network import Array
from trustr.response import Response, mean_lag_s

SHORTEST_S = 2.0 * SETTLING_S
"""Of set-points in a recording."""


def of_fleet(name: str, *, overrides: Sequence[str], seeds: int, console: Any) -> Identified:
    """Identify the vehicles of a recording, or of a scenario's name or file. Raises what either raises."""
    path = instead_of_scenario(name)
    if path is not None:
        if overrides:
            raise ScenarioError(f"--set {overrides[0]}: a recording has been flown; nothing of it can be changed")
        return of_recording(path)
    return of_scenario(load(name, overrides=overrides), seeds=seeds, console=console)


def of_scenario(scenario: Scenario, *, seeds: int, console: Any) -> Identified:
    """Fly a scenario without its faults so many times, and identify its vehicles."""
    from rich.progress import track

    healthy, flights = scenario.without_faults(), range(1, seeds + 1)
    silent = not console.is_terminal
    samples = [_flown(healthy, seed) for seed in track(flights, "flights", console=console, disable=silent)]
    return identify(samples, dt=scenario.time.period_s)


def of_recording(path: Path) -> Identified:
    """Identify the vehicles of a recording in which nothing failed. Raises UnreadableRecording."""
    path = shown(path)
    scenario = read(path).scenario
    wrong = [fault for fault in scenario.fault if fault.blamed is not None]
    if wrong:
        robot = f"robot {wrong[0].vehicle}"
        raise UnreadableRecording(f"{path}: it takes a flight in which nothing fails, and in this one {robot} does")
    period_s = scenario.time.period_s
    samples = [sample for sample in _stretches(steered(path)) if len(sample.velocity_ne) * period_s >= SHORTEST_S]
    if not samples:
        raise UnreadableRecording(
            f"{path}: holds no {SHORTEST_S:g} s of set-points to every vehicle with all of them heard"
        )
    return identify(samples, dt=period_s)


def keys(found: Identified) -> dict[str, dict[str, float]]:
    """Section → key → value, as a scenario has them."""
    return {
        "control": {"response_time_s": mean_lag_s(found.response)},
        "trust": _response_keys(found.response)
        | {"tolerance_m_s": found.tolerance, "place_tolerance_m": found.place_tolerance},
    }


def as_json(found: Identified) -> bytes:
    """One object."""
    return orjson.dumps({**keys(found), "unexplained_m_s": found.unexplained, "moved_m_s": found.moved})


def as_toml(found: Identified) -> str:
    """Lines for a scenario, and what they explain."""
    lines = [f"# velocities moved by {found.moved:.2f} m/s; {found.unexplained:.3f} m/s of it is left unexplained"]
    for section, values in keys(found).items():
        lines += [f"[{section}]", *(f"{key} = {value:.3f}" for key, value in values.items()), ""]
    return "\n".join(lines).rstrip()


def _response_keys(response: Response) -> dict[str, float]:
    bounds = {"response_acceleration_m_s2": response.acceleration, "response_jerk_m_s3": response.jerk}
    return {
        "response_delay_s": response.delay_s,
        "response_lag_s": response.lag_s,
        **{key: value for key, value in bounds.items() if np.isfinite(value)},
    }


class _Logbook:
    """A `Record` of set-points and of what telemetry made of them."""

    def __init__(self) -> None:
        self.entries: list[tuple[Array, ...]] = []

    def tick(self, tick: Tick) -> None:
        """Keep a tick at which set-points flowed."""
        diagnosis = tick.diagnosis
        if diagnosis.sent_ned is not None:
            velocity = tick.swarm.velocity_ned[:, :2]
            self.entries.append((diagnosis.sent_ned[:, :2].copy(), velocity.copy(), diagnosis.position_ne.copy()))

    @property
    def sample(self) -> Sample:
        """All of it."""
        return _sample(self.entries)


def _flown(scenario: Scenario, seed: int) -> Sample:
    from gcs.lockstep import Lockstep

    logbook, world = _Logbook(), Lockstep.of(scenario, seed=seed)
    fly(world, world, ToItsReadOut(scenario), (logbook,), period_ns=scenario.time.period_ns)
    return logbook.sample


def _stretches(ticks: Iterator[SteeredTick]) -> Iterator[Sample]:
    """Samples without a gap: consecutive ticks in which every vehicle was commanded and heard."""
    stretch: list[tuple[Array, ...]] = []
    before = None
    for number, commanded, velocity, position in ticks:
        whole = bool(np.isfinite(commanded).all() and np.isfinite(velocity).all() and np.isfinite(position).all())
        if stretch and (not whole or number != (before or 0) + 1):
            yield _sample(stretch)
            stretch = []
        if whole:
            stretch.append((commanded, velocity, position))
        before = number
    if stretch:
        yield _sample(stretch)


def _sample(ticks: Sequence[tuple[Array, ...]]) -> Sample:
    """Ticks of (commanded, velocity, position) as one stretch."""
    return Sample(*(np.array(column) for column in zip(*ticks, strict=True)))
