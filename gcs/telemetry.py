"""What is known of the fleet: a pure fold of frames into one struct of arrays.

Component 200, the truth of a simulated vehicle, is not read here: nothing that decides may know it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from pymavlink.dialects.v20.ardupilotmega import MAVError

from gcs import messages
from wire.frames import Frame, decode
from wire.ids import AUTOPILOT
from wire.payloads import LocalPosition, unpack_local_position

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Integers = npt.NDArray[np.int64]

NEVER = -(2**62)
"""ns: before any clock began."""


@dataclass(frozen=True, slots=True, eq=False)
class Swarm:
    """The fleet as telemetry tells it; row k is vehicle ids[k]."""

    ids: tuple[int, ...]
    """System ids."""
    position_ned: Array
    """(N, 3) m from each vehicle's own origin."""
    velocity_ned: Array
    """(N, 3) m/s."""
    position_ns: Integers
    """(N,) when position and velocity arrived, on the ground station's clock."""
    boot_ms: Integers
    """(N,) the vehicle's own time of them: older ones that arrive late are dropped."""
    origin: Array
    """(N, 3) latitude and longitude [degrees] and altitude [m] of each vehicle's own origin; NaN until told."""
    attitude_rpy: Array
    """(N, 3) rad."""
    heartbeat_ns: Integers
    """(N,) when the autopilot was last alive."""
    autopilot: Integers
    """(N,) MAV_AUTOPILOT of the heartbeat; 0 until it came."""
    custom_mode: Integers
    """(N,) the autopilot's number of its mode."""
    armed: Flags
    ready: Flags
    """(N,) the autopilot's own checks before arming pass."""
    battery: Array
    """(N,) 0 … 1; NaN until told."""
    not_finite: int
    """Positions and velocities refused because they were no numbers."""
    words: tuple[tuple[int, int, str], ...]
    """(system id, MAV_SEVERITY, text) of each STATUSTEXT that arrived with this tick's frames."""

    @staticmethod
    def of(ids: Sequence[int]) -> Swarm:
        """A fleet of which nothing is known yet."""
        n = len(ids)
        return Swarm(
            ids=tuple(ids),
            position_ned=np.full((n, 3), np.nan),
            velocity_ned=np.full((n, 3), np.nan),
            position_ns=np.full(n, NEVER),
            boot_ms=np.full(n, -1),
            origin=np.full((n, 3), np.nan),
            attitude_rpy=np.full((n, 3), np.nan),
            heartbeat_ns=np.full(n, NEVER),
            autopilot=np.zeros(n, np.int64),
            custom_mode=np.zeros(n, np.int64),
            armed=np.zeros(n, bool),
            ready=np.zeros(n, bool),
            battery=np.full(n, np.nan),
            not_finite=0,
            words=(),
        )

    def fresh(self, now_ns: int, *, within_ns: int) -> Flags:
        """(N,) whose position and velocity are no older than this."""
        return np.asarray(now_ns - self.position_ns <= within_ns)


def observe(swarm: Swarm, frames: Iterable[Frame]) -> Swarm:
    """The fleet after these frames, in their order. Frames of strangers and of other components change nothing."""
    rows = {system: row for row, system in enumerate(swarm.ids)}
    draft = _Draft(swarm)
    for frame in frames:
        fold = _FOLDS.get(frame.message)
        if fold is not None and frame.component == AUTOPILOT and frame.system in rows:
            fold(draft, rows[frame.system], frame)
    return draft.finished()


class _Draft:
    """A swarm being changed. Arrays are copied at the first write; positions, the many, are written together."""

    def __init__(self, swarm: Swarm) -> None:
        self._swarm = swarm
        self._copies: dict[str, npt.NDArray[np.generic]] = {}
        self.boot_ms: list[int] = swarm.boot_ms.tolist()
        self.positions: dict[int, tuple[int, LocalPosition]] = {}
        """Row → (time of arrival [ns], the newest that arrived)."""
        self.not_finite = swarm.not_finite
        self.words: list[tuple[int, int, str]] = []

    def set(self, name: str, row: int, value: float | tuple[float, ...]) -> None:
        copy = self._copies.get(name)
        if copy is None:
            copy = self._copies[name] = getattr(self._swarm, name).copy()
        copy[row] = value

    def finished(self) -> Swarm:
        changed: dict[str, object] = dict(self._copies)
        if self.positions:
            changed |= self._placed(list(self.positions))
        if self.words or self._swarm.words:
            changed["words"] = tuple(self.words)
        return replace(self._swarm, not_finite=self.not_finite, **changed)  # type: ignore[arg-type]

    def _placed(self, rows: list[int]) -> dict[str, object]:
        numbers = np.array([position for _, position in self.positions.values()])
        position, velocity = self._swarm.position_ned.copy(), self._swarm.velocity_ned.copy()
        position_ns = self._swarm.position_ns.copy()
        position[rows], velocity[rows] = numbers[:, 1:4], numbers[:, 4:7]
        position_ns[rows] = [time_ns for time_ns, _ in self.positions.values()]
        boot_ms = np.array(self.boot_ms)
        return {"position_ned": position, "velocity_ned": velocity, "position_ns": position_ns, "boot_ms": boot_ms}


def _local_position(draft: _Draft, row: int, frame: Frame) -> None:
    position = unpack_local_position(frame.payload)
    if not math.isfinite(sum(position)):  # a sum of finite float32s is finite in doubles
        draft.not_finite += 1
        return
    late_ms = draft.boot_ms[row] - position.time_boot_ms
    if 0 <= late_ms < REBOOTED_MS:
        return
    draft.boot_ms[row] = position.time_boot_ms
    draft.positions[row] = frame.time_ns, position


REBOOTED_MS = 2000
"""A vehicle whose own clock is this far back was not reordered on the way: it has booted again."""


def _heartbeat(draft: _Draft, row: int, frame: Frame) -> None:
    beat = decode(frame)
    draft.set("heartbeat_ns", row, frame.time_ns)
    draft.set("autopilot", row, beat.autopilot)
    draft.set("custom_mode", row, beat.custom_mode)
    draft.set("armed", row, bool(beat.base_mode & messages.ARMED))


def _sys_status(draft: _Draft, row: int, frame: Frame) -> None:
    status = decode(frame)
    draft.set("ready", row, bool(status.onboard_control_sensors_health & messages.PREARM_CHECK))
    if status.battery_remaining >= 0:
        draft.set("battery", row, status.battery_remaining / 100)


def _origin(draft: _Draft, row: int, frame: Frame) -> None:
    origin = decode(frame)
    draft.set("origin", row, (origin.latitude / 1e7, origin.longitude / 1e7, origin.altitude / 1e3))


def _attitude(draft: _Draft, row: int, frame: Frame) -> None:
    attitude = decode(frame)
    draft.set("attitude_rpy", row, (attitude.roll, attitude.pitch, attitude.yaw))


def _words(draft: _Draft, _row: int, frame: Frame) -> None:
    said = decode(frame)
    draft.words.append((frame.system, said.severity, said.text))


def _tolerant(fold: Callable[[_Draft, int, Frame], None]) -> Callable[[_Draft, int, Frame], None]:
    """A payload that does not fit its message tells nothing; its frame is in the recording."""

    def folded(draft: _Draft, row: int, frame: Frame) -> None:
        try:
            fold(draft, row, frame)
        except (MAVError, UnicodeDecodeError):
            return

    return folded


_FOLDS: dict[int, Callable[[_Draft, int, Frame], None]] = {
    messages.LOCAL_POSITION_NED: _local_position,
    messages.HEARTBEAT: _tolerant(_heartbeat),
    messages.SYS_STATUS: _tolerant(_sys_status),
    messages.GPS_GLOBAL_ORIGIN: _tolerant(_origin),
    messages.ATTITUDE: _tolerant(_attitude),
    messages.STATUSTEXT: _tolerant(_words),
}
