"""A recording completed from its journal: both hold the same frames in the same order, and either may lack some."""

from __future__ import annotations

from bisect import bisect_left
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence

from gcs.recording.contents import RAW
from gcs.recording.reader import SENT
from gcs.recording.salvage import Rescued, raw_topic
from gcs.recording.tlog import Entry
from wire.frames import MAGIC_1

APART_NS = 500_000_000
"""Between two notes of one frame, at most: what is sent is noted twice on its way out. Frames that read alike are
farther apart, or leave at once for several vehicles."""


def completed(messages: Iterable[Rescued], journal: Sequence[Entry], *, period_ns: int) -> Iterator[Rescued]:
    """All messages in their order, and among them the frames that only the journal has.

    period_ns: of the flight's loop. A tick's own topics stand behind what it received and sent; a frame that was
    missing is put before those of its tick.
    """
    places = _places(journal)
    taken = 0
    held = list[Rescued]()
    """Messages since the last frame that both have."""
    for message in messages:
        place = None if message.encoding != RAW else _place(message, places, journal, taken)
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


def _place(message: Rescued, places: dict[bytes, list[int]], journal: Sequence[Entry], taken: int) -> int | None:
    """Where behind the first so many entries the journal has a frame; None where it does not."""
    same = places.get(message.data, [])
    for place in same[bisect_left(same, taken) :]:
        later_ns = journal[place].time_us * 1000 - message.time_ns
        if abs(later_ns) <= APART_NS:
            return place
        if later_ns > 0:
            break
    return None


def _among(held: Iterable[Rescued], missing: Sequence[Entry], period_ns: int) -> Iterator[Rescued]:
    """Messages in their order, and missing frames in theirs, each before the topics of its tick."""
    rest = [_frame(entry) for entry in missing]
    rest.reverse()
    for message in held:
        if not message.topic.startswith("/mavlink/"):
            while rest and _of_tick(rest[-1], message.time_ns, period_ns):
                yield rest.pop()
        yield message
    yield from reversed(rest)


def _of_tick(frame: Rescued, tick_ns: int, period_ns: int) -> bool:
    """Whether a frame was received or sent by a tick, or before it; what a tick sends, it sends early in its period."""
    return frame.time_ns < tick_ns + period_ns // 2 if frame.topic == SENT else frame.time_ns <= tick_ns


def _frame(entry: Entry) -> Rescued:
    at = 3 if entry.raw[0] == MAGIC_1 else 5
    return Rescued(raw_topic(entry.raw[at], entry.raw[at + 1]), RAW, None, entry.time_us * 1000, entry.raw)
