"""Where words go: results on stdout; progress, questions and complaints on stderr."""

from __future__ import annotations

import sys
from contextlib import nullcontext, suppress
from typing import Any

from gcs.unblocked import Unblocked, unblocked


def say(words: str) -> None:
    """On stderr. A terminal that has gone is no reason to stop: whoever speaks may have vehicles in the air."""
    with suppress(OSError, ValueError):
        sys.stderr.write(words + "\n")
        sys.stderr.flush()


def write(line: bytes) -> None:
    """A result, on stdout."""
    sys.stdout.write(line.decode() + "\n")


def report(text: str) -> None:
    """A flight's result, on stdout, behind what was said. A terminal that takes nothing is not waited for."""
    if isinstance(sys.stderr, Unblocked):
        sys.stderr.drain()
    with unblocked("stdout") if sys.stdout.isatty() else nullcontext():
        sys.stdout.write(text + "\n")


def stdout() -> Any:
    """For tables. As wide as the terminal; elsewhere wide enough for ours."""
    from rich.console import Console

    return Console(width=None if sys.stdout.isatty() else 110)


def stderr() -> Any:
    """For what goes on."""
    from rich.console import Console

    return Console(stderr=True)


def asked(question: str) -> str | None:
    """What a person types in answer; None where nobody sits at a terminal."""
    if not sys.stdin.isatty():
        return None
    sys.stderr.write(question)
    sys.stderr.flush()
    return sys.stdin.readline().strip()
