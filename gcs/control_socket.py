"""A flight's own end of how other commands reach it: a Unix socket of this user's alone.

The flight has its ports, so nobody else can command its vehicles through them. One line of JSON is said, and one
answered at the next tick:

    {"word": "land"}                        {"tick": 412}
    {"word": "kill 3"}                      {"tick": 412}
    {"word": "status"}                      {"tick": 412, "phase": "landing", "vehicles": {"1": {"armed": true, ...}}}
"""

from __future__ import annotations

import os
import socket
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from types import TracebackType

import orjson

from gcs.cards import Card
from gcs.clients import CLIENTS, Conversation, Lines
from gcs.events import HOLD, LAND, killed, taken_back
from gcs.flight_state import Phase
from gcs.loop import Tick
from gcs.roster import listed
from gcs.standing import Standing
from wire.connection import Connection

STATUS = "status"
"""Asks how the flight stands."""


class ControlSocket:
    """Hands out what was said, and is a `Record` so that it can tell how the flight stands."""

    def __init__(self, connections: Iterable[Connection], ids: Sequence[int], say: Callable[[str], None]) -> None:
        """Where no socket can be had the flight goes on without one, and that is said."""
        self._ids = frozenset(ids)
        self._standing = Standing()
        self._lines: Lines[str] | None = None
        self._card: Card | None = None
        try:
            self._card = Card.new(connections)
            listener = _listening(self._card.socket)
            self._lines = Lines(listener, lambda: Conversation(self._understood, self._answer))
            self._card.lay()
        except OSError as error:
            say(f"gcs: `gcs land` will not reach this flight, Ctrl-C does: {error.strerror or error}")

    def __enter__(self) -> ControlSocket:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()

    def take(self) -> tuple[str, ...]:
        """Words of the operator that came since the last call; to be called once a tick, from tick 0 on."""
        if self._lines is None:
            return ()
        return tuple(word for word in self._lines.take() if word != STATUS)

    def tick(self, tick: Tick) -> None:
        """Remember how the flight stands. Its last tick is the last that can answer."""
        self._standing = Standing.at(tick)
        if tick.diagnosis.phase is Phase.DONE:
            self._end()

    def _end(self) -> None:
        if self._card is not None:
            self._card.remove()
        if self._lines is not None:
            self._lines.close({"over": True, **self._standing.told()})
        self._card = self._lines = None

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
            raise ValueError(f"vehicle {named} is not one of this flight, which has {listed(sorted(self._ids))}")
        if named is None and word not in (LAND, HOLD, STATUS):
            raise ValueError(f'{word!r}: allowed are "land", "hold", "kill ID", "take back ID" and "status"')
        if word == HOLD and self._standing.phase == Phase.LAND.value:
            raise ValueError("the flight is landing, and goes on landing: hold comes too late")
        return word

    def _answer(self, word: str, tick: int) -> dict[str, object]:
        return {"tick": tick, **self._standing.told()} if word == STATUS else {"tick": tick}


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
