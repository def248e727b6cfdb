"""Where a run writes: a folder that can be written, with room for all of it, and nobody else's results in it."""

from __future__ import annotations

import datetime as dt
import fcntl
import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import count as counted
from pathlib import Path

from gcs.recording.files import RecordingError
from gcs.recording.reader import RECORDING
from scenarios import Scenario

SUMMARY, PICTURE = "summary.json", "trajectory.png"


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


STEM = Path(RECORDING).stem
WRITTEN = re.compile(rf"{STEM}(\.part\d+)?\.mcap|{STEM}\.tlog|{re.escape(SUMMARY)}|{re.escape(PICTURE)}")
"""What a run writes."""
MADE_OF_IT = re.compile(
    rf"{STEM}(\.part\d+)?(-recovered|-decoded|-frames)*(\.mcap|\.tlog|-csv|-parquet)|report\.html|(video|blind)\.mp4"
)
"""What recover, export, import, report and video make of it, where nobody names another place."""


@contextmanager
def claimed(folder: Path) -> Iterator[None]:
    """A folder for one flight at a time, whichever process flies it. Raises RecordingError."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError as error:
        raise RecordingError(f"--out {folder}: cannot be read: {error.strerror or error}") from None
    try:
        if not _locked(handle):
            raise RecordingError(f"--out {folder}: another flight is being recorded there: name another folder")
        yield
    finally:
        os.close(handle)


def _locked(handle: int) -> bool:
    """False where another process has it. Where there are no locks, its files still take nobody's place."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return not isinstance(error, BlockingIOError)
    return True


def make_room(folder: Path) -> Path | None:
    """Take what an earlier run left, and what was made of it, out of the way: it is kept under the time it ended at.

    Returns the first of it, the recording if there is one. Raises RecordingError.
    """
    try:
        left = sorted(filter(_holds, folder.iterdir()), key=lambda path: (path.name != RECORDING, path.name))
        if not any(WRITTEN.fullmatch(path.name) for path in left):
            return None
        ended = max(path.stat().st_mtime for path in left if WRITTEN.fullmatch(path.name))
        stem = f"{STEM}-{dt.datetime.fromtimestamp(ended, dt.UTC):%Y%m%dT%H%M%S}"
        kept = next(path.name for path in _namesakes(folder, stem) if not any(folder.glob(f"{path.name}[.-]*")))
        first, *_ = [path.rename(folder / f"{kept}{_behind_stem(path.name)}") for path in left]
        return first
    except OSError as error:
        if isinstance(error, RecordingError):
            raise
        why = error.strerror or error
        raise RecordingError(f"--out {folder}: what an earlier run left there cannot be moved: {why}") from None


def _holds(path: Path) -> bool:
    """Whether an earlier run left it, and something in it. Raises RecordingError of what would only be in the way."""
    if not WRITTEN.fullmatch(path.name):
        return MADE_OF_IT.fullmatch(path.name) is not None and path.exists()
    if not path.is_file():
        raise RecordingError(f"--out {path}: is no file, and in the way: name another folder")
    if path.stat().st_size == 0:
        path.unlink()
        return False
    return True


def _behind_stem(name: str) -> str:
    return name.removeprefix(STEM) if name.startswith(STEM) else f"-{name}"


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


def _namesakes(folder: Path, name: str) -> Iterator[Path]:
    """This name in the folder, then the same numbered from 2, without end."""
    yield folder / name
    for number in counted(2):
        yield folder / f"{name}-{number}"
