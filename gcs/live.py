"""Real links as link and clock at once: to wait is to listen, so every frame has the time at which it came."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from typing import NamedTuple

from gcs.commands import Beat
from gcs.link_quality import LinkQuality, Meter
from gcs.messages import HEARTBEAT, Encoder
from gcs.routes import IGNORED, Routes, of_station
from wire.clock import WallClock
from wire.connection import Connection
from wire.frames import Frame
from wire.hub import Hub, Peer
from wire.ids import AUTOPILOT
from wire.signing import Signer

EVERYBODY = 0
"""A system id that no vehicle has: reaches those who wait to be spoken to."""
BEAT_NS = 1_000_000_000
STATIONS_AT_MOST = 16
"""Other ground stations that are remembered."""


class Station(NamedTuple):
    """Another ground station."""

    system: int
    component: int
    address: str


class Live:
    """The vehicles behind any mix of ports, told apart by system id, each bound to the address it speaks from."""

    def __init__(
        self,
        connections: Iterable[Connection],
        ids: Collection[int] | None,
        *,
        speed: float = 1.0,
        signer: Signer | None = None,
        namesakes: bool = False,
    ) -> None:
        """ids: whom to hear, None hears anybody;  signer: with it, only what is signed is heard.

        namesakes: give vehicles of one system id that speak from several addresses a number each (gcs.routes), where
        otherwise only the first is heard.
        Raises ConnectionRefused.
        """
        self._clock = WallClock(speed=speed)
        self._hub = Hub(connections, signer=signer)
        self._routes = Routes(ids)
        self._namesakes = namesakes
        self._meters: dict[int, Meter] = {}
        self._frames: list[Frame] = []
        self._told: list[Callable[[Frame], None]] = []
        self._refused: Counter[str] = Counter()
        self._stations: dict[tuple[int, int], Station] = {}

    def now(self) -> int:
        """ns since 1970."""
        return self._clock.now()

    def sleep_until(self, time_ns: int) -> None:
        """Listen until then."""
        while True:
            seconds = self._clock.seconds_until(time_ns)
            self._hub.wait(seconds)
            for peer, frame in self._hub.arrivals(self._clock.now):
                self._take(peer, frame)
            if seconds == 0.0:
                return

    def hear(self, seconds: float, *, step_ns: int) -> Iterator[list[Frame]]:
        """Frames as they come, for so long. Who waits to be spoken to is sent our heartbeat, and nothing else."""
        encoder = Encoder(EVERYBODY)
        beat_ns = self.now()
        until_ns = beat_ns + round(seconds * 1e9)
        while (now_ns := self.now()) < until_ns:
            if now_ns >= beat_ns:
                beat_ns += BEAT_NS
                self.send(EVERYBODY, encoder.encode(Beat(), 0))
            self.sleep_until(min(until_ns, now_ns + step_ns))
            yield self.receive()

    def tell(self, whom: Callable[[Frame], None]) -> None:
        """Hand every frame of our vehicles to this one too, from now on and as it arrives."""
        self._told.append(whom)

    def receive(self) -> list[Frame]:
        """Frames of our vehicles since the last call."""
        frames, self._frames = self._frames, []
        return frames

    def send(self, system: int, frame: bytes) -> None:
        """To where the vehicle speaks from; before it was heard, to every peer that waits for us to speak first."""
        peer = self._routes.peer(system)
        for receiver in self._hub.spoken_to_first if peer is None else (peer,):
            self._hub.send(receiver, frame)

    @property
    def speaks_first(self) -> bool:
        """Whether any link is to peers that may wait for us."""
        return bool(self._hub.spoken_to_first)

    def close(self) -> None:
        """Give the ports back."""
        self._hub.close()

    @property
    def rejections(self) -> Mapping[str, int]:
        """Reason → how many frames were refused for it."""
        return self._hub.rejections + self._refused

    @property
    def rejected(self) -> int:
        """Frames refused for any reason."""
        return sum(self.rejections.values())

    @property
    def duplicates(self) -> frozenset[int]:
        """System ids whose heartbeats come from two places that are both alive."""
        return self._routes.duplicates(self.now())

    @property
    def stations(self) -> tuple[Station, ...]:
        """Other ground stations whose heartbeats came this way."""
        return tuple(self._stations.values())

    def address(self, system: int) -> str | None:
        """Where a vehicle speaks from; None before it was heard."""
        peer = self._routes.peer(system)
        return None if peer is None else _place(peer)

    @property
    def quality(self) -> Mapping[int, LinkQuality]:
        """System id → how well its autopilot is heard."""
        return {system: meter.quality for system, meter in self._meters.items()}

    def _take(self, peer: Peer, frame: Frame) -> None:
        if frame.message == HEARTBEAT and of_station(frame):
            self._note(Station(frame.system, frame.component, _place(peer)))
        if self._namesakes:
            frame = self._routes.numbered(frame, peer)
        spoke = self._routes.peer(frame.system)
        refusal = self._routes.refusal(frame, peer)
        if refusal is not None:
            if refusal not in IGNORED:
                self._refused[refusal] += 1
            return
        if spoke != peer:
            self._meters[frame.system] = Meter()
            self._hub.know(peer)
            if spoke is not None and spoke not in self._routes.peers:
                self._hub.forget(spoke)
        if frame.component == AUTOPILOT:
            self._meters[frame.system].count(frame)
        self._frames.append(frame)
        for whom in self._told:
            whom(frame)

    def _note(self, station: Station) -> None:
        name = (station.system, station.component)
        if name in self._stations or len(self._stations) < STATIONS_AT_MOST:
            self._stations[name] = station


def _place(peer: Peer) -> str:
    return str(peer.port.connection) if peer.address is None else f"{peer.address[0]}:{peer.address[1]}"
