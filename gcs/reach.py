"""How other commands reach a flight that is under way: a Unix socket of this user's alone.

The flight has its ports, so nobody else can command its vehicles through them. It therefore listens on a socket in the
user's runtime directory; beside it lies a card that says which process it is and which links it has, so that it can be
named even if it does not answer. One line of JSON is said, and one answered at the next tick:

    {"word": "land"}                        {"tick": 412}
    {"word": "kill 3"}                      {"tick": 412}
    {"word": "status"}                      {"tick": 412, "phase": "landing", "vehicles": {"1": {"armed": true, ...}}}
"""

from __future__ import annotations

import math
import os
import re
import socket
import stat
import tempfile
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import orjson

from gcs.clients import CLIENTS, Conversation, Lines
from gcs.events import HOLD, LAND, killed, taken_back
from gcs.loop import Tick
from gcs.telemetry import NEVER
from wire.connection import Connection
from wire.modes import mode_name

STATUS = "status"
"""Asks what the flight is about."""
ANSWERS_WITHIN_S = 1.0
"""Ten ticks: a flight that takes longer hangs."""
_ANYWHERE = ("", "0.0.0.0")


class ControlSocket:
    """The flight's end: hands out what was said, and is a `Record` so that it can tell how the flight stands."""

    def __init__(self, connections: Iterable[Connection], ids: Sequence[int], say: Callable[[str], None]) -> None:
        """Where no socket can be had the flight goes on without one, and that is said."""
        self._ids = frozenset(ids)
        self._standing: dict[str, object] = {"phase": "not begun", "vehicles": {}}
        self._lines: Lines[str] | None = None
        self._card = self._path = None
        try:
            folder = _folder()
            self._path, self._card = folder / f"{os.getpid()}.sock", folder / f"{os.getpid()}.json"
            self._path.unlink(missing_ok=True)
            listener = _listening(self._path)
            card = {"process": os.getpid(), "links": [str(link) for link in connections]}
            self._card.write_bytes(orjson.dumps(card))
        except OSError as error:
            say(f"gcs: `gcs land` will not reach this flight, Ctrl-C does: {error.strerror or error}")
        else:
            self._lines = Lines(listener, lambda: Conversation(self._understood, self._answer))

    def __enter__(self) -> ControlSocket:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for path in (self._card, self._path):
            if path is not None:
                with suppress(OSError):
                    path.unlink(missing_ok=True)
        if self._lines is not None:
            self._lines.close({"over": True, **self._standing})

    def take(self) -> tuple[str, ...]:
        """Words of the operator that came since the last call; to be called once a tick, from tick 0 on."""
        if self._lines is None:
            return ()
        return tuple(word for word in self._lines.take() if word != STATUS)

    def tick(self, tick: Tick) -> None:
        """Remember how the flight stands."""
        self._standing = {"phase": tick.diagnosis.phase.value, "vehicles": _vehicles(tick)}

    def _understood(self, line: bytes) -> str:
        try:
            told = orjson.loads(line)
        except orjson.JSONDecodeError:
            told = None
        word = told.get("word") if isinstance(told, dict) else None
        if word is None:
            raise ValueError('must read like {"word": "land"}')
        word = str(word)
        named = killed(word) or taken_back(word)
        if named is not None and named not in self._ids:
            raise ValueError(f"vehicle {named} is not one of this flight, which has {_listed(sorted(self._ids))}")
        if named is None and word not in (LAND, HOLD, STATUS):
            raise ValueError(f'{word!r}: allowed are "land", "hold", "kill ID", "take back ID" and "status"')
        return word

    def _answer(self, word: str, tick: int) -> dict[str, object]:
        return {"tick": tick, **self._standing} if word == STATUS else {"tick": tick}


@dataclass(frozen=True, slots=True)
class Flying:
    """A flight of this user's that is under way."""

    process: int
    links: tuple[str, ...]
    path: Path


def flying(connections: Iterable[Connection]) -> Flying | None:
    """The flight that has one of these links; None where there is none."""
    wanted = list(connections)
    try:
        cards = sorted(_folder().glob("*.json"))
    except OSError:
        return None
    for card in cards:
        flight = _read(card)
        if flight is not None and any(_same(link, str(mine)) for link in flight.links for mine in wanted):
            return flight
    return None


class Unanswered(Exception):
    """The flight says nothing in time; in a sentence that says what to do."""


class Refused(ValueError):
    """The flight does not take this word, in its own sentence."""


class Ended(Exception):
    """The flight is over."""


class Call:
    """A conversation with a flight, from the other end."""

    def __init__(self, flight: Flying) -> None:
        """Raises Unanswered where nobody listens."""
        self._flight = flight
        self._rest = b""
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.settimeout(ANSWERS_WITHIN_S)
        try:
            self._socket.connect(str(flight.path))
        except OSError:
            self._socket.close()
            raise self._unanswered() from None

    def __enter__(self) -> Call:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._socket.close()

    def ask(self, word: str) -> dict[str, Any]:
        """What is answered; its last words, with "over", where it ends.

        Raises Unanswered, Ended and Refused.
        """
        try:
            with suppress(BrokenPipeError, ConnectionResetError):  # it has ended, and may have said so
                self._socket.sendall(orjson.dumps({"word": word}, option=orjson.OPT_APPEND_NEWLINE))
            while b"\n" not in self._rest:
                more = self._socket.recv(1 << 16)
                if not more:
                    raise Ended
                self._rest += more
        except TimeoutError:
            raise self._unanswered() from None
        except OSError:
            raise Ended from None
        line, _, self._rest = self._rest.partition(b"\n")
        answer: dict[str, Any] = orjson.loads(line)
        if "error" in answer:
            raise Refused(answer["error"])
        return answer

    def _unanswered(self) -> Unanswered:
        process = self._flight.process
        return Unanswered(
            f"the flight of process {process} has {', '.join(self._flight.links)} and did not answer within "
            f"{ANSWERS_WITHIN_S:g} s. If it hangs, its vehicles get no set-points and do what their failsafe "
            f"parameters say. `kill -9 {process}` ends it and frees the link; then give this command again"
        )


def _vehicles(tick: Tick) -> dict[str, dict[str, object]]:
    swarm, released = tick.swarm, tick.state.released
    return {
        str(system): {
            "heard": bool(swarm.heartbeat_ns[row] != NEVER),
            "armed": bool(swarm.armed[row]),
            "mode": mode_name(int(swarm.autopilot[row]), int(swarm.custom_mode[row])),
            "height_m": _number(-swarm.position_ned[row, 2]),
            "speed_m_s": _number(float(np.linalg.norm(swarm.velocity_ned[row]))),
            "released": bool(released[row]),
        }
        for row, system in enumerate(swarm.ids)
    }


def _number(value: float) -> float | None:
    return None if math.isnan(value) else round(float(value), 2)


def _listening(path: Path) -> socket.socket:
    """Mode 0600 from its first moment. Raises OSError."""
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    before = os.umask(0o177)
    try:
        listener.bind(str(path))
        listener.listen(CLIENTS)
    except OSError:
        listener.close()
        raise
    finally:
        os.umask(before)
    return listener


def _folder() -> Path:
    """A directory that only this user can enter, made where it is missing. Raises OSError."""
    runtime = os.environ.get("XDG_RUNTIME_DIR")
    root = Path(runtime) if runtime and Path(runtime).is_dir() else Path(tempfile.gettempdir())
    folder = root / f"trustr-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o077:
        raise PermissionError(f"{folder} is not a directory of this user alone")
    return folder


def _read(card: Path) -> Flying | None:
    """What a card says; it is thrown away where its process has gone."""
    try:
        told = orjson.loads(card.read_bytes())
        flight = Flying(int(told["process"]), tuple(told["links"]), card.with_suffix(".sock"))
        os.kill(flight.process, 0)
    except ProcessLookupError:
        for path in (card, card.with_suffix(".sock")):
            with suppress(OSError):
                path.unlink(missing_ok=True)
        return None
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return flight


def _same(one: str, other: str) -> bool:
    """Whether two links are one port: of those that bind, whatever address they bind to."""
    if one == other:
        return True
    places = [re.fullmatch(r"(udpin|tcpin):(.*):(\d+)", link) for link in (one, other)]
    if places[0] is None or places[1] is None:
        return False
    (kind, host, port), (its_kind, its_host, its_port) = places[0].groups(), places[1].groups()
    return (kind, port) == (its_kind, its_port) and (host in _ANYWHERE or its_host in _ANYWHERE)


def _listed(systems: Iterable[int]) -> str:
    return ", ".join(map(str, systems))
