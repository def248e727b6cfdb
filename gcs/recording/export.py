"""`gcs log export`: a recording for other tools, as frames, as tables, or with its frames decoded."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

from mcap.records import Channel, Message, Schema
from rich import box
from rich.table import Table as Listing

from gcs.guard import DONE
from gcs.output import check_free, whole, whole_folder
from gcs.recording import decoded, tables
from gcs.recording.channels import RAW, Channels
from gcs.recording.contents import frame_of, frames, records
from gcs.recording.copied import Copy
from gcs.recording.mcap_file import McapFile
from gcs.recording.reader import UnreadableRecording, shown
from gcs.recording.table_files import MEANINGS, CsvFile, TableFile, TableFolder, parquet_file
from gcs.recording.tidy import Row, Tidy, of_frame
from gcs.recording.tlog import packed
from gcs.recording.topics import SCHEMA

Form = Literal["tlog", "csv", "parquet", "mcap"]
NAMES: dict[Form, str] = {"tlog": "-frames.tlog", "csv": "-csv", "parquet": "-parquet", "mcap": "-decoded.mcap"}
"""Behind the recording's own name. `run.tlog` is the journal of a live flight."""


def export(path: Path, *, to: Form, out: Path | None, console: Any) -> int:
    """Write a recording, or the one in a run's folder, in another form, and say what was written. Exit code.

    Raises UnreadableRecording, Unwritable where something is there already, BadUsageError where an extra is missing.
    """
    path = shown(path)
    if out is None:
        out = path.with_name(f"{path.stem}{NAMES[to]}")
    check_free(out)
    FORMS[to](path, out, console)
    return DONE


def _say(console: Any, line: str) -> None:
    console.print(line, highlight=False, soft_wrap=True, markup=False)


def _to_tlog(path: Path, out: Path, console: Any) -> None:
    """All frames both ways, in the order of time."""
    count = 0
    with whole(out) as unfinished, unfinished.open("wb") as file:
        for time_ns, raw in frames(path):
            file.write(packed(time_ns, raw))
            count += 1
        if not count:
            raise UnreadableRecording(f"{path}: holds no MAVLink frame: there is nothing to write to a .tlog")
    _say(console, f"{out.resolve()}: {count} frames")


def _to_mcap(path: Path, out: Path, console: Any) -> None:
    """All that is there, and decoded messages beside their frames. Those that are there already are not doubled."""
    with whole(out) as unfinished, McapFile(unfinished) as file:
        channels, added = Channels(file), 0
        copy = Copy(file, channels)
        for record in records(path):
            raw = copy.take(record)
            frame = None if raw is None else frame_of(raw.log_time, raw.data)
            said = None if frame is None else decoded.message(frame)
            if said is not None:
                channels.add(*said)
                added += 1
    _say(console, f"{out.resolve()}: {copy.written} messages, and {added} decoded")


def _to_tables(path: Path, out: Path, console: Any, *, kind: Callable[[Path, tables.Table], TableFile]) -> None:
    """A folder of tables."""
    with whole_folder(out) as unfinished, TableFolder(unfinished, kind) as folder:
        for table, row in _rows(path):
            folder.add(table, row)
        if not folder.rows:
            raise UnreadableRecording(f"{path}: holds neither frames nor topics of ours: there is no table to write")
        if any(table.name in folder.rows for table in tables.OURS):  # a flight of ours has all of them, rows or none
            for table in tables.OURS:
                folder.make(table)
    _say(console, f"{out.resolve()}: {len(folder.rows)} tables; {MEANINGS} says what they and their columns mean")
    listing = Listing(box=box.SIMPLE)
    listing.add_column("table")
    listing.add_column("rows", justify="right")
    for name, count in sorted(folder.rows.items()):
        listing.add_row(name, str(count))
    console.print(listing)


def _rows(path: Path) -> Iterator[tuple[tables.Table, Row]]:
    """Every row that a recording makes, with its table."""
    tidy, channels, ours = Tidy(), dict[int, Channel](), set[int]()
    for record in records(path):
        if isinstance(record, Schema) and record.name.startswith(SCHEMA):
            ours.add(record.id)
        elif isinstance(record, Channel):
            channels[record.id] = record
        elif isinstance(record, Message):
            channel = channels[record.channel_id]
            if channel.message_encoding == RAW:
                frame = frame_of(record.log_time, record.data)
                row = None if frame is None else of_frame(frame)
                if row is not None:
                    yield row
            elif channel.schema_id in ours:
                with _of_this_version(path, channel.topic):
                    rows = list(tidy.rows(channel.topic, record.log_time, record.data))
                yield from rows


@contextmanager
def _of_this_version(path: Path, topic: str) -> Iterator[None]:
    """What a topic of this name does not tell, or tells otherwise, becomes one sentence."""
    try:
        yield
    except (LookupError, TypeError, ValueError):
        raise UnreadableRecording(f"{path}: {topic} is not as this version writes it") from None


def _to_csv(path: Path, out: Path, console: Any) -> None:
    _to_tables(path, out, console, kind=CsvFile)


def _to_parquet(path: Path, out: Path, console: Any) -> None:
    _to_tables(path, out, console, kind=parquet_file())


FORMS: dict[Form, Callable[[Path, Path, Any], None]] = {
    "tlog": _to_tlog,
    "csv": _to_csv,
    "parquet": _to_parquet,
    "mcap": _to_mcap,
}
