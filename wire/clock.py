"""Wall time for real links: monotonic, so that a clock set back or forth moves no deadline."""

from __future__ import annotations

import time


class WallClock:
    """Nanoseconds that start at the wall's time and run with the monotonic clock, `speed` times as fast."""

    def __init__(self, *, speed: float = 1.0) -> None:
        self._speed = speed
        self._epoch = time.time_ns()
        self._start = time.monotonic_ns()

    def now(self) -> int:
        """ns since 1970 at the start, monotonic since."""
        return self._epoch + int((time.monotonic_ns() - self._start) * self._speed)

    def seconds_until(self, time_ns: int) -> float:
        """Real seconds until the clock will show `time_ns`; 0 where it has passed."""
        return max(0.0, (time_ns - self.now()) / self._speed / 1e9)
