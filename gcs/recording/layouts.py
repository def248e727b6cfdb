"""The fields of every MAVLink message of our dialect: names, types, units and meanings, and their values in a payload.

Several times as fast as pymavlink's objects, and held to them by a test.
Page: https://mavlink.io/en/guide/serialization.html
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import accumulate
from operator import itemgetter
from struct import Struct
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect


@dataclass(frozen=True, slots=True)
class Field:
    """One field of a message."""

    name: str
    type: str
    """As MAVLink writes it: uint8_t, float, char."""
    length: int
    """Of an array, or of a text; 0 of a single value."""
    unit: str
    """As MAVLink writes it: m/s, degE7; "" if it has none."""
    enum: str
    """That its numbers are of, or ""."""
    sentence: str

    @property
    def text(self) -> bool:
        """Whether its characters are a text."""
        return self.type == "char"

    @property
    def said(self) -> str:
        """Meaning, unit and enum in one line."""
        return " ".join(filter(None, (self.sentence, self.unit and f"[{self.unit}]", self.enum and f"({self.enum})")))


@dataclass(frozen=True, slots=True)
class Layout:
    """One message of the dialect."""

    name: str
    sentence: str
    fields: tuple[Field, ...]
    """In the order of its definition."""
    _unpacker: Struct
    _pick: Callable[[tuple[Any, ...]], tuple[Any, ...]]
    """The fields' values out of what is unpacked, which is in the order of the wire."""
    _names: tuple[str, ...]
    _texts: tuple[str, ...]

    def read(self, payload: bytes) -> dict[str, Any]:
        """Field name → value: a number, a text up to its first NUL, or the numbers of an array.

        What a payload lacks is zero, as MAVLink 2 cuts it off; what it has beyond our definition is newer than that.
        """
        size = self._unpacker.size
        told = self._unpacker.unpack(payload.ljust(size, b"\0") if len(payload) <= size else payload[:size])
        values = dict(zip(self._names, self._pick(told), strict=True))
        for name in self._texts:
            values[name] = values[name].partition(b"\0")[0].decode("utf-8", "replace")
        return values


def layout(message: int) -> Layout | None:
    """Of this message id; None if our dialect lacks it."""
    found = _LAYOUTS.get(message)
    if found is None and message in dialect.mavlink_map:
        found = _LAYOUTS[message] = _layout(dialect.mavlink_map[message])
    return found


def layout_named(name: str) -> Layout | None:
    """Of the message of this name; None if our dialect lacks it."""
    message = _numbers().get(name)
    return None if message is None else layout(message)


_LAYOUTS: dict[int, Layout] = {}
"""Those that were asked for."""


@cache
def _numbers() -> dict[str, int]:
    return {kind.msgname: number for number, kind in dialect.mavlink_map.items()}


def _layout(kind: Any) -> Layout:
    starts = [0, *accumulate(kind.lengths)]
    sentence, sentences = _sentences(kind)
    fields, places = [], list[int | slice]()
    for name, type_, order in zip(kind.fieldnames, kind.fieldtypes, kind.orders, strict=True):
        length = kind.array_lengths[order]
        one = length == 0 or type_ == "char"
        places.append(starts[order] if one else slice(starts[order], starts[order + 1]))
        unit, enum = kind.fieldunits_by_name.get(name, ""), kind.fieldenums_by_name.get(name, "")
        fields.append(Field(name, type_, length, unit, enum, sentences.get(name, "")))
    return Layout(
        name=kind.msgname,
        sentence=sentence,
        fields=tuple(fields),
        _unpacker=kind.unpacker,
        _pick=itemgetter(*places) if len(places) > 1 else lambda told: (told[places[0]],),
        _names=tuple(field.name for field in fields),
        _texts=tuple(field.name for field in fields if field.text),
    )


_FIELD = re.compile(r"^(\w+)\s+: (.*?)(?: \[[^\]]+\])?(?: \(type:[^)]*\))?$")
"""A field's line in the text of an encoder of pymavlink's."""


def _sentences(kind: Any) -> tuple[str, dict[str, str]]:
    """What a message is, and field name → what it is, as the dialect describes them."""
    text = inspect.getdoc(getattr(dialect.MAVLink, f"{kind.msgname.lower()}_encode")) or ""
    said, _, lines = text.partition("\n\n")
    found = (_FIELD.match(line.strip()) for line in lines.splitlines())
    return " ".join(said.split()), {line[1]: line[2].strip() for line in found if line is not None}
