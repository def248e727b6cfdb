"""A flight under way without a flight: vehicles that do as told, and the socket by which they are."""

import threading
import time
from contextlib import contextmanager
from types import SimpleNamespace

from gcs.cards import under_way
from gcs.control_socket import ControlSocket
from gcs.events import killed, taken_back
from gcs.flight_state import Phase
from gcs.telemetry import Swarm
from wire.connection import parse
from wire.modes import PX4, PX4_MODES

LINK = "udpin:0.0.0.0:14999"


class Fleet:
    """Three vehicles in the air as a flight tells of them, which do what they are told two ticks later."""

    def __init__(self):
        self.swarm = Swarm.of((1, 2, 3))
        self.swarm.heartbeat_ns[:] = 1
        self.swarm.autopilot[:] = PX4
        self.swarm.armed[:] = True
        self.swarm.position_ned[:] = 0.0, 0.0, -9.75
        self.released = self.swarm.armed & False
        self.phase = Phase.MISSION
        self.mode("offboard")

    def mode(self, name):
        self.swarm.custom_mode[~self.released] = PX4_MODES[name].custom_mode

    def obey(self, word):
        if word == "land":
            self.phase = Phase.LAND
            self.swarm.armed[~self.released] = False
        elif word == "hold":
            self.phase = Phase.HOLD
            self.mode("hold")
        elif killed(word):
            self.swarm.armed[killed(word) - 1] = False
        else:
            self.released[taken_back(word) - 1] = False
            self.mode("offboard")

    def tick(self):
        return SimpleNamespace(
            swarm=self.swarm,
            state=SimpleNamespace(released=self.released),
            diagnosis=SimpleNamespace(phase=self.phase),
        )


@contextmanager
def flying(fleet=None, *, link=LINK, ends_after=None):
    """A flight that turns a hundred times a second: the words it was told. ends_after: ticks after its first word."""
    fleet, words, over = fleet or Fleet(), [], threading.Event()

    def turn():
        with ControlSocket(parse(link), (1, 2, 3), say=str) as control:
            due = []
            while not over.is_set():
                control.tick(fleet.tick())
                heard = control.take()
                words.extend(heard)
                due.append(heard)
                for word in due[-3] if len(due) > 2 else ():
                    fleet.obey(word)
                if ends_after is not None and words and sum(map(bool, due)) and len(due) - first(due) > ends_after:
                    control.tick(fleet.tick())
                    return
                time.sleep(0.01)

    thread = threading.Thread(target=turn)
    thread.start()
    until(lambda: under_way(parse(link)))
    try:
        yield words
    finally:
        over.set()
        thread.join()


def first(due):
    return next(place for place, words in enumerate(due) if words)


def until(true, *, within_s=5.0):
    deadline = time.monotonic() + within_s
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.005)
