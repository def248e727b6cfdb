"""What a vehicle tells of itself, beside the truth, at known times."""

import math

import numpy as np
import pymap3d
import pytest
from clients import GLOBAL_POSITION, HZ, LOCAL_POSITION, PLACE, SET_INTERVAL, Flight, scenario

from fdm.sensors import SAMPLE_S, Sensors

NOISE = {"velocity_m_s": 0.05, "position_m": 0.1}
START_S = 20.0
"""Mission start, since boot."""


def truth(time_s):
    """A vehicle that climbs in a bend, at this time since mission start: hardly a number stays the same."""
    return (
        1.5 * time_s,
        40.0 * math.sin(0.05 * time_s),
        -10.0 - 0.1 * time_s,
        1.5,
        2.0 * math.cos(0.05 * time_s),
        -0.1,
    )


class Flown:
    """Sensors on their vehicle, noting as the endpoint makes them."""

    def __init__(self, kind, *, seed=1, noise=None, **keys):
        fault = {"vehicle": 1, "kind": kind} | keys
        self.sensors = Sensors(scenario(fault=[fault], noise=noise or {}), vehicle=1, seed=seed)
        self.samples = round((START_S - 15.0) / SAMPLE_S)
        self.begun = False

    def tells(self, time_s):
        """Telemetry at a time since mission start; times must not fall."""
        while self.samples * SAMPLE_S <= START_S + time_s + 1e-9:
            now = self.samples * SAMPLE_S
            self._begin(now)
            if self.sensors.go_stale:
                self.sensors.note(truth(now - START_S), now)
            self.samples += 1
        self._begin(START_S + time_s)
        return self.sensors.measured(truth(time_s), START_S + time_s)

    def _begin(self, now):
        if not self.begun and now >= START_S:
            self.sensors.begin(START_S)
            self.begun = True

    def errors(self, *times):
        return [pytest.approx(np.subtract(self.tells(t), truth(t)), abs=1e-9) for t in times]


def error(north=0.0, east=0.0, vn=0.0, ve=0.0):
    return [north, east, 0.0, vn, ve, 0.0]


KINDS = {
    "gps_drift": {"rate_m_s": 0.5, "towards_deg": 90.0},
    "gps_jump": {"distance_m": 7.0, "towards_deg": 200.0},
    "frozen_telemetry": {},
    "lagging_telemetry": {"lag_s": 0.73},
    "compass_bias": {"bias_deg": 40.0},
    "false_report": {"offset_m_s": 0.8, "towards_deg": 300.0},
}
"""Every kind that touches telemetry, with a severity."""


# --- each kind


def test_a_drifting_gps_moves_the_place_at_its_rate_and_leaves_the_velocity_true():
    flown = Flown("gps_drift", rate_m_s=0.5, towards_deg=90, onset_s=2, end_s=12)
    assert flown.errors(1, 2, 4, 11.9, 12, 20) == [
        error(), error(), error(east=1.0), error(east=4.95), error(), error()
    ]  # fmt: skip


def test_a_drift_that_grows_goes_by_the_square_of_time():
    flown = Flown("gps_drift", rate_m_s=0.5, towards_deg=180, grows_over_s=10)
    assert flown.errors(0, 2, 10, 20) == [error(), error(-0.1), error(-2.5), error(-7.5)]


def test_a_drift_that_comes_and_goes_begins_anew_each_time():
    flown = Flown("gps_drift", rate_m_s=0.5, towards_deg=0, period_s=10, on_fraction=0.6)
    assert flown.errors(4, 6, 10, 14) == [error(2.0), error(), error(), error(2.0)]


def test_a_gps_that_jumps_is_off_by_one_step():
    flown = Flown("gps_jump", distance_m=5, towards_deg=270, onset_s=2)
    assert flown.errors(1.99, 2, 90) == [error(), error(east=-5.0), error(east=-5.0)]


def test_a_false_report_is_off_in_velocity_and_goes_where_that_would_lead():
    flown = Flown("false_report", offset_m_s=0.8, towards_deg=90, onset_s=2)
    assert flown.errors(2, 3, 12) == [error(ve=0.8), error(east=0.8, ve=0.8), error(east=8.0, ve=0.8)]


@pytest.mark.parametrize("grows_over_s", [0, 4])
def test_the_place_of_a_false_report_is_the_integral_of_its_velocity(grows_over_s):
    flown = Flown("false_report", offset_m_s=0.8, towards_deg=30, onset_s=1, grows_over_s=grows_over_s)
    told = np.array([flown.tells(n * 0.01) for n in range(101, 1001)])
    moved = told[-1, :2] - told[0, :2]
    assert moved == pytest.approx(np.trapezoid(told[:, 3:5], dx=0.01, axis=0), abs=1e-4)


def test_a_vehicle_with_a_wrong_compass_tells_its_velocity_turned_back_and_its_place_truly():
    told = Flown("compass_bias", bias_deg=90).tells(10.0)
    n, e, d, vn, ve, vd = truth(10.0)
    assert told == pytest.approx((n, e, d, ve, -vn, vd))


def test_frozen_telemetry_tells_for_ever_what_was_true_at_onset():
    flown = Flown("frozen_telemetry", onset_s=3, end_s=30)
    assert flown.tells(2.5) == truth(2.5)
    for time_s in (3.0, 3.01, 7.7, 29.9):
        assert flown.tells(time_s) == pytest.approx(truth(3.0), abs=1e-9)
    assert flown.tells(30.0) == truth(30.0)


def test_frozen_telemetry_thaws_and_freezes_anew():
    flown = Flown("frozen_telemetry", onset_s=1, period_s=4)
    for time_s, since_s in ((2.9, 1), (3, 3), (4.9, 4.9), (6, 5), (8, 8), (10.9, 9)):
        assert flown.tells(time_s) == pytest.approx(truth(since_s), abs=1e-9)


def test_frozen_telemetry_repeats_its_noise_too():
    flown = Flown("frozen_telemetry", onset_s=3, noise=NOISE)
    assert flown.tells(2.5) != flown.tells(2.6)
    assert flown.tells(3.5) == flown.tells(9.9)


def test_lagging_telemetry_tells_what_was_true_a_while_ago_even_before_the_mission():
    flown = Flown("lagging_telemetry", lag_s=1.25, onset_s=0.5)
    assert flown.tells(0.4) == truth(0.4)
    for time_s in (0.5, 1.0, 1.237, 44.4):
        assert flown.tells(time_s) == pytest.approx(truth(time_s - 1.25), abs=1e-4)


def test_a_lag_that_grows_makes_reported_time_run_slower():
    flown = Flown("lagging_telemetry", lag_s=2.0, grows_over_s=10)
    for time_s in (0.0, 0.004, 0.5, 5.0, 10.0, 30.0):
        assert flown.tells(time_s) == pytest.approx(truth(time_s - 0.2 * min(time_s, 10.0)), abs=1e-4)


def test_a_lag_longer_than_the_vehicle_has_lived_tells_of_its_first_moment():
    sensors = Sensors(scenario(fault=[{"vehicle": 1, "kind": "lagging_telemetry", "lag_s": 10}]), vehicle=1, seed=1)
    sensors.note(truth(0.0), 0.02)
    sensors.begin(0.02)
    sensors.note(truth(1.0), 1.0)
    assert sensors.measured(truth(1.0), 1.0) == truth(0.0)


def test_a_lie_is_told_late_by_a_vehicle_that_is_late():
    faults = [
        {"vehicle": 1, "kind": "lagging_telemetry", "lag_s": 1.0},
        {"vehicle": 1, "kind": "gps_jump", "distance_m": 5.0, "onset_s": 2.0},
    ]
    flown = Flown("gps_jump")
    flown.sensors = Sensors(scenario(fault=faults), vehicle=1, seed=1)
    for time_s, jumped in ((2.5, 0.0), (2.9, 0.0), (3.1, 5.0)):
        assert flown.tells(time_s)[0] == pytest.approx(truth(time_s - 1.0)[0] + jumped, abs=1e-6)


# --- all kinds


@pytest.mark.parametrize("kind", KINDS)
def test_telemetry_of_others_and_of_before_and_after_is_true(kind):
    fault = {"vehicle": 2, "kind": kind} | KINDS[kind]
    swarm = {"rows": 1, "columns": 2, "leaders": [1]}
    others = Sensors(scenario(fault=[fault], swarm=swarm), vehicle=1, seed=1)
    others.begin(0.0)
    assert not others.go_stale
    assert others.measured(truth(5.0), 5.0) == truth(5.0)
    flown = Flown(kind, onset_s=2, end_s=4, **KINDS[kind])
    for time_s, wrong in ((-1, False), (1.9, False), (2.5, True), (3.9, True), (4.1, False), (9, False)):
        assert (flown.tells(time_s) != truth(time_s)) is wrong
    flown.sensors.end()
    assert flown.sensors.measured(truth(50.0), 50.0) == truth(50.0)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "frozen_telemetry"])
def test_a_severity_that_grows_is_in_between_in_between(kind):
    def off(grows_over_s, time_s):
        flown = Flown(kind, grows_over_s=grows_over_s, **KINDS[kind])
        return np.linalg.norm(np.subtract(flown.tells(time_s), truth(time_s)))

    assert 0 < off(10, 1) < off(10, 5) < off(0, 5)


@pytest.mark.parametrize("kind", KINDS)
def test_noise_comes_on_top_and_is_the_same_as_that_of_a_healthy_vehicle(kind):
    """So a fault changes one thing at a time; only stale telemetry has the noise of its time."""
    if kind in ("frozen_telemetry", "lagging_telemetry"):
        return
    blurred, exact = Flown(kind, noise=NOISE, **KINDS[kind]), Flown(kind, **KINDS[kind])
    healthy = Flown("rotor", noise=NOISE, rotor=1)
    for time_s in (0.5, 3.0, 3.05, 8.0):
        noise = np.subtract(blurred.tells(time_s), exact.tells(time_s))
        assert noise == pytest.approx(np.subtract(healthy.tells(time_s), truth(time_s)), abs=1e-9)
        assert noise[:2].all()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("manner", [{}, {"grows_over_s": 3.0}, {"period_s": 1.3}, {"onset_s": 0.013, "end_s": 3.017}])
def test_what_is_told_depends_on_time_and_not_on_how_often_one_asks(kind, manner):
    asked = [n * 0.004 for n in range(1000)]
    told = [Flown(kind, noise=NOISE, **KINDS[kind] | manner) for _ in range(3)]
    often = dict(zip(asked, map(told[0].tells, asked), strict=True))
    assert all(told[1].tells(t) == often[t] for t in asked[::25])
    assert all(told[2].tells(t) == often[t] for t in asked[7::61])


# --- in flight


def heard(kind, rate_hz, *, manner=None, seconds=4.0):
    """(step → LOCAL_POSITION_NED, final truth) of a vehicle that flies a bend, asked this often."""
    fault = {"vehicle": 1, "kind": kind} | KINDS[kind] | (manner or {})
    flight = Flight(scenario(fault=[fault], noise=NOISE))
    flight.ask(SET_INTERVAL, LOCAL_POSITION, 1e6 / rate_hz)
    flight.hover(3.0).offboard((1.0, 0.0, 0.0), 1.0)
    flight.endpoint.begin_mission()
    flight.stream(seconds / 2, (1.5, 0.0, 0.0), rate_hz=10)
    flight.stream(seconds / 2, (0.5, 1.0, 0.0), rate_hz=10)
    told = {m.time_boot_ms: (m.x, m.y, m.z, m.vx, m.vy, m.vz) for m in flight.all("LOCAL_POSITION_NED")}
    return told, flight.position, flight


@pytest.mark.parametrize("kind", KINDS)
def test_asked_five_times_a_tick_a_vehicle_tells_the_same_at_the_same_times_and_flies_the_same(kind):
    rarely, one, _ = heard(kind, 10, manner={"onset_s": 0.5, "grows_over_s": 2.0})
    often, other, _ = heard(kind, 50, manner={"onset_s": 0.5, "grows_over_s": 2.0})
    assert one == other
    assert len(often) > 4 * len(rarely)
    assert all(often[time_ms] == told for time_ms, told in rarely.items())


def test_frozen_telemetry_goes_on_with_ever_new_time_stamps():
    told, _, _ = heard("frozen_telemetry", 10, manner={"onset_s": 1.0})
    assert len(told) > 60
    assert len(set(list(told.values())[-25:])) == 1


def test_only_vehicles_whose_telemetry_goes_stale_are_looked_at_more_often():
    def moments(*faults):
        return Flight(scenario(fault=list(faults))).endpoint.next_event_step

    assert moments() == moments({"vehicle": 1, "kind": "gps_drift"}) == HZ // 10
    assert moments({"vehicle": 1, "kind": "frozen_telemetry"}) == round(SAMPLE_S * HZ)


def test_the_global_position_is_as_wrong_as_the_local_one_however_far_off():
    fault = {"vehicle": 1, "kind": "gps_jump", "distance_m": 1000.0, "towards_deg": 60.0}
    flight = Flight(scenario(fault=[fault]))
    flight.ask(SET_INTERVAL, GLOBAL_POSITION, 100_000)
    flight.ask(SET_INTERVAL, LOCAL_POSITION, 100_000)
    flight.endpoint.begin_mission()
    flight.wait(0.25)
    local, world = flight.last("LOCAL_POSITION_NED"), flight.last("GLOBAL_POSITION_INT")
    home = PLACE.latitude_deg, PLACE.longitude_deg
    latitude, longitude, _ = pymap3d.ned2geodetic(local.x, local.y, 0.0, *home, PLACE.altitude_m)
    assert (local.x, local.y) == pytest.approx((500.0, 866.025), abs=0.1)
    assert world.lat * 1e-7 == pytest.approx(latitude, abs=0.2 / 111_000)
    assert world.lon * 1e-7 == pytest.approx(longitude, abs=0.2 / 75_000)
