"""What the messages of a topic are, and the topics of one MCAP file, each defined when its first message comes."""

from __future__ import annotations

import re
from functools import cache
from typing import NamedTuple

from gcs.recording.mcap_file import McapFile

RAW = "mavlink"
"""Encoding of the topics of raw frames."""


class Channel(NamedTuple):
    """What a topic's messages are, in whichever file they are written."""

    topic: str
    encoding: str
    schema_name: str = ""
    """Empty where the encoding speaks for itself."""
    schema_encoding: str = ""
    schema: bytes = b""


class Message(NamedTuple):
    """One message, wherever it is to be written."""

    channel: Channel
    time_ns: int
    """Since 1970."""
    data: bytes


def raw_topic(system: int | str, component: int | str) -> str:
    """Of a sender's raw frames."""
    return f"/mavlink/{system}_{component}/raw"


def raw_sender(topic: str) -> tuple[int, int] | None:
    """System and component whose raw frames a topic has; None of any other topic."""
    match = _RAW_TOPIC.fullmatch(topic)
    return None if match is None else (int(match[1]), int(match[2]))


_RAW_TOPIC = re.compile(raw_topic(r"(\d+)", r"(\d+)"))


@cache
def raw_channel(system: int, component: int) -> Channel:
    """Of a sender's raw frames."""
    return Channel(raw_topic(system, component), RAW)


class Channels:
    """Those of one file; schemas and channels that are alike are one."""

    def __init__(self, file: McapFile) -> None:
        self._file = file
        self._schemas: dict[tuple[str, str, bytes], int] = {}
        self._channels: dict[Channel, int] = {}

    def __len__(self) -> int:
        """How many there are."""
        return len(self._channels)

    def number(self, channel: Channel) -> int:
        """Its id in the file, where it is defined if it was not."""
        number = self._channels.get(channel)
        return self._define(channel) if number is None else number

    def add(self, channel: Channel, time_ns: int, data: bytes) -> None:
        """One message. Raises OSError where it fills the chunk, and the disk is full."""
        self._file.add(self.number(channel), time_ns, data)

    def _define(self, channel: Channel) -> int:
        schema = 0
        if channel.schema_name:
            key = channel.schema_name, channel.schema_encoding, channel.schema
            if key not in self._schemas:
                self._schemas[key] = self._file.schema(*key)
            schema = self._schemas[key]
        number = self._channels[channel] = self._file.channel(channel.topic, channel.encoding, schema)
        return number
