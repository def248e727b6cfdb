"""What `gcs run` flies: a scenario, or a recorded flight once more, from what its recording holds."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path

from gcs.choices import Choices
from gcs.events import Event, Rating
from gcs.recording.files import METADATA, further_parts, recovering
from gcs.recording.reader import CUT_SHORT, UnreadableRecording, instead_of_scenario, opened, ticks
from gcs.supervision import Supervision, takes_ratings
from gcs.versions import others
from scenarios import Scenario

FIRST_SEED = 1
"""Where nobody names one."""


@dataclass(frozen=True, slots=True)
class ToFly:
    """A flight before it begins."""

    name: str
    """How its summary calls the scenario."""
    scenario: Scenario
    seed: int
    ratings: tuple[Rating, ...] | None
    """Known beforehand; () where people may say something while it is flown, None where nobody rates."""
    said: Callable[[], tuple[Event, ...]] = tuple
    """Called once a tick: what was said when it was recorded, besides ratings known beforehand."""


def to_fly(
    name: str, choices: Choices, supervision: Supervision, *, seed: int | None, say: Callable[[str], None]
) -> ToFly:
    """From the name or file of a scenario, or a recording or its folder. Raises what either, and what is chosen, does.

    seed: None is the recording's;  say: for what may keep a flight from being the same once more.
    """
    path = instead_of_scenario(name)
    if path is not None:
        return _once_more(path, choices, supervision, seed=seed, say=say)
    scenario, seed = choices.scenario(name), FIRST_SEED if seed is None else seed
    return ToFly(name, scenario, seed, supervision.known(scenario, seed=seed))


def _once_more(
    path: Path, choices: Choices, supervision: Supervision, *, seed: int | None, say: Callable[[str], None]
) -> ToFly:
    """Ratings that counted in the mission do so at the same time of the mission; all else comes at its tick."""
    with opened(path) as recording:
        told, problem, flown = recording.metadata[METADATA], recording.problem, recording.scenario
    scenario = choices.revised(flown, source=str(path))
    said = [(page.number, page.events) for page in ticks(path)]
    seed = _seed(told, path, say) if seed is None else seed
    for remark in _remarks(told, [number for number, _ in said], path, problem):
        say(f"{path}: {remark}")
    ratings = supervision.known(scenario, seed=seed)
    recorded = [event for _, events in said for event in events if isinstance(event, Rating)]
    heard = told.get("ratings", "") != "" and supervision.ratings is None and takes_ratings(scenario)
    if heard:
        ratings = tuple(rating for rating in recorded if rating.time_s is not None)
    elif recorded:
        why = f"trust from {scenario.trust.source} takes none" if supervision.ratings is None else "others are given"
        say(f"the {len(recorded)} ratings of {path} are left out: {why}")
    return ToFly(told.get("scenario") or path.stem, scenario, seed, ratings, _at_their_ticks(said, rated=heard))


def _seed(told: Mapping[str, str], path: Path, say: Callable[[str], None]) -> int:
    """The recording's; flights with real links may have none."""
    recorded = told.get("seed", "")
    if recorded.isdecimal():
        return int(recorded)
    say(f"{path}: names no seed; it is flown with {FIRST_SEED}")
    return FIRST_SEED


def _remarks(told: Mapping[str, str], numbers: Sequence[int], path: Path, problem: str | None) -> Iterator[str]:
    """Why this flight may be another than the one that was recorded. numbers: of the ticks that are there."""
    elsewhere = ", ".join(others(told))
    if elsewhere:
        yield f"was recorded with {elsewhere}; the bytes of this flight may differ"
    if not numbers:
        raise UnreadableRecording(f"{path}: holds no tick of the flight")
    lost = numbers[-1] + 1 - len(numbers)
    if lost:
        yield f"lacks {lost} of its ticks; what was said in them is not said again"
    if parts := ", ".join(part.name for part in further_parts(path)):
        yield f"goes on in {parts}, of which nothing is said again; {recovering(path)} joins all"
    elif problem == CUT_SHORT:
        yield "ends before the flight did; what was said after that is not said again"


def _at_their_ticks(
    recorded: Iterable[tuple[int, tuple[Event, ...]]], *, rated: bool
) -> Callable[[], tuple[Event, ...]]:
    """What was said, call by call: the operator's words, and if rated what people said outside the mission."""
    said = {
        number: tuple(event for event in events if not isinstance(event, Rating) or (rated and event.time_s is None))
        for number, events in recorded
    }
    calls = count()
    return lambda: said.get(next(calls), ())
