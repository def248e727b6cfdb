"""`gcs video`: a flight as an MP4."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gcs.choices import BadUsageError
from gcs.console import report
from gcs.guard import DONE
from gcs.output import whole
from gcs.recording.reader import shown

SLOWEST, FASTEST = 0.1, 100.0
"""Recorded seconds a second of film."""


def video(recording: Path, *, out: Path | None, blind: bool, speed: float, console: Any) -> int:
    """Render a recording; console shows how far it is. Raises UnreadableRecording, BadUsageError and Unwritable."""
    if not SLOWEST <= speed <= FASTEST:
        raise BadUsageError(f"--speed {speed:g}: must be {SLOWEST:g} to {FASTEST:g}")
    file = shown(recording)
    out = file.with_name("blind.mp4" if blind else "video.mp4") if out is None else out
    if out.suffix != ".mp4":
        raise BadUsageError(f"--out {out}: must end in .mp4")
    from gcs.video.encoder import ffmpeg

    program = ffmpeg()
    from gcs.recording.history import load
    from gcs.video.film import film

    history = load(file)
    with whole(out) as unfinished:
        film(history, unfinished, program, blind=blind, speed=speed, console=console)
    report(f"video      {out.resolve()}")
    return DONE
