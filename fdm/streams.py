"""When which message is due: intervals in physics steps, counted from boot, so that equal rates stay in step."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(slots=True)
class _Stream:
    interval: float
    """Physics steps, not always whole."""
    due: int

    def next_after(self, step: int) -> None:
        """Be due at the first multiple of the interval behind this step, rounded up to a step."""
        count = math.floor(step / self.interval + 1e-9) + 1
        self.due = math.ceil(count * self.interval - 1e-9) if self.interval < math.inf else NEVER


NEVER = 2**62


class Schedule:
    """What to do at which step. Keys are MAVLink message ids, or any number the owner chooses."""

    def __init__(self, physics_hz: int) -> None:
        self._hz = physics_hz
        self._streams: dict[int, _Stream] = {}
        self.next_step = NEVER
        """The first step at which anything is due."""

    def set_interval(self, key: int, interval_s: float, *, step: int) -> None:
        """Let `key` be due every `interval_s` seconds from now on; never, if that is not positive."""
        self._streams.pop(key, None)
        if interval_s > 0.0:
            stream = self._streams[key] = _Stream(max(1.0, interval_s * self._hz), NEVER)
            stream.next_after(step)
        self._look_ahead()

    def once(self, key: int, *, step: int) -> None:
        """Let `key` be due at this step, and then no more."""
        self._streams[key] = _Stream(math.inf, step)
        self._look_ahead()

    def has(self, key: int) -> bool:
        """Whether `key` will be due at all."""
        stream = self._streams.get(key)
        return stream is not None and stream.due < NEVER

    def interval_s(self, key: int) -> float:
        """Seconds between two of this key; 0 where there are none."""
        stream = self._streams.get(key)
        return stream.interval / self._hz if stream and stream.interval < math.inf else 0.0

    def take_due(self, step: int) -> list[int]:
        """Keys due at this step or before, in ascending order; each is then due one interval later."""
        due = []
        for key, stream in self._streams.items():
            if stream.due <= step:
                due.append(key)
                stream.next_after(step)
        self._look_ahead()
        due.sort()
        return due

    def _look_ahead(self) -> None:
        self.next_step = min([stream.due for stream in self._streams.values()], default=NEVER)
