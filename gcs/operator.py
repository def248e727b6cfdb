"""What people do while a flight goes on, as events of the loop: to end it, to command it, and to rate who flies it."""

from __future__ import annotations

import signal
from collections.abc import Callable
from contextlib import suppress
from types import FrameType, TracebackType

from gcs.events import LAND, Event, Rating

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Ctrl-C, a polite kill, a terminal that is closed."""

ENDS = 2
"""Ctrl-C so often ends the flight: between two ticks, for a record that is being written would be torn."""


class Operator:
    """Turns signals into the event LAND. A second Ctrl-C ends the process at its next tick, its recording closed and
    whole; a third wherever it is, should there be no next tick.

    No other signal does, however often it comes: a terminal that is closed hangs up twice. A process that was started
    to outlive its terminal (nohup) is not landed by it.
    """

    def __init__(
        self,
        say: Callable[[str], None],
        *,
        words: Callable[[], tuple[Event, ...]] = tuple,
        ratings: Callable[[], tuple[Rating, ...]] = tuple,
    ) -> None:
        """words, ratings: hand out what came since their last call; called once by each call of `events`."""
        self._say = say
        self._words = words
        self._ratings = ratings
        self._asked = self._told = 0
        """Signals that came, counted by their handler alone, and those of them that were handed out."""
        self._pressed = 0
        """Times that Ctrl-C was."""

    @property
    def interrupted(self) -> bool:
        """Whether any signal came."""
        return self._asked > 0

    def __enter__(self) -> Operator:
        heeded = [number for number in SIGNALS if not _outlives(number)]
        self._before = {number: signal.signal(number, self._on_signal) for number in heeded}
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def events(self) -> tuple[Event, ...]:
        """What came since the last call; what is to be said of it is said here, outside the signal."""
        if self._pressed >= ENDS:
            raise KeyboardInterrupt
        asked = self._asked
        landing = (LAND,) if asked > self._told else ()
        self._told = asked
        if landing:
            once_more = " Ctrl-C once more ends at once and lands nothing." if self._pressed else ""
            with suppress(Exception):  # a terminal that has gone is why we land, not why we do not
                self._say(f"Landing the swarm.{once_more}")
        return *landing, *self._words(), *self._ratings()

    def _on_signal(self, number: int, _frame: FrameType | None) -> None:
        if number == signal.SIGINT:
            self._pressed += 1
            if self._pressed > ENDS:
                raise KeyboardInterrupt
        self._asked += 1


def _outlives(number: signal.Signals) -> bool:
    return number == signal.SIGHUP and signal.getsignal(number) is signal.SIG_IGN
