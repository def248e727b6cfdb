"""`gcs replay`: by its time, with keys on a terminal, to its end without one, and to a ground control station."""

import contextlib
import fcntl
import json
import os
import pty
import re
import select
import signal
import socket
import struct
import subprocess
import sys
import termios
import time
from pathlib import Path

import pytest
from flights import GCS, SHORT, messages, recorded, scratch, start
from pymavlink import mavutil

from gcs.replay import command, timeline
from gcs.replay.command import IDLE_NS, LONGEST_TURN_NS, Playback, Words
from gcs.replay.player import Player
from gcs.replay.reel import Reel

SECOND = 1_000_000_000
LIMIT_S = 30.0
"""Real seconds for anything to happen."""


class Typist:
    """A seat whose time is told: it presses keys when they are due, and sleeps through what is asked for."""

    def __init__(self, presses=(), naps=()):
        """presses: (seconds, keys), ascending;  naps: (seconds, how many) in which nobody asks what time it is."""
        self._now_ns = 0
        self._presses, self._naps = list(presses), list(naps)

    def now(self):
        return self._now_ns

    def wait(self, until_ns):
        self._now_ns = until_ns
        if self._naps and self._now_ns >= self._naps[0][0] * SECOND:
            self._now_ns += round(self._naps.pop(0)[1] * SECOND)
        if self._presses and self._now_ns >= self._presses[0][0] * SECOND:
            return self._presses.pop(0)[1]
        return []


class Kept:
    """An output that keeps what it is handed."""

    def __init__(self):
        self.put_out, self.jumps, self.closed = [], [], 0

    def put(self, messages):
        self.put_out += [(message.topic, message.time_ns, message.data) for message in messages]

    def jumped(self, time_ns):
        self.jumps.append(time_ns)

    def close(self):
        self.closed += 1


@pytest.fixture(scope="module")
def flight():
    return timeline.load(recorded("demo", *SHORT).path)


@pytest.fixture(scope="module")
def known():
    """Every message, in the order of time and of the file."""
    return sorted(messages(recorded("demo", *SHORT).path), key=lambda message: message[1])


def played(flight, seat, *, stay=False, **how):
    """What was put out, where it ended, and how long it took [s]."""
    kept = Kept()
    first = flight.end_ns if how.get("reverse") else flight.start_ns
    player = Player(flight.start_ns, flight.end_ns, **{"position_ns": first, **how})
    with Reel(flight.path) as reel:
        ended = Playback(flight, reel, [kept]).run(player, seat, lambda *_, **__: None, stay=stay)
    return kept, ended, seat.now() / SECOND


@pytest.mark.parametrize("speed", [1, 4, 10])
def test_unattended_it_plays_everything_once_in_its_time_and_ends(flight, known, speed):
    kept, ended, took_s = played(flight, Typist(), speed=speed)
    assert kept.put_out == known
    assert ended.position_ns == flight.end_ns
    assert took_s == pytest.approx((flight.end_ns - flight.start_ns) / SECOND / speed, abs=0.011)


def test_backwards_it_plays_everything_in_reverse_order(flight, known):
    kept, ended, _ = played(flight, Typist(), speed=10, reverse=True)
    assert kept.put_out == known[::-1]
    assert ended.position_ns == flight.start_ns


def test_on_a_terminal_it_stays_at_the_end_until_somebody_goes(flight, known):
    kept, ended, took_s = played(flight, Typist([(60.0, ["q"])]), speed=10, stay=True)
    assert kept.put_out == known
    assert ended.paused
    assert took_s == pytest.approx(60.0, abs=IDLE_NS / SECOND)


def test_while_it_is_paused_nothing_is_put_out(flight, known):
    kept, _, _ = played(flight, Typist([(2.0, ["space"]), (10.0, ["q"])]), stay=True)
    assert kept.put_out == [message for message in known if message[1] < flight.start_ns + 2 * SECOND]


def test_after_a_jump_the_messages_of_that_place_follow_and_outputs_are_told(flight, known):
    kept, _, _ = played(flight, Typist([(1.0, ["g", "3", "enter"]), (2.0, ["q"])]), stay=True)
    there = flight.place("3")
    assert kept.jumps == [there]
    assert [time_ns for _, time_ns, _ in kept.put_out if time_ns >= flight.start_ns + SECOND] == [
        time_ns for _, time_ns, _ in known if there <= time_ns < there + SECOND
    ]


def test_a_step_puts_out_one_tick_and_a_step_back_takes_the_same_way(flight, known):
    presses = [(0.5, ["space"]), (1.0, ["right"]), (2.0, ["left"]), (3.0, ["q"])]
    kept, _, _ = played(flight, Typist(presses), position_ns=flight.place("2"), stay=True)
    tail = kept.put_out[len([m for m in known if flight.place("2") <= m[1] < flight.place("2.5")]) :]
    assert tail
    assert tail == tail[::-1]
    assert [topic for topic, _, _ in tail].count("/tick") == 2
    assert kept.jumps == []


def test_who_was_stopped_goes_on_where_he_was(flight):
    _, ended, _ = played(flight, Typist([(3600.0, ["q"])], naps=[(1.0, 3600.0)]), stay=True)
    assert ended.position_ns - flight.start_ns == pytest.approx(SECOND + LONGEST_TURN_NS, abs=SECOND // 50)


def test_without_a_terminal_a_line_a_second_at_most_says_where_it_is(flight, capfd):
    player = Player(flight.start_ns, flight.end_ns, flight.start_ns)
    with Reel(flight.path) as reel:
        Playback(flight, reel, []).run(player, Typist(), Words(flight), stay=False)
    lines = capfd.readouterr().err.splitlines()
    length_s = (flight.end_ns - flight.start_ns) / SECOND
    assert length_s - 2 <= len(lines) <= length_s + 1
    assert lines[1] == f"{float(lines[0][:-2]) + 1.0:.1f} s"


def test_what_was_played_is_one_line_or_one_object(gcs, flight):
    path = recorded("demo", *SHORT).path
    code, out, err = gcs("replay", path, "--from", "done", "--speed", "10")
    last = flight.seconds(flight.end_ns)
    assert (code, out) == (0, f"{path} from {last:.1f} s to {last:.1f} s: 0 messages\n")
    code, out, err = gcs("replay", path, "--reverse", "--speed", "0.25", "--from=-99")
    assert (code, out) == (2, "")
    assert err.startswith("gcs: --from -99: the recording goes from ")
    code, out, _ = gcs("replay", path, "--from", f"{last - 0.5:.1f}", "--json", "--to", "udpout:127.0.0.1:9")
    told = json.loads(out)
    assert (told["recording"], told["speed"], told["reverse"]) == (str(path), 1.0, False)
    assert told["to_s"] == pytest.approx(last, abs=1e-3)
    assert told["messages"] > told["frames_sent"] > 0
    assert told["frames_held_back"] == {}


def test_that_a_large_recording_is_being_read_is_said_at_once(gcs, monkeypatch):
    path = recorded("demo", *SHORT).path
    assert "reading" not in gcs("replay", path, "--from", "done", "--speed", "10")[2]
    monkeypatch.setattr(command, "LARGE", path.stat().st_size)
    told = gcs("replay", recorded("demo", *SHORT).folder, "--from", "done", "--speed", "10")[2].splitlines()
    assert told[0] == f"reading {path}, {path.stat().st_size / 1e6:.0f} MB"


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--speed", "0.2"], "--speed 0.2: must be 0.25 to 10 × recorded time"),
        (["--speed", "11"], "--speed 11: must be 0.25 to 10 × recorded time"),
        (["--speed", "nan"], "--speed nan: must be 0.25 to 10 × recorded time"),
        (["--from", "lunch"], "--from lunch: neither seconds"),
        (["--to", ""], "--to '': must be one port that is spoken to"),
        (["--to-network"], "--to-network: nothing is sent without --to"),
        (["--foxglove-port", "8765"], "--foxglove-port: nothing is served without --foxglove"),
        (["--verify", "--to", "udpout:127.0.0.1:9", "--speed", "2"], "--speed, --to: nothing is played where"),
        (["--controller", "average", "--from", "1", "--foxglove", "--reverse"], "--reverse, --from, --foxglove: noth"),
        (["--to", "tcp:127.0.0.1:5760"], "--to tcp:127.0.0.1:5760: must be one port that is spoken to"),
        (["--to", "udpout:10.1.2.3:14550"], "--to udpout:10.1.2.3:14550: is another machine"),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(gcs, words, sentence):
    code, out, err = gcs("replay", recorded("demo", *SHORT).path, *words)
    assert (code, out) == (2, "")
    assert err.startswith(f"gcs: {sentence}")
    assert err.count("\n") == 1


def test_a_torn_recording_is_refused_with_what_rebuilds_it(gcs):
    torn = scratch() / "torn.mcap"
    torn.write_bytes(recorded("demo", *SHORT).path.read_bytes()[:-5000])
    code, _, err = gcs("replay", torn)
    assert code == 2
    assert "gcs log recover" in err
    assert err.count("\n") == 1


def free_port():
    """A number that no UDP socket has at this moment."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


@pytest.mark.wall_clock
def test_a_ground_control_station_meets_all_six_vehicles_and_nobody_else():
    port = free_port()
    station = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}", source_system=254)
    station.port.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)  # it is slower than ten times real time
    heard, began = {}, time.monotonic()
    words = ("replay", recorded("demo", *SHORT).path, "--speed", "10", "--to", f"udpout:127.0.0.1:{port}", "--json")
    with contextlib.closing(station), start(GCS, *words, stdin=subprocess.DEVNULL) as replay:
        while replay.poll() is None or select.select([station.fd], [], [], 0)[0]:
            message = station.recv_match(blocking=True, timeout=0.2)
            if message is not None:
                who = message.get_srcSystem(), message.get_srcComponent()
                heard.setdefault(message.get_type(), {}).setdefault(who, []).append(message)
                station.mav.param_request_list_send(*who)  # as stations do: it is read, and thrown away
            assert time.monotonic() - began < LIMIT_S
        told = json.loads(replay.stdout.read())
    everybody = {(system, 1) for system in range(1, 7)}
    assert heard["HEARTBEAT"].keys() == heard["LOCAL_POSITION_NED"].keys() == everybody
    assert {who for kind in heard.values() for who in kind} == everybody
    assert not {"SET_POSITION_TARGET_LOCAL_NED", "COMMAND_LONG", "SIM_STATE", "BAD_DATA"} & heard.keys()
    assert sum(len(some) for kind in heard.values() for some in kind.values()) == told["frames_sent"]
    up = [message.z for message in heard["LOCAL_POSITION_NED"][4, 1]]
    assert min(up) < -9.0
    assert max(up) > -1.0


@pytest.mark.wall_clock
def test_mavsdk_meets_all_six_and_sees_where_they_were():
    path, port = recorded("demo", *SHORT).path, free_port()
    with start(sys.executable, Path(__file__).with_name("see_mavsdk.py"), port, 6) as client:
        assert any(line == "listening\n" for line in client.stdout)
        words = ("replay", path, "--from", "0", "--to", f"udpout:127.0.0.1:{port}")
        with start(GCS, *words, stdin=subprocess.DEVNULL) as replay:
            said = client.stdout.read()
            replay.kill()
    (told,) = (line.removeprefix("seen: ") for line in said.splitlines() if line.startswith("seen: "))
    seen = json.loads(told)
    assert sorted(seen) == ["1", "2", "3", "4", "5", "6"]
    assert all(-12.0 < down < -8.0 for _, _, down in seen.values())


class Attended:
    """A shell on a terminal of its own, so many characters wide and high, for one script."""

    def __init__(self, script, *, columns=80, lines=24):
        self._ours, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))
        self.shell = subprocess.Popen(
            ["bash", "-mc", script],
            stdin=theirs,
            stdout=theirs,
            stderr=theirs,
            start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
            env={**os.environ, "TERM": "xterm-256color"},
        )
        os.close(theirs)
        self.screen = b""

    def type(self, keys):
        os.write(self._ours, keys)

    def see(self, pattern):
        """Wait for it, behind all that was seen before."""
        end = time.monotonic() + LIMIT_S
        while not (found := re.search(pattern, self.screen, re.DOTALL)):
            assert time.monotonic() < end, self.screen[-2000:]
            if select.select([self._ours], [], [], 0.1)[0]:
                try:
                    self.screen += os.read(self._ours, 65536)
                except OSError:  # the shell has gone
                    raise AssertionError(self.screen[-2000:]) from None
        self.screen = self.screen[found.end() :]

    @property
    def foreground(self):
        """The process that has the terminal."""
        return os.tcgetpgrp(self._ours)

    def hang_up(self):
        os.close(self._ours)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.shell.pid, signal.SIGKILL)
        self.shell.wait(10)
        with contextlib.suppress(OSError):
            os.close(self._ours)


REPLAY = f"{sys.executable} -m gcs replay {{}} --from 2"
MODES = r"stty -a | tr '\n' ' '"
SANE = rb" icanon.* echo "
"""How stty calls a terminal that waits for whole lines and shows them."""


def replay():
    return REPLAY.format(recorded("demo", *SHORT).path)


@pytest.mark.wall_clock
def test_with_keys_on_a_terminal_which_is_stopped_and_left_as_it_was():
    with Attended(f"{replay()}; echo stopped; {MODES}; fg; echo code $?; {MODES}") as seen:
        seen.see(rb"\x1b\[\?1049h")
        seen.see(rb"since mission start")
        seen.type(b" ")
        seen.see(rb"paused")
        seen.type(b"glanding\r")
        seen.see(rb"go to")
        seen.see(rb"landing\S* +")
        seen.type(b"\x1a")
        seen.see(rb"\x1b\[\?1049l")
        seen.see(rb"stopped")
        seen.see(SANE)
        seen.see(rb"\x1b\[\?1049h")
        seen.see(rb"paused")
        seen.type(b"q")
        seen.see(rb"\x1b\[\?1049l")
        seen.see(rb"run\.mcap from 2\.0 s to \d+\.\d s: \d+ messages")
        seen.see(rb"code 0")
        seen.see(SANE)


@pytest.mark.wall_clock
def test_with_its_result_redirected_it_takes_keys_all_the_same_and_on_a_dumb_terminal_none():
    with Attended(
        f"{replay()} --json > /dev/null; echo code $?; TERM=dumb {replay()} --speed 10; echo code $?"
    ) as seen:
        seen.see(rb"since mission start")
        seen.type(b"q")
        seen.see(rb"code 0")
        seen.see(rb"run\.mcap from 2\.0 s to \d+\.\d s: \d+ messages")
        seen.see(rb"code 0")


@pytest.mark.wall_clock
@pytest.mark.parametrize("how", ["ctrl-c", "term"])
def test_ctrl_c_and_a_polite_kill_leave_a_sane_terminal(how):
    with Attended(f"{replay()} & echo pid $!; fg; echo code $?; {MODES}") as seen:
        seen.see(rb"paused|mission")
        if how == "ctrl-c":
            seen.type(b"\x03")
        else:
            os.kill(seen.foreground, signal.SIGTERM)
        seen.see(rb"\x1b\[\?25h\x1b\[\?1049l")
        seen.see(rb"run\.mcap from 2\.0 s to \d+\.\d s: \d+ messages")
        seen.see(rb"code 130")
        seen.see(SANE)


@pytest.mark.wall_clock
def test_when_the_terminal_goes_the_replay_goes():
    with Attended(f"exec {replay()}") as seen:
        seen.see(rb"mission")
        seen.hang_up()
        assert seen.shell.wait(LIMIT_S) != 0


@pytest.mark.wall_clock
def test_a_reader_that_has_had_enough_ends_it_quietly():
    path = recorded("demo", *SHORT).path
    words = f"{sys.executable} -m gcs replay {path} --from done --json | head -c 1"
    done = subprocess.run(["bash", "-c", words], capture_output=True, text=True, stdin=subprocess.DEVNULL, check=True)
    assert done.stdout == "{"
    assert "Traceback" not in done.stderr
