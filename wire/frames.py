"""MAVLink frames: cut datagrams into checked frames, and put frames together.

pymavlink knows the messages; what is done hundreds of times a second, finding frames, checking their CRC and adding
headers, is done here. Tests hold both to the same bytes. Page: https://mavlink.io/en/guide/serialization.html
"""

from __future__ import annotations

import re
import struct
from collections import Counter
from typing import Any, Literal, NamedTuple

from fastcrc import crc16
from pymavlink.dialects.v20 import ardupilotmega as dialect

MAGIC_1, MAGIC_2 = 0xFE, 0xFD
HEADER_1, HEADER_2, CRC, SIGNATURE = 6, 10, 2, 13
SIGNED = 0x01
"""The only incompatibility flag there is; a frame with any other must be dropped."""

LONGEST = HEADER_2 + 255 + CRC + SIGNATURE
"""Bytes of a frame, at most."""
PATIENCE_NS = 1_000_000_000
"""For the rest of a frame in a stream: the longest one takes 0.3 s at 9600 bits/s."""

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


class _Cutter:
    """Finds frames in bytes, and counts what is none."""

    def __init__(self) -> None:
        self.bad_crc = 0
        """Headers whose checksum did not match."""
        self.unknown = 0
        """Headers with a message id or a flag that our dialect does not have."""
        self.truncated = 0
        """Headers that claimed more bytes than came."""
        self.garbage_bytes = 0
        """Bytes that belonged to no frame."""

    @property
    def rejected(self) -> int:
        """Frames refused for any reason."""
        return self.bad_crc + self.unknown + self.truncated

    def rejections(self) -> Counter[str]:
        """How many were refused for which reason."""
        return Counter({"bad checksum": self.bad_crc, "unknown message": self.unknown, "cut short": self.truncated})

    def _frame_at(self, time_ns: int, data: bytes, at: int, end: int) -> Frame | Literal[False] | None:
        """The frame that begins there; None where none does, False where bytes are missing that could make it one."""
        magic = data[at]
        if magic == MAGIC_2:
            header, tail = HEADER_2, CRC
        elif magic == MAGIC_1:
            header, tail = HEADER_1, CRC
        else:
            return None
        if end - at < header + tail:
            return False
        if magic == MAGIC_2:
            length, incompatible, _, _, system, component, low, high = _HEADER.unpack_from(data, at + 1)
            message = low | high << 16
            if incompatible & ~SIGNED:
                self.unknown += 1
                return None
            tail += SIGNATURE * (incompatible & SIGNED)
        else:
            length, _, system, component, message = data[at + 1 : at + HEADER_1]
        extra = _CRC_EXTRA.get(message)
        if extra is None:
            self.unknown += 1
            return None
        stop = at + header + length
        if stop + tail > end:
            return False
        if _checksum(data[at + 1 : stop] + extra) != data[stop] | data[stop + 1] << 8:
            self.bad_crc += 1
            return None
        return Frame(time_ns, system, component, message, data[at + header : stop], data[at : stop + tail])


class Framer(_Cutter):
    """Cuts datagrams into frames.

    They are cut one at a time with nothing kept between them: a header that claims more bytes than its datagram has can
    otherwise swallow the genuine frames behind it. After a failure the search goes on at the next byte.
    """

    def frames(self, time_ns: int, datagram: bytes) -> list[Frame]:
        """All good frames of one datagram, in order."""
        found = []
        at, end = 0, len(datagram)
        while at < end:
            frame = self._frame_at(time_ns, datagram, at, end)
            if frame:
                found.append(frame)
                at += len(frame.raw)
                continue
            if frame is False:
                self.truncated += 1
            self.garbage_bytes += 1
            at += 1
        return found


class StreamFramer(_Cutter):
    """Cuts one peer's byte stream, which comes in pieces of any size, into frames.

    What may yet become a frame is kept, less than LONGEST bytes of it. A header that claims too much delays the frames
    behind it until as many bytes came, or PATIENCE_NS went by; then the search goes on at the byte behind its first, so
    that none of them is lost.
    """

    def __init__(self) -> None:
        super().__init__()
        self._rest = b""
        self._since_ns = 0
        """When the first byte of the rest came, or later."""

    def frames(self, time_ns: int, data: bytes) -> list[Frame]:
        """All good frames that these bytes complete, in order."""
        found = []
        kept = len(self._rest)
        late = time_ns - self._since_ns > PATIENCE_NS
        data = self._rest + data
        at, end = 0, len(data)
        while at < end:
            frame = self._frame_at(time_ns, data, at, end)
            if frame:
                found.append(frame)
                at += len(frame.raw)
                continue
            if frame is False:
                if not late or at >= kept:
                    break
                self.truncated += 1
            self.garbage_bytes += 1
            at += 1
        self._rest = data[at:]
        if at >= kept:
            self._since_ns = time_ns
        return found

    @property
    def waiting(self) -> int:
        """Bytes kept that may yet become a frame."""
        return len(self._rest)


def sealed(body: bytes, message: int) -> bytes:
    """The MAVLink 2 frame of a message of our dialect; body: its header, without the magic byte, and its payload."""
    return b"\xfd" + body + _checksum(body + _CRC_EXTRA[message]).to_bytes(2, "little")


def sender_of(raw: bytes) -> tuple[int, int]:
    """System and component of whoever sent a whole frame, as its header tells."""
    at = 3 if raw[0] == MAGIC_1 else 5
    return raw[at], raw[at + 1]


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
