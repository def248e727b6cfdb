"""The `fdm` command: parse, build, serve."""

from __future__ import annotations

import math
import signal
import sys
from typing import Annotated, Literal

from cyclopts import App, CycloptsError, Parameter


def _version() -> str:
    from importlib.metadata import version

    return version("trustr")


app = App(name="fdm", help="Fly a scenario's vehicles in JSBSim, each behind a MAVLink endpoint.", version=_version)


@app.command
def serve(
    scenario: str,
    /,
    *,
    to: str = "udpout:127.0.0.1:14550",
    ports: Literal["shared", "separate"] = "shared",
    speed: float = 1.0,
    seed: int = 1,
    set_: Annotated[tuple[str, ...], Parameter(name="--set", negative=(), show_default=False)] = (),
) -> int:
    """Serve the vehicles of a scenario over UDP until Ctrl-C.

    Parameters
    ----------
    scenario
        A scenario's name (see `gcs scenarios`), or the path of a TOML file.
    to
        Where the vehicles send: udpout:HOST:PORT; or where they wait to be spoken to: udpin:HOST:PORT.
    ports
        shared: all to that port. separate: vehicle i to PORT + i - 1.
    speed
        Simulated seconds a second.
    seed
        Of noise, gusts and turbulence.
    set_
        section.key=value, as often as you like: changes one key of the scenario.
    """
    from fdm.server import Server
    from fdm.world import World
    from scenarios import ScenarioError, load
    from wire.connection import ConnectionRefused, parse

    if not 0.0 < speed < math.inf:
        return _refuse(f"--speed {speed}: must be a number above 0")
    if seed < 0:
        return _refuse(f"--seed {seed}: must not be negative")
    try:
        loaded = load(scenario, overrides=set_)
        connections = parse(to)
        if len(connections) > 1:
            return _refuse(f"--to {to}: one port; with --ports separate the others follow it")
        last = connections[0].port + loaded.swarm.count - 1
        if ports == "separate" and last > 65535:
            return _refuse(f"--to {to}: {loaded.swarm.count} vehicles would need ports up to {last}, beyond 65535")
        server = Server(World(loaded, seed=seed), connections[0], ports=ports, speed=speed)
    except (ScenarioError, ConnectionRefused) as error:
        return _refuse(str(error))
    stopped = False

    def stop(_signal: int, _frame: object) -> None:
        nonlocal stopped
        stopped = True

    signal.signal(signal.SIGINT, stop)
    signal.signal(signal.SIGTERM, stop)
    where = f"send to {connections[0]}" if connections[0].kind == "udpout" else f"wait at {connections[0]}"
    _say(f"{loaded.swarm.count} vehicles {where} ({ports} ports, speed {speed:g}); Ctrl-C stops")
    warned = False
    while not stopped:
        server.turn()
        if server.behind_s > 1.0 and not warned:
            warned = True
            _say(f"this machine is too slow for --speed {speed:g}: the simulation lags {server.behind_s:.1f} s")
    server.close()
    _say("stopped")
    return 0


def _refuse(words: str) -> int:
    _say(f"fdm: {words}")
    return 2


def _say(words: str) -> None:
    sys.stderr.write(words + "\n")
    sys.stderr.flush()


def main() -> None:
    """Entry point."""
    try:
        code = app(sys.argv[1:], exit_on_error=False, print_error=False, result_action="return_value")
    except CycloptsError as error:
        code = _refuse(str(error))
    except KeyboardInterrupt:
        code = 130
    sys.exit(code)
