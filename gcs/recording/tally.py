"""What completing a recording from a journal comes to, and whether both are of one flight."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from gcs.recording.channels import RAW, Message
from gcs.recording.merge import completed
from gcs.recording.tlog import Entry

ALIKE = 0.9
"""Of the frames that both should have: simulated flights of one scenario, which begin at the same moment whatever their
seed, have up to three quarters in common.
"""


@dataclass(frozen=True, slots=True)
class Tally:
    """What it comes to."""

    messages: int
    """In all."""
    begin_ns: int
    end_ns: int
    """Times of the first and the last."""
    added: int
    """Frames that only the journal has."""
    shared: int
    """Frames that both have."""
    due: int
    """Frames that both should have: of each those within the times of the other, and the fewer of the two."""

    @property
    def of_one_flight(self) -> bool:
        """Whether the journal is the recording's: nothing but its frames tells."""
        return self.shared > 0 and self.shared >= ALIKE * self.due


def tally(messages: Iterable[Message], journal: Sequence[Entry], *, period_ns: int) -> Tally:
    """Of what `completed` makes of them."""
    log, found, frames, every = _Times(), _Times(), _Times(), _Times()
    for entry in journal:
        log.note(entry.time_us * 1000)

    def noted() -> Iterator[Message]:
        for message in messages:
            found.note(message.time_ns)
            if message.channel.encoding == RAW and log.first_ns <= message.time_ns <= log.last_ns:
                frames.note(message.time_ns)
            yield message

    for message in completed(noted(), journal, period_ns=period_ns):
        every.note(message.time_ns)
    added = every.count - found.count
    meanwhile = sum(frames.first_ns <= entry.time_us * 1000 <= frames.last_ns for entry in journal)
    return Tally(
        messages=every.count,
        begin_ns=every.first_ns,
        end_ns=every.last_ns,
        added=added,
        shared=len(journal) - added,
        due=min(frames.count, meanwhile),
    )


@dataclass(slots=True)
class _Times:
    """How many messages there are, and when: nothing lies between the times of none."""

    count: int = 0
    first_ns: int = 1
    last_ns: int = 0

    def note(self, time_ns: int) -> None:
        """One more."""
        if self.count == 0:
            self.first_ns = self.last_ns = time_ns
        self.first_ns, self.last_ns = min(self.first_ns, time_ns), max(self.last_ns, time_ns)
        self.count += 1
