"""What is known of the fleet: a pure fold of frames into one struct of arrays.

Component 200, the truth of a simulated vehicle, is not read here: nothing that decides may know it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from pymavlink.dialects.v20.ardupilotmega import MAVError

from gcs import messages
from gcs.answers import Answer, Piece, joined
from gcs.parameters import depends_on
from gcs.swarm_frame import origin_of
from wire import parameters
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
    """(N, 3) m: north and east of each vehicle's own origin, down from its home; from its origin until that is told."""
    velocity_ned: Array
    """(N, 3) m/s."""
    origin_down: Array
    """(N,) m down from each vehicle's own origin, as LOCAL_POSITION_NED counts."""
    position_ns: Integers
    """(N,) when position and velocity arrived, on the ground station's clock."""
    boot_ms: Integers
    """(N,) the vehicle's own time of them: older ones that arrive late are dropped."""
    doubted_ms: Integers
    """(N,) the same of one that came far too late, or from a vehicle that booted again; −1 where there is none."""
    interval_s: Array
    """(N,) between two of them over the last second or so, by the vehicle's own clock; NaN until there were two."""
    origin: Array
    """(N, 3) latitude and longitude [degrees] and altitude [m] of each vehicle's own origin; NaN until told."""
    home_m: Array
    """(N,) altitude above mean sea level of each vehicle's home; NaN until told."""
    home_down: Array
    """(N,) m: how far home lies below the origin; 0 until both are told."""
    attitude_rpy: Array
    """(N, 3) rad."""
    heartbeat_ns: Integers
    """(N,) when the autopilot was last alive."""
    since_ns: Integers
    """(N,) when it was first heard."""
    autopilot: Integers
    """(N,) MAV_AUTOPILOT of the heartbeat; 0 until it came."""
    custom_mode: Integers
    """(N,) the autopilot's number of its mode."""
    armed: Flags
    ready: Flags
    """(N,) SYS_STATUS says that the autopilot's own checks before arming pass."""
    estimator: Integers
    """(N,) EKF_STATUS_FLAGS, which ArduPilot tells; 0 until then."""
    landed_state: Integers
    """(N,) MAV_LANDED_STATE; 0 until told."""
    battery: Array
    """(N,) 0 … 1; NaN until told."""
    accuracy_m: Array
    """(N,) horizontal accuracy that the receiver claims; infinite where it claims none, NaN until told."""
    parameters: tuple[Mapping[str, float], ...]
    """(N,) those that a flight depends on, as far as told; what is no number is not kept."""
    impossible: int
    """Positions and velocities refused: no numbers, or none that a multicopter has."""
    pieces: tuple[Piece | None, ...]
    """(N,) texts of which more is to come."""
    words: tuple[tuple[int, int, str], ...]
    """(system id, MAV_SEVERITY, text) of each text that was complete with this tick's frames."""
    answers: tuple[Answer, ...]
    """How commands of ours were taken, of this tick's frames."""

    @staticmethod
    def of(ids: Sequence[int]) -> Swarm:
        """A fleet of which nothing is known yet."""
        n = len(ids)
        return Swarm(
            ids=tuple(ids),
            position_ned=np.full((n, 3), np.nan),
            velocity_ned=np.full((n, 3), np.nan),
            origin_down=np.full(n, np.nan),
            position_ns=np.full(n, NEVER),
            boot_ms=np.full(n, -1),
            doubted_ms=np.full(n, -1),
            interval_s=np.full(n, np.nan),
            origin=np.full((n, 3), np.nan),
            home_m=np.full(n, np.nan),
            home_down=np.zeros(n),
            attitude_rpy=np.full((n, 3), np.nan),
            heartbeat_ns=np.full(n, NEVER),
            since_ns=np.full(n, NEVER),
            autopilot=np.zeros(n, np.int64),
            custom_mode=np.zeros(n, np.int64),
            armed=np.zeros(n, bool),
            ready=np.zeros(n, bool),
            estimator=np.zeros(n, np.int64),
            landed_state=np.zeros(n, np.int64),
            battery=np.full(n, np.nan),
            accuracy_m=np.full(n, np.nan),
            parameters=({},) * n,
            impossible=0,
            pieces=(None,) * n,
            words=(),
            answers=(),
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
        self._copies: dict[str, Any] = {}
        self.boot_ms: list[int] = swarm.boot_ms.tolist()
        self.doubted_ms: list[int] = swarm.doubted_ms.tolist()
        self.interval_s: list[float] = swarm.interval_s.tolist()
        self.positions: dict[int, tuple[int, LocalPosition]] = {}
        """Row → (time of arrival [ns], the newest that arrived)."""
        self.impossible = swarm.impossible
        self.words: list[tuple[int, int, str]] = []
        self.answers: list[Answer] = []

    def get(self, name: str, row: int) -> Any:
        """What is known by now; not of positions."""
        return self._copies.get(name, getattr(self._swarm, name))[row]

    def set(self, name: str, row: int, value: object) -> None:
        copy = self._copies.get(name)
        if copy is None:
            before = getattr(self._swarm, name)
            copy = self._copies[name] = list(before) if isinstance(before, tuple) else before.copy()
        copy[row] = value

    def position(self, row: int) -> LocalPosition | None:
        """The newest of a vehicle; None before the first."""
        if row in self.positions:
            return self.positions[row][1]
        if self.boot_ms[row] < 0:
            return None
        (north, east, _), velocity = self._swarm.position_ned[row].tolist(), self._swarm.velocity_ned[row].tolist()
        return LocalPosition(self.boot_ms[row], north, east, float(self._swarm.origin_down[row]), *velocity)

    def finished(self) -> Swarm:
        changed: dict[str, Any] = {
            name: tuple(copy) if isinstance(copy, list) else copy for name, copy in self._copies.items()
        }
        if "origin" in changed or "home_m" in changed:
            apart = self._now("origin", changed)[:, 2] - self._now("home_m", changed)
            changed["home_down"] = np.where(np.isfinite(apart), apart, 0.0)
        if self.positions or "home_down" in changed:
            changed |= self._placed(list(self.positions))
            changed["position_ned"][:, 2] = changed["origin_down"] - self._now("home_down", changed)
        if self.words or self._swarm.words:
            changed["words"] = tuple(self.words)
        if self.answers or self._swarm.answers:
            changed["answers"] = tuple(self.answers)
        doubted_ms = np.array(self.doubted_ms, np.int64)
        return replace(self._swarm, impossible=self.impossible, doubted_ms=doubted_ms, **changed)

    def _now(self, name: str, changed: Mapping[str, Any]) -> Any:
        return changed.get(name, getattr(self._swarm, name))

    def _placed(self, rows: list[int]) -> dict[str, Any]:
        swarm = self._swarm
        position, velocity, down = swarm.position_ned.copy(), swarm.velocity_ned.copy(), swarm.origin_down.copy()
        position_ns = swarm.position_ns.copy()
        if rows:
            numbers = np.array([position for _, position in self.positions.values()])
            position[rows], velocity[rows], down[rows] = numbers[:, 1:4], numbers[:, 4:7], numbers[:, 3]
            position_ns[rows] = [time_ns for time_ns, _ in self.positions.values()]
        return {
            "position_ned": position,
            "velocity_ned": velocity,
            "origin_down": down,
            "position_ns": position_ns,
            "boot_ms": np.array(self.boot_ms),
            "interval_s": np.array(self.interval_s),
        }


def _local_position(draft: _Draft, row: int, frame: Frame) -> None:
    position = unpack_local_position(frame.payload)
    if not _possible(position):
        draft.impossible += 1
        return
    before_ms, now_ms = draft.boot_ms[row], position.time_boot_ms
    if now_ms <= before_ms:
        doubted_ms = draft.doubted_ms[row]
        draft.doubted_ms[row] = now_ms if before_ms - now_ms >= REBOOTED_MS else -1
        if not 0 <= doubted_ms < now_ms < doubted_ms + REBOOTED_MS:
            return
        before_ms = doubted_ms
    draft.interval_s[row] = _interval_s(draft.interval_s[row], before_ms, now_ms)
    draft.boot_ms[row], draft.doubted_ms[row] = now_ms, -1
    draft.positions[row] = frame.time_ns, position


def _interval_s(before_s: float, before_ms: int, now_ms: int) -> float:
    """Between two reports, after one more of them: a mean in which the last second weighs most."""
    if before_ms < 0:
        return math.nan
    apart_s = (now_ms - before_ms) / 1e3
    return apart_s if math.isnan(before_s) else before_s + min(1.0, apart_s) * (apart_s - before_s)


FASTEST, FARTHEST = 100.0, 100_000.0
"""m/s and m from the origin: beyond them a report tells nothing, and whoever keeps to it is silent."""


def _possible(position: LocalPosition) -> bool:
    """Whether all numbers are finite, and such as vehicles have: a norm that is NaN is below no bound."""
    return math.hypot(*position[4:7]) <= FASTEST and math.hypot(*position[1:4]) <= FARTHEST


REBOOTED_MS = 2000
"""A report so much older than the last was hardly overtaken on the way: if the next one goes on from it, not from the
last, the vehicle has booted again."""


def _heartbeat(draft: _Draft, row: int, frame: Frame) -> None:
    beat = decode(frame)
    draft.set("heartbeat_ns", row, frame.time_ns)
    if draft.get("since_ns", row) == NEVER:
        draft.set("since_ns", row, frame.time_ns)
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


UNTOLD_NS = 3_000_000_000
"""Who has been heard for so long and has not told its origin, though it was asked, never will."""
SAME_MOMENT_MS = 250
"""Two reports of one vehicle no further apart tell of one place, the way it flew between them added."""


def _global_position(draft: _Draft, row: int, frame: Frame) -> None:
    """Where the origin is of a vehicle that never tells: back from where it is, by what both reports say of that."""
    since_ns = draft.get("since_ns", row)
    if math.isfinite(draft.get("origin", row)[0]) or since_ns == NEVER or frame.time_ns - since_ns < UNTOLD_NS:
        return
    place, position = decode(frame), draft.position(row)
    if position is None or abs(place.time_boot_ms - position.time_boot_ms) > SAME_MOMENT_MS:
        return
    late_s = (place.time_boot_ms - position.time_boot_ms) / 1e3
    ned = [at + late_s * speed for at, speed in zip(position[1:4], position[4:7], strict=True)]
    draft.set("origin", row, origin_of(place.lat / 1e7, place.lon / 1e7, place.alt / 1e3, ned))


def _home(draft: _Draft, row: int, frame: Frame) -> None:
    draft.set("home_m", row, decode(frame).altitude / 1e3)


def _gps(draft: _Draft, row: int, frame: Frame) -> None:
    gps = decode(frame)
    known = gps.h_acc > 0 and gps.fix_type >= messages.GPS_FIX_3D
    draft.set("accuracy_m", row, gps.h_acc / 1e3 if known else math.inf)


def _estimator(draft: _Draft, row: int, frame: Frame) -> None:
    draft.set("estimator", row, decode(frame).flags)


def _landed(draft: _Draft, row: int, frame: Frame) -> None:
    draft.set("landed_state", row, decode(frame).landed_state)


def _parameter(draft: _Draft, row: int, frame: Frame) -> None:
    told, autopilot = decode(frame), int(draft.get("autopilot", row))
    if not depends_on(autopilot, told.param_id):
        return
    value = parameters.decode(frame.payload, told.param_type, autopilot)
    if math.isfinite(value):
        draft.set("parameters", row, {**draft.get("parameters", row), told.param_id: value})


def _answer(draft: _Draft, _row: int, frame: Frame) -> None:
    ack = decode(frame)
    if ack.target_system in (0, messages.GROUND_SYSTEM) and ack.target_component in (0, messages.GROUND_COMPONENT):
        draft.answers.append(Answer(frame.system, ack.command, ack.result))


def _attitude(draft: _Draft, row: int, frame: Frame) -> None:
    attitude = decode(frame)
    draft.set("attitude_rpy", row, (attitude.roll, attitude.pitch, attitude.yaw))


def _words(draft: _Draft, row: int, frame: Frame) -> None:
    said = decode(frame)
    before = draft.get("pieces", row)
    texts, begun = joined(before, said.severity, said.text, said.id, said.chunk_seq)
    draft.words += [(frame.system, *text) for text in texts]
    if begun is not before:
        draft.set("pieces", row, begun)


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
    messages.GLOBAL_POSITION_INT: _tolerant(_global_position),
    messages.HOME_POSITION: _tolerant(_home),
    messages.GPS_RAW_INT: _tolerant(_gps),
    messages.EKF_STATUS_REPORT: _tolerant(_estimator),
    messages.EXTENDED_SYS_STATE: _tolerant(_landed),
    messages.PARAM_VALUE: _tolerant(_parameter),
    messages.COMMAND_ACK: _tolerant(_answer),
    messages.ATTITUDE: _tolerant(_attitude),
    messages.STATUSTEXT: _tolerant(_words),
}
