"""What watches a flight, or writes it down, may fail without taking the flight with it."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from typing import TypeVar

from gcs.loop import Record, Tick

Made = TypeVar("Made")


class Shield:
    """Calls some of our code until it fails; then says so once, and calls it no more.

    Only the operator's second Ctrl-C passes.
    """

    def __init__(self, failed: str, say: Callable[[str], None]) -> None:
        """failed: what is to be said when it fails, before the reason."""
        self._failed = failed
        self._say = say
        self.problem: str | None = None
        """Why it is not called any more, if it is not."""

    def call(self, code: Callable[[], Made], otherwise: Made) -> Made:
        """What it returns; otherwise the other."""
        if self.problem is None:
            try:
                return code()
            except KeyboardInterrupt:
                raise
            except BaseException as error:  # rich leaves by SystemExit where its terminal is gone
                self.problem = f"{self._failed}: {in_words(error)}"
                self._say(f"gcs: {self.problem}")
        return otherwise


class Shielded:
    """A record behind a shield: it is handed ticks until it fails, and then left out.

    Whoever watches or writes down a flight is not part of it: vehicles are in the air whether or not a screen can be
    drawn.
    """

    def __init__(self, record: Record, name: str, say: Callable[[str], None]) -> None:
        """name: how a person calls it, as in "the display"."""
        self._record = record
        self._shield = Shield(f"{name} failed and was left out", say)

    @property
    def problem(self) -> str | None:
        """Why it was left out, if it was."""
        return self._shield.problem

    def tick(self, tick: Tick) -> None:
        """Hand it on."""
        self._shield.call(lambda: self._record.tick(tick), None)


def in_words(error: BaseException) -> str:
    """An error that was caught, on one line: what, and at which line of whose file."""
    frames = traceback.extract_tb(error.__traceback__)
    where = f" ({frames[-1].filename.rsplit('/', 1)[-1]}, line {frames[-1].lineno})" if frames else ""
    said = " ".join(str(error).split())
    return f"{type(error).__name__}{': ' if said else ''}{said}{where}"
