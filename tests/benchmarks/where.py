"""Where the flight loop's CPU goes: a statistical sample of its stack, which slows nothing down."""

from __future__ import annotations

import signal
from collections import Counter
from collections.abc import Callable
from types import FrameType

PARTS = (
    ("_run", "physics"),
    ("Endpoint.receive", "vehicles: take in set-points"),
    ("Endpoint.step", "vehicles: fly by modes, report"),
    ("World.step", "vehicles: fly by modes, report"),
    ("McapFile.flush", "recording: finish chunks"),
    ("McapFile.add", "recording: add messages"),
    ("OwnTopics.of", "recording: our topics"),
    ("Viewers.of", "recording: viewers' topics"),
    ("Recorder.tick", "recording: JSON, frames, the rest"),
    ("Framer.frames", "ground: cut and check frames"),
    ("observe", "ground: fold telemetry"),
    ("decide", "ground: control law"),
    ("admit", "ground: gate"),
    ("Encoder.encode", "ground: encode set-points"),
    ("Flight.__call__", "ground: flight, mission"),
    ("Tracker.tick", "ground: truth, track"),
    ("Truth.tick", "ground: truth, track"),
)
"""Function → part; the innermost function of a stack that is named here counts."""


def sample(work: Callable[[], object]) -> Counter[str]:
    """Samples of each part while `work` runs."""
    names, counted = dict(PARTS), Counter[str]()

    def look(_signal: int, frame: FrameType | None) -> None:
        while frame is not None:
            name = frame.f_code.co_qualname
            part = names.get(name) or names.get(name.rpartition(".")[2])
            if part is not None:
                counted[part] += 1
                return
            frame = frame.f_back
        counted["the rest"] += 1

    before = signal.signal(signal.SIGPROF, look)
    signal.setitimer(signal.ITIMER_PROF, 0.001, 0.001)
    try:
        work()
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
    return counted
