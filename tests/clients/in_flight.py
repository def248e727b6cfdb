"""A simulated vehicle and a real client of it, each a process of its own, both ended whatever happens."""

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

HERE = Path(__file__).parent
LOOPBACK = "127.0.0.1"
SPEED = 3.0
"""Simulated seconds a second: these clients bear it."""
PATIENCE_S = 60.0
"""Real seconds that a client's whole flight may take: three times what it needs."""
FACTS = "facts: "
"""What the line begins with in which a client's script says what it saw, as JSON."""

HEADED_EAST = """
title = "one vehicle for somebody else's ground station"
[swarm]
rows = 1
columns = 1
leaders = [1]
[mission]
cruise_m_s = 1.5
[[mission.leg]]
task = "east"
heading_deg = 90
length_m = 30
"""


def free_port():
    """A number that no socket has at this moment, UDP or TCP."""
    while True:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp, socket.socket() as tcp:
            udp.bind((LOOPBACK, 0))
            with contextlib.suppress(OSError):
                tcp.bind(udp.getsockname())
                return udp.getsockname()[1]


@contextlib.contextmanager
def process(command, log, **options):
    """Leads a group of its own that ends with the block, because clients start helpers; says all it says to `log`."""
    with log.open("w", encoding="utf-8") as said:
        running = subprocess.Popen(command, stdout=said, stderr=said, start_new_session=True, **options)
        try:
            yield running
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(running.pid, signal.SIGKILL)
            running.wait(10)


@contextlib.contextmanager
def vehicle(autopilot, folder, *, speed=SPEED):
    """`fdm serve` with one vehicle; gives the port that it speaks to."""
    told = folder / "one.toml"
    told.write_text(HEADED_EAST, encoding="utf-8")
    port = free_port()
    command = [sys.executable, "-m", "fdm", "serve", str(told), "--to", f"udpout:{LOOPBACK}:{port}"]
    with process([*command, "--autopilot", autopilot, "--speed", f"{speed:g}"], folder / "vehicle.log"):
        yield port


def flown(script, *words, autopilot, folder, speed=SPEED):
    """What a client's script tells of its flight, by name; all that was said, where it did not come to an end."""
    log = folder / "client.log"
    with vehicle(autopilot, folder, speed=speed) as port:
        command = [sys.executable, "-X", "faulthandler", str(HERE / script), str(port), autopilot, *words]
        with process(command, log, cwd=folder) as running:
            try:
                end = f"ended with {running.wait(PATIENCE_S)}"
            except subprocess.TimeoutExpired:
                end = f"was still flying after {PATIENCE_S:g} s"
    said = log.read_text(encoding="utf-8", errors="replace")
    facts = [line.removeprefix(FACTS) for line in said.splitlines() if line.startswith(FACTS)]
    assert end == "ended with 0", f"{script} {end}:\n{said}\n{(folder / 'vehicle.log').read_text(encoding='utf-8')}"
    return SimpleNamespace(**json.loads(facts[-1]))
