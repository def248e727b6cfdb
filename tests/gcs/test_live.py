"""The ground station and the vehicles as two processes over UDP; and the link and clock that make it so."""

import os
import signal
import socket
import subprocess
import time
import tty
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import orjson
import pytest
from flights import FDM, GCS, REPETITIONS, SOAK, messages, recorded, start
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs.link_quality import LinkQuality
from gcs.live import Live
from gcs.recording.reader import read
from gcs.replay.verify import decide_again
from wire.connection import Connection, ConnectionRefused
from wire.frames import Sender

SPEED = 2
"""Vehicles wait half a second of theirs for set-points: a busy machine may stand still for half of that."""
HOST = "127.0.0.1"


def free_port():
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as probe:
        probe.bind((HOST, 0))
        return probe.getsockname()[1]


@contextmanager
def vehicles(scenario, port, *options, speed=SPEED):
    """`fdm serve`, for as long as it is needed."""
    server = start(FDM, "serve", scenario, "--to", f"udpout:{HOST}:{port}", "--speed", speed, *options)
    try:
        yield server
    finally:
        server.send_signal(signal.SIGINT)
        _, err = server.communicate(timeout=20)
        assert "Traceback" not in err


def fly(scenario, port, *options, speed=SPEED):
    words = [GCS, "fly", scenario, "--link", f"udpin:{HOST}:{port}", "--speed", speed, "--json", *options]
    return start(*words, stdin=subprocess.DEVNULL)


def ended(process):
    """(exit code, the object on stdout, what was said)."""
    out, err = process.communicate(timeout=120)
    assert "Traceback" not in err, err
    return process.returncode, orjson.loads(out), err


def free_row(count):
    """The first of so many free ports that follow each other."""
    while True:
        first = free_port()
        with ExitStack() as stack:
            try:
                for port in range(first, first + count):
                    stack.enter_context(closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))).bind((HOST, port))
            except (OSError, OverflowError):
                continue
        return first


@dataclass(frozen=True)
class OverUdp:
    """A flight of the transit with seed 1, and what it is compared with."""

    autopilot: str
    code: int
    summary: dict
    words: str
    folder: Path

    @property
    def lockstep(self):
        return recorded("transit", *LOW, autopilot=self.autopilot)


LOW = () if SOAK else ("swarm.altitude_m=4",)
"""Saves half the time that a flight takes."""


def flown_over_udp(autopilot, ports, folder):
    """Six vehicles behind one port, or each behind its own and with a signing key."""
    port = free_row(6)
    options = [word for override in LOW for word in ("--set", override)]
    if ports == "separate":
        (folder / "key").write_text("swordfish")
        options += ["--signing-key", folder / "key"]
    with vehicles("transit", port, *options, "--seed", "1", "--autopilot", autopilot, "--ports", ports):
        listening = port if ports == "shared" else f"{port}-{port + 5}"
        process = fly("transit", listening, *options, "--seed", "1", "--arm", "--yes", "--out", folder)
        return OverUdp(autopilot, *ended(process), folder)


@pytest.fixture(scope="module", params=["shared", "separate"])
def over_udp(request, tmp_path_factory):
    """Flights over one port or six; one with each autopilot at a time, for they mostly wait."""

    def flown(autopilot):
        return flown_over_udp(autopilot, request.param, tmp_path_factory.mktemp("live"))

    with ThreadPoolExecutor(max_workers=2) as both:
        return list(both.map(flown, ["px4", "ardupilot"] * REPETITIONS))


@pytest.mark.wall_clock
def test_a_flight_over_udp_ends_where_the_lockstep_flight_with_its_seed_does(over_udp):
    for flight in over_udp:
        lockstep, live = flight.lockstep.read().track, read(flight.folder / "run.mcap").track
        assert live.time_s[-1] == lockstep.time_s[-1]
        apart = np.linalg.norm(live.position[-1] - lockstep.position[-1], axis=1)
        assert (apart <= 0.5).all()


@pytest.mark.wall_clock
def test_it_passes_as_that_one_does_and_says_so_in_the_same_words(over_udp):
    for flight in over_udp:
        summary = flight.summary
        assert (flight.code, summary["passed"], summary["scored_on"], summary["problem"]) == (0, True, "truth", None)
        assert summary.keys() == orjson.loads(flight.lockstep.summary.json()).keys()
        assert summary["real_time_factor"] == pytest.approx(SPEED, rel=0.05)
        assert summary["rejected_frames"] == 0
        assert all(phase in flight.words for phase in ("joining", "taking off", "mission", "landing"))


@pytest.mark.wall_clock
def test_its_recording_is_decided_again_to_the_bit(over_udp):
    for flight in over_udp:
        result = decide_again(flight.folder / "run.mcap")
        assert result.difference is None
        assert result.setpoints > 1900


@pytest.mark.wall_clock
def test_its_ticks_are_late_by_less_than_a_period_and_none_is_left_out(over_udp):
    for flight in over_udp:
        ticks = [orjson.loads(data) for topic, _, data in messages(flight.folder / "run.mcap") if topic == "/tick"]
        assert [tick["number"] for tick in ticks] == list(range(len(ticks)))
        late = np.array([tick["lateness_ns"] for tick in ticks]) / 1e9
        assert late.min() >= 0
        assert np.median(late) < 0.05


@pytest.mark.wall_clock
def test_ctrl_c_lands_everybody_closes_the_recording_and_ends_with_130(tmp_path):
    port = free_port()
    endless = ("--set", "mission.leg.1.length_m=200")
    with vehicles("demo", port):
        process = fly("demo", port, *endless, "--arm", "--yes", "--out", tmp_path)
        for line in process.stderr:
            if "mission" in line:
                break
        process.send_signal(signal.SIGINT)
        code, summary, words = ended(process)
    assert code == 130
    assert "landing" in words
    assert summary["problem"] is None
    assert summary["heading_error_deg"] is None
    assert decide_again(tmp_path / "run.mcap").difference is None
    assert read(tmp_path / "run.mcap").track.time_s[-1] < 10.0
    beats = {}
    for topic, _, data in messages(tmp_path / "run.mcap"):
        if topic.endswith("_1/raw") and data[7:10] == b"\0\0\0":
            beats[topic] = dialect.MAVLink(None).decode(bytearray(data))
    assert len(beats) == 6
    assert not any(beat.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED for beat in beats.values())


class Vehicles:
    """Six of them behind one socket: they beat, and count what they are sent."""

    def __init__(self, port):
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._to = (HOST, port)
        self._senders = [Sender(system, 1) for system in range(1, 7)]
        self.received = []

    def beat(self, systems=range(1, 7)):
        for system in systems:
            beat = dialect.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)
            self._socket.sendto(self._senders[system - 1].pack(beat), self._to)
        self.listen()

    def listen(self):
        while True:
            try:
                self.received.append(self._socket.recvfrom(2048))
            except (BlockingIOError, ConnectionRefusedError):
                return

    def close(self):
        self._socket.close()


def listened_to(systems):
    """`gcs fly` without --arm in front of these vehicles: exit code, words, datagrams they were sent."""
    port = free_port()
    with closing(Vehicles(port)) as fleet:
        process = start(GCS, "fly", "emergency", "--link", f"udpin:{HOST}:{port}", "--speed", "8")
        while process.poll() is None:
            fleet.beat(systems)
            time.sleep(0.05)
        fleet.listen()
        out, err = process.communicate(timeout=20)
        return process.returncode, out, err, fleet.received


@pytest.mark.wall_clock
def test_without_arm_nothing_at_all_is_sent():
    code, out, err, received = listened_to(range(1, 7))
    assert received == []
    assert (code, out) == (0, "heard: 1, 2, 3, 4, 5, 6; missing: none\n")
    assert "sending nothing" in err


@pytest.mark.wall_clock
def test_without_arm_whoever_is_missing_is_named_and_the_exit_code_is_3():
    code, out, _, received = listened_to((1, 2, 5))
    assert received == []
    assert code == 3
    assert out == "heard: 1, 2, 5; missing: 3, 4, 6\n"


@pytest.fixture
def link():
    """A link on a free port, for the first two vehicles, and its port; time goes a hundred times as fast."""
    port = free_port()
    live = Live([Connection("udpin", HOST, port)], (1, 2), speed=100)
    yield live, port
    live.close()


def after(live, seconds):
    """What has come when so much of its time has passed."""
    live.sleep_until(live.now() + round(seconds * 1e9))
    return live.receive()


@pytest.mark.wall_clock
def test_its_clock_goes_as_fast_as_it_was_told_and_waits_until_the_time_asked_for(link):
    live, _ = link
    before, wall = live.now(), time.monotonic()
    live.sleep_until(before + 10**9)
    assert live.now() >= before + 10**9
    assert 0.01 <= time.monotonic() - wall < 0.1
    live.sleep_until(before)  # has passed


@pytest.mark.wall_clock
def test_frames_have_the_time_at_which_they_came_and_strangers_are_not_heard(link):
    live, port = link
    with closing(Vehicles(port)) as fleet:
        before = live.now()
        fleet.beat((1, 2, 3))
        frames = after(live, 1.0)
    assert [frame.system for frame in frames] == [1, 2]
    assert all(before <= frame.time_ns <= live.now() for frame in frames)
    assert live.receive() == []


@pytest.mark.wall_clock
def test_what_is_sent_goes_to_where_the_vehicle_speaks_from_and_before_that_nowhere(link):
    live, port = link
    live.send(1, b"lost")
    with closing(Vehicles(port)) as one, closing(Vehicles(port)) as other:
        one.beat((1,))
        other.beat((2,))
        after(live, 1.0)
        live.send(1, b"to one")
        live.send(2, b"to the other")
        other.beat((1,))  # claims to be vehicle 1, whose place is still alive
        assert after(live, 1.0) == []
        assert live.duplicates == {1}
        assert live.rejections == {"wrong address": 1}
        live.send(1, b"to one again")
        after(live, 4.0)
        assert live.duplicates == frozenset()
        other.beat((1,))  # vehicle 1 has booted again behind another port
        assert [frame.system for frame in after(live, 1.0)] == [1]
        live.send(1, b"to its new place")
        one.listen()
        other.listen()
        assert [data for data, _ in one.received] == [b"to one", b"to one again"]
        assert [data for data, _ in other.received] == [b"to the other", b"to its new place"]
        assert {peer.address[1] for peer in live._hub.known} == {other._socket.getsockname()[1]}


@pytest.mark.wall_clock
def test_where_namesakes_are_told_apart_both_are_heard_and_each_is_sent_its_own():
    port = free_port()
    with (
        closing(Live([Connection("udpin", HOST, port)], None, speed=100, namesakes=True)) as live,
        closing(Vehicles(port)) as one,
        closing(Vehicles(port)) as other,
    ):
        one.beat((1,))
        after(live, 1.0)
        other.beat((1,))
        one.beat((1,))
        assert sorted(frame.system for frame in after(live, 1.0)) == [1, 257]
        live.send(1, b"to one")
        live.send(257, b"to the other")
        time.sleep(0.01)
        one.listen()
        other.listen()
        assert [data for data, _ in one.received] == [b"to one"]
        assert [data for data, _ in other.received] == [b"to the other"]
        assert live.rejections == {}


@pytest.mark.wall_clock
def test_a_vehicle_is_heard_over_a_crowd_that_fills_the_port_it_is_known_on(link):
    live, port = link
    with closing(Vehicles(port)) as known, closing(Vehicles(port)) as unknown, closing(Vehicles(port)) as crowd:
        known.beat((1,))
        after(live, 1.0)
        for _ in range(20_000):
            crowd._socket.sendto(b"\xfdnobody can read this", (HOST, port))
        known.beat((1,))
        unknown.beat((2,))
        assert [frame.system for frame in after(live, 1.0)] == [1]
        assert live.rejections["wrong address"] == 0


@pytest.mark.wall_clock
def test_without_a_list_of_vehicles_everybody_is_heard_who_is_one():
    port = free_port()
    with closing(Live([Connection("udpin", HOST, port)], None, speed=100)) as live, closing(Vehicles(port)) as fleet:
        fleet._senders.append(Sender(77, 1))
        fleet.beat((1, 6, 7))
        station = dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3)
        fleet._socket.sendto(Sender(255, 190).pack(station), (HOST, port))
        assert [frame.system for frame in after(live, 1.0)] == [1, 6, 77]
        assert live.rejected == 0


@pytest.mark.wall_clock
def test_a_vehicle_not_heard_yet_is_spoken_to_only_where_we_are_to_speak_first():
    listening, waiting = free_port(), socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    waiting.bind((HOST, 0))
    waiting.settimeout(1.0)
    connections = [Connection("udpin", HOST, listening), Connection("udpout", HOST, waiting.getsockname()[1])]
    with closing(waiting), closing(Live(connections, (1, 2), speed=100)) as live, closing(Vehicles(listening)) as fleet:
        assert live.speaks_first
        live.send(1, b"hello")
        data, station = waiting.recvfrom(2048)
        assert data == b"hello"
        fleet.beat((2,))
        waiting.sendto(Sender(1, 1).pack(dialect.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)), station)
        assert sorted(frame.system for frame in after(live, 1.0)) == [1, 2]
        live.send(2, b"to two")
        live.send(1, b"to one")
        assert waiting.recv(2048) == b"to one"
        fleet.listen()
        assert [data for data, _ in fleet.received] == [b"to two"]


@contextmanager
def line(kind):
    """(connection, the vehicles' end of it) of a byte stream: a file descriptor, or a socket that is called."""
    if kind == "serial":
        ours, theirs = os.openpty()
        tty.setraw(ours)
        yield Connection("serial", device=os.ttyname(theirs), bits_per_s=57_600), ours
        os.close(ours)
        os.close(theirs)
    else:
        with socket.create_server((HOST, 0)) as server:
            yield Connection("tcp", *server.getsockname()), server


@pytest.mark.wall_clock
@pytest.mark.parametrize("kind", ["tcp", "serial"])
def test_vehicles_behind_a_stream_share_it_and_are_spoken_to_first(kind):
    with line(kind) as (connection, end), closing(Live([connection], (1, 2), speed=100)) as live:
        assert live.speaks_first
        near = end if kind == "serial" else end.accept()[0].detach()
        live.send(2, b"hello")
        assert os.read(near, 5) == b"hello"
        beats = [Sender(system, 1).pack(dialect.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)) for system in (1, 2)]
        os.write(near, b"noise" + beats[0] + beats[1][:9])
        assert [frame.system for frame in after(live, 2.0)] == [1]
        os.write(near, beats[1][9:])
        assert [frame.system for frame in after(live, 2.0)] == [2]
        live.send(1, b"to one")
        assert os.read(near, 6) == b"to one"
        if kind == "tcp":
            os.close(near)


@pytest.mark.wall_clock
def test_loss_is_counted_for_each_vehicle_by_the_numbers_of_its_autopilots_frames(link):
    live, port = link
    with closing(Vehicles(port)) as fleet:
        for place in range(150):
            fleet.beat((1, 2))
            if 20 <= place < 25:  # five frames of vehicle 1 never leave
                fleet._senders[0].pack(dialect.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3))
        after(live, 10.0)
    assert live.quality == {1: LinkQuality(received=150, lost=5), 2: LinkQuality(received=150)}


@pytest.mark.wall_clock
def test_garbage_is_counted_and_does_not_hide_the_frames_behind_it(link):
    live, port = link
    with closing(Vehicles(port)) as fleet:
        fleet._socket.sendto(b"\xfd\xff garbage", (HOST, port))
        wrong = bytearray(Sender(1, 1).pack(dialect.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)))
        wrong[-1] ^= 1
        fleet._socket.sendto(bytes(wrong), (HOST, port))
        fleet.beat((1,))
        frames = after(live, 1.0)
    assert [frame.system for frame in frames] == [1]
    assert live.rejected >= 2


def test_a_port_that_is_taken_gives_the_others_back():
    free, taken = free_port(), socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    with closing(taken):
        taken.bind((HOST, 0))
        busy = Connection("udpin", HOST, taken.getsockname()[1])
        with pytest.raises(ConnectionRefused, match="in use"):
            Live([Connection("udpin", HOST, free), busy], (1,))
    Live([Connection("udpin", HOST, free), busy], (1,)).close()
