"""What a person does while a flight goes on, as events of the loop: for now, Ctrl-C."""

from __future__ import annotations

import signal
from collections.abc import Callable
from types import FrameType, TracebackType


class Operator:
    """Turns the first Ctrl-C into the event "land"; the second ends the process at once, its recording closed."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._waiting: list[str] = []
        self.interrupted = False

    def __enter__(self) -> Operator:
        self._before = signal.signal(signal.SIGINT, self._on_interrupt)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        signal.signal(signal.SIGINT, self._before)

    def events(self) -> tuple[str, ...]:
        """What was asked for since the last call."""
        asked, self._waiting = tuple(self._waiting), []
        return asked

    def _on_interrupt(self, _signal: int, _frame: FrameType | None) -> None:
        if self.interrupted:
            raise KeyboardInterrupt
        self.interrupted = True
        self._waiting.append("land")
        self._say("Ctrl-C: landing the swarm. Once more ends at once and lands nothing.")
