"""`gcs vehicles`, and the listening before anybody is armed: who is there, told without sending anything."""

import math
import signal
import socket
import subprocess
import time
from contextlib import ExitStack, closing

import orjson
import pytest
from flights import GCS, start
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs.vehicles import Ear, table
from wire.frames import Framer, Sender
from wire.modes import ARDUPILOT, PX4, PX4_MODES
from wire.signing import Signer, read_key

HOST = "127.0.0.1"
ARMED, SIX = dialect.MAV_MODE_FLAG_SAFETY_ARMED, dialect.MAV_TYPE_HEXAROTOR
KEYS = {
    "system", "autopilot", "type", "mode", "armed", "latitude_deg", "longitude_deg", "height_m", "speed_m_s",
    "battery", "satellites", "accuracy_m", "link", "messages_per_s", "loss",
}  # fmt: skip


def beat(*, autopilot=PX4, kind=2, mode=PX4_MODES["hold"].custom_mode, armed=False):
    return dialect.MAVLink_heartbeat_message(kind, autopilot, ARMED * armed, mode, 4, 3)


STATION = beat(autopilot=dialect.MAV_AUTOPILOT_INVALID, kind=dialect.MAV_TYPE_GCS, mode=0)


def heard(*said, system=1, component=1):
    """An ear that has taken in (seconds, message) of one vehicle."""
    ear, sender = Ear(), Sender(system, component)
    for time_s, message in said:
        ear.take(Framer().frames(round(time_s * 1e9), sender.pack(message)))
    return ear


def vehicle(*said, now_s=10.0):
    return heard(*said).vehicle(1, round(now_s * 1e9), link="here", loss=0.0)


def test_of_a_heartbeat_alone_the_rest_is_unknown_and_not_zero():
    one = vehicle((0.0, beat()))
    assert (one.autopilot, one.type, one.mode, one.armed) == ("PX4", "quadrotor", "hold", False)
    assert one.height_m is one.speed_m_s is one.battery is one.satellites is one.accuracy_m is one.latitude_deg is None


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        (beat(autopilot=ARDUPILOT, kind=SIX, mode=4, armed=True), ("ArduPilot", "hexarotor", "guided", True)),
        (beat(autopilot=ARDUPILOT, mode=77), ("ArduPilot", "quadrotor", "mode 77", False)),
        (beat(autopilot=0, mode=5), ("generic", "quadrotor", "mode 5", False)),
        (beat(autopilot=99, kind=199), ("autopilot 99", "type 199", f"mode {PX4_MODES['hold'].custom_mode}", False)),
    ],
)
def test_autopilot_type_and_mode_are_in_words_and_in_numbers_where_we_have_none(message, expected):
    one = vehicle((0.0, message))
    assert (one.autopilot, one.type, one.mode, one.armed) == expected


def test_place_battery_satellites_and_accuracy_are_told_in_their_units():
    one = vehicle(
        (0.0, beat()),
        (0.1, dialect.MAVLink_global_position_int_message(100, 411234567, -811234567, 300_000, 9_750, 0, 0, 0, 0)),
        (0.2, dialect.MAVLink_gps_raw_int_message(0, 3, 411234567, -811234567, 0, 0, 0, 0, 0, 14, h_acc=800)),
        (0.3, dialect.MAVLink_sys_status_message(0, 0, 0, 0, 0, 0, 77, 0, 0, 0, 0, 0, 0)),
        (0.4, dialect.MAVLink_local_position_ned_message(100, 1, 2, -9.75, 3.0, 4.0, 0.0)),
    )
    assert (one.latitude_deg, one.longitude_deg, one.height_m) == (41.1234567, -81.1234567, 9.75)
    assert (one.battery, one.satellites, one.accuracy_m, one.speed_m_s) == (0.77, 14, 0.8, 5.0)


def test_what_a_receiver_does_not_know_is_unknown():
    one = vehicle(
        (0.0, beat()), (0.1, dialect.MAVLink_gps_raw_int_message(0, 0, 0, 0, 0, 65535, 65535, 65535, 65535, 255))
    )
    assert one.satellites is one.accuracy_m is one.latitude_deg is None


def test_messages_a_second_count_from_when_it_was_first_heard():
    assert vehicle(*((5.0 + tick / 10, beat()) for tick in range(50)), now_s=10.0).messages_per_s == 10.0


ROWS = [("id", "mode", "armed", "battery"), ("1", "altitude hold", "armed", "–"), ("10", "hold", "disarmed", "–")]


def test_a_column_that_nobody_told_anything_for_is_left_out():
    assert table(ROWS, math.inf) == [
        "id  mode           armed",
        "1   altitude hold  armed",
        "10  hold           disarmed",
    ]


def test_what_a_line_has_no_room_for_stands_below_and_no_word_is_broken():
    assert table(ROWS, 25) == [
        "id  mode", "1   altitude hold", "10  hold",
        "id  armed", "1   armed", "10  disarmed",
    ]  # fmt: skip
    assert table(ROWS, 27) == table(ROWS, math.inf)
    assert max(map(len, table(ROWS, 27))) == 27
    assert table(ROWS, 3) == table(ROWS, 25)


def test_a_companion_computer_and_the_truth_of_a_simulated_vehicle_are_no_vehicle():
    assert heard((0.0, beat()), component=191).roster.swarms == {}
    assert heard((0.0, beat()), component=200).roster.swarms == {}


def test_a_vehicle_is_there_from_its_heartbeat_on():
    ear = heard((0.0, dialect.MAVLink_local_position_ned_message(100, 1, 2, -3, 0, 0, 0)))
    assert ear.roster.swarms == {}


# --- over UDP


class Crowd:
    """Whoever speaks to one port: each from a socket of its own; counts what comes back."""

    def __init__(self, port, *voices, signer=None):
        """voices: (system, component, message)"""
        self._to, self._signer = (HOST, port), signer
        self._voices = []
        for system, component, message in voices:
            speaker = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            speaker.setblocking(False)
            self._voices.append((speaker, Sender(system, component), message))
        self.received = []

    def speak(self):
        for speaker, sender, message in self._voices:
            frame = sender.pack(message)
            speaker.sendto(frame if self._signer is None else self._signer.sign(frame), self._to)
            try:
                while True:
                    self.received.append(speaker.recv(2048))
            except (BlockingIOError, ConnectionRefusedError):
                continue

    def close(self):
        for speaker, _, _ in self._voices:
            speaker.close()


def free_port():
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as probe:
        probe.bind((HOST, 0))
        return probe.getsockname()[1]


def spoken_to(words, *voices, signer=None, until=lambda _process, _took_s: None):
    """A command while these speak: exit code, stdout, stderr, datagrams that it sent."""
    port = free_port()
    with closing(Crowd(port, *voices, signer=signer)) as crowd:
        process = start(GCS, *words, "--link", f"udpin:{HOST}:{port}", stdin=subprocess.DEVNULL)
        began = time.monotonic()
        while process.poll() is None:
            assert time.monotonic() - began < 30
            crowd.speak()
            until(process, time.monotonic() - began)
            time.sleep(0.05)
        crowd.speak()
        out, err = process.communicate(timeout=20)
        assert "Traceback" not in err
        return process.returncode, out, err, crowd.received


LISTEN = ("vehicles", "--seconds", "1.5")


@pytest.mark.wall_clock
def test_it_lists_whoever_speaks_and_sends_nothing():
    voices = ((1, 1, beat()), (7, 1, beat(autopilot=ARDUPILOT, mode=4, armed=True)), (255, 190, STATION))
    code, out, _, sent = spoken_to(LISTEN, *voices)
    assert (code, sent) == (0, [])
    head, first, second, station = out.splitlines()
    assert head.split()[:5] == ["id", "autopilot", "type", "mode", "armed"]
    assert first.split()[:4] == ["1", "PX4", "quadrotor", "hold"]
    assert second.split()[:5] == ["7", "ArduPilot", "quadrotor", "guided", "armed"]
    assert station.startswith("ground station 255.190 is heard from 127.0.0.1:")


@pytest.mark.wall_clock
def test_for_programs_it_is_one_object_of_json():
    code, out, _, _ = spoken_to((*LISTEN, "--json"), (3, 1, beat()), (3, 1, beat()), (250, 190, STATION))
    told = orjson.loads(out)
    assert code == 0
    assert out.count("\n") == 1
    assert told.keys() == {"vehicles", "ground_stations", "duplicates", "refused"}
    (one,) = told["vehicles"]
    assert one.keys() == KEYS
    assert one["system"] == 3
    assert one["link"].startswith("127.0.0.1:")
    assert 10 < one["messages_per_s"] < 21
    assert one["loss"] == 0.0
    assert told["duplicates"] == [3]
    assert [(station["system"], station["component"]) for station in told["ground_stations"]] == [(250, 190)]


@pytest.mark.wall_clock
def test_two_of_one_name_are_said_so():
    _, out, _, _ = spoken_to(LISTEN, (3, 1, beat()), (3, 1, beat()))
    assert "two vehicles call themselves 3: give each an id of its own\n" in out


@pytest.mark.wall_clock
def test_where_nobody_speaks_the_exit_code_is_3():
    code, out, _, _ = spoken_to(("vehicles", "--seconds", "0.3"))
    assert (code, out) == (3, "nobody is heard\n")


@pytest.mark.wall_clock
def test_ctrl_c_is_enough_heard_and_no_error():
    pressed = []

    def enough(process, took_s):
        if took_s > 2.5 and not pressed:
            pressed.append(process.send_signal(signal.SIGINT))

    code, out, err, _ = spoken_to(("vehicles", "--seconds", "60"), (1, 1, beat()), until=enough)
    assert (code, err) == (0, "")
    assert out.splitlines()[1].startswith("1 ")


@pytest.mark.wall_clock
def test_with_a_key_only_what_is_signed_is_heard_and_the_rest_is_counted(tmp_path):
    key = tmp_path / "key"
    key.write_text("a passphrase")
    words = (*LISTEN, "--signing-key", str(key))
    code, out, _, _ = spoken_to(words, (1, 1, beat()))
    assert code == 3
    assert "nobody is heard\nframes refused: " in out
    assert " unsigned" in out
    code, out, _, _ = spoken_to(words, (1, 1, beat()), signer=Signer(read_key(key)))
    assert code == 0
    assert {path.name for path in tmp_path.iterdir()} == {"key"}


# --- before arming


def refused(*voices):
    """`gcs fly --arm` in front of these, who are refused before anything is sent."""
    code, out, err, sent = spoken_to(("fly", "demo", "--speed", "2", "--arm", "--yes", "--out", "/nowhere"), *voices)
    assert (code, out, sent) == (2, "", [])
    return err


@pytest.mark.wall_clock
def test_two_vehicles_of_one_name_are_not_armed():
    assert (
        refused((3, 1, beat()), (3, 1, beat())) == "gcs: two vehicles call themselves 3: give each an id of its own\n"
    )


@pytest.mark.wall_clock
@pytest.mark.parametrize(
    ("message", "mode"),
    [
        (beat(mode=PX4_MODES["offboard"].custom_mode, armed=True), "offboard"),
        (beat(autopilot=ARDUPILOT, mode=4, armed=True), "guided"),
    ],
    ids=["px4", "ardupilot"],
)
def test_a_vehicle_that_somebody_steers_already_is_refused_with_their_name(message, mode):
    words = refused((2, 1, message), (250, 190, STATION))
    assert words.startswith(f"gcs: vehicle 2 already flies set-points ({mode}): ground station 250.190 at 127.0.0.1:")
    assert words.endswith(" steers it; end that first\n")


@pytest.mark.wall_clock
def test_without_arm_the_same_is_said():
    voices = [(system, 1, beat()) for system in range(1, 7)]
    code, _, err, sent = spoken_to(("fly", "demo", "--speed", "2"), *voices, (3, 1, beat()))
    assert (code, sent) == (0, [])
    assert "two vehicles call themselves 3" in err


@pytest.mark.wall_clock
def test_over_a_line_that_is_called_vehicles_are_heard_too():
    with ExitStack() as stack:
        listener = stack.enter_context(closing(socket.create_server((HOST, 0))))
        link = f"tcp:{HOST}:{listener.getsockname()[1]}"
        process = start(GCS, "vehicles", "--seconds", "1.5", "--link", link)
        line = stack.enter_context(closing(listener.accept()[0]))
        sender = Sender(4, 1)
        while process.poll() is None:
            try:
                line.sendall(sender.pack(beat()))
            except (BrokenPipeError, ConnectionResetError):
                break
            time.sleep(0.05)
        out, _ = process.communicate(timeout=20)
    assert process.returncode == 0
    assert f" {link} " in out
