"""Many ports at once: known peers are read first, strangers in what time is left, so that a flood stops nobody.

Who is known gets, on UDP, a socket of its own. What others send fills the listening socket alone, and the kernel throws
away what does not fit there.
"""

from __future__ import annotations

import selectors
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from wire.connection import Address, Connection, ConnectionRefused
from wire.frames import Frame, Framer, StreamFramer
from wire.lines import TcpInPort
from wire.ports import Port, UdpPort, open_port
from wire.signing import Signer

AT_ONCE = 256
"""Pieces that one known peer may hand in before it is the next one's turn."""
STRANGERS_SHARE = 0.2
"""Of wall time, at most, goes to strangers."""
STRANGERS_AT_ONCE_S = 0.001
"""Seconds for strangers at one go; then known peers have their turn again."""
STREAMS_AT_MOST = 32
"""Peers of streams whose beginnings of frames are kept."""


class Peer(NamedTuple):
    """Somebody who speaks to us."""

    port: Port
    address: Address | None
    """None where the port has one peer only."""


class Hub:
    """Ports opened together, read fairly, and closed together; frames that its signer does not admit never leave it."""

    def __init__(self, connections: Iterable[Connection], *, signer: Signer | None = None) -> None:
        """Raises ConnectionRefused, with all ports given back."""
        self._signer = signer
        self._selector = selectors.DefaultSelector()
        self._ports: list[Port] = []
        self._own: dict[Peer, UdpPort] = {}
        self._known: dict[Port, Peer | None] = {}
        """Port → its one peer, or None where each piece names its sender."""
        self._first: list[Peer] = []
        self._listening: dict[Port, None] = {}
        self._shut_until = 0.0
        """Strangers are not heard before this instant of the monotonic clock."""
        self._shut = False
        self._to_read = 0
        """Datagrams of strangers to be read though their time is up."""
        self._ready: list[Port] = []
        self._datagrams = Framer()
        self._streams: dict[Peer, StreamFramer] = {}
        self._refused: Counter[str] = Counter()
        for connection in connections:
            try:
                self._add(open_port(connection))
            except ConnectionRefused:
                self.close()
                raise

    def _add(self, port: Port) -> None:
        self._ports.append(port)
        if port.connection.kind == "udpin":
            self._listening[port] = None
        elif port.connection.kind == "tcpin":
            self._known[port] = None
        else:
            self._known[port] = peer = Peer(port, None)
            self._first.append(peer)
        self._selector.register(port, selectors.EVENT_READ)

    @property
    def ports(self) -> tuple[Port, ...]:
        """In the order of the connections."""
        return tuple(self._ports)

    @property
    def spoken_to_first(self) -> tuple[Peer, ...]:
        """Peers that may wait for us to speak: the other ends of udpout, tcp and serial."""
        return tuple(self._first)

    def wait(self, seconds: float) -> None:
        """Until there is something to read, at most so long."""
        shut = self._shut_until - time.monotonic()
        if self._shut and shut <= 0.0:
            self._let_in(True)
        ready = self._selector.select(min(seconds, shut) if self._shut else seconds)
        self._ready = [key.fileobj for key, _ in ready]  # type: ignore[misc]

    def arrivals(self, now: Callable[[], int]) -> Iterator[tuple[Peer, Frame]]:
        """What there was to read when waiting ended, as admitted frames; `now` says when each came.

        The time that the caller takes over each of them is counted as its sender's.
        """
        ready, self._ready = self._ready, []
        for port, peer in list(self._known.items()):
            if port in self._known and (port in ready or port.stream):  # a stream sees to its own line when it is asked
                for data, sender in port.receive(AT_ONCE):
                    yield from self._frames(peer or Peer(port, sender), data, now())
        strangers = [port for port in ready if port in self._listening]
        if strangers:
            yield from self._from_strangers(strangers, now)

    def know(self, peer: Peer) -> None:
        """Give a peer of a listening socket a socket of its own, where it has none yet and one can be had.

        What it sent before waits in the listening socket, and is read before what comes to its own: out of order, the
        signed would be taken for replayed.
        """
        port = peer.port
        if not isinstance(port, UdpPort) or port not in self._listening or peer.address is None or peer in self._own:
            return
        try:
            own = port.connected_to(peer.address)
        except ConnectionRefused:  # it is heard on, among strangers
            return
        self._own[peer] = own
        self._to_read = AT_ONCE
        self._known[own] = peer
        self._selector.register(own, selectors.EVENT_READ)

    def forget(self, peer: Peer) -> None:
        """Make a peer a stranger again."""
        own = self._own.pop(peer, None)
        if own is not None:
            del self._known[own]
            self._selector.unregister(own)
            own.close()

    @property
    def known(self) -> frozenset[Peer]:
        """Peers that were given sockets of their own."""
        return frozenset(self._own)

    def has_gone(self, peer: Peer) -> bool:
        """Whether it called us and has hung up: it can neither speak nor be answered any more."""
        return isinstance(peer.port, TcpInPort) and not peer.port.hears(peer.address)

    def send(self, peer: Peer, frame: bytes) -> bool:
        """Send one frame, signed where we sign. False where it did not leave."""
        data = frame if self._signer is None else self._signer.sign(frame, place=self._ports.index(peer.port))
        own = self._own.get(peer)
        return peer.port.send(data, peer.address) if own is None else own.send(data)

    @property
    def rejections(self) -> Counter[str]:
        """Reason → how many frames were refused for it."""
        counted = Counter(self._refused)
        for framer in (self._datagrams, *self._streams.values()):
            counted.update(framer.rejections())
        return counted

    def close(self) -> None:
        """Give all ports back."""
        self._selector.close()
        for port in (*self._own.values(), *self._ports):
            port.close()

    def _from_strangers(self, ports: list[Port], now: Callable[[], int]) -> Iterator[tuple[Peer, Frame]]:
        """One datagram a port in turn, until none waits or time is up; then the door is shut for four times as long."""
        began = time.monotonic()
        spent = 0.0
        while ports and (spent < STRANGERS_AT_ONCE_S or self._to_read > 0):
            waiting = []
            for port in ports:
                for data, sender in port.receive(1):
                    waiting.append(port)
                    yield from self._frames(Peer(port, sender), data, now())
            self._to_read -= len(waiting)
            ports = waiting
            spent = time.monotonic() - began
        self._to_read = 0
        self._shut_until = began + spent / STRANGERS_SHARE
        self._let_in(False)

    def _let_in(self, strangers: bool) -> None:
        self._shut = not strangers
        for port in self._listening:
            if strangers:
                self._selector.register(port, selectors.EVENT_READ)
            else:
                self._selector.unregister(port)

    def _frames(self, peer: Peer, data: bytes, time_ns: int) -> Iterator[tuple[Peer, Frame]]:
        framer = self._stream(peer) if peer.port.stream else self._datagrams
        for frame in framer.frames(time_ns, data):
            refusal = None if self._signer is None else self._signer.refusal(frame)
            if refusal is None:
                yield peer, frame
            else:
                self._refused[refusal] += 1

    def _stream(self, peer: Peer) -> StreamFramer:
        framer = self._streams.pop(peer, None) or StreamFramer()
        self._streams[peer] = framer  # the last one heard is the last one to go
        if len(self._streams) > STREAMS_AT_MOST:
            oldest = self._streams.pop(next(iter(self._streams)))
            self._refused.update(oldest.rejections())
        return framer
