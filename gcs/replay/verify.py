"""`gcs replay --verify`: every frame that a recorded flight sent, against what the decision comes to once more."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any

import orjson

from gcs.choices import AS_IT_IS, Choices
from gcs.console import write
from gcs.guard import DONE, NOT_DONE
from gcs.recording.decoded import decoded
from gcs.recording.reader import RecordedTick
from gcs.replay.again import Gap, Pages, again, chosen, is_setpoint, velocity_of
from scenarios import Scenario
from wire.frames import Frame, Framer, target_system
from wire.payloads import SET_POSITION_TARGET_LOCAL_NED


@dataclass(frozen=True, slots=True)
class Difference:
    """The first frame that the second decision would not have sent, or sent otherwise."""

    tick: int
    mission_s: float
    """Since mission start; NaN outside the mission."""
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


@dataclass(frozen=True, slots=True)
class Verification:
    """What deciding again came to."""

    ticks: int
    """That were decided again."""
    setpoints: int
    """Of those that were sent at these ticks, all of which were compared."""
    difference: Difference | None
    beyond: int
    """Set-points that were not compared, for a gap lies before them."""
    gaps: tuple[Gap, ...]
    unfinished: int
    """Frames that were not compared, for the recording tells nothing of their ticks."""

    @property
    def identical(self) -> bool:
        """Whether every frame in the recording was compared, and is the same to the bit."""
        return self.difference is None and not self.beyond and not self.gaps and not self.unfinished

    def json(self) -> bytes:
        """One object."""
        return orjson.dumps(
            {
                "ticks": self.ticks,
                "setpoints": self.setpoints,
                "identical": self.identical,
                "difference": None if self.difference is None else _told(self.difference),
                "gaps": [{"first_tick": gap.first, "last_tick": gap.last} for gap in self.gaps],
                "setpoints_beyond_gaps": self.beyond,
                "frames_of_unfinished_ticks": self.unfinished,
            }
        )


def decide_again(path: Path, scenario: Scenario | None = None) -> Verification:
    """Decide a recording, or the one in a run's folder, again, bit for bit.

    scenario: another than its own. Raises UnreadableRecording.
    """
    return verified(Pages.of(path), scenario)


def verified(pages: Pages, scenario: Scenario | None = None) -> Verification:
    """Decide again what can be, and compare it."""
    second = again(pages, scenario)
    differences = (
        Difference(page.number, mission_s, *_apart(page.sent, sent))
        for page, sent, mission_s in zip(pages.ticks, second.sent, second.mission_s, strict=True)
        if page.sent != sent
    )
    return Verification(
        ticks=len(pages.ticks),
        setpoints=_setpoints(pages.ticks),
        difference=next(differences, None),
        beyond=_setpoints(pages.beyond),
        gaps=pages.gaps,
        unfinished=pages.unfinished,
    )


def verify(path: Path, *, choices: Choices = AS_IT_IS, as_json: bool = False, console: Any) -> int:
    """Say what deciding again came to, with the recording's own scenario or a changed one; 0 if identical, else 3."""
    pages = Pages.of(path)
    result = verified(pages, chosen(pages, choices))
    if as_json:
        write(result.json())
    else:
        console.print("\n".join(_words(result)), highlight=False, markup=False, soft_wrap=True)
    return DONE if result.identical else NOT_DONE


def _setpoints(pages: Iterable[RecordedTick]) -> int:
    return sum(is_setpoint(frame) for page in pages for frame in page.sent)


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


def _words(result: Verification) -> list[str]:
    """What was compared and how it came out; then what could not be."""
    said = []
    if result.difference is not None:
        said.append(_difference(result.difference))
    elif result.ticks:
        said.append(
            f"{result.ticks} ticks decided again: all {result.setpoints} set-points, and every other frame sent, "
            "identical to the bit"
        )
    if result.gaps:
        said.append(
            f"not verified: the recording lacks frames of {_listed(result.gaps)}; what was decided after the first of "
            f"them cannot be decided again, {result.beyond} set-points among it"
        )
    if result.unfinished:
        said.append(
            f"not verified: {result.unfinished} frames at the end, of ticks that the recording does not tell of: "
            "the flight was killed"
        )
    return said


def _listed(gaps: Sequence[Gap]) -> str:
    ticks = [f"tick {gap.first}" if gap.first == gap.last else f"ticks {gap.first} to {gap.last}" for gap in gaps]
    return ", ".join(ticks[:3]) + (f" and {len(ticks) - 3} more such gaps" if len(ticks) > 3 else "")


def _difference(difference: Difference) -> str:
    mission = "" if math.isnan(difference.mission_s) else f", {difference.mission_s:.1f} s into the mission"
    whom = f"vehicle {difference.vehicle}" if difference.vehicle else "everybody"
    was, would_be = difference.recorded, difference.decided
    return (
        f"the decision differs from tick {difference.tick} on{mission}: {whom} was sent {_content(was, would_be)}, "
        f"and would be sent {_content(would_be, was)}"
    )


def _content(frame: Frame | None, other: Frame | None) -> str:
    """What is in a frame, as far as it is not in the other."""
    if frame is None:
        return "no such frame"
    if frame.message == SET_POSITION_TARGET_LOCAL_NED:
        return f"{', '.join(f'{axis:.3f}' for axis in velocity_of(frame.payload))} m/s"
    name, fields = _decoded(frame)
    known = {} if other is None else _decoded(other)[1]
    apart = (f"{key}={value}" for key, value in fields.items() if key not in known or known[key] != value)
    return " ".join((name, *apart))


def _told(difference: Difference) -> dict[str, Any]:
    """For JSON."""
    was, would_be = difference.recorded, difference.decided
    name = next(_decoded(frame)[0] for frame in (was, would_be) if frame is not None)
    return {
        "tick": difference.tick,
        "mission_s": None if math.isnan(difference.mission_s) else round(difference.mission_s, 6),
        "vehicle": difference.vehicle,
        "message": name,
        "was": None if was is None else _decoded(was)[1],
        "would_be": None if would_be is None else _decoded(would_be)[1],
    }


def _decoded(frame: Frame) -> tuple[str, dict[str, Any]]:
    """Name and fields of a message that the ground station sends."""
    told = decoded(frame)
    assert told is not None, "what was sent is of our dialect"
    return told[0], orjson.loads(told[1])
