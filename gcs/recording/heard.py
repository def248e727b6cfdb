"""The messages of a recording, sorted by topic and tick, and as arrays over its ticks.

T ticks, N vehicles; NaN where nothing was told.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import orjson

from gcs.messages import HEARTBEAT, STATUSTEXT
from gcs.recording import said
from gcs.recording.channels import RAW
from gcs.recording.happenings import Kind
from gcs.recording.reader import Message
from gcs.telemetry import Swarm, observe
from wire.frames import MAGIC_1, Framer

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Told = dict[int, dict[str, Any]]
"""Tick → what a topic told at it."""

ARRAYS = frozenset(
    ("position_m", "velocity_m_s", "age_s", "attitude_rad", "asked", "sent", "verdict", "commanded", "trust", "weights")
)
"""Keys of our topics whose values are numbers for each vehicle."""
AS_THEY_HAPPEN = ("/ratings", "/roles", "/truth/fault")
TICK_BY_TICK = ("/tick", "/mission", "/trust", "/weights", "/setpoint", "/swarm/state", "/uav/", "/truth/pose", "/link")
TELLING = tuple(number.to_bytes(3, "little") for number in (HEARTBEAT, STATUSTEXT))
"""The messages, as they stand in a frame, that tell what no topic of ours does."""


@dataclass(frozen=True, slots=True, eq=False)
class Links:
    """How vehicles were heard over the flight, where the link told: L moments."""

    time_ns: Integers
    """(L,)"""
    received: Integers
    """(L, N) frames since the vehicle was first heard."""
    lost: Integers
    """(L, N)"""

    @staticmethod
    def of(told: Told, times: Mapping[int, int]) -> Links | None:
        """Of /link. times: tick → when it was told [ns]"""
        if not told:
            return None
        ticks = sorted(told)
        received, lost = (
            np.array([told[tick][key] for tick in ticks]).astype(np.int64) for key in ("received", "lost")
        )
        return Links(np.array([times[tick] for tick in ticks], np.int64), received, lost)


@dataclass(frozen=True, slots=True, eq=False)
class Heard:
    """A recording's messages, sorted."""

    topics: Mapping[str, Told]
    """Topic → tick → what it told; numbers for each vehicle are arrays by now."""
    times: Mapping[int, int]
    """Tick → when it was decided [ns]."""
    link_times: Mapping[int, int]
    """Tick → when /link was told [ns]."""
    events: Mapping[str, Sequence[dict[str, Any]]]
    """Topic → what it told, in order."""
    spoken: Sequence[tuple[int, int, str]]
    """(tick that took it in, system id, what its autopilot said)."""
    log: Sequence[tuple[int, Kind, int | None, str]]
    """(time [ns], what it is about, system id if any, sentence) of /log, in order; empty in older recordings."""
    autopilot: Integers
    """(N,) MAV_AUTOPILOT of the heartbeats; 0 where none came."""

    @staticmethod
    def of(messages: Iterable[Message], vehicles: int) -> Heard:
        """All messages of a recording, in its order."""
        topics, events = defaultdict[str, Told](dict), defaultdict[str, list[dict[str, Any]]](list)
        times, link_times, spoken = dict[int, int](), dict[int, int](), list[tuple[int, int, str]]()
        words = list[tuple[int, str]]()
        log = list[tuple[int, Kind, int | None, str]]()
        framer, swarm = Framer(), Swarm.of(range(1, vehicles + 1))
        for topic, encoding, time_ns, data in messages:
            if encoding == RAW:
                if data[7:10] in TELLING or data[0] == MAGIC_1:
                    swarm = observe(swarm, framer.frames(time_ns, data))
                    words += ((system, text) for system, _severity, text in swarm.words)
            elif topic == "/log":
                log.append((time_ns, *said.read(data)))
            elif topic in AS_THEY_HAPPEN:
                events[topic].append(orjson.loads(data))
            elif encoding == "json" and topic.startswith(TICK_BY_TICK):
                told = orjson.loads(data)
                number = told["number" if topic == "/tick" else "tick"]
                topics[topic][number] = {key: _numbers(told[key]) if key in ARRAYS else told[key] for key in told}
                if topic == "/tick":
                    times[number] = time_ns
                    spoken += ((number, system, text) for system, text in words)
                    words.clear()
                elif topic == "/link":
                    link_times[number] = time_ns
        return Heard(topics, times, link_times, events, spoken, log, swarm.autopilot)


def _numbers(value: Any) -> Array | None:
    """null is NaN within, and nothing as a whole."""
    return None if value is None else np.array(value, dtype=np.float64)


def column(told: Told, key: str, number: Integers, *shape: int) -> Array:
    """(T, *shape) what a topic told at the ticks of these numbers."""
    values = np.full((len(number), *shape), np.nan)
    for row, tick in enumerate(number.tolist()):
        content = told.get(tick)
        if content is not None and content[key] is not None:
            values[row] = content[key]
    return values


def held(told: Sequence[Told], key: str, number: Integers, *shape: int) -> Array:
    """(T, N, *shape) what each vehicle's topic told last, at the ticks of these numbers."""
    values = np.full((len(number), len(told), *shape), np.nan)
    for vehicle, states in enumerate(told):
        for tick, content in sorted(states.items()):
            values[np.searchsorted(number, tick) :, vehicle] = content[key]
    return values
