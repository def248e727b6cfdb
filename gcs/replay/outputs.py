"""Where a replay goes besides the screen: each output is handed the recorded messages when they are due."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol


class Played(NamedTuple):
    """One message as it was recorded."""

    time_ns: int
    """When it was logged, since 1970."""
    topic: str
    encoding: str
    """Of the data: mavlink, json, protobuf."""
    schema_name: str
    """"" where the topic has no schema."""
    schema_encoding: str
    schema_data: bytes
    data: bytes


class Output(Protocol):
    """Somebody who is to see the flight again; no method waits."""

    def put(self, messages: Sequence[Played]) -> None:
        """These are due now, in this order: backwards where the flight is played backwards."""
        ...

    def jumped(self, time_ns: int) -> None:
        """The flight goes on from here; what lies between is left out."""
        ...

    def close(self) -> None:
        """Nothing more will come."""
        ...
