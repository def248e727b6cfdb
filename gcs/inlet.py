"""Ratings while flying: TCP on this machine only, one rating a line, each answered with the tick at which it counts.

Nothing here waits: once a tick the flight takes what has come. What a client may have in memory is bounded both ways:
of one that sends more than it may, or does not read its answers, no more is read until there is room.
"""

from __future__ import annotations

import re
import socket
from contextlib import suppress
from types import TracebackType

import orjson

from gcs.events import Rating
from gcs.ratings import RatingsError, parse

HOST = "127.0.0.1"
CLIENTS = 16
"""At one time."""
LINE, BUFFER = 1024, 4096
"""Bytes: the longest line, and what of one client may wait for its turn."""
LINES_A_TICK = 8
"""Of one client; the others wait for the next tick."""
HTTP = re.compile(rb"[A-Z]+ (/|http)")


class Conversation:
    """What one client says and is answered: bytes in, ratings and bytes out."""

    def __init__(self, *, count: int) -> None:
        self._count = count
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

    def step(self, tick: int) -> list[Rating]:
        """Ratings that count at this tick; answers them, and what is no rating. Rests while answers wait."""
        ratings = list[Rating]()
        if self._answers:
            return ratings
        for _ in range(LINES_A_TICK):
            line = self._next_line()
            if line is None:
                break
            if not line.strip():
                continue
            try:
                ratings.append(self._understood(line))
            except RatingsError as error:
                self._answer({"error": str(error)})
            else:
                self._answer({"tick": tick})
        return ratings

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

    def _understood(self, line: bytes) -> Rating:
        if HTTP.match(line):  # a browser that some web page sent here: what follows is not a person's rating
            self._incoming, self._ended = b"", True
            raise RatingsError("this is no web server: one rating a line, and nothing else")
        if len(line) > LINE:
            raise RatingsError(f"this line is too long: at most {LINE} bytes make a rating")
        return parse(line, count=self._count, live=True)

    def _answer(self, answer: dict[str, object]) -> None:
        self._answers += orjson.dumps(answer, option=orjson.OPT_APPEND_NEWLINE)


class Inlet:
    """The port that live ratings come in by."""

    def __init__(self, port: int, *, count: int) -> None:
        """port: 0 takes a free one;  count: of the swarm. Raises RatingsError."""
        self._count = count
        self._tick = 0
        self._clients: list[tuple[socket.socket, Conversation]] = []
        self._listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self._listener.setblocking(False)
        try:
            self._listener.bind((HOST, port))
            self._listener.listen(CLIENTS)
        except OSError as error:
            self._listener.close()
            raise RatingsError(f"--ratings-port {port}: {error.strerror or error}") from None

    def __enter__(self) -> Inlet:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._listener.close()
        for client, _ in self._clients:
            client.close()

    @property
    def port(self) -> int:
        """Where it listens."""
        return int(self._listener.getsockname()[1])

    def take(self) -> tuple[Rating, ...]:
        """Ratings that came since the last call. To be called once a tick, from tick 0 on: the calls are counted."""
        tick, self._tick = self._tick, self._tick + 1
        self._accept()
        ratings = [rating for client, talk in self._clients for rating in _exchange(client, talk, tick)]
        for client, talk in self._clients:
            if talk.over:
                client.close()
        self._clients = [(client, talk) for client, talk in self._clients if not talk.over]
        return tuple(ratings)

    def _accept(self) -> None:
        for _ in range(CLIENTS):
            try:
                client, _address = self._listener.accept()
            except OSError:  # nobody is there, or has gone again
                return
            client.setblocking(False)
            if len(self._clients) < CLIENTS:
                self._clients.append((client, Conversation(count=self._count)))
                continue
            with suppress(OSError), client:
                client.send(orjson.dumps({"error": f"{CLIENTS} are here already"}, option=orjson.OPT_APPEND_NEWLINE))


def _exchange(client: socket.socket, talk: Conversation, tick: int) -> list[Rating]:
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
    ratings = talk.step(tick)
    _send(client, talk)
    return ratings


def _send(client: socket.socket, talk: Conversation) -> None:
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
