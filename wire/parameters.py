"""Parameter values on the wire: PARAM_VALUE and PARAM_SET have one float field for whole numbers too.

PX4 puts the bytes of the number there (MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE), ArduPilot and all others convert
it (…_C_CAST). Page: https://mavlink.io/en/services/parameter.html
"""

from __future__ import annotations

import math
import struct

from pymavlink.dialects.v20 import ardupilotmega as dialect

from wire.modes import PX4

_WHOLE = {
    dialect.MAV_PARAM_TYPE_UINT8: struct.Struct("<B3x"),
    dialect.MAV_PARAM_TYPE_INT8: struct.Struct("<b3x"),
    dialect.MAV_PARAM_TYPE_UINT16: struct.Struct("<H2x"),
    dialect.MAV_PARAM_TYPE_INT16: struct.Struct("<h2x"),
    dialect.MAV_PARAM_TYPE_UINT32: struct.Struct("<I"),
    dialect.MAV_PARAM_TYPE_INT32: struct.Struct("<i"),
}
"""The types that are whole numbers and fit four bytes, each as its bytes lie in the field."""
_FLOAT = struct.Struct("<f")


def encode(value: float, kind: int, autopilot: int) -> float:
    """What the field holds for a value, as a float that survives float32.

    kind: MAV_PARAM_TYPE;  autopilot: MAV_AUTOPILOT of whose parameter it is. Raises ValueError where it does not fit.
    """
    whole = _WHOLE.get(kind)
    try:
        if whole is None:
            return _single(value)
        data = whole.pack(int(value))
        told = float(_FLOAT.unpack(data)[0]) if autopilot == PX4 else _single(int(value))
    except (struct.error, OverflowError, ValueError):
        raise ValueError(f"{value} does not fit a parameter of type {kind}") from None
    if autopilot == PX4 and _FLOAT.pack(told) != data:  # a signalling NaN, which no double can hold
        raise ValueError(f"{value} cannot be told of a parameter of type {kind}")
    return told


def decode(wire_value: float, kind: int, autopilot: int) -> float | int:
    """The value that a field holds; where a converted whole number is none (NaN, infinity), what was told."""
    whole = _WHOLE.get(kind)
    if whole is None:
        return wire_value
    if autopilot == PX4:
        return int(whole.unpack(_FLOAT.pack(wire_value))[0])
    return int(wire_value) if math.isfinite(wire_value) else wire_value


def _single(value: float) -> float:
    return float(_FLOAT.unpack(_FLOAT.pack(value))[0])
