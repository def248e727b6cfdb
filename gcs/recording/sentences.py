"""What is said of a flight, live, in its recording and afterwards: the same sentence for the same thing everywhere."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from gcs.events import Event, Rating
from gcs.track import Parts

OPINIONS = {1: "complete distrust", 2: "distrust", 3: "neither distrust nor trust", 4: "trust", 5: "complete trust"}
"""What the steps of a rating mean."""


def phase(name: str, task: str) -> str:
    """A phase of the flight begins; task: of the mission, "" outside it."""
    return f"{name}: {task}" if task else name


def next_task(task: str) -> str:
    """The mission turns to another task."""
    return f"next task: {task}"


def distrust(system: int, *, fell: bool) -> str:
    """A robot's trust fell below one half, or rose above it again."""
    return f"robot {system} is {'distrusted' if fell else 'trusted again'}"


def silence(system: int, *, lost: bool) -> str:
    """A vehicle fell silent, or is heard again."""
    return f"vehicle {system} is {'silent' if lost else 'heard again'}"


def hands(ids: Iterable[int], before: Iterable[bool], now: Iterable[bool]) -> Iterator[tuple[int, str]]:
    """Vehicles that others took from us, and those that the operator took back: system id and sentence."""
    for system, was, released in zip(ids, before, now, strict=True):
        if released and not was:
            yield system, f"vehicle {system} is not ours any more: nothing is sent to it"
        elif was and not released:
            yield system, f"vehicle {system} is ours"


def rating(said: Rating) -> str:
    """What a person said of a robot, or of the swarm."""
    whom = "the swarm" if said.vehicle is None else f"robot {said.vehicle}"
    return f"{said.rater} rates {whom} {said.rating} of 5: {OPINIONS[said.rating]}"


def parts(before: Parts, now: Parts) -> Iterator[tuple[int, str]]:
    """What changed in who leads and who was left behind: the system id that it is about, and the sentence."""
    for old, new in zip(before.leaders, now.leaders, strict=True):
        if old != new:
            yield new, f"robot {new} leads in place of robot {old}"
    for system in now.left_behind:
        if system not in before.left_behind:
            yield system, f"robot {system} is left behind"
    for system in before.left_behind:
        if system not in now.left_behind:
            yield system, f"robot {system} is taken back"


def operator(event: Event) -> str:
    """A word of the operator."""
    return f"the operator says: {event}"


def vehicle(system: int, text: str) -> str:
    """A word of an autopilot."""
    return f"vehicle {system}: {text}"
