"""`gcs land`, `hold`, `kill` and `take-back` while flights have the links: through their sockets, and to their end."""

import os
import pty
import shutil
import socket
import subprocess
import threading
import time
from contextlib import closing, contextmanager, suppress

import pytest
from flights import GCS
from pymavlink.dialects.v20 import ardupilotmega as dialect
from standing import LINK, Fleet, flying

from gcs import interventions, links, operating
from gcs.control_socket import ControlSocket
from gcs.flight_state import Phase
from wire.connection import parse
from wire.frames import Sender
from wire.modes import PX4_MODES
from wire.signing import SigningKeyError

pytestmark = pytest.mark.usefixtures("cards")


@pytest.mark.wall_clock
@pytest.mark.parametrize("word", ["land", "hold"])
def test_a_flight_takes_the_word_at_a_tick_and_is_watched_until_it_is_done(gcs, word):
    with flying() as words:
        code, out, err = gcs(word, "--link", LINK)
    assert (code, out, words) == (0, "", [word])
    assert f"the flight of process {os.getpid()} takes '{word}' at tick " in err
    assert err.endswith(f"{word}: done\n")


@pytest.mark.wall_clock
def test_a_flight_that_ends_meanwhile_tells_how_it_ended(gcs):
    with flying(ends_after=5) as words:
        code, _, err = gcs("land", "--link", "udpin:127.0.0.1:14999")
    assert (code, words) == (0, ["land"])
    assert err.endswith("land: done\n")


@pytest.mark.wall_clock
def test_a_vehicle_in_other_hands_is_left_there_and_the_exit_code_says_that_not_all_have_landed(gcs):
    fleet = Fleet()
    fleet.released[1] = True
    fleet.swarm.custom_mode[1] = PX4_MODES["position"].custom_mode
    with flying(fleet):
        code, _, err = gcs("land", "--link", LINK)
    assert code == 3
    assert err.endswith("land: done (left in other hands: 2)\n")
    assert fleet.swarm.armed.tolist() == [False, True, False]


@pytest.mark.wall_clock
def test_kill_names_one_vehicle_and_stops_no_other(gcs):
    fleet = Fleet()
    with flying(fleet) as words:
        code, _, err = gcs("kill", "--link", LINK, "--vehicle", "2", "--yes")
    assert (code, words) == (0, ["kill 2"])
    assert fleet.swarm.armed.tolist() == [True, False, True]
    assert err.endswith("kill: done, 2\n")


@pytest.mark.wall_clock
def test_take_back_hands_a_vehicle_to_the_flight_again(gcs):
    fleet = Fleet()
    fleet.released[2] = True
    fleet.swarm.custom_mode[2] = PX4_MODES["position"].custom_mode
    with flying(fleet) as words:
        code, _, err = gcs("take-back", "--link", LINK, "--vehicle", "3")
    assert (code, words) == (0, ["take back 3"])
    assert err.endswith("vehicle 3 flies with the others again\n")


@pytest.mark.wall_clock
def test_one_that_does_not_come_back_is_said_so(gcs, monkeypatch):
    monkeypatch.setattr(operating, "RETURN_S", 0.5)
    fleet = Fleet()
    fleet.obey = str.strip
    fleet.released[2] = True
    with flying(fleet):
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
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as taken, flying() as told:
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


@pytest.fixture
def keyboard(monkeypatch):
    """A terminal's other end: what is written there has been typed."""
    keyboard, terminal = pty.openpty()
    with os.fdopen(keyboard, "wb", buffering=0) as typed, os.fdopen(terminal) as stdin:
        monkeypatch.setattr("sys.stdin", stdin)
        yield typed


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
def test_on_a_terminal_kill_says_who_would_fall_from_where_and_asks_twice(gcs, keyboard, lines, code, told):
    keyboard.write("".join(f"{line}\n" for line in lines).encode())
    with flying() as words:
        ended, _, err = gcs("kill", "--link", LINK)
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


# --- several links


OTHER = "udpin:0.0.0.0:14998"


@pytest.fixture
def quick(monkeypatch):
    """Whoever is not heard at once is not there."""
    monkeypatch.setattr(interventions, "HEAR_S", 0.2)
    monkeypatch.setattr(interventions, "SILENT_S", 0.3)


@pytest.mark.wall_clock
@pytest.mark.parametrize("word", ["land", "hold"])
def test_of_several_flights_each_is_told(gcs, word):
    with flying() as words, flying(link=OTHER) as others:
        code, _, err = gcs(word, "--link", LINK, "--link", OTHER)
    assert (code, words, others) == (0, [word], [word])
    assert err.count(f"{word}: done\n") == 2


@pytest.mark.wall_clock
def test_a_flight_that_hangs_keeps_no_other_from_being_told_and_the_exit_code_is_the_worst(gcs):
    with ControlSocket(parse(LINK), (1,), say=str), flying(link=OTHER) as words:
        code, _, err = gcs("land", "--link", LINK, "--link", OTHER)
    assert (code, words) == (3, ["land"])
    assert f"has {LINK} and did not answer within 1 s" in err
    assert err.endswith("land: done\n")


@pytest.mark.wall_clock
def test_a_flight_that_refuses_keeps_no_other_from_being_told(gcs):
    landing = Fleet()
    landing.phase = Phase.LAND
    with flying(landing) as deaf, flying(link=OTHER) as words:
        code, _, err = gcs("hold", "--link", LINK, "--link", OTHER)
    assert (code, deaf, words) == (2, [], ["hold"])
    assert "gcs: the flight is landing, and goes on landing: hold comes too late\n" in err


@pytest.mark.wall_clock
@pytest.mark.usefixtures("quick")
def test_links_that_no_flight_has_are_stepped_in_on_besides(gcs):
    with flying() as words, closing(Vehicle()) as vehicle:
        code, _, err = gcs("land", "--link", LINK, "--link", vehicle.link)
    assert (code, words) == (0, ["land"])
    assert "land: done by 9\n" in err
    assert err.endswith("land: done\n")


@pytest.mark.wall_clock
@pytest.mark.parametrize("command", ["kill --vehicle 1 --yes", "take-back --vehicle 1"])
def test_what_is_for_one_flight_alone_is_refused_where_links_are_not_all_its_own(gcs, command):
    with flying() as words:
        code, _, err = gcs(*command.split(), "--link", LINK, "--link", OTHER)
    assert (code, words) == (2, [])
    assert f"not all of them are one flight's (process {os.getpid()}): {command.split()[0]} one at a time" in err


# --- where a flight has gone, or somebody else is


class Vehicle(threading.Thread):
    """Vehicle 9, on the ground, in front of a port that we call: it answers whoever speaks to it with a heartbeat."""

    def __init__(self):
        super().__init__(daemon=True)
        self._udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._udp.bind(("127.0.0.1", 0))
        self.link = f"udpout:127.0.0.1:{self._udp.getsockname()[1]}"
        self._over = threading.Event()
        self.start()

    def run(self):
        sender = Sender(9, 1)
        self._udp.settimeout(0.05)
        while not self._over.is_set():
            with suppress(TimeoutError):
                _, station = self._udp.recvfrom(2048)
                self._udp.sendto(sender.pack(dialect.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)), station)

    def close(self):
        self._over.set()
        self.join()
        self._udp.close()


@pytest.mark.wall_clock
@pytest.mark.usefixtures("quick")
def test_where_the_flight_ends_before_all_is_done_its_vehicles_are_landed_without_it(gcs):
    fleet = Fleet()
    fleet.obey = str.strip
    with closing(Vehicle()) as vehicle, flying(fleet, link=vehicle.link, ends_after=5):
        code, _, err = gcs("land", "--link", vehicle.link)
    assert code == 0
    assert "the flight has ended before that; going on without it\n" in err
    assert err.endswith("land: done by 9\n")


@contextmanager
def held(port, *, seconds):
    """Somebody has this port, for so long."""
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as taken:
        taken.bind(("127.0.0.1", port))
        timer = threading.Timer(seconds, taken.close)
        timer.start()
        try:
            yield
        finally:
            timer.cancel()
            timer.join()


@pytest.mark.wall_clock
@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("word", ["land", "hold"])
def test_a_port_that_is_given_back_soon_is_waited_for(gcs, word):
    with held(14997, seconds=0.5):
        code, _, err = gcs(word, "--link", "udpin:127.0.0.1:14997")
    assert code == 3
    assert "udpin:127.0.0.1:14997: Address already in use; trying again for 10 s\n" in err
    assert err.endswith("gcs: nobody is heard\n")


@pytest.mark.wall_clock
def test_one_that_is_not_is_refused_with_what_to_do(gcs, monkeypatch):
    monkeypatch.setattr(links, "GIVEN_BACK_S", 0.2)
    with held(14997, seconds=60.0):
        code, _, err = gcs("land", "--link", "udpin:127.0.0.1:14997")
    assert code == 2
    assert err.endswith("gcs: udpin:127.0.0.1:14997: Address already in use; end what listens there\n")


@pytest.mark.wall_clock
def test_one_that_is_not_keeps_no_flight_from_being_told_and_watched(gcs, monkeypatch):
    monkeypatch.setattr(links, "GIVEN_BACK_S", 0.2)
    with held(14997, seconds=60.0), flying() as words:
        code, _, err = gcs("land", "--link", LINK, "--link", "udpin:127.0.0.1:14997")
    assert (code, words) == (2, ["land"])
    assert err.endswith("end what listens there\nland: done\n")


@pytest.mark.wall_clock
def test_a_device_that_is_not_there_is_not_waited_for(gcs):
    began = time.monotonic()
    code, _, err = gcs("land", "--link", "serial:/dev/nothing")
    assert (code, time.monotonic() - began < 5.0) == (2, True)
    assert "trying again" not in err


def empty(memory):
    memory.write_bytes(b"")


def another_kind(memory):
    memory.mkdir()


@pytest.mark.wall_clock
@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("spoilt", [empty, another_kind])
def test_a_spoilt_memory_of_signing_keeps_nobody_from_landing(gcs, tmp_path, spoilt):
    (tmp_path / "key").write_text("swordfish")
    spoilt(tmp_path / "key.steps-in")
    with closing(Vehicle()) as vehicle:
        code, _, err = gcs("land", "--link", vehicle.link, "--signing-key", tmp_path / "key")
    assert code == 3  # the vehicle does not sign
    assert "going on without it, by this computer's clock\n" in err
    assert "gcs: nobody is heard (frames refused: " in err


def test_a_spoilt_memory_keeps_everybody_from_taking_off(tmp_path):
    (tmp_path / "key").write_text("swordfish")
    empty(tmp_path / "key.flies")
    with pytest.raises(SigningKeyError), links.opened([], (1,), purpose=links.FLIES, signing_key=tmp_path / "key"):
        pass


def test_a_memory_that_could_not_be_written_in_the_end_is_told(tmp_path, capsys):
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "key").write_text("swordfish")
    with links.opened([], (1,), purpose=links.FLIES, signing_key=folder / "key"):
        shutil.rmtree(folder)
    words = capsys.readouterr().err
    assert words == f"gcs: signing memory {folder / 'key.flies'}: cannot be written: No such file or directory\n"


def test_who_flies_and_who_steps_in_or_listens_keep_apart_memories_and_the_same_one_is_nobodys_twice(tmp_path, capsys):
    key = tmp_path / "key"
    key.write_text("swordfish")
    with links.opened([], (1,), purpose=links.FLIES, signing_key=key):
        for purpose in (links.STEPS_IN, links.LISTENS):
            with links.opened([], (1,), purpose=purpose, signing_key=key):
                pass
        assert capsys.readouterr().err == ""
        with (
            pytest.raises(SigningKeyError, match="is in use by another program"),
            links.opened([], (1,), purpose=links.FLIES, signing_key=key),
        ):
            pass
