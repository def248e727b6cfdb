"""A world behind UDP, in real time or a multiple of it."""

from __future__ import annotations

import selectors
from dataclasses import replace
from typing import Literal

from fdm.world import World
from wire.clock import WallClock
from wire.connection import Address, Connection, ConnectionRefused
from wire.frames import Framer, target_system
from wire.ports import UdpPort

CATCH_UP_S = 0.25
"""Simulated seconds at one go, at most, when physics has fallen behind."""
PATIENCE_S = 0.5
"""Real seconds to wait at one go, at most: whoever stops a slow world must not wait for its next message."""


class Server:
    """Vehicles speak to one address each, or all to one; whoever answers from there is listened to.

    shared: all vehicles send from one socket to the connection's port. separate: vehicle i sends from a socket of its
    own to that port + i − 1. On udpin they are silent until somebody speaks to them.
    """

    def __init__(self, world: World, to: Connection, *, ports: Literal["shared", "separate"], speed: float) -> None:
        self._world = world
        self._clock = WallClock(speed=speed)
        self._start_ns = self._clock.now()
        self._framer = Framer()
        self._selector = selectors.DefaultSelector()
        self._peers: dict[UdpPort, Address] = {}
        count = len(world.endpoints)
        if ports == "shared":
            shared = UdpPort(to)
            self._port_of = [shared] * count
        else:
            self._port_of = []
            for place in range(count):
                try:
                    self._port_of.append(UdpPort(replace(to, port=to.port + place)))
                except ConnectionRefused:
                    self.close()
                    raise
        for port in dict.fromkeys(self._port_of):
            self._selector.register(port, selectors.EVENT_READ)
        self.behind_s = 0.0
        """Simulated seconds by which physics lags the clock."""

    def turn(self) -> None:
        """Wait for a datagram or for something to be due, let physics catch up, deliver, send."""
        due_ns = self._start_ns + self._world.next_event_step * 1_000_000_000 // self._world.physics_hz
        ready = self._selector.select(min(PATIENCE_S, self._clock.seconds_until(due_ns)))
        self._step_to_now()
        for key, _ in ready:
            port: UdpPort = key.fileobj  # type: ignore[assignment]
            self._deliver(port)
        self._send()

    def close(self) -> None:
        """Give the ports back."""
        self._selector.close()
        for port in dict.fromkeys(self._port_of):
            port.close()

    def _step_to_now(self) -> None:
        hz = self._world.physics_hz
        wanted = (self._clock.now() - self._start_ns) * hz // 1_000_000_000
        steps = min(wanted - self._world.steps, round(CATCH_UP_S * hz))
        if steps > 0:
            self._world.step(steps)
        self.behind_s = (wanted - self._world.steps) / hz

    def _deliver(self, port: UdpPort) -> None:
        for datagram, sender in port.receive():
            self._peers[port] = sender
            for frame in self._framer.frames(0, datagram):
                target = target_system(frame)
                for endpoint, own_port in zip(self._world.endpoints, self._port_of, strict=True):
                    if own_port is port and target in (0, endpoint.system):
                        endpoint.receive(frame.raw)

    def _send(self) -> None:
        for _step, system, frame in self._world.collect():
            port = self._port_of[system - 1]
            peer = self._peers.get(port)
            if peer is not None or port.connection.kind == "udpout":
                port.send(frame, peer)
