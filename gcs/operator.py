"""What people do while a flight goes on, as events of the loop: to end it, to command it, and to rate who flies it."""

from __future__ import annotations

import signal
from collections.abc import Callable
from contextlib import suppress
from types import FrameType, TracebackType

from gcs.events import LAND, Event, Rating

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Ctrl-C, a polite kill, a terminal that is closed."""


class Operator:
    """Turns the first signal into the event LAND; the second ends the process at once, its recording closed."""

    def __init__(
        self,
        say: Callable[[str], None],
        *,
        words: Callable[[], tuple[str, ...]] = tuple,
        ratings: Callable[[], tuple[Rating, ...]] = tuple,
    ) -> None:
        """words, ratings: hand out what came since their last call; called once by each call of `events`."""
        self._say = say
        self._words = words
        self._ratings = ratings
        self._waiting: list[str] = []
        self.interrupted = False

    def __enter__(self) -> Operator:
        self._before = {number: signal.signal(number, self._on_signal) for number in SIGNALS}
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def events(self) -> tuple[Event, ...]:
        """What came since the last call; what is to be said of it is said here, outside the signal."""
        asked, self._waiting = tuple(self._waiting), []
        if asked:
            with suppress(Exception):  # a terminal that has gone is why we land, not why we do not
                self._say("Landing the swarm. Ctrl-C once more ends at once and lands nothing.")
        return *asked, *self._words(), *self._ratings()

    def _on_signal(self, _signal: int, _frame: FrameType | None) -> None:
        if self.interrupted:
            raise KeyboardInterrupt
        self.interrupted = True
        self._waiting.append(LAND)
