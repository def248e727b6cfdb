"""Links as a person names them, opened: connection strings, a signing key, and who may have the port already."""

from __future__ import annotations

import errno
import time
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from gcs.cards import under_way
from gcs.console import say
from gcs.live import Live
from wire.connection import Connection, ConnectionRefused, parse
from wire.signing import Signer, SigningKeyError, read_key

LISTENS, FLIES, STEPS_IN = "listens", "flies", "steps-in"
"""What a program does with a signed link: each has a link id and a memory of its own, so that none forges another."""
AGAIN_S = 0.1
GIVEN_BACK_S = 10.0
"""Whoever steps in waits so long for a port: `gcs vehicles`, or a flight that draws its picture, will give it back."""
_LINK_IDS = {FLIES: 0, STEPS_IN: 1, LISTENS: 2}


def understood(texts: Iterable[str]) -> list[Connection]:
    """The connections that strings stand for. Raises ConnectionRefused."""
    found = [connection for text in texts for connection in parse(text)]
    twice = next((connection for connection in found if found.count(connection) > 1), None)
    if twice is not None:
        raise ConnectionRefused(f"{twice}: named twice")
    return found


@contextmanager
def opened(
    connections: Iterable[Connection],
    ids: Collection[int] | None,
    *,
    purpose: str,
    speed: float = 1.0,
    signing_key: Path | None = None,
) -> Iterator[Live]:
    """The vehicles behind these connections, until the block ends.

    Raises ConnectionRefused and SigningKeyError.
    """
    wanted = list(connections)
    signer = _signer(signing_key, purpose)
    until_s = time.monotonic() + (GIVEN_BACK_S if purpose == STEPS_IN else 0.0)
    waits = False
    while True:
        try:
            live = Live(wanted, ids, speed=speed, signer=signer, namesakes=purpose == STEPS_IN)
            break
        except ConnectionRefused as error:
            if not _in_use(error):
                raise
            if time.monotonic() >= until_s:
                raise ConnectionRefused(f"{error}; {_who_has(wanted)}") from None
            if not waits:
                waits = True
                say(f"{error}; trying again for {GIVEN_BACK_S:g} s")
            time.sleep(AGAIN_S)
    try:
        yield live
    finally:
        live.close()
        if signer is not None:
            signer.save()
            if signer.trouble is not None:
                say(f"gcs: {signer.trouble}")


def refused(rejections: Mapping[str, int]) -> str | None:
    """What was not admitted and why, in words; None where nothing was refused."""
    told = ", ".join(f"{count} {reason}" for reason, count in sorted(rejections.items()) if count)
    return f"frames refused: {told}" if told else None


def _in_use(error: ConnectionRefused) -> bool:
    """Whether somebody else has the port, as the system said."""
    cause = error.__context__
    return isinstance(cause, OSError) and cause.errno in (errno.EADDRINUSE, errno.EBUSY, errno.EAGAIN)


def _who_has(connections: list[Connection]) -> str:
    flights = under_way(connections)
    if not flights:
        return "end what listens there"
    processes = " and ".join(str(flight.process) for flight in flights)
    return f"the flight of process {processes} has it; gcs land, hold, kill and take-back reach that one"


def _signer(path: Path | None, purpose: str) -> Signer | None:
    """Who only listens keeps no memory: it writes nothing. Who steps in does so without one, if it must."""
    if path is None:
        return None
    key, link = read_key(path), _LINK_IDS[purpose]
    memory = None if purpose == LISTENS else path.with_name(f"{path.name}.{purpose}")
    try:
        return Signer(key, memory=memory, link=link)
    except SigningKeyError as error:
        if purpose != STEPS_IN:
            raise
        say(f"gcs: {error}; going on without it, by this computer's clock")
        return Signer(key, link=link)
