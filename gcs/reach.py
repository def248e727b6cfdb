"""The other end of how a command reaches a flight under way: call it, say a word, and watch what comes of it."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType
from typing import Any

import orjson

from gcs.cards import Card
from gcs.console import say
from gcs.control_socket import STATUS
from gcs.standing import Standing

ANSWERS_WITHIN_S = 1.0
"""Ten ticks: a flight that takes longer hangs."""
POLL_S = 0.2
TELL_S = 5.0
"""Between two words on how far it is."""


class Unanswered(Exception):
    """The flight says nothing in time; in a sentence that says what to do."""


class Refused(ValueError):
    """The flight does not take this word, in its own sentence."""


class Ended(Exception):
    """The flight is over."""

    def __init__(self, standing: Standing | None = None) -> None:
        super().__init__("the flight is over")
        self.standing = standing
        """Its last words, where it had any."""


class Call:
    """A conversation with a flight."""

    def __init__(self, flight: Card) -> None:
        """Raises Ended where nobody listens any more, and Unanswered where nobody takes the call."""
        self.flight = flight
        self._rest = b""
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.settimeout(ANSWERS_WITHIN_S)
        try:
            self._socket.connect(str(flight.socket))
        except OSError as error:
            self._socket.close()
            gone = isinstance(error, ConnectionRefusedError | FileNotFoundError)
            raise Ended if gone else self._unanswered() from None

    def __enter__(self) -> Call:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._socket.close()

    def tell(self, word: str) -> None:
        """Have the flight take a word. Raises Unanswered, Refused and Ended."""
        tick = self._ask(word).get("tick")
        say(f"the flight of process {self.flight.process} takes {word!r} at tick {tick}")

    def standing(self) -> Standing:
        """How the flight stands. Raises Unanswered, Refused and Ended."""
        return self._understood(self._ask(STATUS))

    def watch(self, done: Callable[[Standing], bool], *, patience_s: float) -> bool:
        """Until it is done; False where patience ended first. Raises Unanswered, and Ended where the flight did."""
        began = told = time.monotonic()
        while (now := time.monotonic()) - began < patience_s:
            time.sleep(POLL_S)
            try:
                standing = self.standing()
            except Ended as end:
                if end.standing is not None and done(end.standing):
                    return True
                raise
            if done(standing):
                return True
            if now - told >= TELL_S:
                told = now
                say(f"{standing.phase}: {', '.join(f'{system} ({one})' for system, one in standing.armed.items())}")
        return False

    def _ask(self, word: str) -> dict[str, Any]:
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
        if "over" in answer:
            raise Ended(self._understood(answer))
        return answer

    def _understood(self, answer: dict[str, Any]) -> Standing:
        try:
            return Standing.read(answer)
        except ValueError as error:
            raise Refused(f"the flight of process {self.flight.process} is of another version: {error}") from None

    def _unanswered(self) -> Unanswered:
        process, links = self.flight.process, ", ".join(map(str, self.flight.links))
        return Unanswered(
            f"the flight of process {process} has {links} and did not answer within "
            f"{ANSWERS_WITHIN_S:g} s. If it hangs, its vehicles get no set-points and do what their failsafe "
            f"parameters say. `kill -9 {process}` ends it and frees the link; then give this command again"
        )
