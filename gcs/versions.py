"""The versions that decide what a flight comes to, to the byte."""

from __future__ import annotations

import platform
from collections.abc import Iterator, Mapping
from importlib.metadata import version

PACKAGES = ("trustr", "jsbsim", "pymavlink", "numpy", "mcap")


def installed() -> dict[str, str]:
    """Name → version, as a recording's metadata has them."""
    return {"python": platform.python_version(), **{package: _version(package) for package in PACKAGES}}


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
