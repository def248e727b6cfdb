"""Listening before flying: who is there, and whether anything on the link speaks against flying at all."""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np
import orjson

from gcs.autopilots import Fleet
from gcs.guard import DONE, NOT_DONE
from gcs.links import refused
from gcs.live import Live
from gcs.roster import listed
from gcs.telemetry import Swarm, observe
from scenarios import Scenario
from wire.modes import mode_name

FIRST_S, LISTEN_S = 2.5, 10.0
"""Two heartbeats of everybody, even if all have been heard before that; and the most."""


def listen(live: Live, scenario: Scenario, *, as_json: bool, say: Callable[[str], None]) -> int:
    """Say which of a scenario's vehicles are heard within LISTEN_S; nothing is sent. 0 if all are, else 3."""
    swarm = Swarm.of(range(1, scenario.swarm.count + 1))
    first_ns, until_ns = (live.now() + round(seconds * 1e9) for seconds in (FIRST_S, LISTEN_S))
    say(f"listening for {len(swarm.ids)} vehicles, sending nothing; --arm flies")
    while live.now() < until_ns and not (live.now() >= first_ns and (swarm.heartbeat_ns > 0).all()):
        live.sleep_until(live.now() + scenario.time.period_ns)
        swarm = observe(swarm, live.receive())
    heard = [system for row, system in enumerate(swarm.ids) if swarm.heartbeat_ns[row] > 0]
    missing = [system for system in swarm.ids if system not in heard]
    if as_json:
        sys.stdout.write(orjson.dumps({"heard": heard, "missing": missing}).decode() + "\n")
    else:
        sys.stdout.write(f"heard: {listed(heard) or 'none'}; missing: {listed(missing) or 'none'}\n")
    if missing and live.speaks_first:
        say("vehicles that wait to be spoken to stay silent: listening sends nothing")
    for words in (*_against(live, swarm), *([refused(live.rejections)] if missing else [])):
        if words is not None:
            say(words)
    return NOT_DONE if missing else DONE


def before_arming(live: Live, scenario: Scenario, *, say: Callable[[str], None]) -> tuple[str, ...]:
    """Listen for FIRST_S, and say why nobody may be armed on this link; empty where nothing speaks against it.

    Whoever waits to be spoken to hears our heartbeat, and nothing else.
    """
    swarm = Swarm.of(range(1, scenario.swarm.count + 1))
    for frames in live.hear(FIRST_S, step_ns=scenario.time.period_ns):
        swarm = observe(swarm, frames)
    refusals = _against(live, swarm)
    if not refusals:
        for station in live.stations:
            say(
                f"ground station {station.system}.{station.component} is heard from {station.address}: let it not steer"
            )
    return refusals


def _against(live: Live, swarm: Swarm) -> tuple[str, ...]:
    """Two of one name, and vehicles that somebody steers already."""
    fleet = Fleet(height_m=0.0, position_s=1.0)
    others = ", ".join(f"{one.system}.{one.component} at {one.address}" for one in live.stations)
    who = f"ground station {others}" if others else "another ground station"
    return (
        *(f"two vehicles call themselves {system}: give each an id of its own" for system in sorted(live.duplicates)),
        *(
            f"vehicle {swarm.ids[row]} already flies set-points "
            f"({mode_name(int(swarm.autopilot[row]), int(swarm.custom_mode[row]))}): {who} steers it; end that first"
            for row in np.flatnonzero(fleet.obeying(swarm))
        ),
    )
