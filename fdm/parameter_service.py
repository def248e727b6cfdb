"""The parameter protocol: read by name or number, set, and list, a few at a time, with each autopilot's manners.

Fields are cut by hand, because a whole number may look like a NaN and must keep its bits, and a name may be any bytes.
Page: https://mavlink.io/en/services/parameter.html
"""

from __future__ import annotations

import math
import struct
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from fdm.parameter_tables import REAL32
from fdm.parameters import Parameter, Parameters
from fdm.streams import Schedule
from wire.frames import Frame, Sender
from wire.ids import AUTOPILOT
from wire.parameters import decode, encode

LISTING = -6
"""Key of the schedule at which the next parameter of a list is due."""
LIST_PERIOD_S = 0.02
"""Between two of a list: a list must not crowd a slow link's telemetry out."""
NO_INDEX = 0xFFFF

READ, LIST, SET, VALUE = (
    dialect.MAVLINK_MSG_ID_PARAM_REQUEST_READ,
    dialect.MAVLINK_MSG_ID_PARAM_REQUEST_LIST,
    dialect.MAVLINK_MSG_ID_PARAM_SET,
    dialect.MAVLINK_MSG_ID_PARAM_VALUE,
)
_READ, _LIST, _SET, _VALUE = (struct.Struct(form) for form in ("<hBB16s", "<BB", "<4sBB16sB", "<4sHH16sB"))


class ParameterService:
    """One vehicle's parameters on the wire. autopilot: MAV_AUTOPILOT, 12 or 3."""

    messages = frozenset({READ, LIST, SET})
    """What it answers."""

    def __init__(self, sender: Sender, parameters: Parameters, schedule: Schedule, *, autopilot: int) -> None:
        self._sender = sender
        self._parameters = parameters
        self._schedule = schedule
        self._autopilot = autopilot
        self._is_px4 = autopilot == dialect.MAV_AUTOPILOT_PX4
        self._next = len(parameters)

    def answer(self, frame: Frame, *, step: int) -> list[bytes]:
        """To READ and SET the value in force, to LIST nothing yet, to an unknown name nothing at all."""
        if frame.message == READ:
            return self._read(*_cut(_READ, frame.payload))
        if frame.message == SET:
            return self._set(*_cut(_SET, frame.payload))
        if self._is_for_us(*_cut(_LIST, frame.payload)):
            self._next = 0
            self._schedule.set_interval(LISTING, LIST_PERIOD_S, step=step)
        return []

    def next_listed(self, *, step: int) -> list[bytes]:
        """When LISTING is due: one more, and after the last an end."""
        parameter = self._parameters.at(self._next)
        self._next += 1
        if self._next == len(self._parameters):
            self._schedule.set_interval(LISTING, 0.0, step=step)
        return self._value(parameter, parameter.index)

    def _read(self, index: int, system: int, component: int, name: bytes) -> list[bytes]:
        if not self._is_for_us(system, component):
            return []
        if index >= 0:
            return self._value(self._parameters.at(index), index) if index < len(self._parameters) else []
        return self._told(_text(name))

    def _set(self, value: bytes, system: int, component: int, name: bytes, kind: int) -> list[bytes]:
        if not self._is_for_us(system, component):
            return []
        parameter = self._parameters.named(_text(name))
        if parameter is not None and (kind == parameter.kind or not self._is_px4):
            self._parameters.set(parameter.name, self._decoded(value, parameter.kind))
        return self._told(_text(name))

    def _told(self, name: str) -> list[bytes]:
        """By name: PX4 adds the index, ArduPilot does not look for it."""
        parameter = self._parameters.named(name)
        if parameter is None:
            return []
        return self._value(parameter, parameter.index if self._is_px4 else NO_INDEX)

    def _value(self, parameter: Parameter, index: int) -> list[bytes]:
        value = encode(parameter.value, parameter.kind, self._autopilot)
        name = parameter.name.encode()
        payload = _VALUE.pack(value, len(self._parameters), index, name, parameter.kind)
        return [self._sender.frame(VALUE, payload)]

    def _decoded(self, value: bytes, kind: int) -> float:
        """What is asked for; ArduPilot, whose whole numbers come as floats, cuts what is behind the point."""
        if self._is_px4 or kind == REAL32:
            return float(decode(value, kind, self._autopilot))
        number = float(decode(value, REAL32, self._autopilot))
        return float(math.trunc(number + math.copysign(ROUNDING, number))) if math.isfinite(number) else number

    def _is_for_us(self, system: int, component: int) -> bool:
        return system in (0, self._sender.system) and component in (0, AUTOPILOT)


ROUNDING = 0.01
"""So that a whole number that came out a little too small as a float is not cut to the next. Source: AP_Param.cpp."""


def _cut(form: struct.Struct, payload: bytes) -> tuple[Any, ...]:
    """Fields of a payload that may have lost trailing zeros."""
    return form.unpack(payload[: form.size].ljust(form.size, b"\0"))


def _text(name: bytes) -> str:
    """A name ends at its first zero, or fills its field."""
    return name.split(b"\0", 1)[0].decode("ascii", "replace")
