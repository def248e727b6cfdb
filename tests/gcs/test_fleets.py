"""Whole flights of fleets that differ in what no controller should notice: autopilot, and where each counts from."""

from functools import cache

import numpy as np
import pytest
from flights import SHORT, Counting, OtherStation, mode_command
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs.autopilots import Fleet
from gcs.flight import Flight
from gcs.lockstep import Lockstep
from gcs.loop import fly
from gcs.messages import Encoder
from gcs.preflight import refusals
from gcs.scoring import score
from gcs.telemetry import Swarm, observe
from gcs.track import Tracker
from gcs.trial import ToItsReadOut
from gcs.truth import Truth
from scenarios import load
from wire.modes import mode_name

AUTOPILOTS = ("px4", "ardupilot")
SLOW = (
    "vehicle.lag_s=0.2", "vehicle.acceleration_m_s2=2.5", "vehicle.jerk_m_s3=5", "control.profile=recommended",
    "control.response_time_s=0.92", "trust.response_delay_s=0.305", "trust.response_lag_s=0.374",
    "trust.response_acceleration_m_s2=2.35", "trust.response_jerk_m_s3=3.8",
)  # fmt: skip
"""As ArduCopter answers to set-points with its stock gains; `scenarios/experiments/further.toml` has the same."""
NEAR_M = 0.3
"""From the target, after so short a way without faults."""
APART_M = 50.0
ENCODED = dialect.MAVLink(None)


@cache
def trial(name, *overrides, autopilot="px4", apart_m=0.0):
    """(track, score) of a flight to its read-out. apart_m: how far each vehicle's origin is from its pad."""
    scenario = load(name, overrides=overrides)
    bearing = np.arange(scenario.swarm.count)
    origins_ne = apart_m * np.column_stack([np.cos(bearing), np.sin(bearing)])
    world = Lockstep.of(scenario, seed=1, autopilot=autopilot, origins_ne=origins_ne)
    return judged(scenario, world)


def judged(scenario, world):
    flight = ToItsReadOut(scenario)
    truth = Truth(flight.ids)
    tracker = Tracker(flight, truth)
    state = fly(world, world, flight, (truth, tracker), period_ns=scenario.time.period_ns)
    assert state.problem is None
    return tracker.track, score(tracker.track, scenario)


# --- one result, whichever autopilot


def test_ardupilot_flies_the_emergency_as_px4_does():
    (px4, px4_score), (ardupilot, ardupilot_score) = (trial("emergency", autopilot=name) for name in AUTOPILOTS)
    assert px4_score.passed
    assert ardupilot_score.passed
    assert ardupilot_score.distance_to_target_m == pytest.approx(px4_score.distance_to_target_m, abs=0.5)
    assert np.abs(ardupilot.position[-1] - px4.position[-1]).max() < 0.5


@pytest.mark.parametrize("name", ["transit", "emergency"])
def test_a_fleet_as_slow_as_arducopter_passes_with_the_same_controller(name):
    _, result = trial(name, *SLOW, 'trust.source="auto"', autopilot="ardupilot")
    assert result.passed


class Mixed:
    """Two worlds as one link and clock: some vehicles fly in the one, the rest in the other."""

    def __init__(self, here, there, *, there_from):
        self._here, self._there, self._from = here, there, there_from

    def now(self):
        return self._here.now()

    def sleep_until(self, time_ns):
        self._here.sleep_until(time_ns)
        self._there.sleep_until(time_ns)

    def receive(self):
        here = [frame for frame in self._here.receive() if frame.system < self._from]
        there = [frame for frame in self._there.receive() if frame.system >= self._from]
        return sorted(here + there, key=lambda frame: frame.time_ns)

    def send(self, system, frame):
        (self._here if system < self._from else self._there).send(system, frame)

    @property
    def rejected(self):
        return self._here.rejected + self._there.rejected


def test_a_mixed_fleet_flies_one_formation():
    scenario = load("demo", overrides=SHORT)
    here, there = (Lockstep.of(scenario, seed=1, autopilot=name) for name in AUTOPILOTS)
    mixed, result = judged(scenario, Mixed(here, there, there_from=4))
    alone, _ = trial("demo", *SHORT)
    assert result.distance_to_target_m < NEAR_M
    assert np.abs(mixed.position[-1] - alone.position[-1]).max() < 0.1


@pytest.mark.parametrize(("system", "autopilot"), [(2, "px4"), (5, "ardupilot")])
def test_of_a_mixed_fleet_a_pilot_takes_one_vehicle_and_the_others_fly_on(system, autopilot):
    scenario = load("demo", overrides=SHORT)
    here, there = (Lockstep.of(scenario, seed=1, autopilot=name) for name in AUTOPILOTS)
    mixed = Mixed(here, there, there_from=4)
    pilot = OtherStation(mixed, mixed, system=system, mode=mode_command(autopilot, "return"), at_s=13.0)
    link = Counting(pilot)
    state = fly(link, mixed, Flight(scenario), (), period_ns=scenario.time.period_ns)
    assert state.problem.startswith(f"vehicle {system} was taken over by another (return)")
    assert np.flatnonzero(state.released).tolist() == [system - 1]
    asked = [to for to, frame in link.sent if ENCODED.decode(bytearray(frame)).get_type() != "HEARTBEAT"]
    to_others = asked[len(asked) - asked[::-1].index(system) :]
    assert len(to_others) > 5 * 30
    assert set(to_others) == set(range(1, 7)) - {system}


# --- one formation, wherever each counts from


def test_origins_fifty_metres_apart_make_no_difference_but_their_rounding():
    """GPS_GLOBAL_ORIGIN comes in 1e-7 degrees: 1.1 cm."""
    (apart, result), (together, _) = trial("emergency", apart_m=APART_M), trial("emergency")
    assert result.passed
    assert np.abs(apart.position - together.position).max() < 0.05


class Originless:
    """A link over which nobody's GPS_GLOBAL_ORIGIN comes."""

    def __init__(self, world):
        self._world = world

    def receive(self):
        return [frame for frame in self._world.receive() if frame.message != 49]

    def __getattr__(self, name):
        return getattr(self._world, name)


def test_nor_does_an_origin_that_is_never_told():
    scenario = load("demo", overrides=SHORT)
    origins_ne = APART_M * np.random.default_rng(1).uniform(-1, 1, (6, 2))
    worlds = [Lockstep.of(scenario, seed=1, autopilot="ardupilot", origins_ne=origins_ne) for _ in range(2)]
    told, _ = judged(scenario, worlds[0])
    untold, result = judged(scenario, Originless(worlds[1]))
    assert result.distance_to_target_m < NEAR_M
    assert np.abs(untold.position - told.position).max() < 0.05


# --- twice


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_a_fleet_that_has_landed_takes_off_again_from_where_it_stands(autopilot):
    """Both are left in land, and an ArduCopter cannot be armed in that."""
    scenario = load("demo", overrides=SHORT)
    world = Lockstep.of(scenario, seed=1, autopilot=autopilot)
    first = fly(world, world, Flight(scenario), (), period_ns=scenario.time.period_ns)
    assert (first.problem, first.done) == (None, True)
    swarm = joined(world)
    assert {mode_name(*row) for row in zip(swarm.autopilot, swarm.custom_mode, strict=True)} == {"land"}
    _, result = judged(scenario, world)
    assert result.distance_to_target_m < NEAR_M


# --- before arming


def joined(world, seconds=6.0):
    """What a fleet tells when it is asked for what must be known; nobody is armed."""
    ids = range(1, 7)
    fleet, swarm = Fleet(height_m=10.0, position_s=0.1), Swarm.of(ids)
    encoders = {system: Encoder(system) for system in ids}
    start = world.now()
    for second in range(round(seconds)):
        world.sleep_until(start + (second + 1) * 10**9)
        swarm = observe(swarm, world.receive())
        for row, system in enumerate(ids):
            for command in fleet.next_to_know(swarm, row, world.now()):
                world.send(system, encoders[system].encode(command, 0))
    assert not any(fleet.lacking(swarm, row, world.now()) for row in range(6))
    assert not swarm.armed.any()
    return swarm


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_our_vehicles_protect_themselves_and_say_so(autopilot):
    scenario = load("transit")
    assert refusals(joined(Lockstep.of(scenario, seed=1, autopilot=autopilot)), scenario) == ()


@pytest.mark.parametrize(("autopilot", "name"), [("px4", "COM_OBL_RC_ACT = 0"), ("ardupilot", "FS_GCS_ENABLE = 0")])
def test_vehicles_as_they_are_delivered_do_not(autopilot, name):
    scenario = load("transit")
    (why,) = refusals(joined(Lockstep.of(scenario, seed=1, autopilot=autopilot, stock_failsafes=True)), scenario)
    assert why.startswith(f"vehicles 1, 2, 3, 4, 5, 6: {name} (")


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_vehicles_that_claim_too_little_accuracy_for_their_spacing_stay_on_the_ground(autopilot):
    scenario = load("transit", overrides=["noise.position_m=0.9"])  # on both axes: 1.27 m
    (why,) = refusals(joined(Lockstep.of(scenario, seed=1, autopilot=autopilot)), scenario)
    assert why == "swarm.spacing_m = 3 is below 3 × 1.3 m, the horizontal accuracy that vehicle 1 reports"
