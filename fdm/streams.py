"""When which message is due: intervals in physics steps, counted from boot, so that equal rates stay in step."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(slots=True)
class _Stream:
    interval: float
    count: int

    @property
    def due(self) -> int:
        return math.ceil(self.count * self.interval - 1e-9)


class Schedule:
    """What to do at which step. Keys are MAVLink message ids, or any number the owner chooses."""

    def __init__(self, physics_hz: int) -> None:
        self._hz = physics_hz
        self._streams: dict[int, _Stream] = {}
        self.next_step = 2**62
        """The first step at which anything is due."""

    def set_interval(self, key: int, interval_s: float, *, step: int) -> None:
        """Let `key` be due every `interval_s` seconds from now on; never, if that is not positive."""
        self._streams.pop(key, None)
        if interval_s > 0.0:
            interval = max(1.0, interval_s * self._hz)
            self._streams[key] = _Stream(interval, math.floor(step / interval + 1e-9) + 1)
        self._look_ahead()

    def interval_s(self, key: int) -> float:
        """Seconds between two of this key; 0 where there are none."""
        stream = self._streams.get(key)
        return stream.interval / self._hz if stream else 0.0

    def take_due(self, step: int) -> list[int]:
        """Keys due at this step or before, in ascending order; each is then due one interval later."""
        due = sorted(key for key, stream in self._streams.items() if stream.due <= step)
        for key in due:
            stream = self._streams[key]
            stream.count = math.floor(step / stream.interval + 1e-9) + 1
        self._look_ahead()
        return due

    def _look_ahead(self) -> None:
        self.next_step = min((stream.due for stream in self._streams.values()), default=2**62)
