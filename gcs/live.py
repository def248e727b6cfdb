"""Real links as link and clock at once: to wait is to listen, so every frame has the time at which it came."""

from __future__ import annotations

import selectors
from collections.abc import Iterable, Sequence

from wire.clock import WallClock
from wire.connection import Address, Connection
from wire.frames import Frame, Framer
from wire.ids import AUTOPILOT
from wire.ports import UdpPort


class Live:
    """The vehicles behind one or more UDP ports, told apart by system id."""

    def __init__(self, connections: Iterable[Connection], ids: Sequence[int], *, speed: float = 1.0) -> None:
        self._clock = WallClock(speed=speed)
        self._ids = frozenset(ids)
        self._framer = Framer()
        self._frames: list[Frame] = []
        self._routes: dict[int, tuple[UdpPort, Address]] = {}
        self._selector = selectors.DefaultSelector()
        self._ports: list[UdpPort] = []
        for connection in connections:
            try:
                port = UdpPort(connection)
            except Exception:
                self.close()
                raise
            self._ports.append(port)
            self._selector.register(port, selectors.EVENT_READ)

    def now(self) -> int:
        """ns since 1970."""
        return self._clock.now()

    def sleep_until(self, time_ns: int) -> None:
        """Listen until then."""
        while True:
            seconds = self._clock.seconds_until(time_ns)
            for key, _ in self._selector.select(seconds):
                port: UdpPort = key.fileobj  # type: ignore[assignment]
                self._listen(port)
            if seconds == 0.0:
                return

    def receive(self) -> list[Frame]:
        """Frames of our vehicles since the last call."""
        frames, self._frames = self._frames, []
        return frames

    def send(self, system: int, frame: bytes) -> None:
        """To where the vehicle was last heard; before that, to every peer we are to speak to first."""
        route = self._routes.get(system)
        if route is not None:
            route[0].send(frame, route[1])
            return
        for port in self._ports:
            if port.connection.kind == "udpout":
                port.send(frame)

    @property
    def speaks_first(self) -> bool:
        """Whether any link is to peers that wait for us."""
        return any(port.connection.kind == "udpout" for port in self._ports)

    def close(self) -> None:
        """Give the ports back."""
        self._selector.close()
        for port in self._ports:
            port.close()

    @property
    def rejected(self) -> int:
        """Frames refused: wrong checksum, unknown message, cut short."""
        return self._framer.rejected

    def _listen(self, port: UdpPort) -> None:
        now = self._clock.now()
        for datagram, sender in port.receive():
            for frame in self._framer.frames(now, datagram):
                if frame.system in self._ids:
                    self._frames.append(frame)
                    if frame.component == AUTOPILOT:
                        self._routes[frame.system] = port, sender
