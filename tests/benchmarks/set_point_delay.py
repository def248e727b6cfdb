"""How much later set-points leave because a live flight is recorded: `python -m tests.benchmarks.set_point_delay`.

Six vehicles over UDP in real time, served by another process, flown in turn with recording and journal and without.
Of every tick that sends set-points: when the last of them left, after the tick's deadline; and how long the recording
itself was at work in between. Not part of `make bench`: it takes minutes of wall time.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack, closing
from pathlib import Path

import numpy as np

from gcs.flight import Flight
from gcs.live import Live
from gcs.loop import Link, Tick, fly
from gcs.recording.files import journal
from gcs.recording.journal import Journal, Journaled
from gcs.recording.reader import RECORDING
from gcs.recording.writer import PROMPTLY_NS, Recorder, Tap
from gcs.truth import Truth
from scenarios import Scenario, load
from wire.connection import Connection
from wire.frames import Frame

REPEATS = 3
HOST, PORT = "127.0.0.1", 14691


class Timed:
    """A link that tells how long it was at work, and when it last sent."""

    def __init__(self, link: Link, now: Callable[[], int]) -> None:
        self._link, self._now = link, now
        self.busy_ns = 0
        self.sent_ns = 0

    def receive(self) -> list[Frame]:
        """As the link does."""
        start = time.perf_counter_ns()
        frames = self._link.receive()
        self.busy_ns += time.perf_counter_ns() - start
        return frames

    def send(self, system: int, frame: bytes) -> None:
        """As the link does."""
        start = time.perf_counter_ns()
        self._link.send(system, frame)
        self.busy_ns += time.perf_counter_ns() - start
        self.sent_ns = self._now()

    @property
    def rejected(self) -> int:
        """As the link says."""
        return self._link.rejected


class Delays:
    """A `Record` of each tick with set-points. All in ms."""

    def __init__(self, outside: Timed, inside: Timed) -> None:
        """outside, inside: of all that records, on the way of a frame."""
        self._outside, self._inside = outside, inside
        self._before_ns = 0
        self.left: list[float] = []
        """Deadline until the last set-point has left."""
        self.recording: list[float] = []
        """Of that, at work for the recording."""

    def tick(self, tick: Tick) -> None:
        """Keep one."""
        busy_ns = self._outside.busy_ns - self._inside.busy_ns
        if tick.diagnosis.commanded is not None and tick.diagnosis.commanded.any():
            self.left.append((self._inside.sent_ns - tick.time_ns + tick.lateness_ns) / 1e6)
            self.recording.append((busy_ns - self._before_ns) / 1e6)
        self._before_ns = busy_ns


def flown(scenario: Scenario, *, recorded: bool) -> Delays:
    """One flight, as `gcs fly` flies it."""
    words = ["serve", "emergency", "--to", f"udpout:{HOST}:{PORT}"]
    decide = Flight(scenario)
    truth = Truth(decide.ids)
    with ExitStack() as stack:
        live = stack.enter_context(closing(Live([Connection("udpin", HOST, PORT)], decide.ids)))
        inside = Timed(live, live.now)
        link: Link = inside
        records: list[Truth | Recorder | Delays] = [truth]
        if recorded:
            path = Path(stack.enter_context(tempfile.TemporaryDirectory())) / RECORDING
            log = stack.enter_context(Journal(journal(path), print))
            recorder = Recorder(path, scenario, truth, start_ns=live.now(), metadata={}, flush_ns=PROMPTLY_NS)
            records.append(stack.enter_context(recorder))
            live.tell(log.arrived)
            link = Tap(Journaled(inside, live, log), live, recorder)
        outside = Timed(link, live.now)
        delays = Delays(outside, inside)
        served = subprocess.Popen([sys.executable, "-m", "fdm", *words], stderr=subprocess.DEVNULL)
        stack.callback(served.wait)
        stack.callback(served.terminate)
        state = fly(outside, live, decide, [*records, delays], period_ns=scenario.time.period_ns)
    if state.problem is not None:
        raise SystemExit(state.problem)
    return delays


def main() -> None:
    """Print a table."""
    scenario = load("emergency")
    flights: dict[bool, list[Delays]] = {True: [], False: []}
    for _ in range(REPEATS):
        for recorded, done in flights.items():
            done.append(flown(scenario, recorded=recorded))
    print(f"`emergency` over UDP in real time, {REPEATS} flights each way; ms")
    print("                                                        p50    p99    max   ticks")
    for words, recorded, name in (
        ("deadline until the last set-point left, unrecorded", False, "left"),
        ("the same, recorded and journalled", True, "left"),
        ("of that, at work for the recording", True, "recording"),
    ):
        values = np.concatenate([getattr(delays, name) for delays in flights[recorded]])
        p50, p99 = np.percentile(values, (50, 99))
        print(f"  {words:50s}  {p50:5.2f}  {p99:5.2f}  {values.max():5.2f}   {len(values):5d}")


if __name__ == "__main__":
    main()
