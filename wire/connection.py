"""Connection strings and the UDP sockets behind them.

"udpin:0.0.0.0:14550" binds and answers whoever speaks; "udpout:127.0.0.1:14550" speaks first. "udp:" is "udpin:", and
each may be written with "//" as MAVSDK does. A range of ports, "udpin:0.0.0.0:14550-14555", stands for one string each.
"""

from __future__ import annotations

import re
import socket
from dataclasses import dataclass, replace
from typing import Literal

Address = tuple[str, int]

DATAGRAM = 2048
"""Bytes: more than any MAVLink datagram over Ethernet has."""
RECEIVE_BUFFER = 4 << 20
"""Bytes asked of the kernel, so that a fleet's telemetry survives a slow tick."""
DRAIN_AT_MOST = 4096
"""Datagrams taken at one go: a flood must not keep the caller from its work."""


class ConnectionRefused(ValueError):
    """A connection string that cannot be used, or a port that cannot be had, in one sentence."""


@dataclass(frozen=True, slots=True)
class Connection:
    """A parsed connection string."""

    kind: Literal["udpin", "udpout"]
    host: str
    port: int

    def __str__(self) -> str:
        return f"{self.kind}:{self.host}:{self.port}"


def parse(text: str) -> list[Connection]:
    """The connections a string stands for. Raises ConnectionRefused."""
    match = re.fullmatch(r"(\w+):(?://)?([^:/]*):(\d+)(?:-(\d+))?", text)
    if match is None:
        raise ConnectionRefused(f"{text!r}: must read like udpin:0.0.0.0:14550 or udpout:127.0.0.1:14550")
    kind, host, first, last = match[1], match[2] or "0.0.0.0", int(match[3]), int(match[4] or match[3])
    if kind not in ("udpin", "udpout", "udp"):
        raise ConnectionRefused(f"{text!r}: {kind} is not a kind of link; allowed are udpin, udp (the same) and udpout")
    if not 1 <= first <= last <= 65535:
        raise ConnectionRefused(f"{text!r}: ports must be 1 to 65535, the first of a range not above the last")
    if kind == "udpout" and not match[2]:
        raise ConnectionRefused(f"{text!r}: udpout needs a host to speak to, as in udpout:127.0.0.1:14550")
    one = Connection("udpout" if kind == "udpout" else "udpin", host, first)
    return [replace(one, port=port) for port in range(first, last + 1)]


class UdpPort:
    """A non-blocking UDP socket that hands out whole datagrams with their sender."""

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        address = (connection.host, connection.port)
        try:
            if connection.kind == "udpin":
                self._socket.bind(address)
            else:
                self._socket.connect(address)
        except OSError as error:
            self._socket.close()
            raise ConnectionRefused(f"{connection}: {error.strerror or error}") from None

    def fileno(self) -> int:
        """For `select`."""
        return self._socket.fileno()

    def receive(self) -> list[tuple[bytes, Address]]:
        """Datagrams that wait, oldest first, at most DRAIN_AT_MOST of them."""
        got: list[tuple[bytes, Address]] = []
        for _ in range(DRAIN_AT_MOST):
            try:
                got.append(self._socket.recvfrom(DATAGRAM))
            except BlockingIOError:
                break
            except OSError:  # what became of a datagram we sent (nobody listens, no way there) is told here, once each
                continue
        return got

    def send(self, data: bytes, to: Address | None = None) -> bool:
        """Send one datagram, to `to` or, on udpout, to its one peer. False where the kernel would not take it."""
        try:
            if self.connection.kind == "udpout" or to is None:
                self._socket.send(data)
            else:
                self._socket.sendto(data, to)
        except OSError:  # nobody listens there, no network, a full buffer: the link is as good as its next datagram
            return False
        return True

    def close(self) -> None:
        """Give the port back."""
        self._socket.close()
