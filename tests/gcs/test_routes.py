"""Who speaks for which vehicle, decided without a socket."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs.routes import (
    ALIVE_NS,
    NAMESAKES_AT_MOST,
    NOT_INTRODUCED,
    OTHER_SYSTEM,
    WRONG_ADDRESS,
    Routes,
    id_of,
    introduces,
    name_of,
)
from wire.frames import Framer, Sender
from wire.hub import Peer

HERE, THERE = Peer(None, ("127.0.0.1", 1)), Peer(None, ("127.0.0.1", 2))
SECOND = 1_000_000_000
QUAD, PX4 = dialect.MAV_TYPE_QUADROTOR, dialect.MAV_AUTOPILOT_PX4


def framed(message, *, system=1, component=1, time_ns=0):
    [frame] = Framer().frames(time_ns, Sender(system, component).pack(message))
    return frame


def beat(*, kind=QUAD, autopilot=PX4, **sender):
    return framed(dialect.MAVLink_heartbeat_message(kind, autopilot, 0, 0, 4, 3), **sender)


def position(**sender):
    return framed(dialect.MAVLink_local_position_ned_message(1000, 1, 2, 3, 4, 5, 6), **sender)


def test_a_vehicle_is_heard_from_its_first_heartbeat_on():
    routes = Routes((1, 2))
    assert routes.refusal(position(), HERE) == NOT_INTRODUCED
    assert routes.peer(1) is None
    assert routes.refusal(beat(), HERE) is None
    assert routes.refusal(position(), HERE) is None
    assert routes.refusal(position(component=200), HERE) is None
    assert routes.peer(1) == HERE


def test_only_systems_asked_for_are_heard_and_without_a_list_everybody_is():
    assert Routes((1, 2)).refusal(beat(system=3), HERE) == OTHER_SYSTEM
    assert Routes(None).refusal(beat(system=3), HERE) is None


@pytest.mark.parametrize(
    "stranger",
    [
        beat(kind=dialect.MAV_TYPE_GCS),
        beat(kind=dialect.MAV_TYPE_ONBOARD_CONTROLLER),
        beat(kind=dialect.MAV_TYPE_GIMBAL),
        beat(autopilot=dialect.MAV_AUTOPILOT_INVALID),
        beat(component=191),
        position(),
    ],
)
def test_what_is_no_heartbeat_of_a_vehicle_introduces_nobody(stranger):
    assert not introduces(stranger)
    assert Routes(None).refusal(stranger, HERE) == NOT_INTRODUCED


@pytest.mark.parametrize("kind", [QUAD, dialect.MAV_TYPE_GENERIC, dialect.MAV_TYPE_HEXAROTOR])
@pytest.mark.parametrize("autopilot", [PX4, dialect.MAV_AUTOPILOT_ARDUPILOTMEGA])
def test_heartbeats_of_both_autopilots_introduce_their_vehicle(kind, autopilot):
    assert introduces(beat(kind=kind, autopilot=autopilot))


def test_several_vehicles_may_speak_from_one_address():
    routes = Routes((1, 2))
    assert routes.refusal(beat(system=1), HERE) is routes.refusal(beat(system=2), HERE) is None
    assert routes.peers == {HERE}
    assert routes.duplicates(0) == frozenset()


def test_while_its_address_is_alive_no_other_may_speak_for_a_vehicle_and_whoever_tries_is_a_duplicate():
    routes = Routes((1,))
    routes.refusal(beat(), HERE)
    assert routes.refusal(position(time_ns=SECOND), THERE) == WRONG_ADDRESS
    assert routes.duplicates(SECOND) == frozenset()  # it claims no heartbeat
    assert routes.refusal(beat(time_ns=SECOND), THERE) == WRONG_ADDRESS
    assert routes.duplicates(SECOND) == {1}
    assert routes.peer(1) == HERE


def test_a_duplicate_that_went_away_is_none_any_more():
    routes = Routes((1,))
    routes.refusal(beat(), HERE)
    routes.refusal(beat(time_ns=SECOND), THERE)
    routes.refusal(position(time_ns=SECOND + ALIVE_NS + 1), HERE)
    assert routes.duplicates(SECOND + ALIVE_NS) == {1}
    assert routes.duplicates(SECOND + ALIVE_NS + 1) == frozenset()


def test_any_frame_keeps_an_address_alive_and_after_silence_a_heartbeat_from_elsewhere_takes_over():
    routes = Routes((1,))
    routes.refusal(beat(), HERE)
    routes.refusal(position(time_ns=SECOND), HERE)
    assert routes.refusal(beat(time_ns=SECOND + ALIVE_NS), THERE) == WRONG_ADDRESS
    assert routes.refusal(position(time_ns=SECOND + ALIVE_NS + 1), THERE) == NOT_INTRODUCED
    assert routes.refusal(beat(time_ns=SECOND + ALIVE_NS + 1), THERE) is None
    assert routes.peer(1) == THERE
    assert routes.peers == {THERE}
    assert routes.refusal(position(time_ns=SECOND + ALIVE_NS + 2), HERE) == WRONG_ADDRESS
    assert routes.duplicates(SECOND + ALIVE_NS + 2) == frozenset()


def test_where_namesakes_are_told_apart_each_has_a_number_of_its_own_and_keeps_it():
    routes = Routes(None)

    def number(frame, peer):
        frame = routes.numbered(frame, peer)
        assert routes.refusal(frame, peer) is None
        return frame.system

    peers = [Peer(None, ("127.0.0.1", port)) for port in range(NAMESAKES_AT_MOST)]
    assert [number(beat(system=7), peer) for peer in peers] == [7, 263, 519, 775]
    assert [number(position(system=7), peer) for peer in reversed(peers)] == [775, 519, 263, 7]
    assert routes.duplicates(0) == frozenset()
    assert [routes.peer(7), routes.peer(263)] == peers[:2]


def test_more_namesakes_than_can_be_told_apart_are_a_duplicate_of_the_first():
    routes = Routes(None)
    for port in range(NAMESAKES_AT_MOST + 1):
        peer = Peer(None, ("127.0.0.1", port))
        routes.refusal(routes.numbered(beat(system=7), peer), peer)
    assert routes.duplicates(0) == {7}


def test_a_vehicle_that_speaks_from_elsewhere_after_its_silence_keeps_its_number_and_a_namesake_its_own():
    routes = Routes(None)
    later = ALIVE_NS + 1
    for peer in (HERE, THERE):
        routes.refusal(routes.numbered(beat(), peer), peer)
    assert routes.numbered(beat(time_ns=later), THERE).system == 257
    assert routes.numbered(beat(time_ns=later), Peer(None, ("127.0.0.1", 3))).system == 1


@pytest.mark.parametrize(
    ("number", "system", "name"), [(7, 7, "7"), (263, 7, "7 (no. 2 of that id)"), (255, 255, "255")]
)
def test_a_number_names_its_system_id_and_the_place_among_namesakes(number, system, name):
    assert (id_of(number), name_of(number)) == (system, name)
