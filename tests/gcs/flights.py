"""Flights that tests share, each flown once a process, and how many: TRUSTR_PROFILE=soak flies what the issue names."""

import atexit
import hashlib
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import count
from pathlib import Path

import numpy as np
import orjson
from mcap.reader import NonSeekingReader
from mcap.writer import Writer
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs.flight import Flight
from gcs.lockstep import Lockstep
from gcs.loop import fly
from gcs.mission import plan
from gcs.recording.files import SUMMARY
from gcs.recording.reader import Flown, read
from gcs.session import AS_IN_RUN, flown
from gcs.summary import Reception, Summary
from scenarios import Scenario, load
from wire.modes import ARDUCOPTER_MODES, PX4_MODES

SOAK = os.environ.get("TRUSTR_PROFILE") == "soak"
SEEDS = range(1, 31 if SOAK else 2)
"""Of each of the paper's conditions."""
REPETITIONS = 5 if SOAK else 1
"""Of the flight over UDP."""

SHORT = ("mission.leg.0.length_m=3", "mission.leg.1.length_m=4.5", "mission.run_up_s=1")
"""Makes a demo of a dozen seconds."""

GCS = Path(sys.executable).with_name("gcs")
FDM = Path(sys.executable).with_name("fdm")

_scratch = tempfile.TemporaryDirectory(prefix="trustr-flights-")
atexit.register(_scratch.cleanup)


class Beside:
    """A link that hands everything to another; those below differ from it in a thing or two."""

    def __init__(self, link):
        self._link = link

    def receive(self):
        return self._link.receive()

    def send(self, system, frame):
        self._link.send(system, frame)

    @property
    def rejected(self):
        return self._link.rejected


class Counting(Beside):
    """A link that keeps every frame that passes through it, whichever way."""

    def __init__(self, link):
        super().__init__(link)
        self.received, self.sent = [], []

    def receive(self):
        frames = self._link.receive()
        self.received += frames
        return frames

    def send(self, system, frame):
        self.sent.append((system, frame))
        self._link.send(system, frame)


class Arriving(Beside):
    """A link that hands every frame to somebody, too, as it comes."""

    def __init__(self, link, arrived):
        super().__init__(link)
        self._arrived = arrived

    def receive(self):
        frames = self._link.receive()
        for frame in frames:
            self._arrived(frame)
        return frames


class Severed(Beside):
    """A link that loses one vehicle, both ways, so many seconds after it was made, and may find it again."""

    def __init__(self, link, clock, *, system, from_s, to_s=math.inf):
        super().__init__(link)
        self._clock, self._system = clock, system
        self._from_ns, self._to_ns = clock.now() + from_s * 1e9, clock.now() + to_s * 1e9

    def receive(self):
        return [frame for frame in self._link.receive() if not self._lost(frame.system, frame.time_ns)]

    def send(self, system, frame):
        if not self._lost(system, self._clock.now()):
            self._link.send(system, frame)

    def _lost(self, system, time_ns):
        return system == self._system and self._from_ns <= time_ns < self._to_ns


def mode_command(autopilot, mode):
    """(main, sub) of DO_SET_MODE."""
    if autopilot == "ardupilot":
        return ARDUCOPTER_MODES[mode], 0
    return PX4_MODES[mode].main, PX4_MODES[mode].sub


class OtherStation(Beside):
    """A link beside which another ground station changes one vehicle's mode, so many seconds after it was made."""

    def __init__(self, link, clock, *, system, mode, at_s):
        super().__init__(link)
        self._clock, self._system, self._mode = clock, system, mode
        self._at_ns = clock.now() + round(at_s * 1e9)
        self._said = False

    def receive(self):
        if not self._said and self._clock.now() >= self._at_ns:
            self._said = True
            words = dialect.MAVLink(None, srcSystem=254, srcComponent=190)
            main, sub = self._mode
            message = words.command_long_encode(
                self._system, 1, dialect.MAV_CMD_DO_SET_MODE, 0, 1, main, sub, 0, 0, 0, 0
            )
            self._link.send(self._system, message.pack(words))
        return super().receive()


@dataclass(frozen=True)
class Saying:
    """An operator without a keyboard."""

    events: Callable[[], tuple[str, ...]]


@dataclass(frozen=True)
class Recorded:
    """A flight in lockstep and all that it left behind."""

    scenario: Scenario
    summary: Summary
    folder: Path
    link: Counting

    @property
    def path(self) -> Path:
        return self.folder / "run.mcap"

    def read(self) -> Flown:
        return read(self.path)


@cache
def recorded(name, *overrides, seed=1, ratings=None, autopilot="px4"):
    """One lockstep flight as `gcs run` flies it, but for the picture, which costs a fifth of it.

    ratings: a tuple known beforehand; None where nobody rates.
    """
    return fly_and_record(name, *overrides, seed=seed, ratings=ratings, autopilot=autopilot)


def fly_and_record(
    name,
    *overrides,
    seed=1,
    through=None,
    out=None,
    events=tuple,
    watching=lambda _flight: (),
    ratings=None,
    autopilot="px4",
    recording=AS_IN_RUN,
    reception=Reception,
    faults_made=True,
    pictured=False,
    say=lambda _words: None,
):
    """The same, not shared. through: wraps (link, clock);  events: what an operator says at each tick."""
    scenario = load(name, overrides=overrides)
    folder = scratch() if out is None else out
    world = Lockstep.of(scenario, seed=seed, autopilot=autopilot)
    link = Counting(world if through is None else through(world, world))
    operator = Saying(events)
    summary = flown(
        name,
        scenario,
        link,
        world,
        seed=seed,
        out=folder,
        operator=operator,
        watching=watching,
        ratings=ratings,
        recording=recording,
        reception=reception,
        faults_made=faults_made,
        pictured=pictured,
        say=say,
    )
    return Recorded(scenario, summary, folder, link)


def failing(tick, error):
    """What people say: nothing, and at one tick whoever listens to them fails."""
    calls = count()

    def events():
        if next(calls) == tick:
            raise error
        return ()

    return events


def sent_by(known, *, world, seed=1, ratings=None):
    """Every frame that a ground station which knows one scenario sends to the vehicles of another."""
    vehicles = Lockstep.of(world, seed=seed)
    link = Counting(vehicles)
    fly(link, vehicles, Flight(known, ratings=ratings), (), period_ns=known.time.period_ns)
    return link.sent


def scratch() -> Path:
    """A new folder that goes away with the process."""
    return Path(tempfile.mkdtemp(dir=_scratch.name))


def start(*words, **options):
    """A command of ours in a process of its own, its output kept."""
    return subprocess.Popen(
        [str(word) for word in words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options
    )


def messages(path):
    """(topic, log time, payload) of every message, in the order of the file."""
    with path.open("rb") as stream:
        reader = NonSeekingReader(stream, validate_crcs=True)
        return [(c.topic, m.log_time, m.data) for _, c, m in reader.iter_messages(log_time_order=False)]


def digest(path):
    """A hash over topics, times and payloads."""
    hashed = hashlib.sha256()
    for topic, time_ns, data in messages(path):
        hashed.update(b"%s %d %d " % (topic.encode(), time_ns, len(data)) + data)
    return hashed.hexdigest()


def unended(path):
    """A copy of a recording whose flight nothing tells the end of."""
    return rewritten(path, keep=lambda name: name != SUMMARY)


def rewritten(
    path, change=lambda _at, _topic, _time, data: data, *, scenario=lambda data: data, keep=lambda _name: True
):
    """A copy of a recording, message by message.

    change: (place in the file, topic, log time, payload) → payload, or None to leave the message out;
    scenario: changes the attachment;  keep: whether metadata of a name stays.
    """
    copy = scratch() / "rewritten.mcap"
    with path.open("rb") as stream, copy.open("wb") as target:
        reader = NonSeekingReader(stream)
        writer = Writer(target)
        writer.start(library="test")
        channels = {}
        for place, (schema, channel, message) in enumerate(reader.iter_messages(log_time_order=False)):
            if channel.id not in channels:
                schema_id = 0 if schema is None else writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, schema_id)
            data = change(place, channel.topic, message.log_time, message.data)
            if data is not None:
                writer.add_message(channels[channel.id], message.log_time, data, message.publish_time)
        stream.seek(0)
        for attachment in NonSeekingReader(stream).iter_attachments():
            writer.add_attachment(
                attachment.create_time,
                attachment.log_time,
                attachment.name,
                attachment.media_type,
                scenario(attachment.data),
            )
        stream.seek(0)
        for metadata in filter(lambda record: keep(record.name), NonSeekingReader(stream).iter_metadata()):
            writer.add_metadata(metadata.name, metadata.metadata)
        writer.finish()
    return copy


def told(flight, topic):
    """Every message of one of our own topics, in its order."""
    return [orjson.loads(data) for name, _, data in messages(flight.path) if name == topic]


def column(flight, topic, key):
    """A mission's times (T,), and one list over vehicles at each of them (T, N, …), as far as the read-out."""
    read_out_s = plan(flight.scenario).read_out_s
    flown = [row for row in told(flight, topic) if row["mission_s"] is not None]
    rows = [row for row in flown if row["mission_s"] <= read_out_s + 1e-9]
    return np.array([row["mission_s"] for row in rows]), np.array([row[key] for row in rows])
