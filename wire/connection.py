"""Connection strings: how people name a link to vehicles.

    udpin:0.0.0.0:14550        binds, and answers whoever speaks ("udp:" is the same)
    udpout:127.0.0.1:14550     speaks first
    tcp:127.0.0.1:5760         calls, and calls again where nobody answers or the line breaks ("tcpout:" is the same)
    tcpin:0.0.0.0:5760         is called, by one or several
    serial:/dev/ttyUSB0:57600  a telemetry radio or a cable; 57600 if absent, and "/dev/ttyUSB0:57600" is enough

Each may be written with "//" as MAVSDK does. A range of ports, "udpin:0.0.0.0:14550-14555", stands for one string each.
The sockets behind them are in `wire.ports`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Literal, cast

Kind = Literal["udpin", "udpout", "tcp", "tcpin", "serial"]

Address = tuple[str, int]
"""Host and port of a peer."""

USUAL_BITS_PER_S = 57_600
"""Of a telemetry radio as it is sold, and of an autopilot's telemetry port as it is delivered."""
SLOWEST, FASTEST = 1_200, 12_000_000
"""Bits a second that a serial line may be asked for."""
DIGITS_AT_MOST = 9

_ALIASES = {"udp": "udpin", "tcpout": "tcp"}
_KINDS: tuple[Kind, ...] = ("udpin", "udpout", "tcp", "tcpin", "serial")
_CALLERS = ("udpout", "tcp")
"""Those that need somebody to speak to."""


class ConnectionRefused(ValueError):
    """A connection string that cannot be used, or a port that cannot be had, in one sentence."""


@dataclass(frozen=True, slots=True)
class Connection:
    """A parsed connection string."""

    kind: Kind
    host: str = ""
    """Of the network kinds."""
    port: int = 0
    device: str = ""
    """Of a serial line."""
    bits_per_s: int | None = None
    """Of a serial line; the others are as fast as their network."""

    def __str__(self) -> str:
        if self.kind == "serial":
            return f"serial:{self.device}:{self.bits_per_s}"
        return f"{self.kind}:{self.host}:{self.port}"


def parse(text: str) -> list[Connection]:
    """The connections a string stands for. Raises ConnectionRefused."""
    if text.startswith("/"):
        return [_serial(text, text)]
    match = re.fullmatch(r"(\w+):(?://)?(.+)", text)
    if match is None:
        raise _unreadable(text)
    kind = _ALIASES.get(match[1], match[1])
    if kind not in _KINDS:
        raise ConnectionRefused(
            f"{text!r}: {match[1]} is not a kind of link; allowed are {', '.join(_KINDS)}, udp (as udpin) "
            "and tcpout (as tcp)"
        )
    if kind == "serial":
        return [_serial(text, match[2])]
    return _network(text, cast(Kind, kind), match[2])


def _network(text: str, kind: Kind, place: str) -> list[Connection]:
    match = re.fullmatch(r"([^:/\s\0]*):(\d+)(?:-(\d+))?", place)
    if match is None:
        raise _unreadable(text)
    host, first, last = match[1], _number(text, match[2]), _number(text, match[3] or match[2])
    if not 1 <= first <= last <= 65535:
        raise ConnectionRefused(f"{text!r}: ports must be 1 to 65535, the first of a range not above the last")
    if kind in _CALLERS and not host:
        raise ConnectionRefused(f"{text!r}: {kind} needs a host to speak to, as in {kind}:127.0.0.1:{first}")
    try:
        host.encode("idna")
    except UnicodeError:
        raise ConnectionRefused(f"{text!r}: {host} cannot be the name of a host") from None
    one = Connection(kind, host or "0.0.0.0", first)
    return [replace(one, port=port) for port in range(first, last + 1)]


def _serial(text: str, place: str) -> Connection:
    match = re.fullmatch(r"(/\S*?[^/:\s])(?::(\d+))?", place)
    if match is None:
        raise ConnectionRefused(f"{text!r}: a serial line must read like serial:/dev/ttyUSB0:{USUAL_BITS_PER_S}")
    bits_per_s = USUAL_BITS_PER_S if match[2] is None else _number(text, match[2])
    if not SLOWEST <= bits_per_s <= FASTEST:
        raise ConnectionRefused(
            f"{text!r}: {bits_per_s} bits/s is no speed of a serial line; allowed are {SLOWEST} to {FASTEST}"
        )
    return Connection("serial", device=match[1], bits_per_s=bits_per_s)


def _number(text: str, digits: str) -> int:
    if len(digits) > DIGITS_AT_MOST:
        raise ConnectionRefused(f"{text!r}: no number here has more than {DIGITS_AT_MOST} digits")
    return int(digits)


def _unreadable(text: str) -> ConnectionRefused:
    return ConnectionRefused(
        f"{text!r}: must read like udpin:0.0.0.0:14550, udpout:127.0.0.1:14550, tcp:127.0.0.1:5760, "
        f"tcpin:0.0.0.0:5760 or serial:/dev/ttyUSB0:{USUAL_BITS_PER_S}"
    )
