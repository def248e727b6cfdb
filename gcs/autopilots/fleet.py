"""A fleet of whatever autopilots: each vehicle is asked in the way of its own, which its heartbeat names."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from gcs import messages
from gcs.autopilots.ardupilot import ArduCopter
from gcs.autopilots.protocol import UNKNOWN, Autopilot
from gcs.autopilots.px4 import Px4
from gcs.commands import Command, RequestParameter, RequestStream
from gcs.gate import LOST_NS
from gcs.parameters import untold
from gcs.telemetry import NEVER, Flags, Swarm
from wire.modes import ARDUPILOT, PX4

HEARD_NS = 3_000_000_000
"""Age of a heartbeat from which a vehicle's mode is not known any more."""
THIN, THIN_S = 3.0, 0.2
"""A stream is too thin whose interval is both so many times what was asked for and so many seconds: a link that loses a
third of all frames stretches it to about twice."""


class Fleet:
    """Every function is about one vehicle, a row of the swarm, or about all of them, (N,)."""

    def __init__(self, *, height_m: float, position_s: float) -> None:
        """height_m: above each vehicle's home;  position_s: how often each tells its position and velocity."""
        self._kinds: Mapping[int, Autopilot] = {
            PX4: Px4(height_m=height_m),
            ARDUPILOT: ArduCopter(height_m=height_m),
        }
        self._position_s = position_s

    def next_to_know(self, swarm: Swarm, row: int, now_ns: int) -> tuple[Command, ...]:
        """Everything that must be known before arming and has not been told."""
        kind = self._kind(swarm, row)
        if kind is None or not self.lacking(swarm, row, now_ns):
            return ()
        lacking = untold(int(swarm.autopilot[row]), swarm.parameters[row])
        return (
            self._positions(),
            *kind.streams(),
            *kind.asked_once(swarm, row),
            *(RequestParameter(name) for group in lacking for name in group),
        )

    def lacking(self, swarm: Swarm, row: int, now_ns: int) -> tuple[str, ...]:
        """In words, what a vehicle has not told, or is not, that it must before arming; empty where all is well."""
        kind = self._kind(swarm, row)
        if kind is None:
            return ("a heartbeat of PX4 or ArduPilot",)
        placed = self._placed(swarm, row, now_ns)
        told = (
            ("a heartbeat", now_ns - swarm.heartbeat_ns[row] <= HEARD_NS),
            ("position and velocity", placed),
            (f"positions every {self._position_s:.2g} s", not placed or self._often(swarm, row)),
            ("its origin", np.isfinite(swarm.origin[row]).all()),
            ("its home", np.isfinite(swarm.home_m[row])),
            ("its horizontal accuracy", not np.isnan(swarm.accuracy_m[row])),
            ("whether it stands on the ground", swarm.landed_state[row] != UNKNOWN),
            ("its own readiness to arm", kind.ready(swarm)[row]),
        )
        groups = untold(int(swarm.autopilot[row]), swarm.parameters[row])
        return (*(what for what, is_told in told if not is_told), *(" or ".join(group) for group in groups))

    def next_to_hear(self, swarm: Swarm, row: int, now_ns: int) -> Command | None:
        """Towards positions as often as we asked for them, from a vehicle in the air."""
        hears = self._placed(swarm, row, now_ns) and self._often(swarm, row)
        return None if hears else self._positions()

    def next_to_fly(self, swarm: Swarm, row: int) -> Command | None:
        """Towards hovering at height; None where it is under way, or there."""
        kind = self._kind(swarm, row)
        return None if kind is None else kind.next_to_fly(swarm, row)

    def next_to_obey(self, swarm: Swarm, row: int) -> Command | None:
        """Towards flying our set-points, which must already be coming."""
        kind = self._kind(swarm, row)
        return None if kind is None else kind.next_to_obey(swarm, row)

    def next_to_land(self, swarm: Swarm, row: int) -> Command | None:
        """Towards standing on the ground with rotors off."""
        kind = self._kind(swarm, row)
        return None if kind is None else kind.next_to_land(swarm, row)

    def next_to_hold(self, swarm: Swarm, row: int) -> Command | None:
        """Towards staying where it is, at its height, without us."""
        kind = self._kind(swarm, row)
        return None if kind is None else kind.next_to_hold(swarm, row)

    def climbing(self, swarm: Swarm) -> Flags:
        """(N,) who takes off, or is there, and nobody has stopped it."""
        return self._each(swarm, lambda kind: kind.climbing(swarm))

    def hovering(self, swarm: Swarm) -> Flags:
        """(N,) at height, and take-off is over."""
        return self._each(swarm, lambda kind: kind.hovering(swarm))

    def obeying(self, swarm: Swarm) -> Flags:
        """(N,) who flies our set-points."""
        return self._each(swarm, lambda kind: kind.obeying(swarm))

    def ours(self, swarm: Swarm) -> Flags:
        """(N,) in a mode that we use ourselves: in any other, somebody else flies."""
        return self._each(swarm, lambda kind: kind.ours(swarm))

    def landing(self, swarm: Swarm) -> Flags:
        """(N,) coming down to land."""
        return self._each(swarm, lambda kind: kind.landing(swarm))

    def _positions(self) -> Command:
        return RequestStream(messages.LOCAL_POSITION_NED, self._position_s)

    def _placed(self, swarm: Swarm, row: int, now_ns: int) -> bool:
        """Whether it is known where a vehicle is by now."""
        return bool(np.isfinite(swarm.position_ned[row]).all() and now_ns - swarm.position_ns[row] <= LOST_NS)

    def _often(self, swarm: Swarm, row: int) -> bool:
        """Whether positions come, of late, as often as a lossy link lets them."""
        return bool(swarm.interval_s[row] <= max(THIN * self._position_s, THIN_S))

    def _kind(self, swarm: Swarm, row: int) -> Autopilot | None:
        """None before the vehicle's first heartbeat, and where we do not know its kind."""
        if swarm.heartbeat_ns[row] == NEVER:
            return None
        return self._kinds.get(int(swarm.autopilot[row]))

    def _each(self, swarm: Swarm, asked: Callable[[Autopilot], Flags]) -> Flags:
        """(N,) every vehicle by the answer of its own kind; False for kinds that we do not know."""
        answer = np.zeros(len(swarm.ids), bool)
        for number, kind in self._kinds.items():
            rows = swarm.autopilot == number
            if rows.any():
                answer |= rows & asked(kind)
        return answer
