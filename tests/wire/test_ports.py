"""UDP ports on loopback: who is answered, who may share a port, and who is kept out of it."""

import socket
import subprocess
import sys

import pytest

from wire.connection import Connection, ConnectionRefused
from wire.ports import UdpPort, open_port

HOST = "127.0.0.1"
INTRUDER = """
import socket, sys
option, host, port = sys.argv[1:]
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as thief:
    if option != "plain":
        thief.setsockopt(socket.SOL_SOCKET, getattr(socket, option), 1)
    try:
        thief.bind((host, int(port)))
    except OSError as error:
        print(error.strerror)
    else:
        print("bound")
"""


@pytest.fixture
def opened():
    """Opens ports, and closes them after the test."""
    ports = []

    def open_one(connection):
        ports.append(open_port(connection))
        return ports[-1]

    yield open_one
    for port in ports:
        port.close()


@pytest.fixture
def free():
    """A loopback port that nobody has."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((HOST, 0))
        return probe.getsockname()[1]


@pytest.fixture
def peers():
    """Two sockets that speak."""
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other,
    ):
        for each in (one, other):
            each.bind((HOST, 0))
            each.setblocking(False)
        yield one, other


def here(kind, port):
    return Connection(kind, HOST, port)


def said(port, **how):
    return [data for data, _ in port.receive(**how)]


def intruder(option, host, port):
    """What another program is told that wants the port too."""
    words = [sys.executable, "-c", INTRUDER, option, host, str(port)]
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()


def test_a_port_that_somebody_has_is_refused_in_one_sentence(opened, free):
    opened(here("udpin", free))
    with pytest.raises(ConnectionRefused, match=rf"^udpin:127\.0\.0\.1:{free}: Address already in use$"):
        opened(here("udpin", free))


def test_a_port_is_free_again_when_it_is_closed(opened, free):
    opened(here("udpin", free)).close()
    opened(here("udpin", free))


def test_who_speaks_first_is_answered(opened, free):
    listener, speaker = opened(here("udpin", free)), opened(here("udpout", free))
    assert speaker.send(b"one")
    assert speaker.send(b"two")
    (first, address), (second, same) = listener.receive()
    assert (first, second) == (b"one", b"two")
    assert address == same
    assert listener.send(b"answer", address)
    assert said(speaker) == [b"answer"]


def test_nothing_waiting_is_nothing_received(opened, free):
    assert opened(here("udpin", free)).receive() == []


def test_speaking_to_nobody_raises_nothing(opened, free):
    speaker = opened(here("udpout", free))
    for _ in range(5):
        assert speaker.send(b"hello?") in (True, False)
        assert speaker.receive() == []


def test_a_caller_bounds_its_work_and_loses_nothing_by_it(opened, free):
    listener, speaker = opened(here("udpin", free)), opened(here("udpout", free))
    for number in range(10):
        assert speaker.send(bytes([number]))
    assert said(listener, at_most=3) == [bytes([number]) for number in range(3)]
    assert said(listener, at_most=0) == []
    assert said(listener) == [bytes([number]) for number in range(3, 10)]


# --- a socket for each peer


@pytest.mark.parametrize("host", [HOST, "0.0.0.0"])
def test_a_peer_with_a_socket_of_its_own_is_heard_there_and_strangers_are_not(opened, free, peers, host):
    peer, stranger = peers
    listener = opened(Connection("udpin", host, free))
    own = listener.connected_to(peer.getsockname())
    try:
        for each, words in ((peer, b"from the peer"), (stranger, b"from a stranger")):
            each.sendto(words, (HOST, free))
        assert own.receive() == [(b"from the peer", peer.getsockname())]
        assert listener.receive() == [(b"from a stranger", stranger.getsockname())]
        assert own.send(b"answer", peer.getsockname())
        assert own.send(b"again")
        assert [peer.recvfrom(100) for _ in range(2)] == [(b"answer", (HOST, free)), (b"again", (HOST, free))]
        assert own.connection == listener.connection
        assert own.fileno() != listener.fileno()
    finally:
        own.close()


def test_every_peer_may_have_its_own_socket_and_give_it_back(opened, free, peers):
    listener = opened(here("udpin", free))
    own = [listener.connected_to(peer.getsockname()) for peer in peers]
    for peer in peers:
        peer.sendto(b"%d" % peer.getsockname()[1], (HOST, free))
    assert [said(port) for port in own] == [[b"%d" % peer.getsockname()[1]] for peer in peers]
    for port in own:
        port.close()
    peers[0].sendto(b"back", (HOST, free))
    assert said(listener) == [b"back"]


def test_what_a_flood_overruns_is_the_strangers_queue_not_the_peers(opened, free, peers):
    peer, stranger = peers
    listener = opened(here("udpin", free))
    own = listener.connected_to(peer.getsockname())
    try:
        room = listener._socket.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
        for _ in range(room // 500):
            stranger.sendto(bytes(1000), (HOST, free))
        peer.sendto(b"still heard", (HOST, free))
        assert said(own) == [b"still heard"]
        assert len(listener.receive(at_most=10**6)) < room // 500, "the flood was too small to overrun anything"
    finally:
        own.close()


@pytest.mark.parametrize("option", ["plain", "SO_REUSEADDR", "SO_REUSEPORT"])
@pytest.mark.parametrize("host", [HOST, "0.0.0.0"])
def test_no_other_program_can_take_a_port_before_or_after_it_was_shared(opened, free, peers, option, host):
    listener = opened(here("udpin", free))
    assert intruder(option, host, free) == "Address already in use"
    own = listener.connected_to(peers[0].getsockname())
    try:
        assert intruder(option, host, free) == "Address already in use"
        with pytest.raises(ConnectionRefused, match="Address already in use"):
            opened(here("udpin", free))
    finally:
        own.close()


def test_that_program_would_take_a_port_that_is_free_or_shared(free):
    assert intruder("plain", HOST, free) == "bound"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as careless:
        careless.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        careless.bind((HOST, free))
        assert intruder("SO_REUSEADDR", HOST, free) == "bound"


def test_a_peer_nobody_can_reach_is_refused_in_one_sentence_and_the_port_stays_as_it_was(opened, free, peers):
    listener = opened(here("udpin", free))
    with pytest.raises(ConnectionRefused, match=rf"^udpin:127\.0\.0\.1:{free}, for 192\.0\.2\.1:9 alone: "):
        listener.connected_to(("192.0.2.1", 9))  # a loopback socket cannot speak to the world outside
    peers[0].sendto(b"heard", (HOST, free))
    assert said(listener) == [b"heard"]
    assert intruder("SO_REUSEADDR", HOST, free) == "Address already in use"


def test_datagrams_are_datagrams(opened, free):
    assert isinstance(opened(here("udpin", free)), UdpPort)
    assert not opened(here("udpout", free)).stream
