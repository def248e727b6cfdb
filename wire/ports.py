"""What lies behind a connection string: a UDP socket, a TCP line or a serial line, none of which is ever waited for."""

from __future__ import annotations

import socket
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from typing import Protocol

from wire.connection import Address, Connection, ConnectionRefused
from wire.lines import CallingPort, SerialPort, TcpInPort

DATAGRAM = 2048
"""Bytes: more than any MAVLink datagram over Ethernet has."""
RECEIVE_BUFFER = 4 << 20
"""Bytes asked of the kernel, so that a fleet's telemetry survives a slow tick."""
DRAIN_AT_MOST = 4096
"""Datagrams taken at one go: a flood must not keep the caller from its work."""


class Port(Protocol):
    """One end of a link; no method waits, none raises for what the other end does."""

    @property
    def connection(self) -> Connection:
        """What it was opened from."""
        ...

    @property
    def stream(self) -> bool:
        """Whether what is received are bytes without boundaries (StreamFramer), or whole datagrams (Framer)."""
        ...

    def fileno(self) -> int:
        """For `select`; the same from opening to closing, also over lines that break."""
        ...

    def receive(self, at_most: int = ...) -> Sequence[tuple[bytes, Address | None]]:
        """Pieces that wait, oldest first, with who sent them; None where there is only one who can."""
        ...

    def send(self, data: bytes, to: Address | None = None) -> bool:
        """Send one frame. False where it did not leave; it is not kept for later."""
        ...

    def close(self) -> None:
        """Give the port back."""
        ...


def open_port(connection: Connection) -> Port:
    """The port a connection names. Raises ConnectionRefused."""
    match connection.kind:
        case "udpin" | "udpout":
            return UdpPort(connection)
        case "tcp":
            return CallingPort(connection)
        case "tcpin":
            return TcpInPort(connection)
        case "serial":
            return SerialPort(connection)


class UdpPort:
    """A non-blocking UDP socket that hands out whole datagrams with their sender."""

    stream = False

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self._socket = _udp_socket()
        self._peer: Address | None = None
        address = (connection.host, connection.port)
        try:
            if connection.kind == "udpin":
                self._socket.bind(address)
            else:
                self._socket.connect(address)
                self._peer = self._socket.getpeername()
        except OSError as error:
            self._socket.close()
            raise ConnectionRefused(f"{connection}: {error.strerror or error}") from None

    def connected_to(self, address: Address) -> UdpPort:
        """A second socket on this udpin port, connected to one peer: a flood from others cannot push its datagrams out.

        The kernel delivers there what that peer sends from now on, and what anybody else sends here. Sockets may share
        a port only where each of them says that it may be shared (SO_REUSEADDR), and Linux asks when the last of them
        binds: this one says so for that moment alone, and keeps other programs out at any other time.
        """
        second = _udp_socket()
        second.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            with _shared(self._socket):
                second.bind(self._socket.getsockname())
                second.connect(address)
        except OSError as error:
            second.close()
            raise ConnectionRefused(
                f"{self.connection}, for {address[0]}:{address[1]} alone: {error.strerror or error}"
            ) from None
        twin = copy(self)
        twin._socket, twin._peer = second, address
        return twin

    def fileno(self) -> int:
        """For `select`."""
        return self._socket.fileno()

    def receive(self, at_most: int = DRAIN_AT_MOST) -> list[tuple[bytes, Address]]:
        """Datagrams that wait, oldest first; with a peer, its own alone."""
        got: list[tuple[bytes, Address]] = []
        for _ in range(at_most):
            try:
                data, sender = self._socket.recvfrom(DATAGRAM)
            except BlockingIOError:
                break
            except OSError:  # what became of a datagram we sent (nobody listens, no way there) is told here, once each
                continue
            if self._peer is None or sender == self._peer:  # others may have come between its bind and its connect
                got.append((data, sender))
        return got

    def send(self, data: bytes, to: Address | None = None) -> bool:
        """Send one datagram, to `to` or, with a peer, to it. False where the kernel would not take it."""
        try:
            if self._peer is not None or to is None:
                self._socket.send(data)
            else:
                self._socket.sendto(data, to)
        except OSError:  # nobody listens there, no network, a full buffer: the link is as good as its next datagram
            return False
        return True

    def close(self) -> None:
        """Give the port back."""
        self._socket.close()


def _udp_socket() -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.setblocking(False)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
    return made


@contextmanager
def _shared(one: socket.socket) -> Iterator[None]:
    """Its port may be shared, for as long as this lasts."""
    one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        yield
    finally:
        one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 0)
