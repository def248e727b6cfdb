"""What a serial link carries: positions are asked for as often as fits, and what does not fit is refused in numbers.

A telemetry radio is half-duplex: both directions share its speed, which is summed here, in bytes of our own frames at
their full length. What an autopilot streams unasked is not counted: it must be turned off there (docs/hardware.md).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs import messages
from gcs.autopilots.protocol import SLOW_S
from scenarios import Scenario
from wire.connection import Connection
from wire.frames import CRC, HEADER_2, SIGNATURE
from wire.payloads import SET_POSITION_TARGET_LOCAL_NED

POSITIONS_AT_MOST = 5
"""A tick: real links deliver at any moment of it; asked once, a flight ended 0.5 m from its lockstep twin."""
BITS_A_BYTE = 10
"""8N1: a start bit, eight, a stop bit."""
RESERVE = 0.1
"""Of the link, for commands, their answers, words, and what is sent again."""
BEAT_S, OUR_BEAT_S = 1.0, 0.5
"""Between two heartbeats of a vehicle, and two of ours."""
USUAL_SPEEDS = (57_600, 115_200, 230_400, 460_800, 921_600, 1_500_000, 3_000_000)
"""Bits a second that radios and autopilots can be set to."""
LONGEST_PERIOD_S = 0.4
"""What a scenario may say: vehicles lose patience after 0.5 s."""

Links = tuple[Connection, ...]


class LinkTooSlow(ValueError):
    """A link that cannot carry what the scenario needs, in one sentence with the arithmetic."""


@dataclass(frozen=True, slots=True)
class _Load:
    """Bytes a second of one vehicle, both ways."""

    setpoint: int
    """Bytes of one set-point."""
    position: int
    """Bytes of one LOCAL_POSITION_NED."""
    slow: float
    """Bytes a second of heartbeats and slow streams."""

    def each(self, period_s: float, positions: int) -> float:
        """A set-point and so many positions a tick, and the slow rest."""
        return (self.setpoint + positions * self.position) / period_s + self.slow


def positions_per_tick(connections: Iterable[Connection], scenario: Scenario, *, signed: bool) -> int:
    """How often in a tick vehicles are to tell where they are: 5 to 1, as every serial link allows.

    Where the scenario says how often, it is that or nothing. Who is behind which link is not known yet: they are taken
    to be shared evenly where every link is serial; beside a network, which may as well be unused, each serial link must
    carry them all. Raises LinkTooSlow.
    """
    links = tuple(connections)
    told = scenario.time.positions_per_tick
    wanted = range(POSITIONS_AT_MOST, 0, -1) if told is None else (told,)
    load = _load(signed=signed)
    for positions in wanted:
        if _fit(links, scenario.swarm.count, load.each(scenario.time.period_s, positions)):
            return positions
    raise LinkTooSlow(_sentence(links, scenario, load, wanted[-1], signed=signed))


def _fit(links: Links, vehicles: int, each: float) -> bool:
    """Whether every serial link carries those who may be behind it; each: bytes a second of one vehicle."""
    serial = [link for link in links if link.bits_per_s is not None]
    return all(_behind(links, vehicles) * each <= _carries(link) for link in serial)


def _behind(links: Links, vehicles: int) -> int:
    """How many may be behind a serial link."""
    return math.ceil(vehicles / len(links)) if all(link.bits_per_s is not None for link in links) else vehicles


def _load(*, signed: bool) -> _Load:
    beats = _frame(messages.HEARTBEAT, signed=signed) * (1 / BEAT_S + 1 / OUR_BEAT_S)
    slow = sum(_frame(message, signed=signed) / interval_s for message, interval_s in SLOW_S)
    return _Load(
        setpoint=_frame(SET_POSITION_TARGET_LOCAL_NED, signed=signed),
        position=_frame(messages.LOCAL_POSITION_NED, signed=signed),
        slow=beats + slow,
    )


def _frame(message: int, *, signed: bool) -> int:
    """Bytes of a frame of this message whose payload ends in no zeros."""
    payload: int = dialect.mavlink_map[message].unpacker.size
    return HEADER_2 + payload + CRC + SIGNATURE * signed


def _carries(link: Connection) -> float:
    """Bytes a second that may be planned with."""
    assert link.bits_per_s is not None
    return link.bits_per_s / BITS_A_BYTE * (1 - RESERVE)


def _sentence(links: Links, scenario: Scenario, load: _Load, positions: int, *, signed: bool) -> str:
    link = min((link for link in links if link.bits_per_s is not None), key=_carries)
    vehicles, period_s = _behind(links, scenario.swarm.count), scenario.time.period_s
    each = load.each(period_s, positions)
    hz, raw = 1 / period_s, (link.bits_per_s or 0) / BITS_A_BYTE
    return (
        f"{link}: {vehicles} vehicles at {hz:g} Hz{', signed,' if signed else ''} need {vehicles} × {each:.0f} = "
        f"{vehicles * each:.0f} bytes/s both ways (each {hz:g} set-points of {load.setpoint}, {positions * hz:g} "
        f"positions of {load.position} and {load.slow:.0f} of heartbeats and slow streams), and "
        f"{link.bits_per_s} / {BITS_A_BYTE} = {raw:g} less {RESERVE:.0%} in reserve is {_carries(link):.0f}; "
        f"what would fit: {', or '.join(_remedies(links, scenario, load, positions))}"
    )


def _remedies(links: Links, scenario: Scenario, load: _Load, positions: int) -> list[str]:
    """What would have to be otherwise, each alone and tried."""
    vehicles, time = scenario.swarm.count, scenario.time
    each = load.each(time.period_s, positions)
    remedies = []
    if fewer := next((count for count in range(vehicles, 0, -1) if _fit(links, count, each)), 0):
        remedies.append(f"{fewer} vehicle{'s' if fewer > 1 else ''}")
    longer = range(time.steps_per_tick + 1, math.floor(LONGEST_PERIOD_S * time.physics_hz) + 1)
    for period_s in (steps / time.physics_hz for steps in longer):
        if _fit(links, vehicles, load.each(period_s, positions)):
            remedies.append(f"time.period_s = {period_s}")
            break
    for rarer in range(positions - 1, 0, -1):
        if _fit(links, vehicles, load.each(time.period_s, rarer)):
            remedies.append(f"time.positions_per_tick = {rarer}")
            break
    everywhere = " on every serial link" if sum(link.bits_per_s is not None for link in links) > 1 else ""
    for speed in USUAL_SPEEDS:
        if _fit(tuple(_at_least(speed, link) for link in links), vehicles, each):
            return [*remedies, f"{speed} bits/s{everywhere}"]
    return [*remedies, f"a network instead of {'serial links' if everywhere else 'a serial link'}"]


def _at_least(speed: int, link: Connection) -> Connection:
    return link if link.bits_per_s is None else replace(link, bits_per_s=max(speed, link.bits_per_s))
