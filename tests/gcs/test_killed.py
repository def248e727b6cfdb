"""A ground station killed in flight: what it leaves on the disk, and what is made of that."""

import random
import signal
import socket
import subprocess
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import pytest
from flights import FDM, GCS, SOAK, messages, scratch, start
from relay import HOST, relay

from gcs.recording.channels import RAW, Message
from gcs.recording.history import load
from gcs.recording.reader import SENT
from gcs.recording.recover import rebuilt
from gcs.recording.salvage import salvage
from gcs.recording.tlog import Entry, entries
from gcs.replay.verify import decide_again
from wire.frames import Frame
from wire.payloads import SET_POSITION_TARGET_LOCAL_NED

KILLS = 50 if SOAK else 2
AT_A_TIME = 2
FLEET = ("swarm.rows=1", "swarm.columns=2", "swarm.leaders=[1]", "swarm.altitude_m=2", "mission.run_up_s=1")
"""Two vehicles that are soon where set-points flow."""


@dataclass(frozen=True)
class Killed:
    """What is left of one flight."""

    recording: Path
    kept: list[Message]
    """Frames of the recording as it was found."""
    journal: list[Entry]
    handed: list[Frame]
    """What the vehicles were handed."""

    @property
    def lost(self) -> list[Entry]:
        """Frames of the journal that are not in the recording; of those that read alike, the last."""
        missing, lost = Counter(entry.raw for entry in self.journal) - Counter(frame.data for frame in self.kept), []
        for entry in reversed(self.journal):
            if missing[entry.raw]:
                missing[entry.raw] -= 1
                lost.append(entry)
        return lost[::-1]


def killed(seed):
    """A flight whose ground station is killed within two seconds from the first set-point on."""
    folder, port = scratch(), free_port()
    words = ["demo", *(word for key in FLEET for word in ("--set", key))]
    with relay(port) as between:
        vehicles = start(FDM, "serve", *words, "--to", f"udpout:{HOST}:{between.vehicles}")
        link = ("--link", f"udpin:{HOST}:{port}", "--arm", "--yes", "--out", folder)
        station = start(GCS, "fly", *words, *link, stdin=subprocess.DEVNULL)
        try:
            assert between.setpoint.wait(60)
            time.sleep(random.Random(seed).uniform(0, 2))
        finally:
            station.kill()
            station.communicate()
            vehicles.send_signal(signal.SIGINT)
            vehicles.communicate(timeout=20)
    recording = folder / "run.mcap"
    kept = [message for message in salvage(recording.read_bytes()).messages() if message.channel.encoding == RAW]
    return Killed(recording, kept, list(entries(recording.with_suffix(".tlog"))), between.passed)


def free_port():
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as probe:
        probe.bind((HOST, 0))
        return probe.getsockname()[1]


@pytest.fixture(scope="module")
def flights():
    with ThreadPoolExecutor(AT_A_TIME) as pool:
        return list(pool.map(killed, range(KILLS)))


@pytest.fixture(scope="module")
def recovered(flights):
    """Where each was recovered to."""
    paths = [flight.recording.with_name("recovered.mcap") for flight in flights]
    for flight, path in zip(flights, paths, strict=True):
        rebuilt(flight.recording, journal=None, out=path)
    return paths


def raw(path):
    return [(topic, data) for topic, _, data in messages(path) if topic.endswith("/raw")]


@pytest.mark.wall_clock
def test_a_killed_ground_station_leaves_all_but_a_tenth_of_a_second_in_the_recording(flights):
    for flight in flights:
        lost = flight.lost
        assert not lost or (lost[-1].time_us - lost[0].time_us) / 1e6 <= 0.1
        assert all(entry in flight.journal[-len(lost) :] for entry in lost)


@pytest.mark.wall_clock
def test_with_its_journal_no_frame_is_lost(flights, recovered):
    for flight, path in zip(flights, recovered, strict=True):
        found = [data for _, data in raw(path)]
        assert Counter(found) >= Counter(entry.raw for entry in flight.journal)
        assert len(found) == len(flight.kept) + len(flight.lost)
        assert found[-len(flight.journal) :] == [entry.raw for entry in flight.journal]


@pytest.mark.wall_clock
def test_every_set_point_that_a_vehicle_was_handed_is_in_what_was_recovered(flights, recovered):
    for flight, path in zip(flights, recovered, strict=True):
        setpoints = [frame.raw for frame in flight.handed if frame.message == SET_POSITION_TARGET_LOCAL_NED]
        assert setpoints
        assert Counter(setpoints) <= Counter(data for topic, data in raw(path) if topic == SENT)


@pytest.mark.wall_clock
def test_what_was_recovered_opens_and_is_decided_again_as_it_was(flights, recovered):
    for flight, path in zip(flights, recovered, strict=True):
        again = decide_again(path)
        assert again.difference is None
        assert not again.gaps
        assert again.setpoints > 0
        history = load(path)
        assert history.number.tolist() == list(range(again.ticks))
        assert int(history.recovered["frames_added"]) == len(flight.lost)
