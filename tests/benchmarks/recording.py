"""What a recording costs: CPU of a flight in lockstep, and bytes beside a plain log of the same frames.

CPU of the whole process, of `emergency` with six vehicles at 250 Hz, imports left out. Flights with and without a
recording alternate, because machines change their pace: each is compared with those without one before and after it,
and the median of these comparisons is what counts.
"""

from __future__ import annotations

import statistics
import tempfile
from collections.abc import Iterable
from pathlib import Path

from gcs.recording.mcap_file import McapFile
from gcs.recording.reader import RECORDING, Message, opened
from gcs.recording.tlog import packed
from gcs.recording.writer import PROMPTLY_NS
from gcs.session import AS_IN_RUN, Recording
from scenarios import Scenario, load
from tests.benchmarks.flight_loop import flight

REPEATS = 7
IN_RUN, IN_FLY, DECODED = "as in gcs run", "flushed every 80 ms, as in gcs fly", "with --record-decoded"
WAYS = {IN_RUN: AS_IN_RUN, IN_FLY: Recording(flush_ns=PROMPTLY_NS), DECODED: Recording(decodes=True)}


def cpu(scenario: Scenario) -> tuple[float, dict[str, float]]:
    """CPU seconds of a flight without a recording; what each way of recording adds, as a fraction of that."""
    bare = [flight(scenario, None)[0]]
    added: dict[str, list[float]] = {way: [] for way in WAYS}
    for _ in range(REPEATS):
        for way, how in WAYS.items():
            seconds = flight(scenario, how)[0]
            bare.append(flight(scenario, None)[0])
            added[way].append(seconds / (0.5 * (bare[-1] + bare[-2])) - 1.0)
    return statistics.median(bare), {way: statistics.median(ratios) for way, ratios in added.items()}


def recorded(scenario: Scenario, how: Recording, folder: Path) -> tuple[int, list[Message], float]:
    """Bytes of a recording, what is in it, and vehicle-minutes flown."""
    path = folder / RECORDING
    path.unlink(missing_ok=True)
    ticks = flight(scenario, how, folder)[1]
    with opened(path) as recording:
        messages = list(recording.messages)
    return path.stat().st_size, messages, ticks * scenario.time.period_s * scenario.swarm.count / 60


def kind(message: Message) -> str:
    """Which of a recording's groups of topics it belongs to."""
    if message.encoding == "mavlink":
        return "raw frames"
    if message.topic.startswith("/mavlink/"):
        return "decoded frames, JSON"
    return "viewers' topics, protobuf" if message.encoding == "protobuf" else "own topics, JSON"


def alone(messages: Iterable[Message], path: Path) -> int:
    """Bytes of an MCAP file with nothing else in it, flushed as often."""
    channels: dict[str, int] = {}
    flushed_ns = 0
    with McapFile(path) as file:
        for message in messages:
            if message.topic not in channels:
                channels[message.topic] = file.channel(message.topic, message.encoding)
            file.add(channels[message.topic], message.time_ns, message.data)
            if message.time_ns - flushed_ns >= AS_IN_RUN.flush_ns:
                flushed_ns = message.time_ns
                file.flush()
    return path.stat().st_size


def main() -> None:
    """Print two tables."""
    scenario = load("emergency")
    bare, added = cpu(scenario)
    print(f"recording of `emergency`, six vehicles: CPU added to {bare:.2f} s without one, medians of {REPEATS}")
    for way, fraction in added.items():
        print(f"  {fraction:6.1%}  {way}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        decoded_bytes, messages, minutes = recorded(scenario, WAYS[DECODED], folder)
        groups = sorted({kind(message) for message in messages})
        frames = [message for message in messages if message.encoding == "mavlink"]
        log = sum(len(packed(message.time_ns, message.data)) for message in frames)
        print(f"\nkB a vehicle-minute, beside {log / minutes / 1000:.0f} of a plain tlog of the same frames")
        print("  on the disk   content")
        for group in groups:
            told = [message for message in messages if kind(message) == group]
            size, content = alone(told, folder / "alone.mcap"), sum(len(message.data) for message in told)
            print(f"  {size / minutes / 1000:11.0f}  {content / minutes / 1000:8.0f}  {group}, alone in a file")
        for way in (IN_RUN, IN_FLY):
            size, _, _ = recorded(scenario, WAYS[way], folder)
            print(f"  {size / minutes / 1000:11.0f}            all but decoded frames, {way}")
        print(f"  {decoded_bytes / minutes / 1000:11.0f}            all, {DECODED}")


if __name__ == "__main__":
    main()
