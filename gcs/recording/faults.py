"""What was wrong in a flight and when, as a recording tells it, and by whom it is known."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from gcs import words
from gcs.recording.files import FAULTS, MADE
from scenarios import Scenario

FaultsBy = Literal["made", "planned", "unknown"]
"""Whence it is known what was wrong: "made" by the one who flew it, in simulation or on the link; "planned" by the
scenario, of a simulation behind a link that is taken to fly the same; "unknown" where vehicles told no truth.
"""


@dataclass(frozen=True, slots=True)
class FaultSpan:
    """While a fault acted, where it is known that it did (`FaultsBy`)."""

    vehicle: int | None
    """Who is blamed; None of what strikes everyone."""
    kind: str
    from_s: float
    """Since mission start."""
    to_s: float
    """Infinite where it never ended."""
    words: str
    """What goes wrong, as the summary has it."""


def faults_by(metadata: Mapping[str, str], *, measured: bool) -> FaultsBy:
    """measured: whether nothing told the truth. Older recordings do not say: those of our simulations have a seed."""
    if metadata.get(FAULTS) == MADE:
        return "made"
    if measured:
        return "unknown"
    return "made" if FAULTS not in metadata and metadata.get("seed") else "planned"


def spans(told: Sequence[Mapping[str, Any]], scenario: Scenario) -> Iterator[FaultSpan]:
    """Each fault from its begin to its end, in the order in which they began. told: by /truth/fault."""
    names = list(zip((fault.model_dump() for fault in scenario.fault), words.faults(scenario), strict=True))
    for at, begin in enumerate(told):
        if not begin["active"]:
            continue
        definition = begin["definition"]
        ends = (e["mission_s"] for e in told[at + 1 :] if e["definition"] == definition and not e["active"])
        said = next((name for known, name in names if known == definition), begin["kind"].replace("_", " "))
        blamed = None if definition.get("everyone") else begin["vehicle"]
        yield FaultSpan(blamed, begin["kind"], begin["mission_s"], next(ends, math.inf), said)
