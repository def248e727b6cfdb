"""What vehicles tell people: how they took a command, and texts, which may come in pieces."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as dialect

_COMMANDS: Mapping[int, str] = MappingProxyType(
    {
        dialect.MAV_CMD_COMPONENT_ARM_DISARM: "arming or disarming",
        dialect.MAV_CMD_NAV_TAKEOFF: "taking off",
        dialect.MAV_CMD_NAV_LAND: "landing",
        dialect.MAV_CMD_DO_SET_MODE: "changing mode",
        dialect.MAV_CMD_SET_MESSAGE_INTERVAL: "sending a message regularly",
        dialect.MAV_CMD_REQUEST_MESSAGE: "sending a message once",
    }
)
_ABOUT_MESSAGES = (dialect.MAV_CMD_SET_MESSAGE_INTERVAL, dialect.MAV_CMD_REQUEST_MESSAGE)
_RESULTS: Mapping[int, str] = MappingProxyType(
    {
        dialect.MAV_RESULT_ACCEPTED: "accepted",
        dialect.MAV_RESULT_TEMPORARILY_REJECTED: "rejected for now",
        dialect.MAV_RESULT_DENIED: "denied",
        dialect.MAV_RESULT_UNSUPPORTED: "not supported",
        dialect.MAV_RESULT_FAILED: "failed",
        dialect.MAV_RESULT_IN_PROGRESS: "in progress",
    }
)


class Answer(NamedTuple):
    """A COMMAND_ACK."""

    system: int
    command: int
    """MAV_CMD."""
    result: int
    """MAV_RESULT."""

    @property
    def refused(self) -> bool:
        """Neither done nor being done. A message that a vehicle does not have is nothing to worry about."""
        agreed = self.result in (dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_IN_PROGRESS)
        return not agreed and self.command not in _ABOUT_MESSAGES

    @property
    def words(self) -> str:
        """For the display."""
        what = _COMMANDS.get(self.command, f"command {self.command}")
        return f"vehicle {self.system}: {what} {_RESULTS.get(self.result, f'answered with {self.result}')}"


CHUNK, MOST_CHUNKS = 50, 8
"""Bytes that one STATUSTEXT holds, and how many of them make the longest text that we wait for."""
LOST = "…"
"""Stands where a piece of a text never came."""
UNPRINTABLE = "�"
"""Stands where something was no letter: the begin of a command to a terminal, or a new line."""


class Piece(NamedTuple):
    """The begin of a text of which more is to come."""

    text_id: int
    severity: int
    chunks: int
    """That have come."""
    text: str


def joined(
    begun: Piece | None, severity: int, text: str, text_id: int, chunk: int
) -> tuple[list[tuple[int, str]], Piece | None]:
    """The texts [(severity, text)] that are complete with this STATUSTEXT, and the one that has begun.

    begun: what the same vehicle has begun;  text_id: 0 for a text in one piece;  chunk: counts from 0;
    text: a letter a byte.
    A text is complete with the first chunk that is not full; https://mavlink.io/en/messages/common.html#STATUSTEXT
    What cannot be printed is not handed on: a terminal would do what it says.
    """
    full = len(text) >= CHUNK
    text = "".join(letter if letter.isprintable() else UNPRINTABLE for letter in text)
    if text_id == 0:
        return [(severity, text)], begun
    done = []
    if begun is not None and (begun.text_id, begun.chunks) == (text_id, chunk):
        text = begun.text + text
    else:
        if begun is not None:
            done.append((begun.severity, begun.text + LOST))
        if chunk > 0:
            text = LOST + text
    if full and chunk + 1 < MOST_CHUNKS:
        return done, Piece(text_id, severity, chunk + 1, text)
    return [*done, (severity, text)], None
