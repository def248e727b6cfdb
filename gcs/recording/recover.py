"""`gcs log recover`: a clean recording of what a torn or damaged one, its further parts and its journal hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

import orjson
from rich.table import Table
from rich.text import Text

from gcs.console import write
from gcs.output import check_free, whole
from gcs.recording import files
from gcs.recording.files import DROPPED, METADATA, PART, SCENARIO
from gcs.recording.mcap_file import McapFile
from gcs.recording.merge import completed
from gcs.recording.reader import UnreadableRecording, located
from gcs.recording.recovery import RECOVERED, Part, Recovery
from gcs.recording.salvage import Rescued, Salvaged, salvage
from gcs.recording.seal import SEAL, sealed
from gcs.recording.tlog import Entries

PERIOD_S = 0.1
"""Of the loop, where the scenario that tells it is lost."""


def recover(path: Path, *, journal: Path | None, out: Path | None, as_json: bool, console: Any) -> int:
    """Rebuild a recording, or the one in a run's folder, and say what was found, lost and added. Exit code.

    journal: the one beside the recording, if None;  out: FILE-recovered.mcap, if None. Raises UnreadableRecording where
    nothing is left, and Unwritable.
    """
    path = located(path)
    recovery = rebuilt(path, journal=journal, out=out or path.with_name(f"{path.stem}-recovered{path.suffix}"))
    if as_json:
        write(orjson.dumps(recovery.json()))
    else:
        _tell(recovery, console)
    return 0


def rebuilt(path: Path, *, journal: Path | None, out: Path) -> Recovery:
    """The same, without a word."""
    if path.suffix == files.journal(path).suffix:
        raise UnreadableRecording(f"{path}: no recording: gcs log import makes one of it")
    check_free(out)
    if journal is None and files.journal(path).exists():
        journal = files.journal(path)
    log = None if journal is None else Entries(_bytes(journal))
    entries = [] if log is None else list(log)
    paths = [path, *files.further_parts(path)]
    left = [salvage(_bytes(part)) for part in paths]
    about = _About(left)
    found = list(chain.from_iterable(part.messages() for part in left))
    if not found:
        hint = "" if journal is None else f"; gcs log import {journal} makes a recording of its journal"
        raise UnreadableRecording(f"{path}: no MCAP file, or no message of it is left{hint}")
    messages = list(completed(found, entries, period_ns=about.period_ns))
    recovery = Recovery(
        out=out,
        parts=[
            Part(
                part,
                ended=what.ended,
                messages=what.counts.total() - what.unnamed,
                unnamed=what.unnamed,
                damage=what.damage,
                unsealed=what.unsealed,
            )
            for part, what in zip(paths, left, strict=True)
        ],
        journal=journal,
        journal_skipped=0 if log is None else log.skipped,
        added=len(messages) - len(found),
        dropped=about.dropped,
        messages=len(messages),
        begin_ns=messages[0].time_ns,
        end_ns=messages[-1].time_ns,
        lacking=about.lacking,
    )
    if recovery.needless:
        return replace(recovery, out=None)
    _write(out, messages, about, recovery)
    return recovery


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise UnreadableRecording(f"{path}: cannot be read: {error.strerror or error}") from None


class _About:
    """What the parts of a recording tell of the whole."""

    def __init__(self, parts: Sequence[Salvaged]) -> None:
        self.attachments = {(a.name, a.data): a for part in parts for a in part.attachments}.values()
        """Each once, though every part brings its own."""
        last = {record.name: record.metadata for part in parts for record in part.metadata}
        self.metadata = {
            name: {key: value for key, value in values.items() if key not in (PART, DROPPED, SEAL)}
            for name, values in last.items()
            if name != RECOVERED
        }
        self.dropped = int(last.get(METADATA, {}).get(DROPPED, "0"))
        """Messages that no part holds."""
        scenario = next((a.data for a in self.attachments if a.name == SCENARIO), None)
        self.period_ns = round((PERIOD_S if scenario is None else orjson.loads(scenario)["time"]["period_s"]) * 1e9)
        self.lacking = []
        if scenario is None:
            self.lacking.append("its scenario, without which only export and a replay to other tools can read it")
        if METADATA not in last:
            self.lacking.append("its metadata: versions, seed, and when it was flown")


def _write(path: Path, messages: Sequence[Rescued], about: _About, recovery: Recovery) -> None:
    with whole(path) as unfinished, McapFile(unfinished) as file:
        for attachment in about.attachments:
            file.attach(attachment.log_time, attachment.name, attachment.media_type, attachment.data)
        told = {METADATA: {}, **about.metadata, RECOVERED: recovery.metadata()}
        for name, values in told.items():
            file.metadata(name, sealed(name, values))
        schemas, channels = dict[str, int](), dict[str, int]()
        for topic, encoding, schema, time_ns, data in messages:
            if topic not in channels:
                if schema is not None and schema.name not in schemas:
                    schemas[schema.name] = file.schema(schema.name, schema.encoding, schema.data)
                channels[topic] = file.channel(topic, encoding, 0 if schema is None else schemas[schema.name])
            file.add(channels[topic], time_ns, data)


def _tell(recovery: Recovery, console: Any) -> None:
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for name, words in recovery.lines():
        table.add_row(Text(name), Text(words))
    console.print(table)
    if recovery.out is None:
        console.print("nothing to recover: the recording is whole", highlight=False)
        return
    console.print(f"recovered  {recovery.out.resolve()}", highlight=False, soft_wrap=True, markup=False)
