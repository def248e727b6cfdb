"""The first frame that is not the same in two decisions on one tick: which it is, and how that is told."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

import orjson

from gcs.recording.decoded import decoded
from gcs.replay.pages import when
from gcs.replay.setpoints import velocity_of
from wire.frames import Frame, Framer, target_system
from wire.payloads import SET_POSITION_TARGET_LOCAL_NED

SEQUENCE = 4
"""Where a MAVLink 2 frame has its sequence number."""
VELOCITY = ("vx", "vy", "vz")
"""Fields of a set-point."""


@dataclass(frozen=True, slots=True)
class Difference:
    """The first frame that the second decision would not have sent, or sent otherwise."""

    tick: int
    mission_s: float | None
    """Since mission start, negative before it; None where there is no mission."""
    recorded: Frame | None
    """None where nothing was sent."""
    decided: Frame | None
    """None where nothing would be."""

    @property
    def vehicle(self) -> int:
        """System id of whom it is for; 0 is all."""
        frame = self.recorded or self.decided
        assert frame is not None
        return target_system(frame)

    @staticmethod
    def of(tick: int, mission_s: float | None, recorded: Sequence[bytes], decided: Sequence[bytes]) -> Difference:
        """The first in the frames of a tick, which are not the same."""
        return Difference(tick, mission_s, *_apart(recorded, decided))

    def words(self) -> str:
        """One sentence."""
        whom = f"vehicle {self.vehicle}" if self.vehicle else "everybody"
        was, would_be = self.recorded, self.decided
        return (
            f"the decision differs from tick {self.tick} on{when(self.mission_s)}: "
            f"{whom} was sent {_content(was, would_be)}, and would be sent {_content(would_be, was)}"
        )

    def json(self) -> dict[str, Any]:
        """One object."""
        was, would_be = self.recorded, self.decided
        name = next(_decoded(frame)[0] for frame in (was, would_be) if frame is not None)
        return {
            "tick": self.tick,
            "mission_s": self.mission_s,
            "vehicle": self.vehicle,
            "message": name,
            "was": None if was is None else _decoded(was)[1],
            "would_be": None if would_be is None else _decoded(would_be)[1],
        }


def _apart(recorded: Sequence[bytes], decided: Sequence[bytes]) -> tuple[Frame | None, Frame | None]:
    """The first two frames of a tick that are not the same; one alone where the other decision has none like it."""
    pairs = zip_longest(recorded, decided)
    was, now = next((_frame(one), _frame(other)) for one, other in pairs if one != other)
    if was is None or now is None or _address(was) == _address(now):
        return was, now
    if _address(now) not in _addresses(recorded):
        return None, now
    return (was, None) if _address(was) not in _addresses(decided) else (was, now)


def _frame(raw: bytes | None) -> Frame | None:
    return None if raw is None else Framer().frames(0, raw)[0]


def _address(frame: Frame) -> tuple[int, int]:
    return frame.message, target_system(frame)


def _addresses(raw: Iterable[bytes]) -> set[tuple[int, int]]:
    return {_address(frame) for one in raw for frame in Framer().frames(0, one)}


def _content(frame: Frame | None, other: Frame | None) -> str:
    """What is in a frame, as far as it is not in the other."""
    if frame is None:
        return "no such frame"
    name, fields = _decoded(frame)
    known = {} if other is None else _decoded(other)[1]
    apart = {key: value for key, value in fields.items() if key not in known or known[key] != value}
    if not apart:
        return f"{name} with the sequence number {frame.raw[SEQUENCE]}"
    if frame.message != SET_POSITION_TARGET_LOCAL_NED:
        return " ".join((name, *_listed_fields(apart)))
    if apart.keys().isdisjoint(VELOCITY):
        return " ".join(_listed_fields(apart))
    others = {key: value for key, value in apart.items() if known and key not in VELOCITY}
    return " ".join((_velocity(frame, other), *_listed_fields(others)))


def _listed_fields(fields: Mapping[str, Any]) -> Iterator[str]:
    return (f"{key}={value}" for key, value in fields.items())


def _velocity(frame: Frame, other: Frame | None) -> str:
    """m/s, with as many digits as tell it from the other."""
    here = velocity_of(frame.payload)
    there = None if other is None or other.message != frame.message else velocity_of(other.payload)
    digits = next((digits for digits in range(3, 10) if _rounded(here, digits) != _rounded(there, digits)), 10)
    return f"{_rounded(here, digits)} m/s"


def _rounded(velocity: tuple[float, float, float] | None, digits: int) -> str:
    return "" if velocity is None else ", ".join(f"{axis:.{digits}f}" for axis in velocity)


def _decoded(frame: Frame) -> tuple[str, dict[str, Any]]:
    """Name and fields of a message that the ground station sends."""
    told = decoded(frame)
    assert told is not None, "what was sent is of our dialect"
    return told[0], orjson.loads(told[1])
