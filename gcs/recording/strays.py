"""Times of a log that cannot be: nothing vouches for them, and a frame is kept whatever the time before it says.

A time goes on from the one before it, but for three things: links deliver out of order, by little; nobody speaks for a
while; a clock is set. Set or silent, the times behind it go on from there. Where they go on from before it, or nothing
goes on from it, it is damage.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from typing import NamedTuple, Protocol, TypeVar

LAST_TIME_US = 1 << 52
"""The year 2112: a later time is none."""
AHEAD = 16
"""Frames that are asked behind one whose time is in doubt: as many strays in a row are found out, but one."""


class Habits(NamedTuple):
    """What is usual of the times of a log."""

    back_us: int
    """How far one lies before another that stands ahead of it: links deliver out of order by less."""
    silent_us: int
    """Between the last frame and the one before it, or the first and the next: no flight is silent for longer."""


ANY_LOG = Habits(back_us=1_000_000, silent_us=3_600_000_000)
"""Of other ground stations."""
JOURNAL = Habits(back_us=250_000, silent_us=5_000_000)
"""Of our own: in the order of arrival, and the station itself speaks every second."""


class Timed(Protocol):
    """Whatever has a time."""

    @property
    def time_us(self) -> int:
        """Since 1970."""
        ...


One = TypeVar("One", bound=Timed)


def mended(entries: Iterable[One], habits: Habits) -> Iterator[tuple[One, int]]:
    """Each with its time in µs since 1970; a stray has that of the one before it, the first that of one behind it.

    Where nothing has a time, there is nothing.
    """
    coming = iter(entries)
    behind = deque(islice(coming, AHEAD))
    before: int | None = None
    while behind:
        entry = behind.popleft()
        behind.extend(islice(coming, 1))
        time_us = entry.time_us
        if before is None:
            before = _first([time_us, *(other.time_us for other in behind)], habits)
        elif abs(time_us - before) <= habits.back_us or not _strays(before, time_us, behind, habits):
            before = time_us
        if before is not None:
            yield entry, before


def _first(times: Sequence[int], habits: Habits) -> int | None:
    """The first that another behind it goes on from; where there is none, the first that is one at all."""
    for place, time_us in enumerate(times):
        if _goes_on(time_us, times[place + 1 :], habits):
            return time_us
    return next((time_us for time_us in times if time_us < LAST_TIME_US), None)


def _strays(before: int, time_us: int, behind: Iterable[Timed], habits: Habits) -> bool:
    """Whether a time that may not go on from the one before it is damage."""
    times = [time_us]
    for other in (entry.time_us for entry in behind):
        apart = min(abs(other - one) for one in times)
        if _follows(before, other, habits) and apart > habits.back_us and abs(other - before) < apart:
            return True  # what comes behind it goes on from before it
        times.append(other)
    alone = all(other >= time_us for other in times[1:])  # between two silences, or at the end
    return not (_goes_on(time_us, times[1:], habits) or (alone and _follows(before, time_us, habits)))


def _goes_on(time_us: int, behind: Iterable[int], habits: Habits) -> bool:
    """Whether any of the times behind it follows from it."""
    return time_us < LAST_TIME_US and any(_follows(time_us, other, habits) for other in behind)


def _follows(one: int, other: int, habits: Habits) -> bool:
    return -habits.back_us <= other - one <= habits.silent_us and other < LAST_TIME_US
