"""Where a replay is in recorded time: a state machine that is told how much real time went by, and knows no clock.

A position is a cut between messages: everything before it has been seen, nothing at or behind it. So what lies between
two positions is the same in both directions, and none of it is played twice or left out.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import NamedTuple

SPEEDS = tuple(map(Fraction, ("0.25", "0.5", "1", "2", "4", "10")))
"""Recorded seconds a second, that the keys go through."""
SLOWEST, FASTEST = SPEEDS[0], SPEEDS[-1]
REACTION_NS = 1_000_000_000
"""Real time in which a person who sees an event go by wants the one before it, not the same again."""


class Span(NamedTuple):
    """What is to be played: forwards what is at begin_ns ≤ t < end_ns, backwards what is at end_ns ≤ t < begin_ns."""

    begin_ns: int
    end_ns: int


@dataclass(frozen=True, slots=True)
class Player:
    """A position, and how it moves."""

    start_ns: int
    """The recording's first message."""
    end_ns: int
    """Behind its last one."""
    position_ns: int
    speed: Fraction = Fraction(1)
    """Recorded seconds a second, above 0 in either direction."""
    reverse: bool = False
    paused: bool = False
    rest: Fraction = Fraction(0)
    """The part of a recorded nanosecond that is owed to the next advance: however time is sliced, none is lost."""

    @property
    def at_the_end(self) -> bool:
        """Whether nothing is left in this direction."""
        return self.position_ns == (self.start_ns if self.reverse else self.end_ns)

    def advance(self, wall_ns: int) -> tuple[Player, Span]:
        """So much real time went by. At either end of the recording it pauses."""
        if self.paused:
            return self, Span(self.position_ns, self.position_ns)
        due = wall_ns * self.speed + self.rest
        whole = math.floor(due)
        there = self.at(self.position_ns - whole if self.reverse else self.position_ns + whole)
        there = replace(there, paused=True) if there.at_the_end else replace(there, rest=due - whole)
        return there, Span(self.position_ns, there.position_ns)

    def at(self, time_ns: int) -> Player:
        """At another position, or at the end that lies before it."""
        return replace(self, position_ns=min(max(time_ns, self.start_ns), self.end_ns), rest=Fraction(0))

    def toggled(self) -> Player:
        """Paused, or playing again; where nothing is left in this direction, from the other end."""
        if self.paused and self.at_the_end:
            return replace(self.at(self.end_ns if self.reverse else self.start_ns), paused=False)
        return replace(self, paused=not self.paused)

    def turned(self) -> Player:
        """In the other direction."""
        return replace(self, reverse=not self.reverse, rest=Fraction(0))

    def faster(self) -> Player:
        """The next of SPEEDS."""
        return replace(self, speed=next((speed for speed in SPEEDS if speed > self.speed), FASTEST))

    def slower(self) -> Player:
        """The one before."""
        return replace(self, speed=next((speed for speed in reversed(SPEEDS) if speed < self.speed), SLOWEST))

    def onward(self, marks: Sequence[int], *, reaction_ns: int = 0) -> Player:
        """At the first of these times that is yet to be seen, which then has been; where there is none, as it was.

        marks: ns, ascending;  reaction_ns: one that went by so short a (real) time ago, backwards, does not count.
        """
        index = bisect_left(marks, self.position_ns + (self._passed(reaction_ns) if self.reverse else 0))
        return self.at(marks[index] + 1) if index < len(marks) else self

    def back(self, marks: Sequence[int], *, reaction_ns: int = 0) -> Player:
        """The same in the other direction: at the last of these times before the one that was seen last."""
        index = bisect_right(marks, self.position_ns - 2 - (0 if self.reverse else self._passed(reaction_ns)))
        return self.at(marks[index - 1] + 1) if index else self

    def _passed(self, wall_ns: int) -> int:
        """Recorded ns that go by in so much real time; 0 while nothing moves."""
        return 0 if self.paused else math.floor(wall_ns * self.speed)
