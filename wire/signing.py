"""MAVLink 2 signing: who holds the key is believed, once, and in the order in which it spoke.

A signature is the first 48 bits of SHA-256 over key, frame, link id and a timestamp of 10 µs since 2015. Nothing about
a frame is believed, least of all its timestamp, before its digest is found right: a table that is touched earlier can
be poisoned by anybody. Page: https://mavlink.io/en/guide/message_signing.html
"""

from __future__ import annotations

import fcntl
import hashlib
import hmac
import json
import os
import re
import time
import weakref
from collections.abc import Callable
from pathlib import Path

from wire.frames import CRC, MAGIC_2, SIGNATURE, SIGNED, Frame, sealed

EPOCH_S = 1_420_070_400
"""2015-01-01T00:00Z, when signing timestamps begin, in seconds since 1970."""
TICKS_PER_S = 100_000
LAST_TICK = 2**48 - 1

BEHIND_AT_MOST = 60 * TICKS_PER_S
"""A stream that was never heard before may be this much older than the newest time known, and no more."""
MARGIN = 2 * TICKS_PER_S
"""What is written down is this much ahead, so that it holds for a while and need not be written for every frame."""
AHEAD_AT_MOST = 365 * 86_400 * TICKS_PER_S
"""A memory may know times so far ahead of the wall clock: a clock that was never set is further behind."""
STREAMS_AT_MOST = 1024
"""Streams that are told apart; only who holds the key can open one."""

PROGRAMS = 4
"""Link ids of one component's first port; those of its other ports follow so far apart."""

KEY_FILE_AT_MOST = 4096

Stream = tuple[int, int, int]
"""System, component, link id."""


class SigningKeyError(ValueError):
    """A signing key, or a memory of signing, that cannot be used, in one sentence that does not show the key."""


def read_key(path: Path) -> bytes:
    """The 32 bytes of a key file: 64 hex digits, or a passphrase, which SHA-256 turns into a key.

    MAVProxy and QGroundControl make the same key of the same passphrase. A newline at the end is not part of it. Raises
    SigningKeyError.
    """
    try:
        with path.open("rb") as file:
            data = file.read(KEY_FILE_AT_MOST + 1)
    except OSError as error:
        raise SigningKeyError(f"signing key {path}: {error.strerror or error}") from None
    try:
        words = data.decode().rstrip("\r\n")
    except UnicodeDecodeError:
        raise SigningKeyError(f"signing key {path}: must be text, 64 hex digits or a passphrase") from None
    if not words.strip() or len(data) > KEY_FILE_AT_MOST or "\n" in words:
        raise SigningKeyError(f"signing key {path}: must hold one line, 64 hex digits or a passphrase")
    if re.fullmatch(r"[0-9a-fA-F]{64}", words):
        return bytes.fromhex(words)
    if re.fullmatch(r"[0-9a-fA-F]{48,}", words):
        raise SigningKeyError(f"signing key {path}: has {len(words)} hex digits; a key has 64")
    return hashlib.sha256(words.encode()).digest()


class Signer:
    """Signs what leaves and judges what comes, for all streams of one program.

    key:     32 bytes
    memory:  a file of this program alone (a lock beside it sees to that) that keeps the newest timestamps, own and
             others', over a restart, even where it was killed or its clock set back in between (after a kill, frames
             of the next 2 s are refused); without one a frame can be played again after a restart, within a minute.
             On the disk it is only from a start and an orderly end: where the machine lost power, what was said since
             the start can be played again
    link:    link id of what leaves by the first port: two programs that sign as the same component differ in it, 0 to 3
    wall:    seconds since 1970
    """

    def __init__(
        self, key: bytes, *, memory: Path | None = None, link: int = 0, wall: Callable[[], float] = time.time
    ) -> None:
        if len(key) != 32:
            raise SigningKeyError(f"a signing key has 32 bytes, this one {len(key)}")
        self._keyed = hashlib.sha256(key)
        self._link = link
        self._wall = wall
        self._memory = memory
        self._unlock = None if memory is None else weakref.finalize(self, os.close, _locked(memory))
        self._recalled = {} if memory is None else _recalled(memory)
        self._newest: dict[Stream, int] = dict(self._recalled)
        self._last = max(self._newest.values(), default=0)
        self._written: dict[Stream, int] = {}
        """Up to where each stream is spent after a restart."""
        self.trouble: str | None = None
        """Why the memory could not be written last time, in one sentence."""
        if memory is not None:
            if self._last > self._now() + AHEAD_AT_MOST:
                raise SigningKeyError(
                    f"signing memory {memory}: is more than a year ahead of this machine's clock; set the clock, or "
                    "delete the memory a minute after the last flight"
                )
            self._remember(memory, margin=0, lasting=True)
            if self.trouble is not None:
                raise SigningKeyError(self.trouble)

    def sign(self, frame: bytes, *, place: int = 0) -> bytes:
        """An unsigned MAVLink 2 frame with its signature, and the checksum that goes with it.

        place: of the port by which it leaves, among all of the program. Each has a link id of its own: what leaves by
        several is not heard in the order in which it was signed, and in one stream the later would make the earlier old
        """
        if frame[0] != MAGIC_2 or frame[2]:
            raise ValueError("only a MAVLink 2 frame without flags can be signed")
        message = int.from_bytes(frame[7:10], "little")
        self._last = min(max(self._now(), self._last + 1), LAST_TICK)
        link = (self._link + PROGRAMS * place) % 256
        stream = (frame[5], frame[6], link)
        signed = sealed(frame[1:2] + bytes([SIGNED]) + frame[3:-CRC], message)
        signed += bytes([link]) + self._last.to_bytes(6, "little")
        self._note(stream, self._last)
        return signed + self._digest(signed)

    def refusal(self, frame: Frame) -> str | None:
        """Why a frame is not to be believed, or None; one that is believed now is refused from now on."""
        raw = frame.raw
        if raw[0] != MAGIC_2:
            return "version 1"
        if not raw[2] & SIGNED:
            return "unsigned"
        if not hmac.compare_digest(self._digest(raw[:-6]), raw[-6:]):
            return "bad signature"
        stream = (frame.system, frame.component, raw[-SIGNATURE])
        timestamp = int.from_bytes(raw[-12:-6], "little")
        known = self._newest.get(stream)
        if known is None:
            if timestamp < max(self._now(), self._last) - BEHIND_AT_MOST:
                return "replayed"
            if len(self._newest) >= STREAMS_AT_MOST:
                return "too many streams"
        elif timestamp <= known:
            return "replayed"
        self._last = max(self._last, timestamp)
        self._note(stream, timestamp)
        return None

    def save(self) -> None:
        """Write down what is known now, to the tick, and leave the memory to the next program: an orderly end."""
        if self._memory is not None and self._unlock is not None:
            self._remember(self._memory, margin=0, lasting=True)
            self._memory = None
            self._unlock()

    def __repr__(self) -> str:
        return f"Signer(link={self._link}, {len(self._newest)} streams)"

    def _now(self) -> int:
        return int((self._wall() - EPOCH_S) * TICKS_PER_S)

    def _digest(self, data: bytes) -> bytes:
        digest = self._keyed.copy()
        digest.update(data)
        return digest.digest()[:6]

    def _note(self, stream: Stream, timestamp: int) -> None:
        self._newest[stream] = timestamp
        if self._memory is not None and timestamp > self._written.get(stream, -1):
            self._remember(self._memory, margin=MARGIN)

    def _remember(self, memory: Path, *, margin: int, lasting: bool = False) -> None:
        """Write the memory; where that fails, flying comes first: it is tried again when what it holds runs out.

        lasting: wait until the disk has it, which takes too long for a tick
        """
        self._written = {
            stream: newest if newest == self._recalled.get(stream) else min(newest + margin, LAST_TICK)
            for stream, newest in self._newest.items()
        }
        draft = memory.with_name(memory.name + ".new")
        try:
            with draft.open("w") as file:
                json.dump([[*stream, timestamp] for stream, timestamp in self._written.items()], file)
                if lasting:
                    file.flush()
                    os.fsync(file.fileno())
            draft.replace(memory)
        except OSError as error:
            self.trouble = f"signing memory {memory}: cannot be written: {error.strerror or error}"
        else:
            self.trouble = None


def _locked(memory: Path) -> int:
    """A file beside the memory, open, and locked until it is closed, if only because the program ends.

    The memory itself is another file each time that it is written. Raises SigningKeyError.
    """
    try:
        file = os.open(memory.with_name(memory.name + ".lock"), os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o666)
    except OSError as error:
        raise SigningKeyError(f"signing memory {memory}: cannot be written: {error.strerror or error}") from None
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(file)
        raise SigningKeyError(f"signing memory {memory}: is in use by another program") from None
    return file


def _recalled(memory: Path) -> dict[Stream, int]:
    """What a memory holds. Raises SigningKeyError."""
    try:
        lines = json.loads(memory.read_bytes())
        entries = {(system, component, link): newest for system, component, link, newest in lines}
        for stream, newest in entries.items():
            if not all(type(number) is int for number in (*stream, newest)):
                raise ValueError
            if not (0 <= min(stream) <= max(stream) <= 255 and 0 <= newest <= LAST_TICK):
                raise ValueError
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise SigningKeyError(f"signing memory {memory}: cannot be read: {error.strerror or error}") from None
    except (ValueError, TypeError, RecursionError):
        raise SigningKeyError(
            f"signing memory {memory}: is damaged; a minute after the last flight it may be deleted, to begin a new one"
        ) from None
    return entries
