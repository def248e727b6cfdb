"""A CRC for metadata, which MCAP gives none: as one more of its values."""

from __future__ import annotations

import zlib
from collections.abc import Mapping

import orjson

SEAL = "crc32"


def sealed(name: str, values: Mapping[str, str]) -> dict[str, str]:
    """The values of a metadata record, with their CRC."""
    return {**values, SEAL: _crc(name, values)}


def is_sealed(name: str, values: Mapping[str, str]) -> bool | None:
    """Whether the CRC is right; None of values that came without one."""
    return values[SEAL] == _crc(name, values) if SEAL in values else None


def _crc(name: str, values: Mapping[str, str]) -> str:
    rest = {key: value for key, value in values.items() if key != SEAL}
    return f"{zlib.crc32(orjson.dumps([name, rest], option=orjson.OPT_SORT_KEYS)):08x}"
