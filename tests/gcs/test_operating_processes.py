"""`gcs land` as a process of its own, beside a flight and after one that was killed."""

import signal
import socket
import subprocess
from contextlib import closing, contextmanager

import orjson
import pytest
from flights import FDM, GCS, start

HOST = "127.0.0.1"


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
