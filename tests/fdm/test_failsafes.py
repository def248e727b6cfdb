"""A PX4 left alone by those who fly it: what its parameters say, at the step that they name."""

import math

import pytest
from clients import MODE, OFFBOARD, Flight, Station, parameter, scenario, setpoint
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from fdm.modes import Mode
from fdm.world import World

NORTH = (1.0, 0.0, 0.0)


@pytest.mark.parametrize("after_steps", [0, 3, 7, 12, 20])
def test_it_lands_at_the_step_at_which_the_delay_is_over(after_steps):
    flight = Flight().hover().offboard(NORTH, 1.0)
    flight.endpoint.step(after_steps)
    flight.send(setpoint(NORTH))
    flight.endpoint.step(125)
    assert flight.pilot.mode is Mode.HOLD
    flight.endpoint.step(1249)
    assert flight.pilot.mode is Mode.HOLD
    flight.endpoint.step(1)
    assert flight.pilot.mode is Mode.LAND


@pytest.mark.parametrize("silence_s", [0.3, 1.0, 2.5])
def test_its_patience_is_a_parameter_that_a_client_may_set_in_flight(silence_s):
    flight = Flight().hover().offboard(NORTH, 1.0)
    flight.endpoint.step(13)
    flight.send(setpoint(NORTH), parameter("COM_OF_LOSS_T", silence_s), parameter("COM_FAIL_ACT_T", 1.0))
    flight.endpoint.step(round(silence_s * 250) - 1)
    assert flight.pilot.mode is Mode.OFFBOARD
    flight.endpoint.step(1)
    assert flight.pilot.mode is Mode.HOLD
    flight.endpoint.step(249)
    assert flight.pilot.mode is Mode.HOLD
    flight.endpoint.step(1)
    assert flight.pilot.mode is Mode.LAND


def test_a_shorter_patience_counts_at_once():
    flight = Flight().hover().offboard(NORTH, 1.0)
    flight.send(parameter("COM_OF_LOSS_T", 5.0))
    flight.endpoint.step(252 - flight.vehicle.steps % 25)  # 23 steps before it would look by itself
    flight.send(setpoint(NORTH), parameter("COM_OF_LOSS_T", 0.04))
    flight.endpoint.step(9)
    assert flight.pilot.mode is Mode.OFFBOARD
    flight.endpoint.step(1)
    assert flight.pilot.mode is Mode.HOLD


@pytest.mark.parametrize(("stock", "silence_s", "then"), [(False, 0.5, Mode.LAND), (True, 1.0, Mode.RETURN)])
def test_stock_failsafes_are_the_autopilots_own(stock, silence_s, then):
    flight = Flight(stock=stock).hover().offboard(NORTH, 1.0)
    flight.send(setpoint(NORTH))
    flight.endpoint.step(round(silence_s * 250))
    assert flight.pilot.mode is Mode.HOLD
    flight.wait(2.0)
    assert math.hypot(*flight.velocity[:2]) < 0.1
    flight.wait(3.0)
    assert flight.pilot.mode is then


def test_a_ground_station_that_is_heard_no_more_brings_it_down_at_the_very_step():
    flight = Flight().hover()
    flight.endpoint.step(11)
    flight.beat()
    flight.endpoint.step(2499)
    assert flight.pilot.mode is Mode.HOLD
    assert not flight.pilot.station_lost
    flight.endpoint.step(1)
    assert flight.pilot.station_lost
    flight.endpoint.step(1249)
    assert flight.pilot.mode is Mode.HOLD
    flight.endpoint.step(1)
    flight.listen()
    assert flight.pilot.mode is Mode.LAND
    assert flight.words()[-2:] == ["Ground station lost: holding", "Ground station is not back: landing"]
    assert flight.last("HEARTBEAT").system_status == dialect.MAV_STATE_CRITICAL


def test_only_a_ground_station_is_one():
    flight = Flight().hover()
    flight.send(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_QUADROTOR, 12, 0, 0, 4, 3))
    assert flight.pilot.station_s is None
    flight.beat()
    assert flight.pilot.station_s == flight.endpoint.time_s


def test_stock_it_never_misses_its_ground_station():
    flight = Flight(stock=True).hover()
    flight.beat()
    flight.wait(60.0)
    assert flight.pilot.mode is Mode.HOLD


def test_a_heartbeat_a_second_keeps_it_flying():
    flight = Flight().hover()
    for _ in range(30):
        flight.beat()
        flight.wait(1.0)
    assert flight.pilot.mode is Mode.HOLD


@pytest.fixture(scope="module")
def high_up():
    """One flight, for all silences."""
    return Flight().hover(150.0)


@given(silence_s=st.integers(50, 500).map(lambda steps: steps / 250), late_steps=st.integers(0, 30))
def test_silence_is_zero_velocity_at_once_and_whatever_the_parameter_says(high_up, silence_s, late_steps):
    flight = high_up
    flight.send(parameter("COM_OF_LOSS_T", silence_s))
    flight.endpoint.step(late_steps)
    flight.send(setpoint(NORTH))
    flight.ask(MODE, 1, *OFFBOARD)
    flight.endpoint.step(round(silence_s * 250) - 1)
    assert flight.pilot.mode is Mode.OFFBOARD
    flight.endpoint.step(1)
    assert flight.pilot.mode is Mode.HOLD
    flight.heard.clear()


# A world of either


@pytest.mark.parametrize(
    ("autopilot", "stock", "name", "value"),
    [
        ("px4", False, "COM_OF_LOSS_T", 0.5),
        ("px4", True, "COM_OF_LOSS_T", 1.0),
        ("ardupilot", False, "GUID_TIMEOUT", 0.5),
        ("ardupilot", True, "FS_GCS_ENABLE", 0.0),
    ],
)
def test_a_world_is_of_one_autopilot_with_our_failsafes_or_its_own(autopilot, stock, name, value):
    world = World(scenario(swarm={"rows": 1, "columns": 2, "leaders": [1]}), autopilot=autopilot, stock_failsafes=stock)
    for endpoint in world.endpoints:
        assert endpoint.personality.name == autopilot
        assert endpoint.parameters.get(name) == value
    one, other = (endpoint.parameters for endpoint in world.endpoints)
    assert one is not other


def test_each_vehicle_may_count_from_an_origin_of_its_own():
    told = scenario(swarm={"rows": 1, "columns": 2, "leaders": [1]})
    plain, moved = World(told), World(told, origins_ne=[[30.0, -40.0], [0.0, 0.0]])
    heard = {}
    for name, world in (("plain", plain), ("moved", moved)):
        station = Station()
        for request in (32, 33, 49):
            ask = dialect.MAVLink_command_long_message(1, 1, 512, 0, request, 0, 0, 0, 0, 0, 0)
            world.deliver(1, station.pack(ask))
        for _, _, frame in world.collect():
            station.read(frame)
        heard[name] = [
            station.last(kind) for kind in ("LOCAL_POSITION_NED", "GLOBAL_POSITION_INT", "GPS_GLOBAL_ORIGIN")
        ]
    (local, place, origin), (moved_local, moved_place, moved_origin) = heard["plain"], heard["moved"]
    assert (moved_local.x, moved_local.y) == pytest.approx((local.x - 30.0, local.y + 40.0), abs=1e-3)
    assert (moved_place.lat, moved_place.lon) == (place.lat, place.lon)
    metres = 111_000e-7
    assert (moved_origin.latitude - origin.latitude) * metres == pytest.approx(30.0, rel=0.01)
    assert moved_origin.longitude < origin.longitude


@pytest.mark.parametrize("origins", [[[0.0, 0.0]], [0.0, 0.0], [[0.0, math.nan], [0.0, 0.0]]])
def test_origins_must_be_two_numbers_a_vehicle(origins):
    with pytest.raises(ValueError, match="2 rows of two finite numbers"):
        World(scenario(swarm={"rows": 1, "columns": 2, "leaders": [1]}), origins_ne=origins)
