"""A recorded flight as link and clock: the same loop decides it again, and what it sends is compared."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gcs.choices import AS_IT_IS, Choices
from gcs.events import Event
from gcs.flight import Flight
from gcs.loop import fly
from gcs.recording.reader import RecordedTick, UnreadableRecording, located, read, ticks
from wire.frames import Frame
from wire.payloads import SET_POSITION_TARGET_LOCAL_NED, unpack_position_target

SETPOINT = SET_POSITION_TARGET_LOCAL_NED.to_bytes(3, "little")


class EndOfRecording(Exception):
    """The flight was cut short: its last recorded tick has been decided again."""


class Recorded:
    """Frames and times of a recording; to wait is to turn a page. What is sent goes nowhere but into `sent`."""

    def __init__(self, pages: list[RecordedTick]) -> None:
        self._pages = pages
        self._page = -1
        self.sent: list[list[bytes]] = [[] for _ in pages]

    def now(self) -> int:
        """The recorded time of the current tick."""
        return self._pages[max(self._page, 0)].time_ns

    def sleep_until(self, _time_ns: int) -> None:
        """On to the next tick. Raises EndOfRecording where none is left."""
        self._page += 1
        if self._page == len(self._pages):
            raise EndOfRecording

    def receive(self) -> list[Frame]:
        """What the flight received at this tick."""
        return self._pages[self._page].received

    def send(self, _system: int, frame: bytes) -> None:
        """Kept for comparison."""
        self.sent[self._page].append(frame)

    @property
    def rejected(self) -> int:
        """Nothing: only good frames are recorded."""
        return 0

    def events(self) -> tuple[Event, ...]:
        """What people said at this tick."""
        return self._pages[self._page].events


@dataclass(frozen=True, slots=True)
class Difference:
    """The first tick at which the second decision is another."""

    tick: int
    recorded: list[bytes]
    decided: list[bytes]


@dataclass(frozen=True, slots=True)
class Verification:
    """What deciding again came to."""

    ticks: int
    setpoints: int
    difference: Difference | None


def decide_again(path: Path) -> Verification:
    """Decide a recording, or the one in a run's folder, again, bit for bit. Raises UnreadableRecording."""
    path = located(path)
    told = read(path)
    flight = Flight(told.scenario, ratings=() if told.rated else None)
    pages = list(ticks(path))
    if not pages:
        raise UnreadableRecording(f"{path}: holds no tick to decide again")
    recorded = Recorded(pages)
    with suppress(EndOfRecording):
        fly(recorded, recorded, flight, (), period_ns=flight.scenario.time.period_ns, events=recorded.events)
    difference = next(
        (
            Difference(tick, page.sent, sent)
            for tick, (page, sent) in enumerate(zip(pages, recorded.sent, strict=True))
            if page.sent != sent
        ),
        None,
    )
    setpoints = sum(frame[7:10] == SETPOINT for page in pages for frame in page.sent)
    return Verification(len(pages), setpoints, difference)


def verify(path: Path, *, choices: Choices = AS_IT_IS, as_json: bool = False, console: Any) -> int:
    """Say what deciding again came to; 0 where nothing differs, else 3."""
    result = decide_again(path)
    if result.difference is None:
        console.print(
            f"{result.ticks} ticks decided again: all {result.setpoints} set-points, and every other frame sent, "
            "identical to the bit",
            highlight=False,
        )
        return 0
    console.print(_words(result.difference), highlight=False, soft_wrap=True)
    return 3


def _words(difference: Difference) -> str:
    """Where the decision differs, and from the first set-point that does, how."""
    where = f"the decision differs from tick {difference.tick} on"
    for recorded, decided in zip(difference.recorded, difference.decided, strict=False):
        if recorded != decided and recorded[7:10] == decided[7:10] == SETPOINT:
            was, now = (unpack_position_target(frame[10:-2]) for frame in (recorded, decided))
            return (
                f"{where}: vehicle {was.target_system} was sent {was.vx:.3f}, {was.vy:.3f}, {was.vz:.3f} m/s, "
                f"and would be sent {now.vx:.3f}, {now.vy:.3f}, {now.vz:.3f} m/s"
            )
    return f"{where}: {len(difference.recorded)} frames were sent, {len(difference.decided)} would be"
