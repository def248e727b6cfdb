"""How far many runs are: a bar on a terminal, elsewhere a line every so often."""

from __future__ import annotations

import datetime as dt
import time
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

EVERY_S = 30.0
"""Between two lines."""


class Meter:
    """Counts runs, of which some were kept from before."""

    def __init__(self, console: Console, *, total: int, kept: int) -> None:
        self._console = console
        self._total, self._kept, self._flown = total, kept, 0
        self._began = self._said = time.monotonic()
        columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[pace]}")
        self._bar = Progress(*columns, console=console, disable=not console.is_terminal)
        self._task = self._bar.add_task("runs", total=total, completed=kept, pace="")

    def __enter__(self) -> Meter:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def advance(self) -> None:
        """One more."""
        self._flown += 1
        self._bar.update(self._task, advance=1, pace=self.pace)
        now, done = time.monotonic(), self._kept + self._flown
        if self._console.is_terminal or (now - self._said < EVERY_S and done < self._total):
            return
        self._said = now
        self._console.print(f"{done} of {self._total} runs, {self.pace}", highlight=False)

    @property
    def pace(self) -> str:
        """Runs an hour, and the time left, in words."""
        a_second = self._flown / max(time.monotonic() - self._began, 1e-9)
        left_s = (self._total - self._kept - self._flown) / a_second
        return f"{3600 * a_second:.0f} runs/h, {dt.timedelta(seconds=round(left_s))} left"
