"""Scenarios as frozen, checked data."""

from math import cos, hypot, radians, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ValidationError

from scenarios import MotorDegradation, direction, load, names, parse
from scenarios.models import Time

MIXED = """
title = "one drags, one loses a rotor"
fault = [
    {vehicle = 1, kind = "motor_degradation", onset_s = 2, end_s = 5},
    {vehicle = 2, kind = "rotor", rotor = 3, efficiency = 0.5},
    {vehicle = 3, kind = "motor_degradation", offset_fraction = 0.1},
]
[[mission.leg]]
task = "there"
heading_deg = 0
length_m = 10
"""


def sections(model):
    """A model and all models inside it."""
    yield model
    for value in dict(model).values():
        for item in value if isinstance(value, tuple) else (value,):
            if isinstance(item, BaseModel):
                yield from sections(item)


@pytest.mark.parametrize("name", names())
def test_nothing_in_a_scenario_can_be_changed(name):
    for section in sections(load(name)):
        for field, value in section:
            with pytest.raises(ValidationError, match="frozen"):
                setattr(section, field, value)
            assert not isinstance(value, (list, dict, set))


def test_equal_scenarios_have_equal_hashes():
    assert load("transit") == load("transit")
    assert hash(load("transit")) == hash(load("transit"))
    assert load("transit") != load("emergency")


@pytest.mark.parametrize("severity", [0.0, 0.4, 0.7, 1.0])
def test_severity_reaches_every_degraded_motor_and_nothing_else(severity):
    mixed = parse(MIXED, source="mixed")
    severe = mixed.with_severity(severity)
    assert [getattr(fault, "max_speed_fraction", None) for fault in severe.fault] == [severity, None, severity]
    for before, after in zip(mixed.fault, severe.fault, strict=True):
        assert after.model_dump() | {"max_speed_fraction": 0} == before.model_dump() | {"max_speed_fraction": 0}
    assert severe.model_copy(update={"fault": mixed.fault}) == mixed


def test_severity_of_a_healthy_flight_changes_nothing():
    assert load("demo").with_severity(0.4) == load("demo")


@pytest.mark.parametrize("name", names())
def test_without_faults_nobody_is_struck_and_all_else_stays(name):
    healthy = load(name).without_faults()
    assert healthy.fault == ()
    assert healthy.model_copy(update={"fault": load(name).fault}) == load(name)


@pytest.mark.parametrize("name", names())
def test_a_scenario_survives_being_written_and_read_as_json(name):
    scenario = load(name)
    assert type(scenario).model_validate_json(scenario.model_dump_json()) == scenario


@pytest.mark.parametrize(
    ("onset_s", "end_s", "time_s", "active"),
    [
        (2, 5, 1.999, False),
        (2, 5, 2.0, True),
        (2, 5, 4.999, True),
        (2, 5, 5.0, False),
        (0, None, 0.0, True),
        (0, None, 1e9, True),
        (0, None, -0.1, False),
    ],
)
def test_a_fault_acts_from_its_onset_until_just_before_its_end(onset_s, end_s, time_s, active):
    fault = MotorDegradation(vehicle=1, kind="motor_degradation", onset_s=onset_s, end_s=end_s)
    assert fault.active(time_s) is active


@pytest.mark.parametrize(
    ("physics_hz", "period_s", "steps"), [(250, 0.1, 25), (400, 0.1, 40), (250, 0.004, 1), (100, 0.4, 40)]
)
def test_a_tick_is_a_whole_number_of_physics_steps(physics_hz, period_s, steps):
    time = Time(physics_hz=physics_hz, period_s=period_s)
    assert time.steps_per_tick == steps
    assert time.period_ns * physics_hz == steps * 1_000_000_000


@given(st.integers(0, 100_000))
def test_whole_ticks_are_not_rounded_up_by_floating_point(ticks):
    assert Time().ticks(ticks * 0.1) == ticks


@given(st.floats(0, 1e4))
def test_ticks_are_the_first_at_or_after_the_time(seconds):
    ticks = Time().ticks(seconds)
    assert (ticks - 1) * 0.1 < seconds + 1e-9
    assert ticks * 0.1 >= seconds - 1e-6


@given(st.floats(-360, 360))
def test_direction_is_a_unit_vector_clockwise_from_north(heading):
    assert hypot(*direction(heading)) == pytest.approx(1)
    assert direction(heading) == pytest.approx((cos(radians(heading)), sin(radians(heading))))


@pytest.mark.parametrize(("heading", "expected"), [(0, (1, 0)), (90, (0, 1)), (180, (-1, 0)), (-90, (0, -1))])
def test_directions_of_the_compass(heading, expected):
    assert direction(heading) == pytest.approx(expected, abs=1e-12)
