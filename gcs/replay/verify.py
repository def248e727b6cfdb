"""`gcs replay --verify`: every frame that a recorded flight sent, against what the decision comes to once more."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import orjson

from gcs.choices import AS_IT_IS, Choices
from gcs.console import write
from gcs.guard import DONE, NOT_DONE
from gcs.recording.reader import RecordedTick
from gcs.replay.again import again, chosen
from gcs.replay.difference import Difference
from gcs.replay.pages import LostTicks, Pages
from gcs.replay.setpoints import is_setpoint
from scenarios import Scenario


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
    gaps: tuple[LostTicks, ...]
    unfinished: int
    """Frames that were not compared, for the recording ends in the middle of their tick."""
    parts: tuple[Path, ...]
    """Files in which the recording goes on, that were not compared."""
    cut_short: bool
    """Whether the recording ends before the flight did."""
    lacking: str | None
    """What is known to be missing behind its end, in words."""

    @property
    def identical(self) -> bool:
        """Whether every frame in the recording was compared, and is the same to the bit.

        One that ends before its flight can be identical, for nothing in it was left out; where files lie beside it in
        which it goes on, something was.
        """
        return self.difference is None and not (self.beyond or self.gaps or self.unfinished or self.parts)

    def json(self) -> bytes:
        """One object."""
        return orjson.dumps(
            {
                "ticks": self.ticks,
                "setpoints": self.setpoints,
                "identical": self.identical,
                "difference": None if self.difference is None else self.difference.json(),
                "gaps": [{"first_tick": gap.first, "last_tick": gap.last} for gap in self.gaps],
                "setpoints_beyond_gaps": self.beyond,
                "frames_of_unfinished_ticks": self.unfinished,
                "further_parts": [part.name for part in self.parts],
                "ends_before_flight": self.cut_short,
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
        Difference.of(page.number, pages.mission_s(page.time_ns), page.sent, sent)
        for page, sent in zip(pages.ticks, second.sent, strict=True)
        if page.sent != sent
    )
    return Verification(
        ticks=len(pages.ticks),
        setpoints=_setpoints(pages.ticks),
        difference=next(differences, None),
        beyond=_setpoints(pages.beyond),
        gaps=pages.gaps,
        unfinished=pages.unfinished,
        parts=pages.parts,
        cut_short=pages.cut_short,
        lacking=pages.lacking,
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


def _words(result: Verification) -> list[str]:
    """What was compared and how it came out; then what could not be."""
    said = []
    if result.difference is not None:
        said.append(result.difference.words())
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
        said.append(f"not verified: {result.unfinished} frames at the end: the recording ends in the middle of a tick")
    if result.lacking is not None:
        said.append(f"not verified: {result.lacking}" if result.parts else result.lacking)
    return said


def _listed(gaps: Sequence[LostTicks]) -> str:
    ticks = [f"tick {gap.first}" if gap.first == gap.last else f"ticks {gap.first} to {gap.last}" for gap in gaps]
    return ", ".join(ticks[:3]) + (f" and {len(ticks) - 3} more such gaps" if len(ticks) > 3 else "")
