"""The software and the machine that decide what a flight comes to, to the byte."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path

PACKAGES = (
    "trustr",
    "jsbsim",
    "pymavlink",
    "numpy",
    "mcap",
    "lz4",
    "orjson",
    "protobuf",
    "mcap-protobuf-support",
    "foxglove-schemas-protobuf",
)
"""By whose work bytes of a recording come about: its motion, its frames, its messages, its compression."""
ROOMS = ("aircraft", "fdm", "gcs", "scenarios", "trustr", "wire")
"""Our own packages."""


def installed() -> dict[str, str]:
    """Name → version, as a recording's metadata has them; of our own, which does not change with every edit, the bytes.

    The machine is among them: NumPy and JSBSim are compiled for it, and round by its arithmetic.
    """
    return {
        "python": platform.python_version(),
        "machine": platform.machine(),
        "sources": sources(),
        **{package: _version(package) for package in PACKAGES},
    }


@cache
def sources(root: Path = Path(__file__).parents[1]) -> str:
    """A fingerprint of our own files, code and models, as they lay there when it was first asked for."""
    hashed = hashlib.sha256()
    for path in sorted(path for room in ROOMS for path in (root / room).rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts:
            content = path.read_bytes()
            hashed.update(f"{path.relative_to(root).as_posix()} {len(content)} ".encode() + content)
    return hashed.hexdigest()[:12]


def others(recorded: Mapping[str, str]) -> Iterator[str]:
    """What was recorded with another version than is installed, and both. recorded: a recording's metadata."""
    for name, here in installed().items():
        if name in recorded and recorded[name] != here:
            yield f"{name} {recorded[name]} (here {here})"


def _version(package: str) -> str:
    try:
        return version(package)
    except ImportError:
        return "absent"
