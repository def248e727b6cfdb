"""`gcs land`, `hold`, `kill` and `take-back` while a flight has the link: through its socket, and to its end."""

import os
import pty
import signal
import socket
import stat
import subprocess
import tempfile
import threading
import time
from contextlib import closing, contextmanager
from pathlib import Path
from types import SimpleNamespace

import orjson
import pytest
from flights import FDM, GCS, start

from gcs import operating
from gcs.events import killed, taken_back
from gcs.flight_state import Phase
from gcs.reach import Call, ControlSocket, Refused, flying
from gcs.telemetry import Swarm
from wire.connection import Connection, parse
from wire.modes import PX4, PX4_MODES

HOST, LINK = "127.0.0.1", "udpin:0.0.0.0:14999"


@pytest.fixture(autouse=True)
def runtime(monkeypatch):
    """A runtime directory of the test's own; short, because the names of sockets must be."""
    with tempfile.TemporaryDirectory(prefix="rt-") as folder:
        monkeypatch.setenv("XDG_RUNTIME_DIR", folder)
        yield Path(folder)


class Fleet:
    """Three vehicles in the air as a flight tells of them, which do what they are told two ticks later."""

    def __init__(self):
        self.swarm = Swarm.of((1, 2, 3))
        self.swarm.heartbeat_ns[:] = 1
        self.swarm.autopilot[:] = PX4
        self.swarm.armed[:] = True
        self.swarm.position_ned[:] = 0.0, 0.0, -9.75
        self.released = self.swarm.armed & False
        self.phase = Phase.MISSION
        self.mode("offboard")

    def mode(self, name):
        self.swarm.custom_mode[~self.released] = PX4_MODES[name].custom_mode

    def obey(self, word):
        if word == "land":
            self.phase = Phase.LAND
            self.swarm.armed[~self.released] = False
        elif word == "hold":
            self.phase = Phase.HOLD
            self.mode("hold")
        elif killed(word):
            self.swarm.armed[killed(word) - 1] = False
        else:
            self.released[taken_back(word) - 1] = False
            self.mode("offboard")

    def tick(self):
        return SimpleNamespace(
            swarm=self.swarm,
            state=SimpleNamespace(released=self.released),
            diagnosis=SimpleNamespace(phase=self.phase),
        )


@contextmanager
def under_way(fleet=None, *, ends_after=None):
    """A flight that turns a hundred times a second: the words it was told. ends_after: ticks after its first word."""
    fleet, words, over = fleet or Fleet(), [], threading.Event()

    def turn():
        with ControlSocket(parse(LINK), (1, 2, 3), say=str) as control:
            due = []
            while not over.is_set():
                control.tick(fleet.tick())
                heard = control.take()
                words.extend(heard)
                due.append(heard)
                for word in due[-3] if len(due) > 2 else ():
                    fleet.obey(word)
                if ends_after is not None and words and sum(map(bool, due)) and len(due) - first(due) > ends_after:
                    control.tick(fleet.tick())
                    return
                time.sleep(0.01)

    thread = threading.Thread(target=turn)
    thread.start()
    until(lambda: flying(parse(LINK)))
    try:
        yield words
    finally:
        over.set()
        thread.join()


def first(due):
    return next(place for place, words in enumerate(due) if words)


def until(true, *, within_s=5.0):
    deadline = time.monotonic() + within_s
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.005)


@pytest.mark.wall_clock
@pytest.mark.parametrize("word", ["land", "hold"])
def test_a_flight_takes_the_word_at_a_tick_and_is_watched_until_it_is_done(gcs, word):
    with under_way() as words:
        code, out, err = gcs(word, "--link", LINK)
    assert (code, out, words) == (0, "", [word])
    assert f"the flight of process {os.getpid()} takes '{word}' at tick " in err
    assert err.endswith(f"{word}: done\n")


@pytest.mark.wall_clock
def test_a_flight_that_ends_meanwhile_tells_how_it_ended(gcs):
    with under_way(ends_after=5) as words:
        code, _, err = gcs("land", "--link", "udpin:127.0.0.1:14999")
    assert (code, words) == (0, ["land"])
    assert err.endswith("land: done\n")


@pytest.mark.wall_clock
def test_a_vehicle_in_other_hands_is_left_there_and_the_exit_code_says_that_not_all_have_landed(gcs):
    fleet = Fleet()
    fleet.released[1] = True
    fleet.swarm.custom_mode[1] = PX4_MODES["position"].custom_mode
    with under_way(fleet):
        code, _, err = gcs("land", "--link", LINK)
    assert code == 3
    assert err.endswith("land: done (left in other hands: 2)\n")
    assert fleet.swarm.armed.tolist() == [False, True, False]


@pytest.mark.wall_clock
def test_kill_names_one_vehicle_and_stops_no_other(gcs):
    fleet = Fleet()
    with under_way(fleet) as words:
        code, _, err = gcs("kill", "--link", LINK, "--vehicle", "2", "--yes")
    assert (code, words) == (0, ["kill 2"])
    assert fleet.swarm.armed.tolist() == [True, False, True]
    assert err.endswith("kill: done, 2\n")


@pytest.mark.wall_clock
def test_take_back_hands_a_vehicle_to_the_flight_again(gcs):
    fleet = Fleet()
    fleet.released[2] = True
    fleet.swarm.custom_mode[2] = PX4_MODES["position"].custom_mode
    with under_way(fleet) as words:
        code, _, err = gcs("take-back", "--link", LINK, "--vehicle", "3")
    assert (code, words) == (0, ["take back 3"])
    assert err.endswith("vehicle 3 flies with the others again\n")


@pytest.mark.wall_clock
def test_one_that_does_not_come_back_is_said_so(gcs, monkeypatch):
    monkeypatch.setattr(operating, "RETURN_S", 0.5)
    fleet = Fleet()
    fleet.obey = str.strip
    fleet.released[2] = True
    with under_way(fleet):
        code, _, err = gcs("take-back", "--link", LINK, "--vehicle", "3")
    assert code == 3
    assert err.endswith("gcs: vehicle 3 did not come back to the flight\n")


REFUSED = [
    ("land --vehicle 2", "has this link, and lands as a whole"),
    ("hold --vehicle 2", "has this link, and holds as a whole"),
    ("kill --vehicle 7 --yes", "--vehicle 7: the flight has 1, 2, 3"),
    ("take-back --vehicle 7", "vehicle 7 is not one of this flight, which has 1, 2, 3"),
    ("vehicles", f"the flight of process {os.getpid()} has it; gcs land, hold, kill and take-back reach that one"),
]


@pytest.mark.wall_clock
@pytest.mark.parametrize(("words", "said"), REFUSED, ids=[words for words, _ in REFUSED])
def test_what_a_flight_cannot_do_is_one_sentence_and_exit_code_2(gcs, words, said):
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as taken, under_way() as told:
        taken.bind(("0.0.0.0", 14999))
        code, out, err = gcs(*words.split(), "--link", LINK)
    assert (code, out, told) == (2, "", [])
    assert err.startswith("gcs: ")
    assert said in err


@pytest.mark.wall_clock
def test_a_flight_that_hangs_is_named_with_its_process_and_what_to_do(gcs):
    with ControlSocket(parse(LINK), (1, 2, 3), say=str):
        began = time.monotonic()
        code, _, err = gcs("land", "--link", LINK)
        assert time.monotonic() - began < 2.0
    assert code == 3
    assert f"the flight of process {os.getpid()} has {LINK} and did not answer within 1 s" in err
    assert f"`kill -9 {os.getpid()}`" in err


def typed(*lines, link=LINK):
    """`gcs kill` at a terminal where this is typed: exit code, what was said."""
    keyboard, terminal = pty.openpty()
    process = start(GCS, "kill", "--link", link, stdin=terminal)
    os.write(keyboard, "".join(f"{line}\n" for line in lines).encode())
    _, err = process.communicate(timeout=20)
    os.close(keyboard)
    os.close(terminal)
    return process.returncode, err


@pytest.mark.wall_clock
@pytest.mark.parametrize(
    ("lines", "code", "told"),
    [
        (("KILL", "1 2 3"), 0, ["kill 1", "kill 2", "kill 3"]),
        (("KILL", "1 2"), 2, []),
        (("kill", "1 2 3"), 2, []),
        (("", ""), 2, []),
    ],
    ids=["both", "too-few", "small-letters", "nothing"],
)
def test_on_a_terminal_kill_says_who_would_fall_from_where_and_asks_twice(lines, code, told):
    with under_way() as words:
        ended, err = typed(*lines)
    assert (ended, words) == (code, told)
    assert "vehicle 2: offboard, 9.8 m up" in err
    assert "Type KILL to go on" in err
    if not told:
        assert "nothing was stopped" in err


@pytest.mark.parametrize("options", [(), ("--vehicle", "1"), ("--yes",)], ids=["bare", "no-yes", "nobody"])
def test_without_a_terminal_kill_needs_a_name_and_a_yes(options):
    done = subprocess.run(
        [GCS, "kill", "--link", LINK, *options], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stderr == "gcs: kill without a terminal needs --vehicle and --yes: whoever is in the air falls\n"


# --- the socket


def test_the_socket_is_its_users_alone_and_goes_with_the_flight(runtime):
    with ControlSocket(parse(LINK), (1,), say=str):
        (folder,) = runtime.iterdir()
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700
        (sock,) = folder.glob("*.sock")
        assert stat.S_IMODE(sock.stat().st_mode) == 0o600
        assert flying(parse(LINK)).process == os.getpid()
    assert list(folder.iterdir()) == []
    assert flying(parse(LINK)) is None


def test_a_directory_that_others_can_enter_is_not_used_and_the_flight_goes_on(runtime):
    folder = runtime / f"trustr-{os.getuid()}"
    folder.mkdir()
    folder.chmod(0o777)
    said = []
    with ControlSocket(parse(LINK), (1,), said.append) as control:
        assert control.take() == ()
        assert flying(parse(LINK)) is None
    assert len(said) == 1
    assert "is not a directory of this user alone" in said[0]
    assert list(folder.iterdir()) == []


def test_what_a_dead_process_left_behind_is_thrown_away(runtime):
    with ControlSocket(parse(LINK), (1,), say=str):
        (card,) = runtime.glob("*/*.json")
        process = subprocess.Popen(["true"])
        process.wait()
        left = card.with_name(f"{process.pid}.json")
        left.write_bytes(orjson.dumps({"process": process.pid, "links": ["udpin:0.0.0.0:15000"]}))
        assert flying(parse("udpin:0.0.0.0:15000")) is None
        assert not left.exists()
        assert flying(parse(LINK)) is not None


@pytest.mark.parametrize("content", [b"", b"[]", b"{}", b'{"process": "x", "links": []}', b"\xff"])
def test_a_card_that_makes_no_sense_is_nobodys(runtime, content):
    with ControlSocket(parse(LINK), (1,), say=str):
        (card,) = runtime.glob("*/*.json")
        card.write_bytes(content)
        assert flying(parse(LINK)) is None


@pytest.mark.parametrize(
    ("mine", "same"),
    [
        ("udpin:0.0.0.0:14550", True),
        ("udpin:127.0.0.1:14550", True),
        ("udp://:14550", True),
        ("udpin:0.0.0.0:14549-14550", True),
        ("udpin:0.0.0.0:14551", False),
        ("tcpin:0.0.0.0:14550", False),
        ("udpout:127.0.0.1:14550", False),
        ("serial:/dev/ttyUSB0:57600", True),
        ("/dev/ttyUSB0", True),
        ("serial:/dev/ttyUSB1:57600", False),
    ],
)
def test_a_flight_is_found_by_any_of_its_links_however_they_are_written(mine, same):
    links = [*parse("udpin:0.0.0.0:14550"), *parse("serial:/dev/ttyUSB0:57600")]
    with ControlSocket(links, (1,), say=str):
        assert (flying(parse(mine)) is not None) == same


def test_two_addresses_of_one_port_are_two_links():
    with ControlSocket([Connection("udpin", "127.0.0.1", 14550)], (1,), say=str):
        assert flying(parse("udpin:127.0.0.2:14550")) is None


@pytest.mark.wall_clock
@pytest.mark.parametrize("word", ["fly", "kill", "kill 0", "kill 4", "take back 9", "land now", 7, None, ["land"]])
def test_a_word_that_is_none_is_refused_with_what_is_allowed(word):
    with (
        under_way() as words,
        Call(flying(parse(LINK))) as call,
        pytest.raises(Refused, match=r"allowed|must|not one of"),
    ):
        call.ask(word)
    assert words == []


def test_the_flight_never_waits_for_who_talks_to_it():
    with ControlSocket(parse(LINK), (1,), say=str) as control, Call(flying(parse(LINK))) as call:
        call._socket.sendall(b'{"word": "la')
        began = time.process_time()
        assert all(control.take() == () for _ in range(1000))
        assert time.process_time() - began < 0.5


# --- whole processes


@contextmanager
def served(port, *options, speed=8):
    server = start(FDM, "serve", "demo", "--to", f"udpout:{HOST}:{port}", "--speed", speed, *options)
    try:
        yield
    finally:
        server.send_signal(signal.SIGINT)
        server.communicate(timeout=20)


def free_port():
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as probe:
        probe.bind((HOST, 0))
        return probe.getsockname()[1]


def in_mission(port, out, *options):
    """`gcs fly` in a mission without end."""
    words = ["--link", f"udpin:{HOST}:{port}", "--speed", "8", "--arm", "--yes", "--json", "--out", out]
    process = start(
        GCS, "fly", "demo", "--set", "mission.leg.1.length_m=200", *options, *words, stdin=subprocess.DEVNULL
    )
    for line in process.stderr:
        if "mission" in line:
            return process
    raise AssertionError("it never began")


@pytest.mark.wall_clock
def test_gcs_land_lands_a_flight_under_way_and_gcs_land_again_lands_what_a_killed_one_left(gcs, tmp_path):
    port = free_port()
    link = f"udpin:0.0.0.0:{port}"
    with served(port, "--set", "swarm.rows=1", "--set", "swarm.columns=2", "--set", "swarm.leaders=[1]"):
        fleet = ("--set", "swarm.rows=1", "--set", "swarm.columns=2", "--set", "swarm.leaders=[1]")
        process = in_mission(port, tmp_path / "one", *fleet)
        code, _, err = gcs("land", "--link", link)
        assert code == 0, err
        out, _ = process.communicate(timeout=30)
        assert process.returncode == 0
        assert orjson.loads(out)["problem"] is None
        process = in_mission(port, tmp_path / "two", *fleet)
        process.kill()
        process.communicate(timeout=20)
        code, _, err = gcs("land", "--link", link)
        assert code == 0, err
        assert "land: done by 1, 2\n" in err
