"""Connection strings: what is understood, and what is refused in which words."""

import pytest

from wire.connection import Connection, ConnectionRefused, parse

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
    ("tcp:127.0.0.1:5760", "tcp:127.0.0.1:5760"),
    ("tcp://127.0.0.1:5760", "tcp:127.0.0.1:5760"),
    ("tcpout://sitl.local:5760", "tcp:sitl.local:5760"),
    ("tcpin:0.0.0.0:5760", "tcpin:0.0.0.0:5760"),
    ("tcpin://:5760", "tcpin:0.0.0.0:5760"),
    ("serial:/dev/ttyUSB0:115200", "serial:/dev/ttyUSB0:115200"),
    ("serial:///dev/ttyUSB0:115200", "serial:/dev/ttyUSB0:115200"),
    ("serial:/dev/ttyACM0", "serial:/dev/ttyACM0:57600"),
    ("/dev/ttyACM0", "serial:/dev/ttyACM0:57600"),
    ("/dev/ttyACM0:921600", "serial:/dev/ttyACM0:921600"),
    ("serial:/dev/serial/by-path/pci-0:1:1.0-port0:9600", "serial:/dev/serial/by-path/pci-0:1:1.0-port0:9600"),
]
REFUSED = [
    ("", "must read like udpin:0.0.0.0:14550, udpout:127.0.0.1:14550, tcp:127.0.0.1:5760, tcpin:0.0.0.0:5760 or"),
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
    ("tcp:127.0.0.1", "must read like"),
    ("tcp::5760", "tcp needs a host to speak to, as in tcp:127.0.0.1:5760"),
    ("udpout::14550", "udpout needs a host to speak to, as in udpout:127.0.0.1:14550"),
    ("tcpin:0.0.0.0:70000", "ports must be 1 to 65535"),
    ("can:vcan0:1", "can is not a kind of link; allowed are udpin, udpout, tcp, tcpin, serial, udp (as udpin)"),
    ("serial:ttyUSB0:57600", "a serial line must read like serial:/dev/ttyUSB0:57600"),
    ("serial:/dev/ttyUSB0:", "a serial line must read like serial:/dev/ttyUSB0:57600"),
    ("serial:/dev/ttyUSB0:0", "0 bits/s is no speed of a serial line; allowed are 1200 to 12000000"),
    ("/dev/ttyUSB0:99999999", "99999999 bits/s is no speed of a serial line"),
    ("/dev/ttyUSB0\n", "a serial line must read like"),
    ("UDPIN:0.0.0.0:14550", "UDPIN is not a kind of link"),
    ("udpin:0.0.0.0:" + "1" * 5000, "no number here has more than 9 digits"),
    ("udpin:0.0.0.0:14550-" + "1" * 10, "no number here has more than 9 digits"),
    ("/dev/ttyUSB0:" + "5" * 5000, "no number here has more than 9 digits"),
    ("tcp:" + "x" * 64 + ":5760", "x cannot be the name of a host"),
    ("tcp:a..b:5760", "a..b cannot be the name of a host"),
    ("udpout:.b:5760", ".b cannot be the name of a host"),
    ("udpin:\udc80:5760", "cannot be the name of a host"),
    ("tcp:a\0b:5760", "must read like"),
    ("tcp:a b:5760", "must read like"),
    ("udpin:0.0.0.0:0", "ports must be 1 to 65535"),
    ("udpin:0.0.0.0:65536", "ports must be 1 to 65535"),
    ("udpin:0.0.0.0:14555-14550", "the first of a range not above the last"),
    ("udpin:0.0.0.0:65530-65536", "ports must be 1 to 65535"),
]  # fmt: skip


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


def test_only_a_serial_line_has_a_speed():
    assert parse("serial:/dev/ttyUSB0")[0].bits_per_s == 57600
    assert parse("/dev/ttyUSB0:115200")[0].bits_per_s == 115200
    assert [parse(f"{kind}:127.0.0.1:1")[0].bits_per_s for kind in ("udpin", "udpout", "tcp", "tcpin")] == [None] * 4


def test_a_range_is_understood_of_every_network_kind():
    assert [str(one) for one in parse("tcp:10.0.0.1:5760-5762")] == [
        f"tcp:10.0.0.1:{port}" for port in (5760, 5761, 5762)
    ]
