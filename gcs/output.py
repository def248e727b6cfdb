"""Where a run writes: a folder that can be written, with room for all of it, and nobody else's results in it."""

from __future__ import annotations

import datetime as dt
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import count as counted
from pathlib import Path

from gcs.recording import files
from gcs.recording.files import RecordingError
from gcs.recording.reader import RECORDING
from scenarios import Scenario

PICTURE = "trajectory.png"


class Unwritable(OSError):
    """A file that a command cannot write, in one sentence."""


@contextmanager
def whole(path: Path, option: str = "--out") -> Iterator[Path]:
    """A path beside this one to write to; when the block ends well it takes its place, whole or not at all.

    Raises Unwritable.
    """
    unfinished = path.with_name(f".unfinished-{path.name}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield unfinished
        unfinished.replace(path)
    except OSError as error:
        if isinstance(error, Unwritable) or error.errno is None:
            raise
        raise Unwritable(f"{option} {path}: cannot be written: {error.strerror or error}") from None
    finally:
        with suppress(OSError):
            unfinished.unlink(missing_ok=True)


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """The same of a folder, which is there to be filled. Raises Unwritable."""
    with whole(path) as unfinished:
        shutil.rmtree(unfinished, ignore_errors=True)
        unfinished.mkdir()
        try:
            yield unfinished
        except BaseException:
            shutil.rmtree(unfinished, ignore_errors=True)
            raise


def check_free(path: Path, option: str = "--out") -> None:
    """Raises Unwritable where something is: it may be a recording, or its journal."""
    if path.is_file() or (path.is_dir() and any(path.iterdir())):
        raise Unwritable(f"{option} {path}: is there already: name another, or take it away")


A_VEHICLE_MINUTE, A_PAIR_MINUTE = 2_000_000, 20_000
"""Bytes of a recording and its journal, at most: frames of each vehicle, and what each thinks of each."""


def make_room(folder: Path) -> Path | None:
    """Take what an earlier run left out of the way: its recording, further parts of it and its journal are kept
    under the time they were closed at.
    """
    for name in ("summary.json", PICTURE):
        (folder / name).unlink(missing_ok=True)
    recording = folder / RECORDING
    earlier = [path for path in (recording, files.journal(recording), *files.further_parts(recording)) if _holds(path)]
    if not earlier:
        return None
    closed = max(path.stat().st_mtime for path in earlier)
    stem = f"{recording.stem}-{dt.datetime.fromtimestamp(closed, dt.UTC):%Y%m%dT%H%M%S}"
    kept = next(path for path in _namesakes(folder, stem, recording.suffix) if not any(folder.glob(f"{path.stem}.*")))
    first, *_ = [path.rename(folder / f"{kept.stem}{path.name.removeprefix(recording.stem)}") for path in earlier]
    return first


def _holds(path: Path) -> bool:
    return path.is_file() and path.stat().st_size > 0


def room(scenario: Scenario) -> int:
    """Bytes that a flight may leave behind, if it takes as long as it may."""
    count = scenario.swarm.count
    minutes = scenario.time.timeout_s / 60
    return round(minutes * (count * A_VEHICLE_MINUTE + count**2 * A_PAIR_MINUTE))


def output_folder(out: Path | None, name: str, *, needs: int = 0) -> Path:
    """Where a run writes, made and tried. needs: bytes that must be free there. Raises RecordingError."""
    now = dt.datetime.now(dt.UTC).strftime("%Y%m%dT%H%M%S")
    folder = Path("runs") / f"{now}-{Path(name).stem}" if out is None else out
    try:
        folder = _new(folder) if out is None else folder
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".writable"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise RecordingError(f"--out {folder}: cannot be written: {error.strerror or error}") from None
    free = shutil.disk_usage(folder).free
    if free < needs:
        raise RecordingError(
            f"--out {folder}: {free / 1e6:.0f} MB are free, and a flight as long as time.timeout_s allows may leave "
            f"{needs / 1e6:.0f} MB there"
        )
    return folder


def _new(folder: Path) -> Path:
    """This folder, or the first of its namesakes that nobody has: two runs may begin in one second."""
    for candidate in _namesakes(folder.parent, folder.name):
        try:
            candidate.mkdir(parents=True)
        except FileExistsError:
            continue
        return candidate
    raise AssertionError("names never end")


def _namesakes(folder: Path, stem: str, suffix: str = "") -> Iterator[Path]:
    """This name in the folder, then the same numbered from 2, without end."""
    yield folder / f"{stem}{suffix}"
    for number in counted(2):
        yield folder / f"{stem}-{number}{suffix}"
