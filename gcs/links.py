"""Links as a person names them, opened: connection strings, a signing key, and who may have the port already."""

from __future__ import annotations

import time
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from gcs.live import Live
from gcs.reach import flying
from wire.connection import Connection, ConnectionRefused, parse
from wire.signing import Signer, read_key

LISTENS, FLIES, STEPS_IN = "listens", "flies", "steps-in"
"""What a program does with a signed link: each has a link id and a memory of its own, so that none forges another."""
AGAIN_S = 0.1
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
    patience_s: float = 0.0,
) -> Iterator[Live]:
    """The vehicles behind these connections, until the block ends.

    patience_s: to wait for a port that somebody else is about to give back.
    Raises ConnectionRefused and SigningKeyError.
    """
    wanted = list(connections)
    signer = _signer(signing_key, purpose)
    until_s = time.monotonic() + patience_s
    while True:
        try:
            live = Live(wanted, ids, speed=speed, signer=signer)
        except ConnectionRefused as error:
            if time.monotonic() < until_s:
                time.sleep(AGAIN_S)
                continue
            flight = flying(wanted)
            if flight is None:
                raise
            hint = f"the flight of process {flight.process} has it; gcs land, hold, kill and take-back reach that one"
            raise ConnectionRefused(f"{error}; {hint}") from None
        break
    try:
        yield live
    finally:
        live.close()
        if signer is not None:
            signer.save()


def refused(rejections: Mapping[str, int]) -> str | None:
    """What was not admitted and why, in words; None where nothing was refused."""
    told = ", ".join(f"{count} {reason}" for reason, count in sorted(rejections.items()) if count)
    return f"frames refused: {told}" if told else None


def _signer(path: Path | None, purpose: str) -> Signer | None:
    """Who only listens keeps no memory: it writes nothing."""
    if path is None:
        return None
    memory = None if purpose == LISTENS else path.with_name(f"{path.name}.{purpose}")
    return Signer(read_key(path), memory=memory, link=_LINK_IDS[purpose])
