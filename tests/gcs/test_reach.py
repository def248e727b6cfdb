"""The socket of a flight, the card beside it, and how it is found: by whatever shell, however its link is written."""

import os
import socket
import stat
import time
from contextlib import closing

import orjson
import pytest
from standing import LINK, Fleet, flying

from gcs.cards import under_way
from gcs.control_socket import ControlSocket
from gcs.flight_state import Phase
from gcs.reach import Call, Ended, Refused
from wire.connection import Connection, parse

pytestmark = pytest.mark.usefixtures("cards")


def found(link=LINK):
    """The one flight that has this link."""
    (flight,) = under_way(parse(link))
    return flight


def test_the_socket_is_its_users_alone_and_goes_with_the_flight(cards):
    with ControlSocket(parse(LINK), (1,), say=str):
        assert stat.S_IMODE(cards.stat().st_mode) == 0o700
        (sock,) = cards.glob("*.sock")
        assert stat.S_IMODE(sock.stat().st_mode) == 0o600
        assert found().process == os.getpid()
    assert list(cards.iterdir()) == []
    assert under_way(parse(LINK)) == ()


def test_a_directory_that_others_can_enter_is_not_used_and_the_flight_goes_on(cards):
    cards.mkdir()
    cards.chmod(0o777)
    said = []
    with ControlSocket(parse(LINK), (1,), said.append) as control:
        assert control.take() == ()
        assert under_way(parse(LINK)) == ()
    assert len(said) == 1
    assert "is not a directory of this user alone" in said[0]
    assert list(cards.iterdir()) == []


def test_a_flight_is_found_from_a_shell_with_another_environment(monkeypatch, tmp_path):
    with ControlSocket(parse(LINK), (1,), say=str):
        for name in ("XDG_RUNTIME_DIR", "TMPDIR", "HOME"):
            monkeypatch.setenv(name, str(tmp_path))
        assert found().process == os.getpid()


def left_behind(cards, process):
    """Card and socket of a flight that was killed, while a process has its id."""
    card = cards / f"{process}-left.json"
    card.write_bytes(orjson.dumps({"process": process, "links": ["udpin:0.0.0.0:15000"]}))
    with closing(socket.socket(socket.AF_UNIX)) as dead:
        dead.bind(str(card.with_suffix(".sock")))
        dead.listen()
    return card


@pytest.mark.parametrize("whose", ["alive", "gone"])
def test_what_a_dead_flight_left_behind_is_thrown_away_whoever_has_its_process_id_now(cards, whose):
    with ControlSocket(parse(LINK), (1,), say=str):
        card = left_behind(cards, os.getpid() if whose == "alive" else 2**22 + 1)
        assert under_way(parse("udpin:0.0.0.0:15000")) == ()
        assert not card.exists()
        assert not card.with_suffix(".sock").exists()
        assert found()


def test_a_card_without_a_socket_is_thrown_away(cards):
    with ControlSocket(parse(LINK), (1,), say=str):
        (sock,) = cards.glob("*.sock")
        sock.unlink()
        assert under_way(parse(LINK)) == ()
        assert list(cards.iterdir()) == []


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"[]",
        b"{}",
        b'{"process": "x", "links": []}',
        b'{"process": 1, "links": [3]}',
        b'{"process": 1, "links": ["the moon"]}',
        b'{"process": 1, "links": "udpin:0.0.0.0:14999"}',
        b"\xff",
    ],
)
def test_a_card_that_makes_no_sense_is_nobodys(cards, content):
    with ControlSocket(parse(LINK), (1,), say=str):
        (card,) = cards.glob("*.json")
        card.write_bytes(content)
        assert under_way(parse(LINK)) == ()


@pytest.mark.parametrize(
    ("mine", "same"),
    [
        ("udpin:0.0.0.0:14550", True),
        ("udpin:127.0.0.1:14550", True),
        ("udp://:14550", True),
        ("udpin:0.0.0.0:14549-14550", True),
        ("udpin:0.0.0.0:14551", False),
        ("tcpin:0.0.0.0:14550", False),
        ("udpout:127.0.0.1:14550", False),
        ("tcp:127.0.0.1:5760", True),
        ("tcp:localhost:5760", True),
        ("tcp:127.0.0.2:5760", False),
        ("serial:/dev/ttyUSB0:57600", True),
        ("serial:/dev/ttyUSB0:115200", True),
        ("/dev/ttyUSB0", True),
        ("serial:/dev/ttyUSB1:57600", False),
    ],
)
def test_a_flight_is_found_by_any_of_its_links_however_they_are_written(mine, same):
    links = [
        link
        for text in ("udpin:0.0.0.0:14550", "serial:/dev/ttyUSB0:57600", "tcp:127.0.0.1:5760")
        for link in parse(text)
    ]
    with ControlSocket(links, (1,), say=str):
        assert bool(under_way(parse(mine))) == same


def test_a_device_is_the_same_under_its_alias(tmp_path):
    (tmp_path / "ttyUSB7").touch()
    (tmp_path / "by-id").symlink_to(tmp_path / "ttyUSB7")
    with ControlSocket(parse(f"serial:{tmp_path}/by-id"), (1,), say=str):
        assert found(f"serial:{tmp_path}/ttyUSB7:115200")


def test_two_addresses_of_one_port_are_two_links():
    with ControlSocket([Connection("udpin", "127.0.0.1", 14550)], (1,), say=str):
        assert under_way(parse("udpin:127.0.0.2:14550")) == ()


def test_flights_of_one_process_are_told_apart():
    with ControlSocket(parse(LINK), (1,), say=str), ControlSocket(parse("udpin:0.0.0.0:15001"), (1,), say=str):
        both = under_way([*parse(LINK), *parse("udpin:0.0.0.0:15001")])
        assert {str(link) for flight in both for link in flight.links} == {LINK, "udpin:0.0.0.0:15001"}
        assert found().socket != found("udpin:0.0.0.0:15001").socket


@pytest.mark.wall_clock
@pytest.mark.parametrize("word", ["fly", "kill", "kill 0", "kill 4", "take back 9", "land now", 7, None, ["land"]])
def test_a_word_that_is_none_is_refused_with_what_is_allowed(word):
    with (
        flying() as words,
        Call(found()) as call,
        pytest.raises(Refused, match=r"allowed|must|not one of"),
    ):
        call.tell(word)
    assert words == []


def said_to(control, call, *words):
    """The flight's answer to these words, one tick later."""
    for word in words:
        call._socket.sendall(orjson.dumps({"word": word}) + b"\n")
    return control.take(), [orjson.loads(line) for line in call._socket.recv(1 << 16).splitlines()]


def test_hold_is_refused_by_a_flight_that_lands_and_land_is_not():
    fleet = Fleet()
    with ControlSocket(parse(LINK), (1, 2, 3), say=str) as control, Call(found()) as call:
        control.tick(fleet.tick())
        assert said_to(control, call, "hold") == (("hold",), [{"tick": 0}])
        fleet.phase = Phase.LAND
        control.tick(fleet.tick())
        words, answers = said_to(control, call, "hold", "land")
        assert words == ("land",)
        assert answers == [{"error": "the flight is landing, and goes on landing: hold comes too late"}, {"tick": 1}]


def test_whoever_calls_a_flight_that_has_just_gone_hears_that_it_has():
    with ControlSocket(parse(LINK), (1,), say=str):
        flight = found()
    with pytest.raises(Ended):
        Call(flight)


def test_a_flight_whose_last_tick_is_done_is_under_way_no_more_though_its_picture_is_still_drawn():
    fleet = Fleet()
    fleet.phase = Phase.DONE
    with ControlSocket(parse(LINK), (1, 2, 3), say=str) as control:
        card = found()
        control.tick(fleet.tick())
        assert under_way(parse(LINK)) == ()
        with pytest.raises(Ended):
            Call(card)
        assert control.take() == ()


def test_a_word_said_while_the_flight_ends_is_answered_with_how_it_ended():
    fleet = Fleet()
    with ControlSocket(parse(LINK), (1, 2, 3), say=str) as control:
        call = Call(found())
        control.take()
        control.tick(fleet.tick())
    with call, pytest.raises(Ended) as end:
        call.tell("land")
    assert end.value.standing.phase == "mission"
    assert end.value.standing.ours.keys() == {1, 2, 3}


def test_the_flight_never_waits_for_who_talks_to_it():
    with ControlSocket(parse(LINK), (1,), say=str) as control, Call(found()) as call:
        call._socket.sendall(b'{"word": "la')
        began = time.process_time()
        assert all(control.take() == () for _ in range(1000))
        assert time.process_time() - began < 0.5
