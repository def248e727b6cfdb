"""`gcs report`: read flights, write the page, whole or not at all."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gcs.choices import BadUsageError
from gcs.guard import DONE
from gcs.output import whole
from gcs.recording.history import load
from gcs.recording.reader import located, shown
from gcs.report.page import page

PAGE = "report.html"
SUFFIXES = ".html", ".htm"


def report(recordings: Sequence[Path], *, out: Path | None, console: Any) -> int:
    """Write one page on these flights, side by side, and say where it is.

    Raises BadUsageError, UnreadableRecording and Unwritable.
    """
    if not recordings:
        raise BadUsageError("report: name at least one recording, or the folder of a run")
    target = located(recordings[0]).with_name(PAGE) if out is None else out / PAGE if out.is_dir() else out
    if target.suffix not in SUFFIXES:
        raise BadUsageError(f"--out {target}: must end in {' or '.join(SUFFIXES)}")
    html = page([load(shown(path)) for path in recordings])
    with whole(target) as unfinished:
        unfinished.write_text(html, encoding="utf-8")
    console.print(f"report     {target.resolve()}", highlight=False, soft_wrap=True, markup=False)
    return DONE
