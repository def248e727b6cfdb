"""20 000 datagrams a second from strangers, three times five seconds, while vehicles fly: nobody notices."""

import re
import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from flights import SOAK, Saying, start
from test_live import HOST, free_port, vehicles

from gcs.events import LAND
from gcs.flight_state import Phase
from gcs.live import Live
from gcs.session import flown
from scenarios import load
from wire.connection import Connection
from wire.ids import AUTOPILOT
from wire.payloads import LOCAL_POSITION_NED

RATE, SECONDS = 20_000, 5.0
FLOODS = 3
"""One after the other: a hundredth of fifty ticks would be none."""
RATES = (RATE, RATE // 2) if SOAK else (RATE,)
"""Datagrams a second: to the ground station, and under soak to the vehicles too."""
BEFORE_S = 1.0
"""Of quiet, from which the vehicles' clocks are known."""
QUICK = ("swarm.altitude_m=2", "time.positions_per_tick=5")

pytestmark = [pytest.mark.wall_clock, pytest.mark.alone]


class Watch:
    """A link that notes when it was last sent through, and what became of each tick.

    It opens the flood when set-points flow, and has the flight landed after it.
    """

    def __init__(self, live, port):
        self._live, self._port = live, port
        self._boot_ns = {}
        self._began_ns = None
        self._sent_ns = 0
        self._floods = []
        self.late_s, self.ages_s, self.said = [], [], []

    def receive(self):
        return self._live.receive()

    def send(self, system, frame):
        self._live.send(system, frame)
        self._sent_ns = self._live.now()

    @property
    def rejected(self):
        return self._live.rejected

    def tick(self, tick):
        if tick.state.phase is Phase.TAKE_CONTROL and self._began_ns is None:
            self._began_ns = tick.time_ns
        running = [flood.poll() is None for flood in self._floods]
        if not running:
            self._learn_clocks(tick)
            if self._began_ns is not None and tick.time_ns - self._began_ns > BEFORE_S * 1e9:
                self._open()
        elif all(running):
            self.late_s.append((self._sent_ns - tick.time_ns + tick.lateness_ns) / 1e9)
            clocks = zip(tick.swarm.ids, tick.swarm.boot_ms, strict=True)
            measured_ns = [self._boot_ns[system] + ms * 10**6 for system, ms in clocks]
            self.ages_s.append((tick.time_ns - np.array(measured_ns)) / 1e9)
        elif not any(running) and len(self.said) < FLOODS:
            self.said.append([flood.communicate()[0] for flood in self._floods])
            if len(self.said) < FLOODS:
                self._open()

    def _learn_clocks(self, tick):
        for frame in tick.frames:
            if frame.message == LOCAL_POSITION_NED and frame.component == AUTOPILOT:
                booted = frame.time_ns - int.from_bytes(frame.payload[:4], "little") * 1_000_000
                self._boot_ns[frame.system] = min(booted, self._boot_ns.get(frame.system, booted))

    def events(self):
        return (LAND,) if len(self.said) == FLOODS else ()

    def _open(self):
        ports = ([self._port], {peer.address[1] for peer in self._live._hub.known})
        self._floods = [self._flood(rate, *to) for rate, to in zip(RATES, ports, strict=False)]

    def _flood(self, rate, *ports):
        return start(sys.executable, Path(__file__).with_name("flood.py"), rate, SECONDS, *ports)


@pytest.fixture(scope="module")
def flooded(tmp_path_factory):
    """(what was watched, the link's counts of refused frames, the summary) of a flight in real time."""
    port, scenario = free_port(), load("transit", overrides=QUICK)
    with (
        vehicles("transit", port, "--set", QUICK[0], speed=1),
        closing(Live([Connection("udpin", HOST, port)], range(1, 7))) as live,
    ):
        watch = Watch(live, port)
        summary = flown(
            "transit",
            scenario,
            watch,
            live,
            seed=None,
            out=tmp_path_factory.mktemp("flood"),
            operator=Saying(watch.events),
            watching=lambda _flight: (watch,),
            say=lambda _words: None,
        )
        return watch, live.rejections, summary


def test_the_floods_were_such(flooded):
    watch, rejections, _ = flooded
    assert len(watch.said) == FLOODS
    for said in watch.said:
        for words, rate in zip(said, RATES, strict=True):
            count, took_s = map(float, re.findall(r"[\d.]+", words))
            assert count == rate * SECONDS
            assert took_s < SECONDS + 0.5
    assert rejections["wrong address"] > 100
    assert len(watch.late_s) > 40 * FLOODS


def test_set_points_leave_within_ten_milliseconds_of_their_deadline(flooded):
    watch, *_ = flooded
    assert np.quantile(watch.late_s, 0.99) <= 0.010


def test_telemetry_is_no_older_than_sixty_milliseconds(flooded):
    watch, *_ = flooded
    assert np.max(watch.ages_s) <= 0.060


def test_nothing_that_was_forged_is_believed_and_the_flight_ends_as_it_should(flooded):
    _, _, summary = flooded
    assert summary.problem is None
    assert summary.completed
