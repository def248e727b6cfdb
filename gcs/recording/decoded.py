"""MAVLink messages as JSON topics: what `--record-decoded`, export and import write beside raw frames.

NaN and infinity are null; bytes that are no UTF-8 are replaced; arrays are lists. 64-bit integers are JSON's numbers,
whole in any reader that does not squeeze them into a double.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import orjson

from gcs.recording.channels import Channel, Message
from gcs.recording.layouts import Field, layout, layout_named
from wire.frames import Frame

SCHEMA = "mavlink."
"""Before a message's name: the name of its schema."""


def message(frame: Frame) -> Message | None:
    """What a frame says, at its time, for a topic of its message and sender; None where our dialect lacks it."""
    said = decoded(frame)
    return None if said is None else Message(_channel(frame.system, frame.component, said[0]), frame.time_ns, said[1])


@cache
def _channel(system: int, component: int, name: str) -> Channel:
    topic = f"/mavlink/{system}_{component}/{name}"
    return Channel(topic, "json", f"{SCHEMA}{name}", "jsonschema", schema(name))


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
