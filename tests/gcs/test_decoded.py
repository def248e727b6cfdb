"""MAVLink messages as JSON: the same fields that pymavlink reads."""

import math
import struct

import orjson
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs.recording.decoded import decoded, schema
from gcs.recording.layouts import layout
from wire.frames import Frame, Framer, Sender, decode

MESSAGES = sorted(dialect.mavlink_map)


def framed(message, payload):
    """The frame of a message with this payload, as it would arrive."""
    (frame,) = Framer().frames(0, Sender(7, 1).frame(message, payload))
    return frame


def said(frame):
    name, data = decoded(frame)
    return name, orjson.loads(data)


def as_json(value):
    """What a field of pymavlink's is in JSON."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, bytes):
        return value.partition(b"\0")[0].decode("utf-8", "replace")
    return [as_json(one) for one in value] if isinstance(value, list) else value


@given(message=st.sampled_from(MESSAGES), payload=st.binary(min_size=1, max_size=255))
def test_every_message_has_the_fields_that_pymavlink_reads(message, payload):
    frame = framed(message, payload[: dialect.mavlink_map[message].unpacker.size])
    theirs = decode(frame)
    name, ours = said(frame)
    assert name == theirs.get_type()
    assert list(ours) == theirs.get_fieldnames()
    raw = {field: getattr(theirs, f"_{field}_raw", getattr(theirs, field)) for field in ours}
    assert ours == {field: as_json(value) for field, value in raw.items()}


def test_what_is_no_number_is_null():
    sender = Sender(1, 1)
    message = sender.pack(dialect.MAVLink_attitude_message(5, math.nan, math.inf, -math.inf, 0.5, 0.0, -1.0))
    name, fields = said(Framer().frames(0, message)[0])
    assert name == "ATTITUDE"
    assert list(fields.values()) == [5, None, None, None, 0.5, 0.0, -1.0]


@pytest.mark.parametrize(
    ("text", "read"),
    [
        (b"armed\0and what was there before", "armed"),
        (b"x" * 50, "x" * 50),
        (b"", ""),
        ("Höhe 3 m".encode(), "Höhe 3 m"),
        (b"\xff3 m", "\N{REPLACEMENT CHARACTER}3 m"),
    ],
)
def test_a_text_ends_at_its_nul_and_is_utf_8(text, read):
    _, fields = said(framed(dialect.MAVLINK_MSG_ID_STATUSTEXT, b"\6" + text.ljust(50, b"\0") + b"\1\0\0"))
    assert fields == {"severity": 6, "text": read, "id": 1, "chunk_seq": 0}


def test_64_bits_stay_whole():
    _, fields = said(framed(dialect.MAVLINK_MSG_ID_TIMESYNC, struct.pack("<qq", 2**63 - 1, -(2**63))))
    assert (fields["tc1"], fields["ts1"]) == (2**63 - 1, -(2**63))


def test_what_a_newer_definition_adds_is_left_aside():
    heartbeat = bytes([0, 0, 0, 0, 2, 3, 81, 4, 3])
    assert said(framed(0, heartbeat + b"\1\2\3"))[1] == said(framed(0, heartbeat))[1]


def test_a_message_beyond_our_dialect_is_not_decoded():
    assert decoded(Frame(0, 1, 1, 0xFFFFFF, b"\1", b"")) is None


@pytest.mark.parametrize("message", MESSAGES)
def test_every_message_is_what_its_schema_says(message):
    told = orjson.loads(schema(dialect.mavlink_map[message].msgname))
    name, fields = said(framed(message, b"\0"))
    assert told["title"] == f"mavlink.{name}"
    assert told["required"] == list(told["properties"]) == list(fields)
    for field, value in fields.items():
        kind = told["properties"][field]["type"]
        if isinstance(value, list):
            assert kind == "array"
            assert len(value) == told["properties"][field]["minItems"]
        else:
            assert kind == {int: "integer", float: ["number", "null"], str: "string"}[type(value)]


def test_a_schema_tells_units_and_enums():
    lat = orjson.loads(schema("GLOBAL_POSITION_INT"))["properties"]["lat"]
    assert lat == {"type": "integer", "description": "Latitude, expressed [degE7]"}
    status = orjson.loads(schema("HEARTBEAT"))["properties"]["system_status"]
    assert status["description"] == "System status flag. (MAV_STATE)"
    assert layout(dialect.MAVLINK_MSG_ID_HEARTBEAT).sentence.startswith("The heartbeat message shows")
