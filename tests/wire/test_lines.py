"""TCP lines on loopback and serial lines over pseudo-terminals: they break, come back, and never make anybody wait."""

import os
import select
import socket
import subprocess
import sys
import termios
import tty

import pytest
import serial

from wire.connection import Connection, ConnectionRefused, parse
from wire.lines import CALLERS_AT_MOST, RETRY_S, CallingPort, SerialPort, TcpInPort
from wire.ports import open_port

HOST = "127.0.0.1"
SOON_MS = 2000
"""The kernel's own time for loopback and terminals: `poll` returns much earlier."""


class Time:
    """Seconds that pass when told to."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


@pytest.fixture
def opened():
    """Keeps ports, and closes them after the test."""
    ports = []

    def keep(port):
        ports.append(port)
        return port

    yield keep
    for port in ports:
        port.close()


@pytest.fixture
def free():
    """A loopback port that nobody has."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        probe.bind((HOST, 0))
        return probe.getsockname()[1]


@pytest.fixture
def terminal():
    """(a pseudo-terminal's far end, the name of its near end): a cable with a vehicle on it."""
    far, near = os.openpty()
    tty.setraw(far)
    name = os.ttyname(near)
    os.close(near)
    yield far, name
    os.close(far)


def ready(port):
    """Whether the port says that something waits."""
    poll = select.poll()
    poll.register(port, select.POLLIN)
    return bool(poll.poll(SOON_MS))


def heard(port):
    assert ready(port)
    return b"".join(data for data, _ in port.receive())


def callers(port):
    return TcpInPort(Connection("tcpin", HOST, port))


def calling(port, clock=None):
    return CallingPort(Connection("tcp", HOST, port), monotonic=clock or Time())


# --- TCP


def test_a_caller_and_who_is_called_hear_each_other(opened, free):
    called, caller = opened(callers(free)), opened(calling(free))
    assert ready(called)
    called.receive()
    assert caller.send(b"hello")
    assert heard(called) == b"hello"
    assert called.send(b"hello yourself")
    assert heard(caller) == b"hello yourself"
    assert caller.receive() == []


def test_callers_are_told_apart_and_answered_one_by_one_or_all(opened, free):
    called = opened(callers(free))
    one, other = opened(calling(free)), opened(calling(free))
    assert ready(called)
    called.receive()
    assert one.send(b"1")
    assert other.send(b"2")
    got = called.receive()
    assert sorted(data for data, _ in got) == [b"1", b"2"]
    address = dict(got)
    assert called.send(b"to one", address[b"1"])
    assert called.send(b", to all")
    assert heard(one) == b"to one, to all"
    assert heard(other) == b", to all"
    assert not called.send(b"to nobody", (HOST, 1))


def test_nobody_there_yet_is_no_error_and_is_called_again_each_second(opened, free):
    clock = Time()
    caller = opened(calling(free, clock))
    assert not caller.send(b"hello?")
    assert caller.receive() == []
    called = opened(callers(free))
    assert not caller.send(b"too early to try again")
    clock.now += RETRY_S
    caller.receive()
    assert ready(called)
    called.receive()
    assert caller.send(b"hello")
    assert heard(called) == b"hello"


def test_a_line_that_broke_is_called_again_and_whoever_watches_it_need_not_know(opened, free):
    clock = Time()
    called, caller = callers(free), opened(calling(free, clock))
    watched = caller.fileno()
    assert ready(called)
    called.receive()
    called.close()
    assert ready(caller), "the end of a line is something to be told"
    assert caller.receive() == []
    assert not caller.send(b"hello?")
    again = opened(callers(free))
    clock.now += RETRY_S
    caller.receive()
    assert ready(again)
    again.receive()
    assert again.send(b"back")
    assert caller.fileno() == watched
    assert heard(caller) == b"back"


def test_a_caller_that_hangs_up_is_forgotten_and_its_last_words_are_heard(opened, free):
    called, caller = opened(callers(free)), calling(free)
    assert ready(called)
    called.receive()
    assert caller.send(b"bye")
    caller.close()
    assert heard(called) == b"bye"
    assert not called.send(b"anybody?")
    assert called.receive() == []


def test_callers_beyond_the_most_are_turned_away(opened, free):
    called = opened(callers(free))
    lines = [opened(calling(free)) for _ in range(CALLERS_AT_MOST + 1)]
    assert ready(called)
    called.receive()
    assert called.send(b"welcome")
    assert [heard(line) for line in lines[:-1]] == [b"welcome"] * CALLERS_AT_MOST
    assert heard(lines[-1]) == b""
    assert not lines[-1].send(b"but I")


def test_a_peer_that_does_not_read_holds_up_nobody_and_gets_no_half_frames(opened, free):
    called, caller = opened(callers(free)), opened(calling(free))
    assert ready(called)
    called.receive()
    frame = bytes(range(256)) * 4
    taken = [caller.send(frame) for _ in range(20_000)]
    assert True in taken
    assert not all(taken), "nothing was full"
    got = b""
    while len(got) < sum(taken) * len(frame):
        got += b"".join(data for data, _ in called.receive())
        caller.receive()  # sends the rest of the frame that had begun to leave
    assert got == frame * sum(taken)
    assert caller.send(frame)


def test_a_caller_bounds_its_work_over_a_stream_too(opened, free):
    called, caller = opened(callers(free)), opened(calling(free))
    assert ready(called)
    called.receive()
    assert caller.send(bytes(5000))
    assert ready(called)
    sizes = [[len(data) for data, _ in called.receive(at_most=1)] for _ in range(4)]
    assert sizes == [[2048], [2048], [904], []]
    assert called.receive(at_most=0) == caller.receive(at_most=0) == []


def test_a_tcp_port_that_somebody_has_is_refused_and_free_again_when_closed(opened, free):
    first = callers(free)
    with pytest.raises(ConnectionRefused, match=rf"^tcpin:127\.0\.0\.1:{free}: Address already in use$"):
        callers(free)
    first.close()
    opened(callers(free))


def test_a_host_that_nobody_knows_is_refused_in_one_sentence():
    with pytest.raises(ConnectionRefused, match=r"^tcp:no-such-host\.invalid:5760: [^\n]+$"):
        open_port(Connection("tcp", "no-such-host.invalid", 5760))


# --- serial


def test_a_serial_line_carries_bytes_both_ways_unchanged(opened, terminal):
    far, name = terminal
    port = opened(open_port(parse(f"serial:{name}:115200")[0]))
    everything = bytes(range(256))
    os.write(far, everything)
    assert heard(port) == everything
    assert port.receive() == []
    assert port.send(everything)
    assert os.read(far, 1000) == everything
    assert port.stream


def test_a_serial_line_is_ours_alone(opened, terminal):
    _, name = terminal
    connection = Connection("serial", device=name, bits_per_s=57600)
    opened(SerialPort(connection))
    with pytest.raises(ConnectionRefused, match=rf"^serial:{name}:57600: another program has it open$"):
        SerialPort(connection)


def test_no_such_device_and_no_serial_line_are_refused_in_one_sentence(tmp_path):
    plain = tmp_path / "plain"
    plain.touch()
    for device, words in (("/dev/no-such-device", "there is no such device"), (plain, "this is not a serial line")):
        with pytest.raises(ConnectionRefused, match=rf"^serial:{device}:57600: {words}[^\n]*$"):
            open_port(Connection("serial", device=str(device), bits_per_s=57600))


def test_only_who_opens_a_serial_line_waits_for_the_import_of_pyserial():
    code = "import sys, wire.ports; sys.exit('serial' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_full_serial_line_refuses_and_goes_on_where_it_stopped(opened, terminal):
    far, name = terminal
    port = opened(SerialPort(Connection("serial", device=name, bits_per_s=57600)))
    frame = bytes(range(65))
    taken = [port.send(frame) for _ in range(10_000)]
    assert True in taken
    assert not all(taken), "nothing was full"
    got = b""
    while len(got) < sum(taken) * len(frame):
        got += os.read(far, 65536)
        port.receive()
    assert got == frame * sum(taken)


class Going:
    """A serial.Serial whose device goes while it is being opened, or does not know its speed."""

    def __init__(self, error):
        self.error = error

    def __call__(self, *_, **__):
        raise self.error


ODD_ERRORS = [
    (termios.error(5, "Input/output error"), "Input/output error"),
    (
        ValueError("Failed to set custom baud rate (12345)"),
        "this is not a serial line, or it does not go at that speed",
    ),
]


@pytest.mark.parametrize(("error", "words"), ODD_ERRORS)
def test_a_device_that_goes_while_it_is_being_opened_is_refused_in_one_sentence(monkeypatch, error, words):
    monkeypatch.setattr(serial, "Serial", Going(error))
    with pytest.raises(ConnectionRefused, match=rf"^serial:/dev/ttyUSB0:57600: {words}$"):
        open_port(parse("serial:/dev/ttyUSB0:57600")[0])


@pytest.mark.parametrize(("error", "_words"), ODD_ERRORS)
def test_a_device_that_goes_while_it_is_being_opened_again_is_tried_once_more(
    opened, terminal, monkeypatch, error, _words
):
    clock, (far, name) = Time(), terminal
    port = opened(SerialPort(Connection("serial", device=name, bits_per_s=57600), monotonic=clock))
    port._drop(port._line)
    clock.now += RETRY_S
    with monkeypatch.context() as unplugged:
        unplugged.setattr(serial, "Serial", Going(error))
        assert port.receive() == []
        assert not port.send(b"anybody?")
    clock.now += RETRY_S
    assert port.send(b"hello")
    assert os.read(far, 100) == b"hello"


def test_a_device_that_was_pulled_out_is_opened_again_when_it_is_back(opened, tmp_path):
    clock, plug = Time(), tmp_path / "ttyUSB0"

    def plugged_in():
        far, near = os.openpty()
        tty.setraw(far)
        plug.unlink(missing_ok=True)
        plug.symlink_to(os.ttyname(near))
        os.close(near)
        return far

    far = plugged_in()
    port = opened(SerialPort(Connection("serial", device=str(plug), bits_per_s=57600), monotonic=clock))
    watched = port.fileno()
    os.close(far)
    plug.unlink()
    assert ready(port)
    assert port.receive() == []
    assert not port.send(b"anybody?")
    clock.now += RETRY_S
    assert not port.send(b"still nobody")
    far = plugged_in()
    try:
        clock.now += RETRY_S
        assert port.send(b"hello")
        assert os.read(far, 100) == b"hello"
        os.write(far, b"back")
        assert heard(port) == b"back"
        assert port.fileno() == watched
    finally:
        os.close(far)
