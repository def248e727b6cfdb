"""An autopilot's parameters by name, as it keeps them: float32 or whole numbers, never an impossible one."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

from fdm import parameter_tables
from fdm.parameter_tables import REAL32, Entry


@dataclass(frozen=True, slots=True)
class Parameter:
    """One of the list, as a client is told of it."""

    name: str
    value: float
    kind: int
    """MAV_PARAM_TYPE."""
    index: int
    """Place in the list."""


class Parameters:
    """The list of one vehicle: its order never changes, values do."""

    def __init__(self, entries: tuple[Entry, ...]) -> None:
        self._entries = entries
        self._place = {entry.name: index for index, entry in enumerate(entries)}
        self._values = [_kept(entry, entry.value) for entry in entries]
        self.changes = 0
        """How often a value was changed: whoever keeps something worked out from the list looks here."""

    def __len__(self) -> int:
        return len(self._entries)

    def __contains__(self, name: object) -> bool:
        return name in self._place

    def __iter__(self) -> Iterator[Parameter]:
        return map(self.at, range(len(self)))

    def at(self, index: int) -> Parameter:
        """The one at this place. Raises IndexError where there is none."""
        if not 0 <= index < len(self):
            raise IndexError(f"there is no parameter {index}: they are 0 to {len(self) - 1}")
        entry = self._entries[index]
        return Parameter(entry.name, self._values[index], entry.kind, index)

    def named(self, name: str) -> Parameter | None:
        """The one with this name; None where there is none."""
        index = self._place.get(name)
        return None if index is None else self.at(index)

    def get(self, name: str) -> float:
        """The value in force. Raises KeyError where there is no such parameter."""
        return self._values[self._place[name]]

    def set(self, name: str, value: float) -> bool:
        """Adopt a value; False, and nothing changes, where the name or the value is impossible for this vehicle."""
        index = self._place.get(name)
        if index is None or not math.isfinite(value):
            return False
        entry = self._entries[index]
        if entry.kind == REAL32 and abs(value) > FLOAT32_MAX:
            return False
        kept = _kept(entry, value)
        if not _kept(entry, entry.low) <= kept <= _kept(entry, entry.high):
            return False
        if entry.choices and kept not in entry.choices:
            return False
        self.changes += kept != self._values[index]
        self._values[index] = kept
        return True


FLOAT32_MAX = 3.4028234663852886e38


def table(autopilot: Literal["px4", "ardupilot"], stock: bool = False, *, system: int = 1) -> Parameters:
    """The parameters of a vehicle with this system id; stock: with the autopilot's own failsafes."""
    entries = (parameter_tables.px4 if autopilot == "px4" else parameter_tables.ardupilot)(system)
    return Parameters(tuple([replace(entry, value=entry.stock) for entry in entries]) if stock else entries)


def _kept(entry: Entry, value: float) -> float:
    """What an autopilot's memory makes of a number."""
    if entry.kind != REAL32:
        return float(round(value))
    single: float = _SINGLE.unpack(_SINGLE.pack(value))[0]
    return single


_SINGLE = struct.Struct("<f")
