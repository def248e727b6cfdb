"""Writes a recording while a flight goes on.

On the way of a frame nothing is written: a `Tap` notes what passes. When a turn of the loop is over, its set-points
have left, and it is time, the recorder writes whatever turns it has noted: several at once cost less than one by one.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import TracebackType

from gcs import console
from gcs.loop import Clock, Link, Tick
from gcs.recording.own_topics import OwnTopics, pose_of
from gcs.recording.rotation import About, Rotation
from gcs.recording.sources import Turn, sources
from gcs.recording.viewers import Viewers
from gcs.shielded import Shield, in_words
from gcs.summary import Reception
from gcs.truth import Truth
from scenarios import Scenario
from wire.frames import Frame

PROMPTLY_NS = 80_000_000
"""For flights that nobody can fly again: a killed process loses no more of the recording than this and one tick."""
IN_LARGE_CHUNKS_NS = 1_000_000_000
"""For flights that can: fewer, larger chunks cost less."""


class Recorder:
    """One recording: raw frames through a `Tap`, our topics and the viewers' tick by tick."""

    def __init__(
        self,
        path: Path,
        scenario: Scenario,
        truth: Truth,
        *,
        start_ns: int,
        metadata: dict[str, str],
        flush_ns: int = IN_LARGE_CHUNKS_NS,
        decodes: bool = False,
        reception: Callable[[], Reception] = Reception,
        faults_made: bool = False,
        say: Callable[[str], None] = console.say,
    ) -> None:
        """flush_ns: how long anything may wait to be written;  decodes: write frames' messages as JSON, too.

        faults_made: whether we make the scenario's faults ourselves, whatever the vehicles tell.
        reception: tells how the vehicles were heard, where the link knows;  say: what to do with a sentence about a
        recording that stops, or goes on. Raises RecordingError.
        """
        about = About(scenario.model_dump_json(indent=1).encode(), metadata, start_ns)
        self._path, self._say = path, say
        self._files = Rotation(path, about, say)
        self._truth = truth
        self._posing = Shield(f"{path}: true places are missing from here on", say)
        own, viewers = OwnTopics(scenario, reception, faults_made=faults_made), Viewers(scenario)
        self._sources = sources(path, own, viewers, decodes=decodes, say=say)
        self._now, self._turns = Turn([], []), list[Turn]()
        self._flush_ns, self._flushed_ns = flush_ns, start_ns
        self._defect: str | None = None

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Whatever happened, the file is finished, unless the disk takes no more."""
        self.close()

    @property
    def problem(self) -> str | None:
        """Why some of the flight is not recorded, if it is not: it goes on all the same."""
        problems = (self._defect, *(source.problem for source in self._sources), self._posing.problem)
        return next(filter(None, problems), self._files.problem)

    def came(self, frames: list[Frame]) -> None:
        """Note frames that were received in this turn of the loop."""
        self._now.came.extend(frames)

    def went(self, time_ns: int, frame: bytes) -> None:
        """Note a frame that is being sent."""
        self._now.went.append((time_ns, frame))

    def tick(self, tick: Tick) -> None:
        """Note the turn that is over; whenever it is time, everything noted is written, and leaves the process."""
        came, went, _, _ = self._now
        self._now = Turn([], [])
        self._turns.append(Turn(came, went, tick, self._posing.call(lambda: pose_of(tick, self._truth), None)))
        if tick.time_ns - self._flushed_ns >= self._flush_ns:
            self._flushed_ns = tick.time_ns
            self._write()
            self._attempt(lambda: self._files.flush(tick.time_ns))

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """What is known only in the end, and is no part of the promise of same seed, same bytes."""
        self._attempt(lambda: self._files.metadata(name, values))

    def close(self) -> None:
        """Write what is left, of a turn that was broken off too, and the summary."""
        self._turns.append(self._now)
        self._write()
        self._attempt(self._files.finish)
        self._files.close()

    def _write(self) -> None:
        turns, self._turns = self._turns, []
        for turn in turns if self._defect is None else ():
            for source in self._sources:
                source.write(turn, self._files.add)

    def _attempt(self, write: Callable[[], None]) -> None:
        """A defect of the files' own ends the recording, but the file is finished all the same."""
        try:
            write()
        except Exception as error:  # not of the disk, of which the files tell
            if self._defect is None:
                self._defect = f"{self._path}: the recording stopped: {in_words(error)}"
                self._say(f"gcs: {self._defect}; the flight goes on without it")


class Tap:
    """A link whose frames are recorded. What the link refused is in no recording: /link counts it."""

    def __init__(self, link: Link, clock: Clock, recorder: Recorder) -> None:
        self._link, self._clock, self._recorder = link, clock, recorder

    def receive(self) -> list[Frame]:
        """What came, under its time of arrival."""
        frames = self._link.receive()
        self._recorder.came(frames)
        return frames

    def send(self, system: int, frame: bytes) -> None:
        """Noted, then sent, whether or not it could be noted, and whether or not it arrives."""
        try:
            self._recorder.went(self._clock.now(), frame)
        finally:
            self._link.send(system, frame)

    @property
    def rejected(self) -> int:
        """What the link refused."""
        return self._link.rejected
