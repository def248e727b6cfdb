"""Many ports read fairly, over sockets on loopback."""

import itertools
import socket
import time
from contextlib import closing

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from wire.connection import Connection, ConnectionRefused
from wire.frames import Sender
from wire.hub import AT_ONCE, STRANGERS_AT_ONCE_S, STRANGERS_SHARE, Hub
from wire.signing import Signer

pytestmark = pytest.mark.wall_clock

HOST = "127.0.0.1"


def bound():
    """A UDP socket that nobody else has."""
    udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    udp.bind((HOST, 0))
    udp.settimeout(1.0)
    return udp


def listening():
    """A hub on a free UDP port, and its address."""
    with closing(bound()) as free:
        address = free.getsockname()
    return Hub([Connection("udpin", *address)]), address


def beat(system=1, component=1):
    return Sender(system, component).pack(dialect.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3))


def heard(hub, *, seconds=0.5, until=1):
    """(peer, frame) of all that comes until so many have come."""
    got, end = [], time.monotonic() + seconds
    while len(got) < until and time.monotonic() < end:
        hub.wait(0.05)
        got += hub.arrivals(time.monotonic_ns)
    return got


def test_waiting_ends_when_something_comes_or_when_time_is_up():
    hub, address = listening()
    with closing(hub), closing(bound()) as vehicle:
        began = time.monotonic()
        hub.wait(0.1)
        assert 0.1 <= time.monotonic() - began < 0.2
        assert list(hub.arrivals(time.monotonic_ns)) == []
        vehicle.sendto(beat(), address)
        hub.wait(5.0)
        assert time.monotonic() - began < 1.0
        [(peer, frame)] = hub.arrivals(lambda: 77)
        assert (peer.address, frame.system, frame.time_ns) == (vehicle.getsockname(), 1, 77)


def test_a_known_peer_is_answered_from_the_port_it_speaks_to_and_forgotten_it_is_a_stranger_again():
    hub, address = listening()
    with closing(hub), closing(bound()) as vehicle:
        vehicle.sendto(beat(), address)
        [(peer, _)] = heard(hub)
        for known in (False, True, False):
            hub.know(peer) if known else hub.forget(peer)
            assert hub.known == ({peer} if known else frozenset())
            assert hub.send(peer, b"hello")
            assert vehicle.recvfrom(2048) == (b"hello", address)
            vehicle.sendto(beat(), address)
            assert [sender for sender, _ in heard(hub)] == [peer]


def test_known_peers_come_first_and_none_of_them_keeps_the_others_waiting():
    hub, address = listening()
    with closing(hub), closing(bound()) as busy, closing(bound()) as quiet, closing(bound()) as stranger:
        for vehicle in (busy, quiet):
            vehicle.sendto(beat(), address)
        for peer, _ in heard(hub, until=2):
            hub.know(peer)
        time.sleep(STRANGERS_AT_ONCE_S)  # the door opens for strangers
        stranger.sendto(beat(3), address)
        for _ in range(AT_ONCE + 50):
            busy.sendto(beat(1), address)
        quiet.sendto(beat(2), address)
        hub.wait(0.0)
        assert [frame.system for _, frame in hub.arrivals(time.monotonic_ns)] == [1] * AT_ONCE + [2, 3]
        hub.wait(0.0)
        assert len(list(hub.arrivals(time.monotonic_ns))) == 50


def test_strangers_get_a_fifth_of_the_time_however_many_they_are():
    hub, address = listening()
    with closing(hub), closing(bound()) as crowd:
        began, spent, served = time.monotonic(), 0.0, 0
        while time.monotonic() - began < 0.5:
            for _ in range(40):
                crowd.sendto(b"x" * 200, address)
            hub.wait(0.001)
            before = time.monotonic()
            served += sum(1 for _ in hub.arrivals(time.monotonic_ns))
            spent += time.monotonic() - before
        assert served == 0
        assert hub.rejections.total() == 0
        assert spent < (STRANGERS_SHARE + 0.1) * 0.5


def test_what_a_peer_sent_before_it_was_known_is_read_before_what_it_sends_after():
    hub, address = listening()
    sender, sent = Sender(1, 1), []
    with closing(hub), closing(bound()) as vehicle:
        for place in range(200):
            sent.append(sender.pack(dialect.MAVLink_heartbeat_message(2, 12, 0, place, 4, 3)))
            vehicle.sendto(sent[-1], address)
        hub.wait(0.1)
        got = []
        for peer, frame in hub.arrivals(time.monotonic_ns):
            if not got:
                hub.know(peer)
                vehicle.sendto(sender.pack(dialect.MAVLink_heartbeat_message(2, 12, 0, 200, 4, 3)), address)
                time.sleep(2 * STRANGERS_AT_ONCE_S)
            got.append(frame.raw)
        assert got == sent
        assert len(heard(hub)) == 1


def test_while_strangers_wait_outside_a_known_peer_is_heard_at_once():
    hub, address = listening()
    with closing(hub), closing(bound()) as vehicle, closing(bound()) as crowd:
        vehicle.sendto(beat(), address)
        [(peer, _)] = heard(hub)
        hub.know(peer)
        for _ in range(5000):
            crowd.sendto(b"\xfd" * 200, address)
        for _ in range(5):
            hub.wait(0.01)
            list(hub.arrivals(time.monotonic_ns))
            vehicle.sendto(beat(), address)
            began = time.monotonic()
            assert heard(hub)
            assert time.monotonic() - began < 0.02


def test_streams_carry_frames_in_pieces_and_their_callers_are_told_apart():
    with closing(socket.socket()) as free:
        free.bind((HOST, 0))
        address = free.getsockname()
    hub = Hub([Connection("tcpin", *address)])
    with closing(hub), socket.create_connection(address) as one, socket.create_connection(address) as other:
        first, second = beat(1), beat(2)
        one.sendall(first[:7])
        other.sendall(second[:9])
        assert heard(hub, seconds=0.1) == []
        one.sendall(first[7:])
        other.sendall(second[9:])
        arrived = heard(hub, until=2)
        assert {peer.address: frame.system for peer, frame in arrived} == {
            one.getsockname(): 1,
            other.getsockname(): 2,
        }
        for peer, frame in arrived:
            assert hub.send(peer, bytes([frame.system]))
        assert (one.recv(10), other.recv(10)) == (b"\1", b"\2")


def test_a_stream_we_call_is_called_again_until_somebody_answers():
    with closing(socket.socket()) as free:
        free.bind((HOST, 0))
        address = free.getsockname()
    with closing(Hub([Connection("tcp", *address)])) as hub:
        [peer] = hub.spoken_to_first
        hub.wait(0.1)
        assert list(hub.arrivals(time.monotonic_ns)) == []
        assert not hub.send(peer, b"nobody is there")
        with socket.create_server(address) as server:
            server.settimeout(0.01)
            end = time.monotonic() + 3.0
            vehicle = None
            while vehicle is None:
                assert time.monotonic() < end
                hub.wait(0.05)
                list(hub.arrivals(time.monotonic_ns))
                try:
                    vehicle, _ = server.accept()
                except TimeoutError:
                    continue
            with vehicle:
                vehicle.sendall(beat(4))
                assert [(sender, frame.system) for sender, frame in heard(hub)] == [(peer, 4)]


def test_a_port_that_cannot_be_had_gives_the_others_back():
    with closing(bound()) as taken, closing(bound()) as free:
        address = free.getsockname()
        free.close()
        with pytest.raises(ConnectionRefused, match="in use"):
            Hub([Connection("udpin", *address), Connection("udpin", *taken.getsockname())])
        Hub([Connection("udpin", *address)]).close()


def test_reasons_are_counted_over_all_peers():
    hub, address = listening()
    with closing(hub), closing(bound()) as one, closing(bound()) as other:
        broken = beat()[:-1] + b"\0"
        for vehicle, times in ((one, 2), (other, 3)):
            for _ in range(times):
                vehicle.sendto(broken, address)
        one.sendto(beat(), address)
        heard(hub)
        assert sum(hub.rejections.values()) == 5


def test_senders_are_not_mixed_up_when_ports_are_shared_by_many():
    hub, address = listening()
    vehicles = [bound() for _ in range(20)]
    with closing(hub):
        for system, vehicle in enumerate(vehicles, start=1):
            vehicle.sendto(beat(system), address)
        for peer, _ in heard(hub, until=20):
            hub.know(peer)
        for system, vehicle in itertools.chain(*[enumerate(vehicles, start=1)] * 2):
            vehicle.sendto(beat(system), address)
        names = {frame.system: peer.address for peer, frame in heard(hub, until=40)}
        assert names == {system: vehicle.getsockname() for system, vehicle in enumerate(vehicles, start=1)}
    for vehicle in vehicles:
        vehicle.close()


def test_what_is_signed_for_many_ports_in_turn_is_admitted_by_who_reads_port_after_port():
    key, ends = bytes(32), [bound() for _ in range(6)]
    addresses = [end.getsockname() for end in ends]
    for end in ends:
        end.close()
    vehicles = Hub([Connection("udpin", *address) for address in addresses], signer=Signer(key))
    station = Hub([Connection("udpout", *address) for address in addresses], signer=Signer(key))
    with closing(vehicles), closing(station):
        for _ in ("strangers, a datagram of each in turn", "known, all of one and then of the next"):
            for peer in station.spoken_to_first * 2:
                station.send(peer, beat(255, 190))
            said = heard(vehicles, until=12)
            assert len(said) == 12
            for peer, _ in said:
                vehicles.know(peer)
        assert vehicles.rejections.total() == 0
