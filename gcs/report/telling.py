"""How a story is kept short: things of a kind are told one by one, or in sum, or left out with a word of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from gcs.words import robots

MOST = 12
"""Sentences of a story; what always matters is told even beyond."""
FEW = 4
"""Things of a kind that are told one by one."""


@dataclass(frozen=True, slots=True)
class Sentence:
    """One thing that happened."""

    at_s: float
    """Since mission start, as are all."""
    said: str


@dataclass(frozen=True, slots=True)
class Strand:
    """Things of one kind, in the order of time."""

    sentences: tuple[Sentence, ...]
    in_sum: Sentence | None = None
    """Instead of them all, where they are too many."""
    spared: str = ""
    """What they are, where there is no room even for that: "3 changes of the lead"; "" of what always matters."""

    @staticmethod
    def one(at_s: float, said: str, *, spared: str = "") -> Strand:
        """Of a thing that happens once."""
        return Strand((Sentence(at_s, said),), spared=spared)

    @property
    def shorter(self) -> Strand | None:
        """In sum; None where it cannot be."""
        if len(self.sentences) < 2 or self.in_sum is None:
            return None
        return Strand((self.in_sum,), spared=self.spared)


def fitted(strands: Sequence[Strand], room: int) -> list[Sentence]:
    """At most `room` sentences in the order of time, or as many as always matter.

    strands: what matters most first. The longest are summed up first; then the last are left out, and that is said.
    """
    kept = [strand.shorter or strand if len(strand.sentences) > FEW else strand for strand in strands]
    left_out: list[str] = []
    while sum(len(strand.sentences) for strand in kept) + bool(left_out) > room:
        longest = max((strand for strand in kept if strand.shorter), key=_length, default=None)
        spared = next((strand for strand in reversed(kept) if strand.spared), None)
        if longest is not None and longest.shorter is not None:
            kept[kept.index(longest)] = longest.shorter
        elif spared is not None:
            kept.remove(spared)
            left_out.insert(0, spared.spared)
        else:
            break
    told = sorted((sentence for strand in kept for sentence in strand.sentences), key=lambda one: one.at_s)
    if left_out:
        told.append(Sentence(math.inf, f"Left out here: {listed(left_out)}."))
    return told


def _length(strand: Strand) -> int:
    return len(strand.sentences)


def listed(things: Sequence[str]) -> str:
    """a; a and b; a, b and c."""
    return things[0] if len(things) == 1 else f"{', '.join(things[:-1])} and {things[-1]}"


def some(things: Sequence[str], *, most: int = FEW, between: str = ", ") -> str:
    """The first of them, and how many more."""
    if len(things) <= most:
        return listed(things) if between == ", " else between.join(things)
    return f"{between.join(things[:most])}{between}and {len(things) - most} more"


def crowd(systems: Sequence[int]) -> str:
    """Robots by their numbers, or how many."""
    return robots(systems) if len(systems) <= 2 * FEW else f"{len(systems)} robots"


def capital(said: str) -> str:
    """As a sentence begins."""
    return said[:1].upper() + said[1:]


def counted(number: int, what: str) -> str:
    """1 rating; 3 ratings."""
    return f"{number} {what}{'' if number == 1 else 's'}"
