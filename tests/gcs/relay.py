"""Stands between vehicles and a ground station, each a process of its own, and keeps what passes to the vehicles."""

import select
import socket
import threading
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field

from wire.frames import Frame, Framer
from wire.payloads import SET_POSITION_TARGET_LOCAL_NED

HOST = "127.0.0.1"
QUIET_S = 0.2
"""After which nothing more comes of a process that is gone."""


@dataclass
class Relay:
    """Two ports: `vehicles`, to which they speak, and another that speaks to the ground station in their stead."""

    vehicles: int
    passed: list[Frame] = field(default_factory=list)
    """Every frame that the vehicles were handed."""
    setpoint: threading.Event = field(default_factory=threading.Event)
    """Set-points flow."""
    stop: threading.Event = field(default_factory=threading.Event)

    def run(self, front, back):
        """Until it is told to stop, and nothing comes any more."""
        framer, fleet = Framer(), None
        while True:
            ready, _, _ = select.select([front, back], [], [], QUIET_S)
            if self.stop.is_set() and back not in ready:
                return
            if front in ready:
                datagram, fleet = front.recvfrom(2048)
                try:
                    back.send(datagram)
                except ConnectionRefusedError:  # nobody is there yet, or any more
                    continue
            if back in ready:
                try:
                    datagram = back.recv(2048)
                except ConnectionRefusedError:
                    continue
                frames = framer.frames(0, datagram)
                self.passed += frames
                front.sendto(datagram, fleet)
                if any(frame.message == SET_POSITION_TARGET_LOCAL_NED for frame in frames):
                    self.setpoint.set()


@contextmanager
def relay(ground):
    """A relay to the ground station at this port; what came to it until the block ends has passed when it has."""
    with ExitStack() as stack:
        front, back = (stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(2))
        front.bind((HOST, 0))
        back.connect((HOST, ground))
        for end in (front, back):
            end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        between = Relay(front.getsockname()[1])
        thread = threading.Thread(target=between.run, args=(front, back))
        thread.start()
        try:
            yield between
        finally:
            between.stop.set()
            thread.join()
