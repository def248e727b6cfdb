"""A terminal that hands out keys as they are pressed, and is left as it was found, however that comes about."""

from __future__ import annotations

import os
import select
import signal
import sys
import termios
import tty
from collections.abc import Callable
from contextlib import suppress
from types import FrameType, TracebackType

from gcs.replay.keys import keys
from gcs.unblocked import Unblocked
from wire.clock import WallClock

ENDING = (signal.SIGTERM, signal.SIGHUP)
"""A polite kill and a terminal that is closed end a replay as Ctrl-C does."""
AT_MOST = 1024
"""Bytes of keys taken at a time."""


class Keyboard:
    """Keys from stdin, one by one and without an echo. Ctrl-Z stops the process, the terminal as the shell had it."""

    def __init__(self, clock: WallClock, *, leave: Callable[[], None], enter: Callable[[], None]) -> None:
        """leave, enter: take the picture off the screen, and put it there again."""
        self._clock = clock
        self._leave, self._enter = leave, enter
        self._fd = sys.stdin.fileno()
        self._stopping = False

    def __enter__(self) -> Keyboard:
        self._modes = termios.tcgetattr(self._fd)
        self._before = {number: signal.getsignal(number) for number in (*ENDING, signal.SIGTSTP)}
        for number in ENDING:
            if self._before[number] is not signal.SIG_IGN:  # started to outlive its terminal
                signal.signal(number, signal.default_int_handler)
        signal.signal(signal.SIGTSTP, self._on_stop)
        tty.setcbreak(self._fd)
        self._enter()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._leave()
        finally:
            self._restore()
            for number, handler in self._before.items():
                signal.signal(number, handler)

    def now(self) -> int:
        """ns, of the clock."""
        return self._clock.now()

    def wait(self, until_ns: int) -> list[str]:
        """Until then, or until keys are pressed: which; "q" once the terminal has gone."""
        ready, _, _ = select.select([self._fd], [], [], self._clock.seconds_until(until_ns))
        if self._stopping:
            self._stop()
        if not ready:
            return []
        try:
            data = os.read(self._fd, AT_MOST)
        except OSError:
            data = b""
        return keys(data) if data else ["q"]

    def _on_stop(self, _number: int, _frame: FrameType | None) -> None:
        self._stopping = True

    def _stop(self) -> None:
        """As a program stops that knows nothing of terminals; it goes on here."""
        self._stopping = False
        self._leave()
        if isinstance(sys.stderr, Unblocked):
            sys.stderr.drain()
        self._restore()
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGTSTP)
        signal.signal(signal.SIGTSTP, self._on_stop)
        tty.setcbreak(self._fd)
        self._enter()

    def _restore(self) -> None:
        with suppress(termios.error):  # the terminal has gone
            termios.tcsetattr(self._fd, termios.TCSAFLUSH, self._modes)
