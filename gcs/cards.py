"""Which flights of this user's are under way: beside each one's socket lies a card that says which links it has.

They lie in one folder whatever a shell's environment: who lands a flight need not have begun it in the same shell. A
card is believed as long as somebody listens on its socket; what a dead flight left behind is thrown away.
"""

from __future__ import annotations

import os
import secrets
import socket
import stat
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import orjson

from wire.connection import Connection, ConnectionRefused, parse

FOLDER = Path("/tmp") / f"trustr-{os.getuid()}"
_ANYWHERE = "0.0.0.0"
_BINDING = ("udpin", "tcpin")


@dataclass(frozen=True, slots=True)
class Card:
    """What a flight says of itself without being asked."""

    process: int
    links: tuple[Connection, ...]
    """As `resolved` has them."""
    path: Path

    @staticmethod
    def new(connections: Iterable[Connection]) -> Card:
        """For a flight of this process. Raises OSError where no card can be laid."""
        _make(FOLDER)
        path = FOLDER / f"{os.getpid()}-{secrets.token_hex(3)}.json"
        return Card(os.getpid(), tuple(map(resolved, connections)), path)

    @staticmethod
    def read(path: Path) -> Card:
        """Raises OSError, and ValueError where it makes no sense."""
        told = orjson.loads(path.read_bytes())
        match told:
            case {"process": int(process), "links": [*texts]} if all(isinstance(text, str) for text in texts):
                try:
                    return Card(process, tuple(link for text in texts for link in parse(text)), path)
                except ConnectionRefused as error:
                    raise ValueError(str(error)) from None
        raise ValueError(f"{path} is no card")

    @property
    def socket(self) -> Path:
        """Where the flight listens."""
        return self.path.with_suffix(".sock")

    def lay(self) -> None:
        """To be done when somebody listens. Raises OSError."""
        self.path.write_bytes(orjson.dumps({"process": self.process, "links": [str(link) for link in self.links]}))

    def remove(self) -> None:
        """With the socket."""
        for path in (self.path, self.socket):
            with suppress(OSError):
                path.unlink(missing_ok=True)

    def has(self, link: Connection) -> bool:
        """Whether a link is one of this flight's, however it is written."""
        return any(_same(mine, resolved(link)) for mine in self.links)


def under_way(connections: Iterable[Connection]) -> tuple[Card, ...]:
    """Cards of the flights that have any of these links."""
    wanted, found = list(connections), list[Card]()
    try:
        _make(FOLDER)
        paths = sorted(FOLDER.glob("*.json"))
    except OSError:
        return ()
    for path in paths:
        try:
            card = Card.read(path)
        except (OSError, ValueError):
            continue
        if not _listened_to(card.socket):
            card.remove()
        elif any(map(card.has, wanted)):
            found.append(card)
    return tuple(found)


def resolved(link: Connection) -> Connection:
    """A link as the system knows it: its device without aliases, an address where it has a host's name."""
    if link.kind == "serial":
        return replace(link, device=str(Path(link.device).resolve()))
    with suppress(OSError, UnicodeError):
        return replace(link, host=socket.gethostbyname(link.host))
    return link


def _same(one: Connection, other: Connection) -> bool:
    """Whether two links are one port: of those that bind, whatever address they bind to; of a device, at any speed."""
    if (one.kind, one.port, one.device) != (other.kind, other.port, other.device):
        return False
    return one.host == other.host or (one.kind in _BINDING and _ANYWHERE in (one.host, other.host))


def _make(folder: Path) -> None:
    """A directory that only this user can enter, made where it is missing. Raises OSError."""
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o077:
        raise PermissionError(f"{folder} is not a directory of this user alone")


def _listened_to(path: Path) -> bool:
    """A flight that hangs is; one that has gone is not, whoever has its process id now."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        probe.setblocking(False)
        try:
            probe.connect(str(path))
        except (ConnectionRefusedError, FileNotFoundError):
            return False
        except OSError:  # nobody takes calls, but they may still be made
            return True
    return True
