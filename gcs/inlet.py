"""Ratings while flying: TCP on this machine only, one rating a line, each answered with the tick at which it counts."""

from __future__ import annotations

import socket
from functools import partial
from types import TracebackType

from gcs.clients import CLIENTS, Conversation, Lines
from gcs.events import Rating
from gcs.ratings import RatingsError, parse

HOST = "127.0.0.1"


class Inlet:
    """The port that live ratings come in by."""

    def __init__(self, port: int, *, count: int) -> None:
        """port: 0 takes a free one;  count: of the swarm. Raises RatingsError."""
        listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((HOST, port))
            listener.listen(CLIENTS)
        except OSError as error:
            listener.close()
            raise RatingsError(f"--ratings-port {port}: {error.strerror or error}") from None
        self.port: int = listener.getsockname()[1]
        """Where it listens."""
        self._lines = Lines(listener, partial(Conversation[Rating], partial(parse, count=count, live=True)))

    def __enter__(self) -> Inlet:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._lines.close()

    def take(self) -> tuple[Rating, ...]:
        """Ratings that came since the last call. To be called once a tick, from tick 0 on: the calls are counted."""
        return self._lines.take()
