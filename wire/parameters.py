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


def encode(value: float, kind: int, autopilot: int) -> bytes:
    """The four bytes that the field holds for a value: by PX4's way some look like no number, and must keep their bits.

    kind: MAV_PARAM_TYPE;  autopilot: MAV_AUTOPILOT of whose parameter it is. Raises ValueError where it does not fit.
    """
    whole = _WHOLE.get(kind)
    try:
        data = _FLOAT.pack(value) if whole is None else whole.pack(int(value))
        return data if whole is None or autopilot == PX4 else _FLOAT.pack(int(value))
    except (struct.error, OverflowError, ValueError):
        raise ValueError(f"{value} does not fit a parameter of type {kind}") from None


def decode(payload: bytes, kind: int, autopilot: int) -> float | int:
    """The value that a payload begins with; where a converted whole number is none (NaN, infinity), what was told."""
    field = payload[: _FLOAT.size].ljust(_FLOAT.size, b"\0")
    whole = _WHOLE.get(kind)
    if whole is not None and autopilot == PX4:
        return int(whole.unpack(field)[0])
    told: float = _FLOAT.unpack(field)[0]
    return told if whole is None or not math.isfinite(told) else int(told)
