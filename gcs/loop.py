"""The one loop: simulation, real vehicles and replay differ in the link and the clock they hand to it, no more."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import count
from typing import Protocol

from gcs.events import Event
from gcs.flight import Flight
from gcs.flight_state import Diagnosis, FlightState
from gcs.messages import Encoder
from gcs.telemetry import Swarm, observe
from wire.frames import Frame


class Link(Protocol):
    """The way to the vehicles."""

    def receive(self) -> list[Frame]:
        """Frames that arrived since the last call, in the order of their coming."""
        ...

    def send(self, system: int, frame: bytes) -> None:
        """Towards one vehicle; a link that cannot reach it goes on."""
        ...

    @property
    def rejected(self) -> int:
        """How much came that was no good frame."""
        ...


class Clock(Protocol):
    """Time, in integer nanoseconds since 1970."""

    def now(self) -> int:
        """What time it is."""
        ...

    def sleep_until(self, time_ns: int) -> None:
        """Return at that time, or at once if it has passed."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Tick:
    """All that one turn of the loop did, for whoever records or shows it."""

    number: int
    time_ns: int
    lateness_ns: int
    """After its deadline."""
    frames: list[Frame]
    events: tuple[Event, ...]
    """What people said."""
    swarm: Swarm
    state: FlightState
    diagnosis: Diagnosis


class Record(Protocol):
    """Keeps, or shows, what happened."""

    def tick(self, tick: Tick) -> None:
        """After each turn of the loop."""
        ...


def fly(
    link: Link,
    clock: Clock,
    decide: Flight,
    record: Iterable[Record],
    *,
    period_ns: int,
    events: Callable[[], tuple[Event, ...]] = tuple,
) -> FlightState:
    """Fly one flight to its end. `events` hands out what people said since the last tick, and is asked once a tick."""
    recorders = tuple(record)
    encoders = {system: Encoder(system) for system in decide.ids}
    swarm, state = Swarm.of(decide.ids), decide.start()
    start_ns = clock.now()
    for number in count():
        deadline_ns = start_ns + number * period_ns
        clock.sleep_until(deadline_ns)
        now_ns = clock.now()
        frames = link.receive()
        asked = events()
        swarm = observe(swarm, frames)
        state, commands, diagnosis = decide(state, swarm, asked, now_ns)
        time_ms = number * period_ns // 1_000_000
        for system, command in commands:
            link.send(system, encoders[system].encode(command, time_ms))
        tick = Tick(number, now_ns, now_ns - deadline_ns, frames, asked, swarm, state, diagnosis)
        for recorder in recorders:
            recorder.tick(tick)
        if state.done:
            return state
    raise AssertionError("count() ends never")
