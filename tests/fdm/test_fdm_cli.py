"""The fdm command as people and scripts run it: a process, its words and its exit code."""

import contextlib
import signal
import socket
import subprocess
import sys
import time

import pytest
from clients import REQUEST, VERSION, Station, command

from fdm.cli import app
from fdm.world import World
from scenarios import load
from wire.connection import ConnectionRefused
from wire.frames import Framer, decode
from wire.signing import Signer, read_key

FDM = [sys.executable, "-c", "from fdm.cli import main; main()"]


@contextlib.contextmanager
def listening():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        udp.bind(("127.0.0.1", 0))
        udp.settimeout(4.0)
        yield udp, f"udpout:127.0.0.1:{udp.getsockname()[1]}"


@pytest.fixture
def run(capsys):
    """Run a command that must end by itself: (exit code, stdout, stderr)."""

    def run_it(*arguments):
        with pytest.raises(SystemExit) as ended:
            sys.exit(app(list(arguments)))
        return ended.value.code, *capsys.readouterr()

    return run_it


@pytest.mark.wall_clock
@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM])
def test_serve_flies_until_it_is_told_to_stop(stop):
    with listening() as (udp, to):
        process = subprocess.Popen(
            [*FDM, "serve", "demo", "--to", to, "--speed", "2"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        try:
            client, deadline = Station(), time.monotonic() + 4.0
            while not client.all("HEARTBEAT", system=6) and time.monotonic() < deadline:
                client.read(udp.recv(2048))
            assert {message.get_srcSystem() for _, message in client.heard} == {1, 2, 3, 4, 5, 6}
            process.send_signal(stop)
            out, words = process.communicate(timeout=4.0)
        finally:
            process.kill()
            process.wait()
    assert process.returncode == 0
    assert out == ""
    assert words.splitlines() == [f"6 vehicles send to {to} (px4, shared ports, speed 2); Ctrl-C stops", "stopped"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nope"], ["nope", "demo, emergency, transit"]),
        (["demo", "--to", "hello"], ["'hello'", "udpout:127.0.0.1:14550"]),
        (["demo", "--to", "ipx:127.0.0.1:14550"], ["ipx", "udpout"]),
        (["demo", "--to", "serial:/dev/ttyUSB0:57600", "--ports", "separate"], ["a serial line is one"]),
        (["demo", "--to", "serial:/dev/no-such-line:57600"], ["/dev/no-such-line"]),
        (["demo", "--signing-key", "/no/such/key"], ["/no/such/key"]),
        (["demo", "--to", "udpout:127.0.0.1:0"], ["ports must be 1 to 65535"]),
        (["demo", "--to", "udpout:127.0.0.1:14550-14555"], ["one port"]),
        (["demo", "--to", "udpout:127.0.0.1:65533", "--ports", "separate"], ["65538"]),
        (["demo", "--to", "udpout:256.0.0.1:14550"], ["256.0.0.1"]),
        (["demo", "--speed", "0"], ["--speed", "above 0"]),
        (["demo", "--speed", "-2"], ["--speed", "above 0"]),
        (["demo", "--speed", "nan"], ["--speed nan"]),
        (["demo", "--speed", "inf"], ["--speed inf"]),
        (["demo", "--seed", "-1"], ["--seed -1"]),
        (["demo", "--set", "swarm.rows=0"], ["swarm.rows = 0"]),
        (["demo", "--set", "swarm.raws=2"], ["swarm.raws", "did you mean rows?"]),
        (["demo", "--set", "nonsense"], ["section.key=value"]),
    ],
)
def test_bad_input_is_refused_with_one_sentence_and_code_2(run, arguments, words):
    code, out, said = run("serve", *arguments)
    assert (code, out) == (2, "")
    assert said.startswith("fdm: ")
    assert len(said.splitlines()) == 1
    for word in words:
        assert word in said


ONE = ("--set", "swarm.rows=1", "--set", "swarm.columns=1", "--set", "swarm.leaders=[1]", "--no-fault")


@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM])
def test_whoever_stops_it_while_it_builds_need_not_ask_twice(run, monkeypatch, stop):
    def build(scenario, **options):
        signal.raise_signal(stop)
        return World(scenario, **options)

    monkeypatch.setattr("fdm.world.World", build)
    handlers = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    with listening() as (_, to):
        code, out, said = run("serve", "demo", "--to", to, *ONE)
    assert (code, out) == (0, "")
    assert said.splitlines() == [f"1 vehicle sends to {to} (px4, shared ports, speed 1); Ctrl-C stops", "stopped"]
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == handlers


class Turns:
    """What happens in each turn of a server, one after the other."""

    def __init__(self, *turns):
        self.turns = list(turns)

    def __call__(self):
        self.turns.pop(0)()


def test_however_it_ends_the_port_and_the_memory_of_signing_are_given_back(monkeypatch, tmp_path):
    key = tmp_path / "key"
    key.write_text("correct horse battery staple\n")
    monkeypatch.setattr("fdm.server.Server.turn", Turns(lambda: None, lambda: 1 // 0))
    with listening() as (udp, to):
        address = udp.getsockname()
    to = to.replace("udpout", "udpin")
    with pytest.raises(ZeroDivisionError):
        app(["serve", "demo", "--to", to, "--signing-key", str(key), *ONE])
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as again:
        again.bind(address)
    (memory,) = tmp_path.glob("key.vehicles-*[0-9]")
    Signer(read_key(key), memory=memory)


def test_a_memory_of_signing_that_cannot_be_written_is_said_when_it_begins_and_at_the_end(run, monkeypatch, tmp_path):
    key = tmp_path / "key"
    key.write_text("correct horse battery staple\n")
    signers = []

    class Full(Signer):
        def __init__(self, *arguments, **options):
            super().__init__(*arguments, **options)
            signers.append(self)

        def save(self):
            super().save()
            self.trouble = "signing memory: is full"

    def turn(trouble):
        def happens():
            signers[0].trouble = trouble

        return happens

    monkeypatch.setattr("wire.signing.Signer", Full)
    turns = map(turn, (None, "first", "first", None, "second", "second"))
    monkeypatch.setattr("fdm.server.Server.turn", Turns(*turns, lambda: signal.raise_signal(signal.SIGTERM)))
    with listening() as (_, to):
        code, _, said = run("serve", "demo", "--to", to, "--signing-key", str(key), *ONE)
    assert code == 0
    assert said.splitlines()[1:] == ["first", "second", "signing memory: is full", "stopped"]


def test_two_programs_do_not_share_a_memory_of_signing(run, tmp_path):
    key = tmp_path / "key"
    key.write_text("correct horse battery staple\n")
    with listening() as (_, to):
        place = to.replace(":", "-")
        memory = Signer(read_key(key), memory=tmp_path / f"key.vehicles-{place}")
        code, _, said = run("serve", "demo", "--to", to, "--signing-key", str(key), *ONE)
        memory.save()
    assert code == 2
    assert said.endswith("is in use by another program\n")


def test_a_port_in_use_is_refused_with_one_sentence_and_code_2(run):
    with listening() as (_, to):
        code, _, said = run("serve", "demo", "--to", to.replace("udpout", "udpin"))
    assert code == 2
    assert "in use" in said
    assert len(said.splitlines()) == 1


@pytest.mark.parametrize(
    "arguments",
    [
        ["serve"],
        ["fly"],
        ["serve", "demo", "--speed", "abc"],
        ["serve", "demo", "--bogus"],
        ["serve", "a", "b"],
        ["serve", "demo", "--autopilot", "paparazzi"],
    ],
)
def test_what_is_no_command_ends_with_code_2_and_words(run, arguments):
    code, out, said = run(*arguments)
    assert code == 2
    assert said or out


def test_help_names_every_option(run):
    code, out, _ = run("serve", "--help")
    assert code == 0
    for option in ("--to", "--ports", "--autopilot", "--stock-failsafes", "--signing-key", "--no-fault", "--speed"):
        assert option in out
    for option in ("--seed", "--set"):
        assert option in out


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ([], {"seed": 1, "autopilot": "px4", "stock_failsafes": False}),
        (["--autopilot", "ardupilot", "--seed", "7"], {"seed": 7, "autopilot": "ardupilot", "stock_failsafes": False}),
        (["--stock-failsafes"], {"seed": 1, "autopilot": "px4", "stock_failsafes": True}),
    ],
)
def test_what_is_asked_for_is_what_is_built(run, monkeypatch, arguments, told):
    built = []

    def build(scenario, **options):
        built.append((scenario.title, options))
        raise ConnectionRefused("that is all")

    monkeypatch.setattr("fdm.world.World", build)
    assert run("serve", "emergency", *arguments)[0] == 2
    assert built == [(load("emergency").title, told)]


@pytest.mark.parametrize(("arguments", "faults"), [([], 1), (["--no-fault"], 0)])
def test_everything_is_healthy_where_that_is_asked_for(run, monkeypatch, arguments, faults):
    seen = []

    def build(scenario, **_options):
        seen.append(len(scenario.fault))
        raise ConnectionRefused("that is all")

    monkeypatch.setattr("fdm.world.World", build)
    run("serve", "emergency", *arguments)
    assert seen == [faults]


@pytest.mark.wall_clock
def test_with_a_key_the_vehicles_sign_and_obey_nobody_without_it(tmp_path):
    key = tmp_path / "swarm.key"
    key.write_text("correct horse battery staple\n")
    station, signer = Station(), Signer(read_key(key))
    with listening() as (udp, to):
        arguments = ["serve", "demo", "--to", to, "--autopilot", "ardupilot", "--signing-key", str(key)]
        process = subprocess.Popen([*FDM, *arguments], stderr=subprocess.DEVNULL)
        try:
            deadline = time.monotonic() + 8.0
            asked, answered = False, []
            while not answered and time.monotonic() < deadline:
                data, sender = udp.recvfrom(2048)
                assert data[2] == 1, "every frame is signed"
                for frame in Framer().frames(0, data):
                    assert signer.refusal(frame) is None
                    answered += [decode(frame)] if frame.message == VERSION else []
                if not asked:
                    asked = True
                    udp.sendto(station.pack(command(REQUEST, VERSION, system=2)), sender)
                    udp.sendto(signer.sign(station.pack(command(REQUEST, VERSION, system=3))), sender)
            assert [message.get_srcSystem() for message in answered] == [3]
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(timeout=4.0)
    assert process.returncode == 0
    assert len(list(tmp_path.glob("swarm.key.vehicles-*[0-9]"))) == 1
