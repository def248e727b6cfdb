"""The `fdm` command: parse, build, serve."""

from __future__ import annotations

import math
import re
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import App, CycloptsError, Parameter

if TYPE_CHECKING:
    from fdm.server import Server
    from wire.connection import Connection
    from wire.signing import Signer


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
    autopilot: Literal["px4", "ardupilot"] = "px4",
    stock_failsafes: Annotated[bool, Parameter(negative=())] = False,
    signing_key: Path | None = None,
    no_fault: Annotated[bool, Parameter(negative=())] = False,
    speed: float = 1.0,
    seed: int = 1,
    set_: Annotated[tuple[str, ...], Parameter(name="--set", negative=(), show_default=False)] = (),
) -> int:
    """Serve the vehicles of a scenario until Ctrl-C, over UDP, TCP or a serial line.

    Parameters
    ----------
    scenario
        A scenario's name (see `gcs scenarios`), or the path of a TOML file.
    to
        Where the vehicles send: udpout:HOST:PORT, tcp:HOST:PORT, serial:DEVICE:SPEED; or where they wait to be
        spoken to: udpin:HOST:PORT, tcpin:HOST:PORT.
    ports
        shared: all to that port. separate: vehicle i to PORT + i - 1.
    autopilot
        What the vehicles are taken for: its modes, messages, parameters and failsafes.
    stock_failsafes
        With the autopilot's own failsafe parameters. With ours a vehicle stops 0.5 s after its last set-point. A px4
        lands 5 s later; an ardupilot hovers on for as long as it hears heartbeats of its ground station (system 255),
        and lands 5 s after the last. Neither misses a ground station that it never heard.
    signing_key
        A file with the key, 64 hex digits or a passphrase: what the vehicles say is signed, and they obey nothing
        that is not.
    no_fault
        Everything healthy, whatever the scenario says.
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
    from wire.signing import SigningKeyError

    if not 0.0 < speed < math.inf:
        return _refuse(f"--speed {speed}: must be a number above 0")
    if seed < 0:
        return _refuse(f"--seed {seed}: must not be negative")
    with _told_to_stop() as stopped:
        try:
            loaded = load(scenario, overrides=set_)
            connections = parse(to)
            if len(connections) > 1:
                return _refuse(f"--to {to}: one port; with --ports separate the others follow it")
            trouble = _no_room(connections[0], ports, loaded.swarm.count)
            if trouble:
                return _refuse(f"--to {to}: {trouble}")
            world = World(
                loaded.without_faults() if no_fault else loaded,
                seed=seed,
                autopilot=autopilot,
                stock_failsafes=stock_failsafes,
            )
            signer = _signer(signing_key, connections[0])
            server = Server(world, connections[0], ports=ports, speed=speed, signer=signer)
        except (ScenarioError, ConnectionRefused, SigningKeyError) as error:
            return _refuse(str(error))
        try:
            _say(
                f"{_who_does_what(loaded.swarm.count, connections[0])} ({autopilot}, {ports} ports, speed {speed:g}); "
                "Ctrl-C stops"
            )
            _fly(server, signer, speed, stopped)
        finally:
            server.close()
            if signer is not None:
                signer.save()
                _warn(None, signer.trouble)
    _say("stopped")
    return 0


@contextmanager
def _told_to_stop() -> Iterator[Callable[[], bool]]:
    """Whether Ctrl-C or SIGTERM came since the block began: they are noted, and interrupt nothing."""
    came: list[int] = []
    before = {number: signal.signal(number, lambda *_: came.append(1)) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: bool(came)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _fly(server: Server, signer: Signer | None, speed: float, stopped: Callable[[], bool]) -> None:
    """Until told to stop; what goes wrong meanwhile is said when it begins."""
    slow, trouble = False, None
    while not stopped():
        server.turn()
        if server.behind_s > 1.0 and not slow:
            slow = True
            _say(f"this machine is too slow for --speed {speed:g}: the simulation lags {server.behind_s:.1f} s")
        if signer is not None:
            trouble = _warn(trouble, signer.trouble)


def _warn(before: str | None, now: str | None) -> str | None:
    """Say what is wrong now, unless something was before."""
    if now is not None and before is None:
        _say(now)
    return now


def _no_room(to: Connection, ports: str, count: int) -> str:
    """Why vehicles cannot have a port each; empty where they can, or need not."""
    if ports == "shared":
        return ""
    if to.kind == "serial":
        return "a serial line is one; all vehicles share it"
    last = to.port + count - 1
    return f"{count} vehicles would need ports up to {last}, beyond 65535" if last > 65535 else ""


def _signer(key: Path | None, to: Connection) -> Signer | None:
    """Its memory lies beside the key, one for each link: what was said before a restart cannot be said again."""
    from wire.signing import Signer, read_key

    if key is None:
        return None
    place = re.sub(r"[^\w.]+", "-", str(to))
    return Signer(read_key(key), memory=key.with_name(f"{key.name}.vehicles-{place}"))


def _who_does_what(count: int, to: Connection) -> str:
    verb, place = ("wait", "at") if to.kind in ("udpin", "tcpin") else ("send", "to")
    return f"1 vehicle {verb}s {place} {to}" if count == 1 else f"{count} vehicles {verb} {place} {to}"


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
