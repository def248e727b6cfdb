"""One flight for its score alone: in lockstep, unrecorded, and over at its read-out, for nobody scores a landing."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from gcs.events import Event, Rating
from gcs.flight import Flight
from gcs.flight_state import FlightState, Phase, Step
from gcs.lockstep import Lockstep
from gcs.loop import fly
from gcs.scoring import Score, score
from gcs.summary import collision
from gcs.telemetry import Swarm
from gcs.track import Tracker
from gcs.truth import Truth
from scenarios import Scenario


@dataclass(frozen=True, slots=True)
class Trial:
    """How it went."""

    score: Score | None
    """None where the flight ended before its read-out."""
    problem: str | None
    """Why the flight could not be completed."""

    @property
    def passed(self) -> bool:
        """Flown to the read-out, and well."""
        return self.problem is None and self.score is not None and self.score.passed


def attempt(scenario: Scenario, *, seed: int, ratings: Iterable[Rating] | None = None) -> Trial:
    """Fly a scenario from take-off to its read-out. ratings: None where nobody rates."""
    flight = ToItsReadOut(scenario, ratings=ratings)
    truth = Truth(flight.ids)
    tracker = Tracker(flight, truth)
    world = Lockstep.of(scenario, seed=seed)
    state = fly(world, world, flight, (truth, tracker), period_ns=scenario.time.period_ns)
    result = None if tracker.track is None else score(tracker.track, scenario)
    if result is None:
        return Trial(None, state.problem or "ended before its read-out")
    return Trial(result, state.problem or collision(result.min_separation_m))


class ToItsReadOut(Flight):
    """A flight that is done when it would land, whether its mission is over or given up."""

    def __call__(self, state: FlightState, swarm: Swarm, events: Iterable[Event], now_ns: int) -> Step:
        """One tick, as any flight's."""
        state, commands, diagnosis = super().__call__(state, swarm, events, now_ns)
        return (replace(state, phase=Phase.DONE) if state.phase is Phase.LAND else state), commands, diagnosis
