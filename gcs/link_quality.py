"""How well a vehicle is heard, from the sequence numbers of its frames."""

from __future__ import annotations

from dataclasses import dataclass

from gcs.routes import ALIVE_NS
from gcs.telemetry import NEVER, REBOOTED_MS
from wire.frames import MAGIC_2, Frame
from wire.payloads import LOCAL_POSITION_NED

WINDOW = 64
"""Frames: one that comes this late or later is taken for one of the next round of the eight-bit numbers."""


@dataclass(frozen=True, slots=True)
class LinkQuality:
    """One autopilot's frames since it was first heard, or since it booted again."""

    received: int = 0
    """Frames, each counted once."""
    lost: int = 0
    """Frames that did not come, nor within the next WINDOW."""
    reordered: int = 0
    """Frames that came after a later one."""
    duplicated: int = 0
    """Frames that came again."""

    @property
    def loss(self) -> float | None:
        """Share of the frames that did not come; None where there were none."""
        return round(self.lost / (self.received + self.lost), 4) if self.received + self.lost else None


class Meter:
    """Counts one component's frames.

    A frame that is missing is lost only when WINDOW later ones have come, so that frames out of order are none.
    What was lost in a silence longer than ALIVE_NS is not counted: eight bits cannot tell how much it was.
    """

    def __init__(self) -> None:
        self._boot_ms = 0
        self._heard_ns = NEVER
        self._newest = 0
        self._missing = 0
        """Bit k: the frame k before the newest has not come."""
        self._received = self._lost = self._reordered = self._duplicated = 0

    @property
    def quality(self) -> LinkQuality:
        """As of now."""
        return LinkQuality(self._received, self._lost, self._reordered, self._duplicated)

    def count(self, frame: Frame) -> None:
        """Take in a frame as it arrives."""
        if frame.message == LOCAL_POSITION_NED:
            boot_ms = int.from_bytes(frame.payload[:4], "little")
            if self._boot_ms - boot_ms >= REBOOTED_MS:
                self._heard_ns = NEVER
                self._received = self._lost = self._reordered = self._duplicated = 0
                self._boot_ms = boot_ms
            self._boot_ms = max(self._boot_ms, boot_ms)
        sequence = frame.raw[4] if frame.raw[0] == MAGIC_2 else frame.raw[2]
        if frame.time_ns - self._heard_ns > ALIVE_NS:
            self._newest, self._missing = sequence, 0
            self._received += 1
        else:
            self._place(sequence)
        self._heard_ns = frame.time_ns

    def _place(self, sequence: int) -> None:
        behind = self._newest - sequence & 0xFF
        if behind >= WINDOW:
            ahead = 256 - behind
            missing = self._missing << ahead | (1 << ahead) - 2
            self._lost += (missing >> WINDOW).bit_count()
            self._missing = missing & (1 << WINDOW) - 1
            self._newest = sequence
            self._received += 1
        elif self._missing >> behind & 1:
            self._missing ^= 1 << behind
            self._reordered += 1
            self._received += 1
        else:
            self._duplicated += 1
