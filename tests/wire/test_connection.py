"""Connection strings, and the UDP ports behind them."""

import socket

import pytest

from wire.connection import Connection, ConnectionRefused, UdpPort, parse

UNDERSTOOD = [
    ("udpin:0.0.0.0:14550", "udpin:0.0.0.0:14550"),
    ("udpin://0.0.0.0:14550", "udpin:0.0.0.0:14550"),
    ("udp:0.0.0.0:14550", "udpin:0.0.0.0:14550"),
    ("udp://:14540", "udpin:0.0.0.0:14540"),
    ("udpin::14550", "udpin:0.0.0.0:14550"),
    ("udpout:127.0.0.1:14550", "udpout:127.0.0.1:14550"),
    ("udpout://127.0.0.1:14550", "udpout:127.0.0.1:14550"),
    ("udpout:drone-1.local:1", "udpout:drone-1.local:1"),
    ("udpin:127.0.0.1:65535", "udpin:127.0.0.1:65535"),
    ("udpin:127.0.0.1:14550-14550", "udpin:127.0.0.1:14550"),
]
REFUSED = [
    ("", "must read like udpin:0.0.0.0:14550 or udpout:127.0.0.1:14550"),
    ("14550", "must read like"),
    ("udpin:14550", "must read like"),
    ("udpin:0.0.0.0", "must read like"),
    ("udpin:0.0.0.0:", "must read like"),
    ("udpin:0.0.0.0:port", "must read like"),
    ("udpin:0.0.0.0:-1", "must read like"),
    ("udpin:0.0.0.0:14550-", "must read like"),
    ("udpin:0.0.0.0:14550\n", "must read like"),
    (" udpin:0.0.0.0:14550", "must read like"),
    ("udpin:0.0.0.0:14550:57600", "must read like"),
    ("tcp:127.0.0.1:5760", "tcp is not a kind of link; allowed are udpin, udp (the same) and udpout"),
    ("UDPIN:0.0.0.0:14550", "UDPIN is not a kind of link"),
    ("udpin:0.0.0.0:0", "ports must be 1 to 65535"),
    ("udpin:0.0.0.0:65536", "ports must be 1 to 65535"),
    ("udpin:0.0.0.0:14555-14550", "the first of a range not above the last"),
    ("udpin:0.0.0.0:65530-65536", "ports must be 1 to 65535"),
]  # fmt: skip


@pytest.fixture
def opened():
    """Opens ports, and closes them after the test."""
    ports = []

    def open_port(connection):
        ports.append(UdpPort(connection))
        return ports[-1]

    yield open_port
    for port in ports:
        port.close()


@pytest.fixture
def free():
    """A loopback port that nobody has."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def here(kind, port):
    return Connection(kind, "127.0.0.1", port)


@pytest.mark.parametrize(("text", "canonical"), UNDERSTOOD)
def test_connection_strings_are_understood(text, canonical):
    (connection,) = parse(text)
    assert str(connection) == canonical


@pytest.mark.parametrize(("text", "canonical"), UNDERSTOOD)
def test_a_connection_reads_as_the_string_it_parses_from(text, canonical):
    assert parse(canonical) == parse(text)


@pytest.mark.parametrize("form", ["udpin:0.0.0.0:14550-14555", "udp://0.0.0.0:14550-14555"])
def test_a_range_of_ports_is_one_connection_each(form):
    assert parse(form) == [Connection("udpin", "0.0.0.0", port) for port in range(14550, 14556)]


@pytest.mark.parametrize(("text", "words"), REFUSED)
def test_what_cannot_be_used_is_refused_with_what_was_said_and_what_is_allowed(text, words):
    with pytest.raises(ConnectionRefused) as refused:
        parse(text)
    assert repr(text) in str(refused.value)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


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
    assert [data for data, _ in speaker.receive()] == [b"answer"]


def test_nothing_waiting_is_nothing_received(opened, free):
    assert opened(here("udpin", free)).receive() == []


def test_speaking_to_nobody_raises_nothing(opened, free):
    speaker = opened(here("udpout", free))
    for _ in range(5):
        assert speaker.send(b"hello?") in (True, False)
        assert speaker.receive() == []
