"""The last resort: where the code that flies fails, its vehicles are told to land by code that needs none of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from types import TracebackType

from gcs.commands import ChangeMode, Land
from gcs.loop import Clock, Link, Tick
from gcs.messages import Encoder
from gcs.shielded import in_words
from wire.modes import ARDUCOPTER_MODES, ARDUPILOT, PX4, PX4_MODES

ROUNDS, PAUSE_S = 10, 0.2
"""Every vehicle is told so often, with so much time between: a link that loses half of everything delivers one."""

_MODES = {PX4: (PX4_MODES["land"].main, PX4_MODES["land"].sub), ARDUPILOT: (ARDUCOPTER_MODES["land"], 0)}


class LastResort:
    """Lands the fleet when the block it guards ends by an error; the error goes on.

    Also a `Record`, to know who was taken from us and which autopilot each is. Frames are built before take-off; what
    they need later is the link and the clock, and if the clock fails too they go out without waiting. The operator's
    second Ctrl-C is no error: who presses it has been told that nothing will be landed.
    """

    def __init__(self, link: Link, clock: Clock, ids: Iterable[int], say: Callable[[str], None]) -> None:
        """link: what notes its frames may be in between, which keeps none from leaving."""
        self._link = link
        self._clock = clock
        self._say = say
        self._frames = {system: _frames(system) for system in ids}
        self._autopilots = dict.fromkeys(self._frames, 0)
        self._released = frozenset[int]()

    def __enter__(self) -> LastResort:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is not None and not isinstance(error, KeyboardInterrupt):
            self._say(f"gcs: the flight failed ({in_words(error)}); telling its vehicles to land")
            self.land()

    def tick(self, tick: Tick) -> None:
        """Remember whom to tell, and in whose way."""
        swarm = tick.swarm
        self._autopilots = dict(zip(swarm.ids, swarm.autopilot.tolist(), strict=True))
        released = zip(swarm.ids, tick.state.released.tolist(), strict=True)
        self._released = frozenset(system for system, gone in released if gone)

    def land(self) -> None:
        """Tell everybody who is ours, again and again: what they answer is taken for the record alone."""
        start_ns = self._now()
        for turn in range(ROUNDS):
            for system, frames in self._frames.items():
                if system in self._released:
                    continue
                for autopilot, frame in frames:
                    if autopilot in (0, self._autopilots[system]):
                        with suppress(Exception):  # one vehicle that cannot be reached must not keep us from the next
                            self._link.send(system, frame)
            with suppress(Exception):
                self._clock.sleep_until(start_ns + round((turn + 1) * PAUSE_S * 1e9))
            with suppress(Exception):
                self._link.receive()

    def _now(self) -> int:
        with suppress(Exception):
            return self._clock.now()
        return 0


def _frames(system: int) -> tuple[tuple[int, bytes], ...]:
    """(autopilot, frame): NAV_LAND, which all understand, and each one's own mode."""
    encoder = Encoder(system)
    modes = ((autopilot, encoder.encode(ChangeMode(*mode), 0)) for autopilot, mode in _MODES.items())
    return ((0, encoder.encode(Land(), 0)), *modes)
