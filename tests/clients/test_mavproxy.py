"""MAVProxy, as somebody types into it, flies an ArduCopter over UDP; its log is a recording of ours."""

import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest
from in_flight import LOOPBACK, process, vehicle
from mcap.reader import make_reader

from fdm.parameters import table
from gcs.console import stdout
from gcs.recording.importing import import_tlog
from wire.frames import LONGEST

pytestmark = pytest.mark.wall_clock

LIMIT_S = 15.0
CRUISE, WITHIN = 3.0, 0.1  # m/s
MAVPROXY = Path(sys.executable).with_name("mavproxy.py")
LOG = "flight.tlog"
OPTIONS = [f"--logfile={LOG}", "--streamrate=10", "--heartbeat-rate=3"]
"""A heartbeat every simulated second, for the simulation is as much faster than the client."""


class Console:
    """What a person sees, and where they type."""

    def __init__(self, running, screen):
        self.running = running
        self.screen = screen
        self.read = 0
        """Bytes of the screen that were looked at."""

    def type(self, line):
        self.running.stdin.write(line + "\n")
        self.running.stdin.flush()

    def see(self, pattern, *, limit_s=LIMIT_S):
        """Wait for it below all that was seen before."""
        end = time.monotonic() + limit_s
        while not (found := re.search(pattern, self.screen.read_text(encoding="utf-8", errors="replace")[self.read :])):
            assert self.running.poll() is None, f"it ended:\n{self.shown()}"
            assert time.monotonic() < end, f"{pattern!r} did not come:\n{self.shown()}"
            time.sleep(0.02)
        self.read += found.end()
        return found

    def shown(self):
        """The whole screen, with a mark where we are."""
        text = self.screen.read_text(encoding="utf-8", errors="replace")
        return f"{text[: self.read]}█{text[self.read :]}"

    def ask(self, line, pattern):
        self.type(line)
        return self.see(pattern)


@pytest.fixture
def console(tmp_path):
    """MAVProxy at an ArduCopter that it has just detected."""
    screen = tmp_path / "screen.txt"
    alone = os.environ | {"HOME": str(tmp_path), "PYTHONUNBUFFERED": "1"}
    with vehicle("ardupilot", tmp_path) as port:
        command = [sys.executable, str(MAVPROXY), f"--master=udpin:{LOOPBACK}:{port}", *OPTIONS]
        options = {"stdin": subprocess.PIPE, "text": True, "cwd": tmp_path, "env": alone}
        with process(command, screen, **options) as running:
            try:
                console = Console(running, screen)
                console.see("Detected vehicle 1:1 on link 0")
                yield console
            finally:
                running.stdin.close()


def told(console, field):
    """One field of LOCAL_POSITION_NED [m, m/s], as it was told last."""
    return float(console.ask("status LOCAL_POSITION_NED", rf"LOCAL_POSITION_NED {{.*\b{field} : (\S+?)[,}}]")[1])


def until(true, *, meanwhile=lambda: None):
    """Wait for it, as whoever sits there does."""
    end = time.monotonic() + LIMIT_S
    while not true():
        assert time.monotonic() < end, "it did not happen in time"
        meanwhile()
        time.sleep(0.1)


def set_to(console, name, value):
    """Set a parameter, and see that the vehicle took it over."""
    console.type(f"param set {name} {value}")
    until(lambda: float(console.ask(f"param show {name}", rf"{name} +(\S+)\n")[1]) == value)


def test_it_reads_parameters_changes_modes_and_flies_an_arducopter_from_arming_to_disarming(console, tmp_path):
    """It sends one set-point for each `velocity` that is typed, in the body's frame: this one is headed east."""
    own = table("ardupilot")
    console.see(f"Received {len(own)} parameters")
    console.ask("param fetch", f"Received {len(own)} parameters")
    for parameter in own:
        assert float(console.ask(f"param show {parameter.name}", rf"{parameter.name} +(\S+)\n")[1]) == parameter.value
    set_to(console, "GUID_TIMEOUT", 3.0)
    set_to(console, "LAND_SPEED", 200.0)
    console.type("set streamrate 20")

    console.ask("takeoff 10", "NAV_TAKEOFF: FAILED")
    console.ask("mode guided", "Mode GUIDED")
    console.ask("arm throttle", "COMPONENT_ARM_DISARM: ACCEPTED")
    console.ask("takeoff 10", "NAV_TAKEOFF: ACCEPTED")
    until(lambda: told(console, "z") < -9.8)
    console.ask("disarm", "COMPONENT_ARM_DISARM: FAILED")

    until(lambda: told(console, "vy") > CRUISE - WITHIN, meanwhile=lambda: console.type("velocity 3 0 0"))
    for _ in range(5):
        console.type("velocity 3 0 0")
        assert [told(console, field) for field in ("vx", "vy", "vz")] == pytest.approx([0.0, CRUISE, 0.0], abs=WITHIN)
    console.type("velocity 0 0 0")
    until(lambda: abs(told(console, "vy")) < WITHIN)

    console.ask("land", "DO_LAND_START: UNSUPPORTED")
    console.ask("mode land", "Mode LAND")
    console.see("DISARMED")
    assert told(console, "z") == pytest.approx(0.0, abs=0.1)
    assert "fence breach" not in console.shown()
    assert_its_log_is_imported(tmp_path / LOG)


def assert_its_log_is_imported(log):
    """Every byte of it is a frame, but for one that is being written."""
    recording = log.with_suffix(".mcap")
    assert import_tlog(log, out=recording, console=stdout()) == 0
    with recording.open("rb") as stream:
        (told,) = make_reader(stream).iter_metadata()
    assert int(told.metadata["frames"]) > 1000
    assert int(told.metadata["skipped_bytes"]) < 8 + LONGEST
