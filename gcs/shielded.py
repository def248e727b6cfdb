"""A record that may fail without taking the flight with it."""

from __future__ import annotations

import traceback
from collections.abc import Callable

from gcs.loop import Record, Tick


class Shielded:
    """Hands ticks on until the record fails; then says so once, and leaves it out.

    Whoever watches or writes down a flight is not part of it: vehicles are in the air whether or not a screen can be
    drawn. Only the operator's second Ctrl-C passes.
    """

    def __init__(self, record: Record, name: str, say: Callable[[str], None]) -> None:
        """name: how a person calls it, as in "the display"."""
        self._record = record
        self._name = name
        self._say = say
        self.problem: str | None = None
        """Why it was left out, if it was."""

    def tick(self, tick: Tick) -> None:
        """Hand it on."""
        if self.problem is not None:
            return
        try:
            self._record.tick(tick)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # rich leaves by SystemExit where its terminal is gone
            self.problem = f"{self._name} failed and was left out: {in_words(error)}"
            self._say(f"gcs: {self.problem}")


def in_words(error: BaseException) -> str:
    """An error that was caught, on one line: what, and at which line of whose file."""
    frames = traceback.extract_tb(error.__traceback__)
    where = f" ({frames[-1].filename.rsplit('/', 1)[-1]}, line {frames[-1].lineno})" if frames else ""
    said = " ".join(str(error).split())
    return f"{type(error).__name__}{': ' if said else ''}{said}{where}"
