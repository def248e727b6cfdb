"""MAVLink frames: cut datagrams into checked frames, and put frames together.

pymavlink knows the messages; what is done hundreds of times a second, finding frames, checking their CRC and adding
headers, is done here. Tests hold both to the same bytes. Page: https://mavlink.io/en/guide/serialization.html
"""

from __future__ import annotations

import re
import struct
from typing import Any, NamedTuple

from fastcrc import crc16
from pymavlink.dialects.v20 import ardupilotmega as dialect

MAGIC_1, MAGIC_2 = 0xFE, 0xFD
HEADER_1, HEADER_2, CRC, SIGNATURE = 6, 10, 2, 13
SIGNED = 0x01
"""The only incompatibility flag there is; a frame with any other must be dropped."""

_HEADER = struct.Struct("<BBBBBBHB")
_CRC_EXTRA = {number: bytes([kind.crc_extra]) for number, kind in dialect.mavlink_map.items()}
_checksum = crc16.mcrf4xx


class Frame(NamedTuple):
    """One frame whose CRC is right, as it came."""

    time_ns: int
    """When it arrived, on the receiver's clock."""
    system: int
    component: int
    message: int
    """Message id."""
    payload: bytes
    """Without header and CRC; MAVLink 2 has cut off trailing zeros."""
    raw: bytes
    """The whole frame, for recording and for pymavlink."""


class Framer:
    """Cuts what one peer sends into frames.

    Datagrams are cut one at a time with nothing kept between them: a header that claims more bytes than its datagram
    has can otherwise swallow the genuine frames behind it. After a failure the search goes on at the next byte.
    """

    def __init__(self) -> None:
        self.bad_crc = 0
        """Headers whose checksum did not match."""
        self.unknown = 0
        """Headers with a message id or a flag that our dialect does not have."""
        self.truncated = 0
        """Headers that claimed more bytes than the datagram had."""
        self.garbage_bytes = 0
        """Bytes that belonged to no frame."""

    @property
    def rejected(self) -> int:
        """Frames refused for any reason."""
        return self.bad_crc + self.unknown + self.truncated

    def frames(self, time_ns: int, datagram: bytes) -> list[Frame]:
        """All good frames of one datagram, in order."""
        found = []
        at, end = 0, len(datagram)
        while at < end:
            frame = self._frame_at(time_ns, datagram, at, end)
            if frame is None:
                self.garbage_bytes += 1
                at += 1
            else:
                found.append(frame)
                at += len(frame.raw)
        return found

    def _frame_at(self, time_ns: int, data: bytes, at: int, end: int) -> Frame | None:
        magic = data[at]
        if magic == MAGIC_2:
            header, tail = HEADER_2, CRC
        elif magic == MAGIC_1:
            header, tail = HEADER_1, CRC
        else:
            return None
        if end - at < header + tail:
            self.truncated += 1
            return None
        if magic == MAGIC_2:
            length, incompatible, _, _, system, component, low, high = _HEADER.unpack_from(data, at + 1)
            message = low | high << 16
            if incompatible & ~SIGNED:
                self.unknown += 1
                return None
            tail += SIGNATURE * (incompatible & SIGNED)
        else:
            length, _, system, component, message = data[at + 1 : at + HEADER_1]
        stop = at + header + length
        if stop + tail > end:
            self.truncated += 1
            return None
        extra = _CRC_EXTRA.get(message)
        if extra is None:
            self.unknown += 1
            return None
        if _checksum(data[at + 1 : stop] + extra) != data[stop] | data[stop + 1] << 8:
            self.bad_crc += 1
            return None
        return Frame(time_ns, system, component, message, data[at + header : stop], data[at : stop + tail])


def sealed(body: bytes, message: int) -> bytes:
    """The MAVLink 2 frame of a message of our dialect; body: its header, without the magic byte, and its payload."""
    return b"\xfd" + body + _checksum(body + _CRC_EXTRA[message]).to_bytes(2, "little")


def target_system(frame: Frame) -> int:
    """The system a frame is meant for; 0 is all of them."""
    at = _TARGET_AT.get(frame.message)
    return 0 if at is None or at >= len(frame.payload) else frame.payload[at]


def _target_at(kind: Any) -> int | None:
    """Where in the payload a message has its target_system."""
    if "target_system" not in kind.ordered_fieldnames:
        return None
    place = kind.ordered_fieldnames.index("target_system")
    before = re.findall(r"\d*[a-zA-Z]", kind.unpacker.format)[:place]
    return struct.calcsize("<" + "".join(before))


_TARGET_AT = {number: at for number, kind in dialect.mavlink_map.items() if (at := _target_at(kind)) is not None}


def decode(frame: Frame) -> Any:
    """The pymavlink message in a frame. Raises pymavlink's MAVError where the payload does not fit the message."""
    return _decoder.decode(bytearray(frame.raw))


_decoder = dialect.MAVLink(None)


class Sender:
    """Frames of one MAVLink component: owns its sequence number."""

    def __init__(self, system: int, component: int) -> None:
        self.system = system
        self.component = component
        self._sequence = 0
        self._packer = dialect.MAVLink(None, srcSystem=system, srcComponent=component)

    def frame(self, message: int, payload: bytes) -> bytes:
        """A MAVLink 2 frame round a full-length payload packed by hand."""
        payload = payload.rstrip(b"\0") or b"\0"
        body = _HEADER.pack(
            len(payload), 0, 0, self._sequence, self.system, self.component, message & 0xFFFF, message >> 16
        )
        self._sequence = (self._sequence + 1) & 0xFF
        return sealed(body + payload, message)

    def pack(self, message: Any) -> bytes:
        """A frame of a pymavlink message."""
        self._packer.seq = self._sequence
        self._sequence = (self._sequence + 1) & 0xFF
        packed: bytes = bytes(message.pack(self._packer))
        return packed
