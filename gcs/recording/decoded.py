"""MAVLink messages as JSON topics: what `--record-decoded`, export and import write beside raw frames.

NaN and infinity are null; bytes that are no UTF-8 are replaced; arrays are lists. 64-bit integers are JSON's numbers,
whole in any reader that does not squeeze them into a double.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import orjson

from gcs.recording.layouts import Field, layout, layout_named
from gcs.recording.mcap_file import McapFile
from wire.frames import Frame

SCHEMA = "mavlink."
"""Before a message's name: the name of its schema."""


class DecodedTopics:
    """The decoded messages of a file: a topic for each message of each sender."""

    def __init__(self, file: McapFile) -> None:
        self._file = file
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self.written = 0
        """Messages."""

    def add(self, frame: Frame) -> None:
        """What a frame says, at its time; nothing of a message that our dialect lacks. Raises OSError."""
        said = decoded(frame)
        if said is not None:
            name, data = said
            self._file.add(self._channel(topic(frame.system, frame.component, name), name), frame.time_ns, data)
            self.written += 1

    def _channel(self, path: str, name: str) -> int:
        if name not in self._schemas:
            self._schemas[name] = self._file.schema(f"{SCHEMA}{name}", "jsonschema", schema(name))
        if path not in self._channels:
            self._channels[path] = self._file.channel(path, "json", self._schemas[name])
        return self._channels[path]


def topic(system: int, component: int, name: str) -> str:
    """Where the decoded messages of this name and sender are."""
    return f"/mavlink/{system}_{component}/{name}"


def decoded(frame: Frame) -> tuple[str, bytes] | None:
    """The name of a frame's message, and its fields as JSON; None of a message that our dialect lacks."""
    known = layout(frame.message)
    return None if known is None else (known.name, orjson.dumps(known.read(frame.payload)))


@cache
def schema(name: str) -> bytes:
    """The JSON Schema of a message of our dialect, with its units and enums in the descriptions."""
    known = layout_named(name)
    assert known is not None, name
    return orjson.dumps(
        {
            "title": f"{SCHEMA}{name}",
            "description": known.sentence,
            "type": "object",
            "properties": {field.name: _json_type(field) | {"description": field.said} for field in known.fields},
            "required": [field.name for field in known.fields],
        }
    )


def _json_type(field: Field) -> dict[str, Any]:
    if field.text:
        return {"type": "string"}
    one = {"type": ["number", "null"] if field.type in ("float", "double") else "integer"}
    return {"type": "array", "items": one, "minItems": field.length, "maxItems": field.length} if field.length else one
