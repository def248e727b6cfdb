"""Other programs that say something while a flight goes on: lines in, what they mean and answers out; nobody waits.

Once a tick the flight takes what has come. What a client may have in memory is bounded both ways: of one that sends
more than it may, or does not read its answers, no more is read until there is room.
"""

from __future__ import annotations

import re
import socket
from collections.abc import Callable
from contextlib import suppress
from typing import Generic, TypeVar

import orjson

CLIENTS = 16
"""At one time."""
LINE, BUFFER = 1024, 4096
"""Bytes: the longest line, and what of one client may wait for its turn."""
LINES_A_TICK = 8
"""Of one client; the others wait for the next tick."""
HTTP = re.compile(rb"[A-Z]+ (/|http)")

Said = TypeVar("Said")


def at_tick(_said: object, tick: int) -> dict[str, object]:
    """The usual answer: the tick at which it counts."""
    return {"tick": tick}


class Conversation(Generic[Said]):
    """What one client says and is answered."""

    def __init__(
        self, understand: Callable[[bytes], Said], answer: Callable[[Said, int], dict[str, object]] = at_tick
    ) -> None:
        """understand: what a line says, or ValueError with the sentence to refuse it;  answer: said, tick → answer."""
        self._understand = understand
        self._reply = answer
        self._incoming = b""
        self._answers = b""
        self._skipping = False
        self._ended = False

    @property
    def room(self) -> int:
        """How many bytes may be received now."""
        return 0 if self._ended else BUFFER - len(self._incoming)

    @property
    def over(self) -> bool:
        """Nothing more will come, and nothing is left to be said."""
        return self._ended and not self._incoming and not self._answers

    def receive(self, data: bytes) -> None:
        """What has come."""
        if self._skipping:
            _, end, data = data.partition(b"\n")
            self._skipping = not end
        self._incoming += data

    def end(self) -> None:
        """Nothing more will come; a last line may have no end."""
        self._ended = True

    def step(self, tick: int) -> list[Said]:
        """What was said that counts at this tick; answers it, and what was not understood. Rests while answers wait."""
        heard = list[Said]()
        if self._answers:
            return heard
        for _ in range(LINES_A_TICK):
            line = self._next_line()
            if line is None:
                break
            if not line.strip():
                continue
            try:
                said = self._understood(line)
            except ValueError as error:
                self.say({"error": str(error)})
            else:
                heard.append(said)
                self.say(self._reply(said, tick))
        return heard

    def say(self, answer: dict[str, object]) -> None:
        """One line more to be sent."""
        self._answers += orjson.dumps(answer, option=orjson.OPT_APPEND_NEWLINE)

    def data_to_send(self) -> bytes:
        """Answers that wait."""
        return self._answers

    def sent(self, count: int) -> None:
        """So many bytes of them are on their way."""
        self._answers = self._answers[count:]

    def _next_line(self) -> bytes | None:
        line, end, rest = self._incoming.partition(b"\n")
        if not end and len(line) > LINE:
            self._skipping = True
        elif not end and not self._ended:
            return None
        self._incoming = rest
        return line if line or end else None

    def _understood(self, line: bytes) -> Said:
        if HTTP.match(line):  # a browser that some web page sent here: what follows no person has said
            self._incoming, self._ended = b"", True
            raise ValueError("this is no web server: one line for one thing said, and nothing else")
        if len(line) > LINE:
            raise ValueError(f"this line is too long: at most {LINE} bytes")
        return self._understand(line)


class Lines(Generic[Said]):
    """Everybody who talks to one listening socket."""

    def __init__(self, listener: socket.socket, begin: Callable[[], Conversation[Said]]) -> None:
        """listener: bound and listening; closed by `close`."""
        self._listener = listener
        self._listener.setblocking(False)
        self._begin = begin
        self._tick = 0
        self._clients: list[tuple[socket.socket, Conversation[Said]]] = []

    def take(self) -> tuple[Said, ...]:
        """What was said since the last call. To be called once a tick, from tick 0 on: the calls are counted."""
        tick, self._tick = self._tick, self._tick + 1
        self._accept()
        heard = [said for client, talk in self._clients for said in _exchange(client, talk, tick)]
        for client, talk in self._clients:
            if talk.over:
                client.close()
        self._clients = [(client, talk) for client, talk in self._clients if not talk.over]
        return tuple(heard)

    def close(self, last: dict[str, object] | None = None) -> None:
        """Hang up, with a last word for everybody if there is one."""
        self._listener.close()
        for client, talk in self._clients:
            if last is not None:
                talk.say(last)
                _send(client, talk)
            client.close()
        self._clients = []

    def _accept(self) -> None:
        for _ in range(CLIENTS):
            try:
                client, _address = self._listener.accept()
            except OSError:  # nobody is there, or has gone again
                return
            client.setblocking(False)
            if len(self._clients) < CLIENTS:
                self._clients.append((client, self._begin()))
                continue
            with suppress(OSError), client:
                client.send(orjson.dumps({"error": f"{CLIENTS} are here already"}, option=orjson.OPT_APPEND_NEWLINE))


def _exchange(client: socket.socket, talk: Conversation[Said], tick: int) -> list[Said]:
    """Read, understand and answer as much as goes without waiting."""
    _send(client, talk)
    if talk.room:
        try:
            data = client.recv(talk.room)
        except BlockingIOError:
            pass
        except OSError:  # gone; what was said before still counts
            talk.end()
        else:
            talk.receive(data)
            if not data:
                talk.end()
    heard = talk.step(tick)
    _send(client, talk)
    return heard


def _send(client: socket.socket, talk: Conversation[Said]) -> None:
    data = talk.data_to_send()
    if not data:
        return
    try:
        talk.sent(client.send(data))
    except BlockingIOError:
        pass
    except OSError:  # nobody listens any more
        talk.sent(len(data))
        talk.end()
