"""What leaves for a ground control station: what vehicles sent, nothing that commands, and no further than loopback."""

import socket
from contextlib import closing
from itertools import product

import pytest
from excerpts import OTHER_STATION, frames_alone, said_by_another_station
from flights import SHORT, messages, recorded
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs.choices import BadUsageError
from gcs.replay import timeline
from gcs.replay.outputs import Played
from gcs.replay.senders import Senders
from gcs.replay.to_udp import TELEMETRY, UdpOutput, checked, may_leave
from wire.connection import Connection
from wire.frames import Framer

KINDS = {kind.msgname: kind for kind in dialect.mavlink_map.values()}
COMMANDING = (
    "SET_", "COMMAND_INT", "COMMAND_LONG", "COMMAND_CANCEL", "MISSION_ITEM_INT", "MISSION_COUNT", "MISSION_CLEAR",
    "MISSION_SET", "MISSION_WRITE", "MISSION_REQUEST", "PARAM_SET", "PARAM_REQUEST", "PARAM_MAP", "PARAM_EXT_SET",
    "RC_CHANNELS_OVERRIDE", "MANUAL_", "FILE_TRANSFER", "REQUEST_", "GPS_INJECT", "GPS_INPUT", "GPS_RTCM", "HIL_",
    "VISION_", "VICON_", "ATT_POS_MOCAP", "FOLLOW_TARGET", "SERIAL_CONTROL", "DEVICE_OP", "LOG_", "TUNNEL", "SETUP_",
    "CHANGE_OPERATOR", "AUTH_KEY", "RALLY", "FENCE_POINT", "FENCE_FETCH", "MOUNT_", "GIMBAL_", "DIGICAM", "LED_",
    "PLAY_TUNE", "CAN_", "CANFD", "TERRAIN_DATA", "TERRAIN_CHECK", "SYSTEM_TIME", "TIMESYNC", "PING", "ADSB_",
    "LANDING_TARGET", "OBSTACLE_", "ODOMETRY", "ENCAPSULATED_DATA", "SECURE_COMMAND", "SAFETY_SET", "V2_EXTENSION",
    "SIM_STATE",
)  # fmt: skip
"""How messages begin that ask something of a vehicle, or that one takes for an input; and the simulation's truth."""
SENDERS = Senders(vehicles=(1, 2), stations=frozenset({(255, 190), (2, 191)}))


def framed(name, system=1, component=1, **values):
    """A message of the dialect as somebody sends it, zeros where nothing is said."""
    kind = KINDS[name]
    fields = [
        values.get(field, b"" if sort == "char" and length else [0] * length if length else 0)
        for field, sort, length in zip(kind.fieldnames, kind.fieldtypes, _lengths(kind), strict=True)
    ]
    raw = kind(*fields).pack(dialect.MAVLink(None, srcSystem=system, srcComponent=component))
    (frame,) = Framer().frames(0, bytes(raw))
    return frame


def _lengths(kind):
    """Of each field's array, 0 of what is none, in the order of the fieldnames."""
    return [kind.array_lengths[kind.ordered_fieldnames.index(name)] for name in kind.fieldnames]


def test_of_every_message_of_the_dialect_only_telemetry_leaves():
    assert {name for name in KINDS if may_leave(framed(name), SENDERS)} == TELEMETRY


@pytest.mark.parametrize("stranger", [(255, 190), (255, 1), (2, 191), (1, 200), (7, 1), (254, 190)])
def test_of_who_is_no_vehicle_nothing_leaves(stranger):
    assert not any(may_leave(framed(name, *stranger), SENDERS) for name in KINDS)


def test_no_telemetry_is_addressed_to_anybody_but_the_answer_to_a_command():
    addressed = {name for name in TELEMETRY if "target_system" in KINDS[name].fieldnames}
    assert addressed == {"COMMAND_ACK"}


def test_nothing_that_asks_something_of_a_vehicle_is_telemetry():
    assert [(name, word) for name, word in product(TELEMETRY, COMMANDING) if name.startswith(word)] == []
    assert all(any(name.startswith(word) for name in KINDS) for word in COMMANDING if word != "COMMAND_CANCEL")


def test_who_says_it_is_a_ground_station_is_silent_even_under_a_vehicles_name():
    assert may_leave(framed("HEARTBEAT", type=dialect.MAV_TYPE_QUADROTOR), SENDERS)
    assert not may_leave(framed("HEARTBEAT", type=dialect.MAV_TYPE_GCS), SENDERS)


@pytest.fixture
def station():
    """A socket that hears, and the connection that reaches it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as heard:
        heard.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8 << 20)
        heard.bind(("127.0.0.1", 0))
        heard.setblocking(False)
        yield heard, Connection("udpout", "127.0.0.1", heard.getsockname()[1])


def drained(heard):
    datagrams = []
    while True:
        try:
            datagrams.append(heard.recv(2048))
        except BlockingIOError:
            return datagrams


def put_out(path, station):
    """Every message of a recording, put out at once: the datagrams that arrived."""
    heard, connection = station
    arrived = []
    recording = sorted(messages(path), key=lambda message: message[1])
    with closing(UdpOutput(connection, timeline.load(path).senders)) as output:
        for topic, time_ns, data in recording:
            encoding = "mavlink" if topic.endswith("/raw") else "json"
            output.put([Played(time_ns, topic, encoding, "", "", b"", data)])
            arrived += drained(heard)
        assert output.sent == len(arrived)
    return recording, arrived


def test_of_a_flight_every_frame_of_an_autopilot_leaves_as_it_was_and_nothing_else(station):
    recording, arrived = put_out(recorded("demo", *SHORT).path, station)
    of_autopilots = [data for topic, _, data in recording if topic in {f"/mavlink/{n}_1/raw" for n in range(1, 7)}]
    assert arrived == of_autopilots
    assert len(arrived) > 500


def test_of_another_ground_stations_log_what_that_station_sent_stays_behind(station):
    path = frames_alone(recorded("demo", *SHORT).path, more=said_by_another_station(2.0))
    recording, arrived = put_out(path, station)
    assert sum(topic == "/mavlink/{}_{}/raw".format(*OTHER_STATION) for topic, _, _ in recording) == 2
    assert {data[5] for data in arrived} == {1, 2, 3, 4, 5, 6}
    assert {data[6] for data in arrived} == {1}


def test_what_comes_back_is_thrown_away_and_nobody_listening_is_no_reason_to_fail(station):
    heard, connection = station
    beat = framed("HEARTBEAT", type=dialect.MAV_TYPE_QUADROTOR).raw
    one = [Played(0, "/mavlink/1_1/raw", "mavlink", "", "", b"", beat)]
    with closing(UdpOutput(connection, SENDERS)) as output:
        output.put(one)
        data, sender = heard.recvfrom(2048)
        assert data == beat
        for _ in range(10):
            heard.sendto(beat, sender)
        output.put(one)
        assert heard.recv(2048) == beat
        heard.close()
        for _ in range(5):
            output.put(one * 2)
        assert output.sent == 12
        assert output.refused > 0


def test_a_refusal_of_what_was_sent_before_somebody_listened_loses_nothing_that_is_sent_now(station):
    heard, connection = station
    address = heard.getsockname()
    heard.close()
    beat = framed("HEARTBEAT", type=dialect.MAV_TYPE_QUADROTOR).raw
    with closing(UdpOutput(connection, SENDERS)) as output, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as late:
        output.put([Played(0, "/mavlink/1_1/raw", "mavlink", "", "", b"", beat)])
        late.bind(address)
        late.setblocking(False)
        output._left(beat)
        assert late.recv(2048) == beat


def test_what_vehicles_sent_and_is_held_back_is_counted_by_its_name(station):
    _, connection = station
    frames = [framed("SYSTEM_TIME"), framed("SYSTEM_TIME"), framed("COMMAND_LONG"), framed("HEARTBEAT", 255, 190)]
    with closing(UdpOutput(connection, SENDERS)) as output:
        output.put([Played(0, "/mavlink/1_1/raw", "mavlink", "", "", b"", frame.raw) for frame in frames])
        assert output.held_back == {"SYSTEM_TIME": 2, "COMMAND_LONG": 1}
        assert output.sent == 0


@pytest.mark.parametrize("text", ["udpout:127.0.0.1:14550", "udpout:localhost:14550", "udpout://127.8.9.10:14550"])
def test_loopback_is_allowed_by_any_name(text):
    connection = checked(text, network=False)
    assert connection.host.startswith("127.")
    assert (connection.kind, connection.port) == ("udpout", 14550)


@pytest.mark.parametrize("host", ["192.168.1.7", "10.0.0.1", "239.1.1.1"])
def test_another_machine_needs_to_be_allowed(host):
    with pytest.raises(BadUsageError, match=rf"--to udpout:{host}:14550: is another machine.*--to-network"):
        checked(f"udpout:{host}:14550", network=False)
    assert checked(f"udpout:{host}:14550", network=True) == Connection("udpout", host, 14550)


@pytest.mark.parametrize(
    "text",
    ["udpin:0.0.0.0:14550", "udp:127.0.0.1:1", "tcp:127.0.0.1:5760", "tcpin:0.0.0.0:5760", "serial:/dev/ttyS0"],
)
def test_what_is_not_spoken_to_by_udp_is_refused(text):
    with pytest.raises(BadUsageError, match=r"must be one port that is spoken to, as in udpout:127\.0\.0\.1:14550"):
        checked(text, network=True)


@pytest.mark.parametrize(
    "text", ["udpout:0.0.0.0:14550", "udpout:0:1", "udpout:255.255.255.255:1", "udpout:127.255.255.255:1"]
)
@pytest.mark.parametrize("network", [False, True])
def test_what_is_no_machines_address_is_refused(text, network):
    with pytest.raises(BadUsageError, match=rf"^--to {text}: .* is .* of .* machine"):
        checked(text, network=network)


def test_a_way_that_the_system_refuses_is_refused_in_a_sentence():
    with pytest.raises(BadUsageError, match=r"^--to udpout:255\.255\.255\.255:14550: Permission denied$"):
        UdpOutput(Connection("udpout", "255.255.255.255", 14550), SENDERS)


@pytest.mark.parametrize(
    "text", ["", "udpout:127.0.0.1:14550-14555", "udpout:127.0.0.1", "14550", "udpout::1:14550", "udpout:127.0.0.1:0"]
)
def test_what_names_no_single_place_is_refused(text):
    with pytest.raises(BadUsageError, match=r"^--to "):
        checked(text, network=False)


def test_a_name_that_nobody_knows_is_refused():
    with pytest.raises(BadUsageError, match=r"nowhere\.invalid is not known"):
        checked("udpout:nowhere.invalid:14550", network=False)
