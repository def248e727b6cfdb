"""Byte streams as ports: TCP lines that call and are called, and serial lines. They break, and come back by themselves.

A line that is full takes no more: a set-point that cannot leave now is refused, not queued, so that what arrives is
never older than what the kernel holds. Only the rest of a frame that has begun to leave is kept.
"""

from __future__ import annotations

import errno
import os
import selectors
import socket
import time
from collections.abc import Callable
from functools import partial
from typing import Protocol, TypeVar

from wire.connection import Address, Connection, ConnectionRefused

Pieces = list[tuple[bytes, Address | None]]

_Done = TypeVar("_Done")

PIECE = 2048
"""Bytes read at one go."""
PIECES_AT_MOST = 512
"""Pieces a call: 1 MiB, more than any line carries in a tick."""
RETRY_S = 1.0
"""Between two attempts to open a line."""
CALLERS_AT_MOST = 16
"""Lines that a tcpin port answers at once."""
SEND_BUFFER = 16 << 10
"""Bytes that the kernel may hold for a TCP peer: what waits there is stale when it arrives."""
SILENCE_S = 5
"""After so long without an acknowledgement a TCP peer is gone."""


class _Source(Protocol):
    """A socket, or a serial.Serial."""

    def fileno(self) -> int: ...

    def close(self) -> None: ...


class _Line:
    """One open line, through its non-blocking file descriptor. Raises OSError where the other end is gone."""

    def __init__(self, source: _Source) -> None:
        self._source = source
        self._rest = b""

    def fileno(self) -> int:
        return self._source.fileno()

    def read(self) -> bytes:
        """What is there, up to a piece. To be asked only where `select` says that there is something."""
        try:
            data = os.read(self.fileno(), PIECE)
        except BlockingIOError:
            return b""
        if not data:  # something to read, and nothing read: the end of a stream, or a device that was pulled out
            raise ConnectionResetError
        return data

    def write(self, frame: bytes) -> bool:
        """Whether the frame is on its way, all of it or its beginning."""
        if not self.flush():
            return False
        written = self._put(frame)
        if written == 0:
            return False
        self._rest = frame[written:]
        return True

    def flush(self) -> bool:
        """Whether no beginning of a frame waits for its rest any more."""
        if self._rest:
            self._rest = self._rest[self._put(self._rest) :]
        return not self._rest

    def close(self) -> None:
        self._source.close()

    def _put(self, data: bytes) -> int:
        try:
            return os.write(self.fileno(), data)
        except BlockingIOError:
            return 0


class LonePort:
    """A line to one peer, opened again at most once a second where it broke; to call `receive` or `send` sees to it."""

    stream = True

    def __init__(
        self, connection: Connection, source: Callable[[], _Source], *, monotonic: Callable[[], float] = time.monotonic
    ) -> None:
        """`source` opens the line without waiting. Its OSError is the caller's the first time, and a reason to try
        again later.
        """
        self.connection = connection
        self._open = source
        self._monotonic = monotonic
        self._watch = selectors.DefaultSelector()
        self._line: _Line | None = None
        try:
            self._begin()
        except OSError:
            self._watch.close()
            raise
        self._tried = monotonic()

    def fileno(self) -> int:
        """Of what watches the line, so that it outlives the line."""
        return self._watch.fileno()

    def receive(self, at_most: int = PIECES_AT_MOST) -> Pieces:
        """Pieces that wait, of up to 2048 bytes each."""
        got: Pieces = []
        line = self._alive()
        if line is None:
            return got
        try:
            line.flush()
            while len(got) < at_most and self._watch.select(0):
                if data := line.read():
                    got.append((data, None))
                else:
                    break
        except OSError:
            self._drop(line)
        return got

    def send(self, data: bytes, to: Address | None = None) -> bool:  # noqa: ARG002 – there is only one peer
        """Send one frame. False where the line is down or full."""
        line = self._alive()
        if line is None:
            return False
        try:
            return line.write(data)
        except OSError:
            self._drop(line)
            return False

    def close(self) -> None:
        """Give the line back."""
        if self._line is not None:
            self._drop(self._line)
        self._watch.close()

    def _alive(self) -> _Line | None:
        if self._line is None and self._monotonic() - self._tried >= RETRY_S:
            self._tried = self._monotonic()
            try:
                self._begin()
            except OSError:
                return None
        return self._line

    def _begin(self) -> None:
        self._line = _Line(self._open())
        self._watch.register(self._line, selectors.EVENT_READ)

    def _drop(self, line: _Line) -> None:
        self._watch.unregister(line)
        line.close()
        self._line = None
        self._tried = self._monotonic()


class CallingPort(LonePort):
    """A TCP line that we call: nobody there yet is no error, a host that nobody knows is."""

    def __init__(self, connection: Connection, *, monotonic: Callable[[], float] = time.monotonic) -> None:
        try:
            address = socket.getaddrinfo(connection.host, connection.port, socket.AF_INET, socket.SOCK_STREAM)[0][4]
        except OSError as error:
            raise ConnectionRefused(f"{connection}: {error.strerror or error}") from None
        super().__init__(connection, lambda: _called((str(address[0]), int(address[1]))), monotonic=monotonic)


def _called(address: Address) -> socket.socket:
    """A socket that is being connected: until it is, it takes nothing, and where it cannot be, reading says so."""
    caller = _tuned(socket.socket(socket.AF_INET, socket.SOCK_STREAM))
    caller.connect_ex(address)
    return caller


class SerialPort(LonePort):
    """A serial line, ours alone, 8N1 without flow control."""

    def __init__(self, connection: Connection, *, monotonic: Callable[[], float] = time.monotonic) -> None:
        try:
            super().__init__(connection, lambda: _serial(connection), monotonic=monotonic)
        except OSError as error:
            raise ConnectionRefused(f"{connection}: {_words(error)}") from None


def _serial(connection: Connection) -> _Source:
    """Raises OSError."""
    import termios

    from serial import Serial  # only who has a serial line waits for its import

    try:
        line: _Source = Serial(connection.device, connection.bits_per_s, timeout=0, write_timeout=0, exclusive=True)
    except (
        termios.error
    ) as error:  # of a device that goes while it is being opened: no OSError, though it says the same
        raise OSError(*error.args) from None
    except ValueError as error:  # of a speed that the device does not have
        raise OSError(str(error)) from None
    return line


def _words(error: OSError) -> str:
    match error.errno:
        case errno.ENOENT | errno.ENODEV | errno.ENXIO:
            return "there is no such device"
        case errno.EACCES | errno.EPERM:
            return "permission denied: on most systems the user must be in the group dialout"
        case errno.EAGAIN | errno.EBUSY:
            return "another program has it open"
        case None | errno.ENOTTY:
            return "this is not a serial line, or it does not go at that speed"
        case number:
            return os.strerror(number)


class TcpInPort:
    """A TCP port that answers whoever calls, and tells callers apart by their address."""

    stream = True

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self._watch = selectors.DefaultSelector()
        self._callers: dict[Address, _Line] = {}
        self._listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._listener.setblocking(False)
        self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._listener.bind((connection.host, connection.port))
            self._listener.listen(CALLERS_AT_MOST)
        except OSError as error:
            self.close()
            raise ConnectionRefused(f"{connection}: {error.strerror or error}") from None
        self._watch.register(self._listener, selectors.EVENT_READ)

    def fileno(self) -> int:
        """Of what watches listener and callers."""
        return self._watch.fileno()

    def receive(self, at_most: int = PIECES_AT_MOST) -> Pieces:
        """Pieces that wait, with who sent them; callers take turns, piece by piece."""
        for address, line in list(self._callers.items()):
            self._try(address, line.flush)
        got: Pieces = []
        for _ in range(at_most):
            ready = self._watch.select(0)
            for key, _ in ready[: at_most - len(got)]:
                if key.fileobj is self._listener:
                    self._answer()
                elif data := self._try(key.data, self._callers[key.data].read):
                    got.append((data, key.data))
            if not ready or len(got) == at_most:
                break
        return got

    def send(self, data: bytes, to: Address | None = None) -> bool:
        """Send one frame to a caller, or to all of them. False where nobody could take it."""
        wanted = [to] if to is not None else list(self._callers)
        lines = [(address, self._callers[address]) for address in wanted if address in self._callers]
        return sum(1 for address, line in lines if self._try(address, partial(line.write, data))) > 0

    def hears(self, address: Address | None) -> bool:
        """Whether this caller's line stands."""
        return address in self._callers

    def close(self) -> None:
        """Give the port back."""
        for line in self._callers.values():
            line.close()
        self._callers.clear()
        self._listener.close()
        self._watch.close()

    def _answer(self) -> None:
        try:
            caller, address = self._listener.accept()
        except OSError:  # who called has hung up before we answered
            return
        if len(self._callers) >= CALLERS_AT_MOST:
            caller.close()
            return
        line = _Line(_tuned(caller))
        self._callers[address] = line
        self._watch.register(line, selectors.EVENT_READ, address)

    def _try(self, address: Address, act: Callable[[], _Done]) -> _Done | None:
        """What comes of it, or None where the caller has gone."""
        try:
            return act()
        except OSError:
            line = self._callers.pop(address)
            self._watch.unregister(line)
            line.close()
            return None


def _tuned(line: socket.socket) -> socket.socket:
    """Non-blocking, sending at once, holding little back, and noticing a peer that fell silent."""
    line.setblocking(False)
    line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    line.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
    line.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    if hasattr(socket, "TCP_USER_TIMEOUT"):  # Linux
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, SILENCE_S * 1000)
    return line
