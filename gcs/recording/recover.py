"""`gcs log recover`: a clean recording of what a torn or damaged one, its further parts and its journal hold."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import orjson
from rich.table import Table
from rich.text import Text

from gcs.console import write
from gcs.output import check_free, whole
from gcs.recording import files
from gcs.recording.channels import Channels, Message
from gcs.recording.contents import foreign, mapped
from gcs.recording.files import DROPPED, METADATA, PART, SCENARIO
from gcs.recording.gathered import Gathered, PartFile, gathered
from gcs.recording.mcap_file import McapFile
from gcs.recording.merge import completed
from gcs.recording.reader import DAMAGE, UnreadableRecording, located
from gcs.recording.recovery import RECOVERED, Part, Recovery
from gcs.recording.seal import SEAL, sealed
from gcs.recording.strays import JOURNAL
from gcs.recording.tally import Tally, tally
from gcs.recording.tlog import Entries, Entry

PERIOD_S = 0.1
"""Of the loop, where the scenario that tells it is lost."""


def recover(path: Path, *, journal: Path | None, out: Path | None, as_json: bool, console: Any) -> int:
    """Rebuild a recording, or the one in a run's folder, and say what was found, lost and added. Exit code.

    journal: the one beside the recording, if None;  out: FILE-recovered.mcap, if None. Raises UnreadableRecording where
    nothing is left, or the journal named is of another flight, and Unwritable.
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
        raise UnreadableRecording(f"{path}: no recording: {files.importing(path)} makes one of it")
    check_free(out)
    log = _Log.of(path, journal)
    found = gathered(path)
    needless = _needless(found)
    if needless is not None:
        return needless
    about = _About(found.parts)
    result = tally(about.messages(), log.entries, period_ns=about.period_ns)
    left_out = list(found.left_out)
    if log.entries and result.messages > result.added and not result.of_one_flight:
        left_out.append((log.path, _of_another(result)))
        if journal is not None:
            raise UnreadableRecording("{}: {}".format(*left_out[-1]))
        log = _Log(log.path, [])
        result = tally(about.messages(), (), period_ns=about.period_ns)
    if result.messages == result.added:
        hint = f"; {files.importing(log.path)} makes a recording of its journal" if log.entries else ""
        raise UnreadableRecording(f"{path}: no MCAP file, or nothing that a CRC vouches for is left of it{hint}")
    recovery = Recovery(
        out=out,
        parts=[_part(one) for one in found.parts],
        left_out=left_out,
        journal=log.path if log.entries or log.skipped else None,
        journal_skipped=log.skipped,
        journal_mended=log.mended,
        added=result.added,
        dropped=about.dropped,
        messages=result.messages,
        begin_ns=result.begin_ns,
        end_ns=result.end_ns,
        missing=found.missing,
        lacking=about.lacking,
    )
    if recovery.needless:
        return replace(recovery, out=None)
    _write(out, completed(about.messages(), log.entries, period_ns=about.period_ns), about, recovery)
    return recovery


@dataclass(frozen=True, slots=True)
class _Log:
    """A recording's journal, or none."""

    path: Path
    entries: Sequence[Entry]
    skipped: int = 0
    """Bytes that are damaged."""
    mended: int = 0
    """Times that are."""

    @staticmethod
    def of(recording: Path, named: Path | None) -> _Log:
        """The one that was named, else the one beside it. Raises UnreadableRecording where it is all there is."""
        path = files.journal(recording) if named is None else named
        if named is None and not path.exists():
            return _Log(path, [])
        if not recording.exists() and not files.further(recording):
            hint = f"{files.importing(path)} makes a recording of its journal"
            raise UnreadableRecording(f"{recording}: is not there; {hint}")
        entries = Entries(mapped(path), JOURNAL)
        return _Log(path, list(entries), entries.skipped, entries.mended)


def _of_another(result: Tally) -> str:
    what = "it is the journal of another flight"
    if result.due == 0:
        return f"{what}: none of its frames was noted while the recording was"
    return f"{what}: of {result.due} frames that both should have, both have {result.shared}"


def _needless(found: Gathered) -> Recovery | None:
    """What is told of another program's file that is whole: salvage knows nothing that no CRC vouches for."""
    (only, *others) = found.parts
    if others or only.left.whole:
        return None
    told = foreign(only.path)
    if told is None:
        return None
    unvouched = told.messages - only.left.counts.total()
    part = Part(only.path, True, told.messages, unnamed=0, unvouched=unvouched, damage=(), unsealed=())
    return Recovery(None, [part], messages=told.messages, begin_ns=told.begin_ns, end_ns=told.end_ns)


def _part(one: PartFile) -> Part:
    left = one.left
    return Part(
        one.path,
        ended=left.ended,
        messages=left.counts.total() - left.unnamed,
        unnamed=left.unnamed,
        unvouched=0,
        damage=left.damage,
        unsealed=left.unsealed,
    )


class _About:
    """What the parts of a recording tell of the whole."""

    def __init__(self, parts: Sequence[PartFile]) -> None:
        self._left = [part.left for part in parts]
        self.attachments = {(a.name, a.data): a for left in self._left for a in left.attachments}.values()
        """Each once, though every part brings its own."""
        last = {record.name: record.metadata for left in self._left for record in left.metadata}
        self.metadata = {
            name: {key: value for key, value in values.items() if key not in (PART, DROPPED, SEAL)}
            for name, values in last.items()
            if name != RECOVERED
        }
        dropped = last.get(METADATA, {}).get(DROPPED, "")
        self.dropped = int(dropped) if dropped.isdecimal() else 0
        """Messages that no part holds."""
        scenario = next((a.data for a in self.attachments if a.name == SCENARIO), None)
        self.period_ns = round(_period_s(scenario) * 1e9)
        self.lacking = []
        if scenario is None:
            self.lacking.append("its scenario, without which only export and a replay to other tools can read it")
        if METADATA not in last:
            self.lacking.append("its metadata: versions, seed, and when it was flown")

    def messages(self) -> Iterator[Message]:
        """Of all parts, in their order."""
        return chain.from_iterable(left.messages() for left in self._left)


def _period_s(scenario: bytes | None) -> float:
    """What it says, be it of an older version; another program's says nothing."""
    with suppress(*DAMAGE):
        return PERIOD_S if scenario is None else float(orjson.loads(scenario)["time"]["period_s"])
    return PERIOD_S


def _write(path: Path, messages: Iterable[Message], about: _About, recovery: Recovery) -> None:
    with whole(path) as unfinished, McapFile(unfinished) as file:
        for attachment in about.attachments:
            file.attach(attachment.log_time, attachment.name, attachment.media_type, attachment.data)
        told = {METADATA: {}, **about.metadata, RECOVERED: recovery.metadata()}
        for name, values in told.items():
            file.metadata(name, sealed(name, values))
        channels = Channels(file)
        for message in messages:
            channels.add(*message)


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
