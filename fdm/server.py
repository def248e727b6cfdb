"""A world behind real links, in real time or a multiple of it."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from fdm.world import World
from wire.clock import WallClock
from wire.connection import Connection
from wire.frames import Frame, target_system
from wire.hub import Hub, Peer
from wire.signing import Signer

CATCH_UP_S = 0.25
"""Simulated seconds at one go, at most, when physics has fallen behind."""
PATIENCE_S = 0.5
"""Real seconds to wait at one go, at most: whoever stops a slow world must not wait for its next message."""
GONE_S = 3.0
"""Real seconds of silence after which somebody else may take a ground station's place: they beat once a second."""

WRONG_ADDRESS = "wrong address"
"""Why a good frame is refused: somebody else is this port's ground station."""


@dataclass(slots=True)
class _Station:
    """The one ground station of a port."""

    peer: Peer
    heard_s: float


class Server:
    """Vehicles speak to one ground station each, or all to one, and listen to nobody else.

    shared: all vehicles speak through one port. separate: vehicle i has one of its own, numbered i − 1 higher. Where
    ground stations speak first (udpin, tcpin), the first who does is the one, until it has been silent for GONE_S or,
    on tcpin, has hung up.
    """

    def __init__(
        self,
        world: World,
        to: Connection,
        *,
        ports: Literal["shared", "separate"],
        speed: float,
        signer: Signer | None = None,
    ) -> None:
        """signer: with it, only what is signed is obeyed. Raises ConnectionRefused."""
        self._world = world
        count = len(world.endpoints)
        places = range(count if ports == "separate" else 1)
        self._hub = Hub([replace(to, port=to.port + place) for place in places], signer=signer)
        self._port_of = list(self._hub.ports) * (count // len(places))
        self._stations = {peer.port: _Station(peer, 0.0) for peer in self._hub.spoken_to_first}
        self._refused: Counter[str] = Counter()
        self._clock = WallClock(speed=speed)
        self._start_ns = self._clock.now()
        self.behind_s = 0.0
        """Simulated seconds by which physics lags the clock."""

    def turn(self) -> None:
        """Wait for a frame or for something to be due, let physics catch up, deliver, send."""
        due_ns = self._start_ns + self._world.next_event_step * 1_000_000_000 // self._world.physics_hz
        self._hub.wait(min(PATIENCE_S, self._clock.seconds_until(due_ns)))
        self._step_to_now()
        for peer, frame in self._hub.arrivals(self._clock.now):
            self._take(peer, frame)
        self._send()

    def close(self) -> None:
        """Give the ports back."""
        self._hub.close()

    @property
    def rejections(self) -> Mapping[str, int]:
        """Reason → how many frames were refused for it."""
        return self._hub.rejections + self._refused

    def _step_to_now(self) -> None:
        hz = self._world.physics_hz
        wanted = (self._clock.now() - self._start_ns) * hz // 1_000_000_000
        steps = min(wanted - self._world.steps, round(CATCH_UP_S * hz))
        if steps > 0:
            self._world.step(steps)
        self.behind_s = (wanted - self._world.steps) / hz

    def _take(self, peer: Peer, frame: Frame) -> None:
        if not self._is_the_station(peer):
            self._refused[WRONG_ADDRESS] += 1
            return
        target = target_system(frame)
        for endpoint, port in zip(self._world.endpoints, self._port_of, strict=True):
            if port is peer.port and target in (0, endpoint.system):
                endpoint.receive(frame.raw)

    def _is_the_station(self, peer: Peer) -> bool:
        now_s = time.monotonic()
        station = self._stations.get(peer.port)
        if station is not None and station.peer != peer and self._has_gone(station, now_s):
            self._hub.forget(station.peer)
            station = None
        if station is None:
            self._stations[peer.port] = station = _Station(peer, now_s)
            self._hub.know(peer)
        elif station.peer == peer:
            station.heard_s = now_s
        return station.peer == peer

    def _has_gone(self, station: _Station, now_s: float) -> bool:
        return now_s - station.heard_s > GONE_S or self._hub.has_gone(station.peer)

    def _send(self) -> None:
        for _step, system, frame in self._world.collect():
            station = self._stations.get(self._port_of[system - 1])
            if station is not None:
                self._hub.send(station.peer, frame)
