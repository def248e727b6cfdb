"""A simulated world as link and clock at once: to wait is to let its physics step.

Runs as fast as JSBSim does, and the same every time. The only module of the ground station that knows `fdm`.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from fdm.craft import EPOCH_US
from fdm.world import World
from scenarios import Scenario
from wire.frames import Frame, Framer

Array = npt.NDArray[np.float64]

EPOCH_NS = 1000 * EPOCH_US
"""2020-01-01T00:00Z: when every lockstep flight begins, on the vehicles' own clocks too."""


class Lockstep:
    """The vehicles of a world, over the very bytes that UDP would carry."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._hz = world.physics_hz
        self._framer = Framer()

    @staticmethod
    def of(
        scenario: Scenario,
        *,
        seed: int,
        autopilot: Literal["px4", "ardupilot"] = "px4",
        stock_failsafes: bool = False,
        origins_ne: Array | None = None,
    ) -> Lockstep:
        """The vehicles of a scenario, on their pads.

        stock_failsafes: as each autopilot is delivered, not as we ask for;  origins_ne: (N, 2) m from each pad to where
        that vehicle counts from; its pad, where not given.
        """
        return Lockstep(
            World(scenario, seed=seed, autopilot=autopilot, stock_failsafes=stock_failsafes, origins_ne=origins_ne)
        )

    def now(self) -> int:
        """ns since 1970, from the step count."""
        return self._time_ns(self._world.steps)

    def sleep_until(self, time_ns: int) -> None:
        """Step the world to the first step at or after this time."""
        wanted = -((EPOCH_NS - time_ns) * self._hz // 1_000_000_000)
        if wanted > self._world.steps:
            self._world.step(wanted - self._world.steps)

    def receive(self) -> list[Frame]:
        """Every frame, with the time at which its vehicle sent it."""
        return [
            frame
            for step, _system, data in self._world.collect()
            for frame in self._framer.frames(self._time_ns(step), data)
        ]

    def send(self, system: int, frame: bytes) -> None:
        """Delivered at once."""
        self._world.deliver(system, frame)

    @property
    def rejected(self) -> int:
        """Frames refused: none, if the world is sound."""
        return self._framer.rejected

    def _time_ns(self, step: int) -> int:
        return EPOCH_NS + step * 1_000_000_000 // self._hz
