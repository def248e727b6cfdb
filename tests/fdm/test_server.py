"""A world behind UDP. One thread: the server's turns and the client's reading take turns."""

import contextlib
import itertools
import select
import socket
import time

import pytest
from clients import ARM, HZ, LOCAL_POSITION, REQUEST, SET_INTERVAL, TAKE_OFF, VERSION, Station, command, scenario
from pymavlink.dialects.v20 import ardupilotmega as dialect

from fdm.server import GONE_S, Server
from fdm.world import SITE, World
from wire.connection import Connection, ConnectionRefused
from wire.signing import Signer

LOOPBACK = "127.0.0.1"


def bound(port=0):
    """A socket that nobody else has."""
    udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    udp.setblocking(False)
    udp.bind((LOOPBACK, port))
    return udp


def bound_in_a_row(count):
    """Sockets on ports that follow each other."""
    while True:
        first = bound()
        row = [first]
        try:
            row += [bound(first.getsockname()[1] + place) for place in range(1, count)]
        except (OSError, OverflowError):
            for udp in row:
                udp.close()
        else:
            return row


class Listener(Station):
    """A ground station with a socket: answers whoever spoke to it last."""

    def __init__(self, udp):
        super().__init__()
        self.udp = udp
        self.peer = None

    def listen(self):
        with contextlib.suppress(BlockingIOError):
            while True:
                datagram, self.peer = self.udp.recvfrom(2048)
                self.read(datagram)

    def send(self, *messages):
        for message in messages:
            self.udp.sendto(self.pack(message), self.peer)

    def answers(self, **sender):
        return [(answer.command, answer.result) for answer in self.all("COMMAND_ACK", **sender)]


def abreast(count):
    return World(scenario(swarm={"rows": 1, "columns": count, "leaders": [1]}))


@contextlib.contextmanager
def serving(world, *, ports="shared", speed=1.0):
    """(server, a listener for each of its ports)."""
    sockets = bound_in_a_row(len(world.endpoints) if ports == "separate" else 1)
    to = Connection("udpout", LOOPBACK, sockets[0].getsockname()[1])
    server = Server(world, to, ports=ports, speed=speed)
    try:
        yield server, [Listener(udp) for udp in sockets]
    finally:
        server.close()
        for udp in sockets:
            udp.close()


def turn_until(server, listeners, done, *, limit_s=4.0):
    """Serve and listen until something is true; it must come true in time."""
    end = time.monotonic() + limit_s
    while not done():
        assert time.monotonic() < end, "it did not happen in time"
        server.turn()
        for listener in listeners:
            listener.listen()


@pytest.mark.wall_clock
def test_a_client_arms_and_takes_off_over_udp():
    with serving(abreast(1), speed=4.0) as (server, [client]):
        turn_until(server, [client], lambda: client.all("SYS_STATUS"))
        client.send(command(SET_INTERVAL, LOCAL_POSITION, 50_000), command(ARM, 1))
        client.send(command(TAKE_OFF, 0, 0, 0, 0, 0, 0, SITE.altitude_m + 3.0))
        turn_until(server, [client], lambda: "Take-off height reached" in client.words())
        assert client.answers() == [(SET_INTERVAL, 0), (ARM, 0), (TAKE_OFF, 0)]
        assert client.last("LOCAL_POSITION_NED").z == pytest.approx(-3.0, abs=0.4)
        times = [message.time_boot_ms for message in client.all("LOCAL_POSITION_NED")[1:]]
        assert {later - earlier for earlier, later in itertools.pairwise(times)} <= {48, 52}


@pytest.mark.wall_clock
def test_shared_vehicles_all_speak_from_one_port_and_hear_what_is_meant_for_them():
    with serving(abreast(3)) as (server, [client]):
        turn_until(server, [client], lambda: client.all("HEARTBEAT", system=3))
        client.send(command(REQUEST, VERSION, system=2))
        turn_until(server, [client], lambda: client.all("AUTOPILOT_VERSION", system=2))
        assert not client.all("COMMAND_ACK", system=1)
        assert not client.all("COMMAND_ACK", system=3)
        client.send(command(REQUEST, VERSION, system=0))
        turn_until(server, [client], lambda: client.all("AUTOPILOT_VERSION", system=3))
        assert [client.last("AUTOPILOT_VERSION", system=system).uid for system in (1, 2, 3)] == [1, 2, 3]


@pytest.mark.wall_clock
def test_separate_vehicles_speak_and_hear_each_on_a_port_of_its_own():
    with serving(abreast(3), ports="separate") as (server, clients):
        turn_until(server, clients, lambda: all(client.heard for client in clients))
        for system, client in enumerate(clients, start=1):
            assert {message.get_srcSystem() for _, message in client.heard} == {system}
        clients[1].send(command(ARM, 1, system=2), command(ARM, 1, system=1), command(REQUEST, VERSION, system=0))
        turn_until(server, clients, lambda: clients[1].all("AUTOPILOT_VERSION", system=2))
        assert len(clients[1].answers(system=2)) == 2
        assert not any(clients[place].answers(system=place + 1) for place in (0, 2))


@pytest.mark.wall_clock
@pytest.mark.parametrize("speed", [1.0, 4.0])
def test_simulated_time_runs_as_many_times_as_fast(speed):
    with serving(world := abreast(1), speed=speed) as (server, [client]):
        turn_until(server, [client], lambda: client.heard)
        before, steps = time.monotonic(), world.steps
        turn_until(server, [client], lambda: time.monotonic() - before > 1.5)
        simulated = (world.steps - steps) / HZ
        assert simulated / (time.monotonic() - before) == pytest.approx(speed, rel=0.2)
        assert server.behind_s < 0.3


@pytest.mark.wall_clock
def test_a_world_that_hardly_moves_still_comes_back_to_be_told_to_stop():
    with serving(abreast(1), speed=1e-9) as (server, _):
        before = time.monotonic()
        server.turn()
        assert time.monotonic() - before < 1.0


@pytest.mark.wall_clock
def test_garbage_on_the_port_stops_nobody():
    with serving(abreast(1)) as (server, [client]):
        turn_until(server, [client], lambda: client.heard)
        for garbage in (b"", b"\xfd", b"\xfd" * 280, bytes(range(256)) * 5):
            client.udp.sendto(garbage, client.peer)
        client.send(command(REQUEST, VERSION))
        turn_until(server, [client], lambda: client.all("AUTOPILOT_VERSION"))


@pytest.mark.wall_clock
def test_it_sends_on_though_nobody_listens_yet():
    with serving(world := abreast(1), speed=4.0) as (server, [client]):
        address = client.udp.getsockname()
        client.udp.close()
        while world.steps < 2 * HZ:
            server.turn()
        client.udp = bound(address[1])
        turn_until(server, [client], lambda: client.all("HEARTBEAT"))
        client.udp.close()


@pytest.mark.wall_clock
def test_on_udpin_it_is_silent_until_spoken_to_and_then_answers_the_speaker():
    with bound() as free:
        address = free.getsockname()
    world = abreast(1)
    server = Server(world, Connection("udpin", *address), ports="shared", speed=4.0)
    client = Listener(bound())
    try:
        while world.steps < HZ:
            server.turn()
        client.listen()
        assert client.heard == []
        client.peer = address
        client.send(command(REQUEST, VERSION))
        turn_until(server, [client], lambda: client.all("AUTOPILOT_VERSION") and client.all("HEARTBEAT"))
    finally:
        server.close()
        client.udp.close()


@contextlib.contextmanager
def waiting(world, *, kind="udpin", speed=1.0, signer=None):
    """(server that waits to be spoken to, the address where it does)."""
    with bound() as free:
        address = free.getsockname()
    server = Server(world, Connection(kind, *address), ports="shared", speed=speed, signer=signer)
    try:
        yield server, address
    finally:
        server.close()


@contextlib.contextmanager
def calling(address):
    """Two clients that speak to one address."""
    clients = Listener(bound()), Listener(bound())
    for client in clients:
        client.peer = address
    try:
        yield clients
    finally:
        for client in clients:
            client.udp.close()


@pytest.mark.wall_clock
def test_on_udpin_the_first_who_speaks_is_the_ground_station_and_nobody_else_is_heard_or_answered():
    with waiting(abreast(1)) as (server, address), calling(address) as (first, second):
        first.send(command(REQUEST, VERSION))
        turn_until(server, [first, second], lambda: first.all("AUTOPILOT_VERSION"))
        second.send(command(REQUEST, VERSION))
        turn_until(server, [first, second], lambda: server.rejections)
        assert server.rejections == {"wrong address": 1}
        beats = len(first.all("HEARTBEAT"))
        turn_until(server, [first, second], lambda: len(first.all("HEARTBEAT")) > beats + 1)
        assert second.heard == []


@pytest.mark.wall_clock
def test_a_ground_station_that_fell_silent_can_be_followed_by_another(monkeypatch):
    monkeypatch.setattr("fdm.server.GONE_S", 0.3)
    with waiting(abreast(1)) as (server, address), calling(address) as (first, second):
        first.send(command(REQUEST, VERSION))
        turn_until(server, [first, second], lambda: first.all("AUTOPILOT_VERSION"))
        speaking = time.monotonic() + 0.6
        while time.monotonic() < speaking:
            for client in (first, second):
                client.send(command(REQUEST, VERSION))
            server.turn()
        second.listen()
        assert second.heard == []
        silent = time.monotonic()
        while not second.heard:
            assert time.monotonic() - silent < 2.0
            second.send(command(REQUEST, VERSION))
            server.turn()
            second.listen()
        assert time.monotonic() - silent > 0.25
        assert {peer.address for peer in server._hub.known} == {second.udp.getsockname()}
        first.listen()
        first.heard.clear()
        turn_until(server, [first, second], lambda: second.all("HEARTBEAT"))
        assert first.heard == []


@pytest.mark.wall_clock
def test_a_crowd_at_the_port_does_not_stop_physics_nor_the_ground_station():
    with waiting(world := abreast(1), speed=4.0) as (server, address), calling(address) as (client, crowd):
        client.send(command(SET_INTERVAL, LOCAL_POSITION, 50_000))
        turn_until(server, [client], lambda: client.all("LOCAL_POSITION_NED"))
        forged = crowd.pack(command(REQUEST, VERSION))
        steps, behind, end = world.steps, 0.0, time.monotonic() + 1.0
        while time.monotonic() < end:
            for _ in range(50):
                crowd.udp.sendto(forged, address)
            server.turn()
            behind = max(behind, server.behind_s)
        assert world.steps - steps == pytest.approx(4.0 * HZ, rel=0.1)
        assert behind < 0.2
        for _ in range(20_000):  # more than the port has room for
            crowd.udp.sendto(forged, address)
        client.send(command(REQUEST, VERSION))
        turn_until(server, [client], lambda: client.all("AUTOPILOT_VERSION"))
        crowd.listen()
        assert crowd.heard == []
        assert server.rejections["wrong address"] > 100


@pytest.mark.wall_clock
def test_a_client_over_tcp_is_answered_over_tcp():
    with waiting(abreast(2), kind="tcpin") as (server, address), socket.create_connection(address) as line:
        line.setblocking(False)
        client, parser = Station(), dialect.MAVLink(None)
        line.sendall(client.pack(command(REQUEST, VERSION, system=2)))

        def answered():
            with contextlib.suppress(BlockingIOError):
                client.heard += [(None, message) for message in parser.parse_buffer(line.recv(4096)) or []]
            return client.all("AUTOPILOT_VERSION", system=2) and client.all("HEARTBEAT", system=1)

        turn_until(server, [], answered)


@pytest.mark.wall_clock
def test_a_client_over_tcp_that_hung_up_is_followed_at_once_and_one_that_did_not_is_not():
    def asks(line, client):
        line.sendall(client.pack(command(REQUEST, VERSION)))

    with waiting(abreast(1), kind="tcpin") as (server, address), socket.create_connection(address) as second:
        with socket.create_connection(address) as first:
            asks(first, Station())
            turn_until(server, [], lambda: select.select([first], [], [], 0)[0])
            asks(second, Station())
            turn_until(server, [], lambda: server.rejections == {"wrong address": 1})
        asks(second, Station())
        turn_until(server, [], lambda: select.select([second], [], [], 0)[0], limit_s=GONE_S / 3)


@pytest.mark.wall_clock
def test_with_a_key_only_who_has_it_is_heard_and_all_that_is_sent_is_signed():
    key = bytes(range(32))
    with waiting(abreast(1), signer=Signer(key)) as (server, address), calling(address) as (stranger, client):
        stranger.send(command(REQUEST, VERSION))
        turn_until(server, [], lambda: server.rejections)
        assert server.rejections == {"unsigned": 1}
        asked = Signer(key).sign(client.pack(command(REQUEST, VERSION)))
        client.udp.sendto(asked, address)
        turn_until(server, [stranger, client], lambda: client.all("AUTOPILOT_VERSION"))
        assert stranger.heard == []
        assert all(message.get_header().incompat_flags == 1 for _, message in client.heard)
        client.udp.sendto(asked, address)
        turn_until(server, [client], lambda: server.rejections["replayed"] == 1)
        assert len(client.all("AUTOPILOT_VERSION")) == 1


@pytest.mark.wall_clock
def test_a_port_in_use_is_refused_in_a_sentence():
    with bound() as taken:
        to = Connection("udpin", *taken.getsockname())
        with pytest.raises(ConnectionRefused, match=f"{to.port}.*in use"):
            Server(abreast(1), to, ports="shared", speed=1.0)
