"""Several vehicles in one air, on one step count."""

import hashlib
import math

import numpy as np
import pymap3d
import pytest
from clients import HOLD, LAND, LOCAL_POSITION, MODE, SET_INTERVAL, Fleet, command, scenario, setpoint

from fdm.modes import Mode
from fdm.world import SITE, World, pads
from scenarios import load, offsets_ne

PAIR = {"rows": 1, "columns": 2, "leaders": [1]}
ONE_METRE = {"position_m": 1.0}
NOISE = {"velocity_m_s": 0.05, "position_m": 0.1, "gust_m_s": 0.5, "gust_time_s": 2.0}
CRUISE, RUN_UP_S = 1.5, 2.0
MISSION = {"cruise_m_s": CRUISE, "run_up_s": RUN_UP_S, "leg": [{"task": "north", "heading_deg": 0, "length_m": 30}]}


def story(*, seed=1, at_once=None, told=None):
    """A whole flight of two with noise and wind, landing and afterwards; gives the fleet."""
    told = told or scenario(swarm=PAIR, mission=MISSION, noise=NOISE, wind={"speed_m_s": 3, "turbulence": 8})
    fleet = Fleet(told, seed=seed)
    fleet.send_all(lambda system: command(SET_INTERVAL, LOCAL_POSITION, 50_000, system=system))
    fleet.take_off(5.0, at_once=at_once)
    fleet.offboard((CRUISE, 0, 0), at_once=at_once)
    fleet.stream(6.0, (CRUISE, 0.0, 0.0), at_once=at_once)
    fleet.send_all(lambda system: command(LAND, system=system))
    fleet.step(15 * fleet.hz, at_once=at_once)
    return fleet


def first_difference(one, other):
    """Step of the first frame that differs."""
    return next((a[0] for a, b in zip(one.sent, other.sent, strict=False) if a != b), None)


@pytest.fixture(scope="module")
def told_once():
    return story()


def test_the_same_seed_and_the_same_frames_give_the_same_bytes(told_once):
    assert story().sent == told_once.sent


@pytest.mark.parametrize("at_once", [1, 5, 7, 25])
def test_how_many_steps_are_taken_at_once_changes_no_byte(told_once, at_once):
    again = story(at_once=at_once)
    assert first_difference(again, told_once) is None
    assert len(again.sent) == len(told_once.sent)


def test_the_frames_come_in_the_order_of_time_then_of_ids():
    fleet = Fleet(scenario(swarm={"rows": 2, "columns": 2, "leaders": [1]}))
    fleet.step(1000)
    keys = [(step, system) for step, system, _ in fleet.sent]
    assert len(keys) > 100
    assert keys == sorted(keys)


def test_another_seed_is_another_flight_but_only_from_mission_start(told_once):
    other = story(seed=2)
    step = first_difference(other, told_once)
    assert step is not None
    take_off_s = 1.2 + 5.0 / 1.5 + 4.0
    mission_start = round(take_off_s * 250) + round(RUN_UP_S * 250)
    assert mission_start <= step <= mission_start + 25


def test_pads_are_the_formation_with_its_mean_at_the_site():
    for name in ("emergency", "transit", "demo"):
        told = load(name)
        places = pads(told)
        offsets = offsets_ne(told)
        for place, (north, east) in zip(places, offsets, strict=True):
            ned = pymap3d.geodetic2ned(
                place.latitude_deg, place.longitude_deg, place.altitude_m,
                SITE.latitude_deg, SITE.longitude_deg, SITE.altitude_m,
            )  # fmt: skip
            assert ned == pytest.approx((north, east, 0.0), abs=1e-3)
        assert {place.altitude_m for place in places} == {SITE.altitude_m}


def test_vehicles_stand_on_their_pads_in_the_order_of_their_ids_and_face_the_first_leg():
    told = load("emergency")
    world = World(told)
    assert [endpoint.system for endpoint in world.endpoints] == [1, 2, 3, 4, 5, 6]
    for endpoint, pad in zip(world.endpoints, pads(told), strict=True):
        state = endpoint.vehicle.state()
        assert (state.latitude_deg, state.longitude_deg) == pytest.approx((pad.latitude_deg, pad.longitude_deg))
        assert state.altitude_m == pytest.approx(pad.altitude_m, abs=1e-3)
        assert state.attitude_rpy[2] == pytest.approx(math.radians(60))
        assert not endpoint.pilot.armed


def test_every_vehicle_has_a_way_of_its_own_to_hear():
    fleet = Fleet(scenario(swarm=PAIR))
    fleet.step(300)
    fleet.send(2, command(LAND, system=2))
    fleet.step(1)
    assert [endpoint.pilot.mode for endpoint in fleet.world.endpoints] == [Mode.HOLD, Mode.LAND]
    assert fleet.messages("COMMAND_ACK", system=1) == []
    assert len(fleet.messages("COMMAND_ACK", system=2)) == 1


# Mission start


def errors(fleet, system=1):
    """[(step, reported distance east of the pad)] so far, of a vehicle that flies straight north in still air."""
    return [(step, message.y) for step, message in fleet.messages("LOCAL_POSITION_NED", system=system)]


def blurred_after(fleet, step, until=10**9, system=1):
    """Whether telemetry is exact until this step, and never after it."""
    before = [abs(e) > 2e-3 for s, e in errors(fleet, system) if s <= step]
    after = [abs(e) > 2e-3 for s, e in errors(fleet, system) if step < s <= until]
    assert not any(before)
    return sum(after) / len(after)


def listening(told, **options):
    fleet = Fleet(told, **options)
    fleet.send_all(lambda system: command(SET_INTERVAL, LOCAL_POSITION, 50_000, system=system))
    return fleet


@pytest.mark.parametrize("run_up_s", [0.0, 2.0, 4.0])
def test_the_mission_starts_a_run_up_after_the_first_sideways_set_point(run_up_s):
    fleet = listening(scenario(mission=MISSION | {"run_up_s": run_up_s}, noise=ONE_METRE))
    fleet.take_off()
    fleet.stream(3.0, (0.0, 0.0, -0.1))
    moved = fleet.world.steps
    fleet.offboard((CRUISE, 0.0, 0.0))
    fleet.stream(6.0, (CRUISE, 0.0, 0.0))
    assert blurred_after(fleet, moved + round(run_up_s * 250)) > 0.95


def test_the_first_to_move_starts_the_mission_of_all():
    fleet = listening(scenario(swarm=PAIR, mission=MISSION, noise=ONE_METRE))
    fleet.take_off()
    moved = fleet.world.steps
    for _ in range(50):
        fleet.send(2, setpoint((0.5, 0.0, 0.0), system=2))
        fleet.step(25)
    for system in (1, 2):
        assert blurred_after(fleet, moved + round(RUN_UP_S * 250), system=system) > 0.95


def test_after_landing_the_mission_is_over_and_the_next_begins_the_same():
    fleet = listening(scenario(mission=MISSION, noise=ONE_METRE))
    noise = []
    for _ in range(2):
        started = fleet.world.steps
        fleet.sent.clear()
        fleet.take_off()
        moved = fleet.world.steps
        fleet.offboard((CRUISE, 0.0, 0.0))
        fleet.stream(6.0, (CRUISE, 0.0, 0.0))
        fleet.send_all(lambda system: command(LAND, system=system))
        fleet.step(12 * 250)
        landed = next(step for step, message in fleet.messages("STATUSTEXT") if message.text == "Landed, disarmed")
        mission = moved + round(RUN_UP_S * 250)
        assert blurred_after(fleet, mission, until=landed) > 0.95
        assert all(abs(e) < 2e-3 for s, e in errors(fleet) if s > landed)
        assert started < moved
        noise.append([e for s, e in errors(fleet) if mission < s <= landed][:100])
    assert noise[0] == pytest.approx(noise[1], abs=5e-3)


# Wind


def test_in_a_steady_wind_it_holds_its_place_and_leans_into_it():
    fleet = Fleet(scenario(swarm=PAIR, wind={"speed_m_s": 5, "from_deg": 0, "vehicles": [2]}))
    fleet.take_off(10.0)
    fleet.step(10 * 250)
    calm, windy = (endpoint.vehicle for endpoint in fleet.world.endpoints)
    before = windy.position_velocity()
    fleet.step(10 * 250)
    assert windy.position_velocity() == pytest.approx(before, abs=0.02)
    assert np.hypot(*windy.position_velocity()[:2]) < 1.0
    assert math.degrees(calm.state().attitude_rpy[1]) == pytest.approx(0.0, abs=0.1)
    assert math.degrees(windy.state().attitude_rpy[1]) == pytest.approx(-5.2, abs=0.3)  # aircraft/quad/README.md


def test_gusts_push_a_hovering_vehicle_from_mission_start_only():
    fleet = Fleet(scenario(mission=MISSION, noise={"gust_m_s": 2.0}))
    fleet.take_off()
    fleet.step(10 * 250)
    vehicle = fleet.world.endpoints[0].vehicle

    def shaking():
        speeds = []
        for _ in range(100):
            fleet.step(25)
            speeds.append(math.hypot(*vehicle.position_velocity()[3:]))
        return np.std(speeds)

    assert shaking() < 1e-3
    fleet.stream(RUN_UP_S + 0.2, (1e-3, 0.0, 0.0))
    assert shaking() > 1e-2


# Faults


@pytest.fixture(scope="module")
def dragging():
    """Vehicle 2 of two drags from mission start."""
    fault = {"vehicle": 2, "kind": "motor_degradation"}
    fleet = Fleet(scenario(swarm=PAIR, mission=MISSION | {"run_up_s": 4.0}, fault=[fault]))
    fleet.take_off()
    return fleet


def test_a_dragging_vehicle_flies_like_the_others_until_mission_start_and_drags_after(dragging):
    healthy, faulty = (endpoint.vehicle for endpoint in dragging.world.endpoints)
    cruise = (0.0, CRUISE, 0.0)
    dragging.offboard(cruise)
    dragging.stream(3.6, cruise)
    assert faulty.position_velocity()[3:] == pytest.approx(cruise, abs=0.05)
    dragging.stream(5.0, cruise)
    assert healthy.position_velocity()[3:] == pytest.approx(cruise, abs=0.02)
    # To the left of eastwards is north.
    assert faulty.position_velocity()[3:] == pytest.approx((0.47 * CRUISE, 0.4 * CRUISE, 0.0), abs=0.02)
    # Nobody but OFFBOARD is degraded: it holds its place as any other.
    dragging.send_all(lambda system: command(MODE, 1, *HOLD, system=system))
    dragging.step(8 * 250)
    held = faulty.position_velocity()[:3]
    dragging.step(4 * 250)
    assert faulty.position_velocity()[:3] == pytest.approx(held, abs=0.02)


def test_a_weak_rotor_turns_and_sinks_only_from_its_onset():
    fault = {"vehicle": 1, "kind": "rotor", "rotor": 2, "efficiency": 0.8, "onset_s": 2}
    fleet = Fleet(scenario(mission=MISSION, fault=[fault]))
    fleet.take_off(20.0)
    fleet.offboard((1e-3, 0.0, 0.0))
    vehicle = fleet.world.endpoints[0].vehicle
    spins = []
    for _ in range(80):
        fleet.stream(0.1, (1e-3, 0.0, 0.0))
        spins.append(max(abs(rate) for rate in vehicle.state().rate_body))
    onset = round((RUN_UP_S + 2.0 - 0.2) * 10)
    assert max(spins[: onset - 1]) < 0.005
    assert max(spins[onset : onset + 5]) > 0.05


def test_a_fault_changes_no_byte_of_the_others():
    def bytes_of_others(*faults):
        fleet = story(told=scenario(swarm=PAIR, mission=MISSION, noise=NOISE, fault=list(faults)))
        digest = hashlib.sha256()
        for step, system, frame in fleet.sent:
            if system == 1:
                digest.update(step.to_bytes(4, "little") + frame)
        return digest.digest()

    assert bytes_of_others() == bytes_of_others({"vehicle": 2, "kind": "motor_degradation"})
