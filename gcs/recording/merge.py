"""A recording completed from its journal: both hold the same frames in the same order, and either may lack some."""

from __future__ import annotations

from bisect import bisect_left
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence

from gcs.recording.channels import RAW, Message, raw_channel
from gcs.recording.reader import SENT
from gcs.recording.strays import JOURNAL
from gcs.recording.tlog import Entry
from wire.frames import sender_of

APART_NS = 500_000_000
"""Between two notes of one frame, at most: what is sent is noted twice on its way out, and a damaged time may be off by
as much before it is found out. Frames that read alike are farther apart, or leave at once for several vehicles."""


def completed(messages: Iterable[Message], journal: Sequence[Entry], *, period_ns: int) -> Iterator[Message]:
    """All messages in their order, and among them the frames that only the journal has.

    period_ns: of the flight's loop. A tick's own topics stand behind what it received and sent; a frame that was
    missing is put before those of its tick.
    """
    places = _places(journal)
    taken = 0
    held = list[Message]()
    """Messages since the last frame that both have."""
    for message in messages:
        if taken == len(journal):
            yield message
            continue
        place = None if message.channel.encoding != RAW else _place(message, places, journal, taken)
        if place is None:
            held.append(message)
            continue
        yield from _among(held, journal[taken:place], period_ns)
        yield message
        taken, held = place + 1, []
    yield from _among(held, journal[taken:], period_ns)


def _places(journal: Sequence[Entry]) -> dict[bytes, list[int]]:
    """Frame → where in the journal it stands."""
    places = defaultdict[bytes, list[int]](list)
    for place, entry in enumerate(journal):
        places[entry.raw].append(place)
    return dict(places)


def _place(message: Message, places: dict[bytes, list[int]], journal: Sequence[Entry], taken: int) -> int | None:
    """Where behind the first so many entries the journal has a frame; None where it does not."""
    same = places.get(message.data, [])
    for place in same[bisect_left(same, taken) :]:
        at_an_end = place in (0, len(journal) - 1)  # where neighbours on one side alone bear out a time
        apart_ns = JOURNAL.silent_us * 1000 if at_an_end else APART_NS
        if abs(journal[place].time_us * 1000 - message.time_ns) <= apart_ns:
            return place
    return None


def _among(held: Iterable[Message], missing: Sequence[Entry], period_ns: int) -> Iterator[Message]:
    """Messages in their order, and missing frames in theirs, each before the topics of its tick."""
    rest = [Message(raw_channel(*sender_of(raw)), time_us * 1000, raw) for time_us, raw in reversed(missing)]
    for message in held:
        if not message.channel.topic.startswith("/mavlink/"):
            while rest and _of_tick(rest[-1], message.time_ns, period_ns):
                yield rest.pop()
        yield message
    yield from reversed(rest)


def _of_tick(frame: Message, tick_ns: int, period_ns: int) -> bool:
    """Whether a frame was received or sent by a tick, or before it; what a tick sends, it sends early in its period."""
    sent = frame.channel.topic == SENT
    return frame.time_ns < tick_ns + period_ns // 2 if sent else frame.time_ns <= tick_ns
