"""When each topic of a recording has messages, and where there are none: read from the MCAP's indexes alone."""

from __future__ import annotations

import struct
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt
from mcap.opcode import Opcode

Times = npt.NDArray[np.int64]

GAP_NS = 1_500_000_000
"""Whoever flies beats once a second at least."""

_RECORD = struct.Struct("<BQ")
"""Opcode and length. Page: https://mcap.dev/spec#records"""
_ENTRIES = struct.Struct("<HI")
"""Of a message index: channel, and bytes of entries of (log time, offset), 8 bytes each."""


@dataclass(frozen=True, slots=True)
class Silence:
    """A time without messages."""

    begin_ns: int
    end_ns: int
    vehicle: int | None
    """System id of who was silent; None where nobody was heard."""


def times(stream: BinaryIO, summary: Any) -> dict[str, Times]:
    """Topic → when it has messages, ns, ascending. Raises ValueError where an index is damaged."""
    entries: defaultdict[str, list[Times]] = defaultdict(list)
    for chunk in summary.chunk_indexes:
        stream.seek(chunk.chunk_start_offset + chunk.chunk_length)
        for channel, found in _indexes(stream.read(chunk.message_index_length)):
            if channel not in summary.channels:
                raise ValueError(f"the index names a channel {channel} that there is not")
            entries[summary.channels[channel].topic].append(found)
    return {topic: np.sort(np.concatenate(parts)) for topic, parts in entries.items()}


def _indexes(block: bytes) -> Iterator[tuple[int, Times]]:
    """Channel and log times of each message index behind a chunk."""
    at = 0
    while at < len(block):
        opcode, length = _RECORD.unpack_from(block, at)
        at += _RECORD.size
        if opcode == Opcode.MESSAGE_INDEX:
            channel, size = _ENTRIES.unpack_from(block, at)
            yield channel, np.frombuffer(block, "<i8", size // 8, at + _ENTRIES.size)[::2]
        at += length


def silences(heard: Mapping[int, Times]) -> tuple[Silence, ...]:
    """Where nobody was heard, and where each was not; heard: system id → times, ns, ascending.

    A vehicle is silent, too, while others are heard already, or still.
    """
    if not heard:
        return ()
    everybody = np.sort(np.concatenate(list(heard.values())))
    found = [Silence(*span, None) for span in _spans(everybody)]
    for system, own in heard.items():
        there = np.concatenate([everybody[:1], own, everybody[-1:]])
        found += [Silence(*span, system) for span in _spans(there)]
    return tuple(found)


def _spans(heard: Times) -> Iterator[tuple[int, int]]:
    rows = np.flatnonzero(np.diff(heard) > GAP_NS)
    yield from zip(heard[rows].tolist(), heard[rows + 1].tolist(), strict=True)
