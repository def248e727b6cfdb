"""Listening only: who is there, until Ctrl-C or until everybody is heard."""

from __future__ import annotations

import sys
from collections.abc import Callable

import orjson

from gcs.live import Live
from gcs.telemetry import Swarm, observe
from scenarios import Scenario

LISTEN_S = 10.0


def listen(live: Live, scenario: Scenario, *, as_json: bool, say: Callable[[str], None]) -> int:
    """Say which of a scenario's vehicles are heard within LISTEN_S; nothing is sent. 0 if all are, else 3."""
    swarm = Swarm.of(range(1, scenario.swarm.count + 1))
    until_ns = live.now() + int(LISTEN_S * 1e9)
    say(f"listening for {len(swarm.ids)} vehicles, sending nothing; --arm flies")
    while live.now() < until_ns and not (swarm.heartbeat_ns > 0).all():
        live.sleep_until(live.now() + scenario.time.period_ns)
        swarm = observe(swarm, live.receive())
    heard = [system for row, system in enumerate(swarm.ids) if swarm.heartbeat_ns[row] > 0]
    missing = [system for system in swarm.ids if system not in heard]
    if as_json:
        sys.stdout.write(orjson.dumps({"heard": heard, "missing": missing}).decode() + "\n")
    else:
        sys.stdout.write(f"heard: {_ids(heard)}; missing: {_ids(missing)}\n")
    if missing and live.speaks_first:
        say("vehicles that wait to be spoken to stay silent: listening sends nothing")
    return 3 if missing else 0


def _ids(systems: list[int]) -> str:
    return ", ".join(map(str, systems)) or "none"
