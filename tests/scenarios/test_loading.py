"""From TOML to a scenario, and what a person is told who got it wrong."""

import json
import re
import tomllib
from typing import get_args

import pytest

from scenarios import ScenarioError, find, load, names, parse
from scenarios.faults import AnyFault

# --- what ships


def test_three_scenarios_ship():
    assert names() == ["demo", "emergency", "transit"]


@pytest.mark.parametrize("name", ["demo", "emergency", "transit"])
def test_a_shipped_scenario_loads_by_name_and_by_path(name):
    assert load(name) == load(find(name)) == load(str(find(name)))


def test_transit_is_the_papers_first_mission():
    scenario = load("transit")
    assert [(leg.heading_deg, leg.length_m) for leg in scenario.mission.leg] == [(10, 8), (43, 30)]
    assert scenario.event == ()
    assert (scenario.trust.faulty_rating, scenario.trust.others_rating) == (1.94, 3.83)


def test_emergency_is_the_papers_second_mission():
    scenario = load("emergency")
    (leg,), (call,) = scenario.mission.leg, scenario.event
    assert (leg.heading_deg, leg.length_m) == (60, 30)
    assert (call.at_length_m, call.heading_deg, call.length_m) == (9, 0, 30)
    assert (scenario.trust.faulty_rating, scenario.trust.others_rating) == (2.18, 4.08)


@pytest.mark.parametrize("name", ["emergency", "transit"])
def test_the_papers_missions_carry_the_papers_parameters(name):
    scenario = load(name)
    (fault,) = scenario.fault
    assert (fault.vehicle, fault.max_speed_fraction, fault.offset_fraction, fault.onset_s) == (5, 0.4, 0.47, 0)
    assert (scenario.swarm.rows, scenario.swarm.columns, scenario.swarm.spacing_m) == (2, 3, 3)
    assert scenario.mission.cruise_m_s == 1.5
    control, network, noise = scenario.control, scenario.network, scenario.noise
    assert (control.c1, control.c2, control.feedback_cap, control.eta, control.threshold) == (0.1, 0.6, 0.25, 0.05, 0.5)
    assert (control.separation_radius_m, control.separation_gain) == (2.0, 0.3)
    assert (network.range_m, network.best_range_m, network.decay) == (28, 6, 2)
    assert (noise.velocity_m_s, noise.position_m, noise.gust_m_s) == (0.05, 0.1, 0.1)
    assert (scenario.expect.heading_error_deg, scenario.expect.distance_to_target_m) == (4, 3.2)


def test_a_file_of_ones_own_loads_by_its_path(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('title = "mine"\nmission.leg = [{task = "there", heading_deg = 0, length_m = 5}]\n')
    assert load(path).title == load(str(path)).title == "mine"


# --- --set

EVERY_KEY = tomllib.loads("""
title = "another"
time = {physics_hz = 500, period_s = 0.2, positions_per_tick = 4, timeout_s = 90.0}
swarm = {rows = 3, columns = 4, spacing_m = 4.0, leaders = [1, 2], altitude_m = 12.0}
mission = {cruise_m_s = 1.0, run_up_s = 0.0, leg = [{task = "look", heading_deg = 15.0, length_m = 25.0}]}
event = [{kind = "redirect", at_length_m = 12.0, task = "call", heading_deg = -30.0, length_m = 20.0}]
network = {range_m = 30.0, best_range_m = 5.0, decay = 1.0}
noise = {velocity_m_s = 0.2, position_m = 0.3, gust_m_s = 0.4, gust_time_s = 3.0}
wind = {speed_m_s = 4.0, from_deg = 270.0, turbulence = 2.0, vehicles = [2, 3]}
vehicle = {lag_s = 0.2, acceleration_m_s2 = 2.5, jerk_m_s3 = 5.0}
limits = {speed_m_s = 4.0, acceleration_m_s2 = 3.0, fence = {radius_m = 60.0, ceiling_m = 20.0, floor_m = 1.5}}
expect = {heading_error_deg = 5.0, distance_to_target_m = 4.0, min_separation_m = 0.5}

[[fault]]
vehicle = 6
kind = "motor_degradation"
onset_s = 1.0
end_s = 9.0
grows_over_s = 5.0
period_s = 4.0
on_fraction = 0.25
max_speed_fraction = 0.7
offset_fraction = 0.2

[trust]
source = "ratings"
faulty_rating = 1.5
others_rating = 4.5
response_delay_s = 0.2
response_lag_s = 0.4
response_acceleration_m_s2 = 2.5
response_jerk_m_s3 = 4.0
tolerance_m_s = 0.1
place_tolerance_m = 0.2
age_out_s = 15.0
hand_over = false
beyond_repair = "land"

[control]
rule = "average"
c1 = 0.2
c2 = 0.5
feedback_cap = 0.5
weights = "literal"
eta = 0.5
threshold = 0.4
confidence = 0.8
confidence_decay = 0.7
profile = "recommended"
separation_radius_m = 1.0
separation_gain = 0.1
berth_m = 2.5
berth_gain = 0.2
response_time_s = 0.9
""")
"""A value for each key; all but the kinds differ from what the scenario has."""


def leaves(tables, prefix=""):
    """(dotted key, value) of everything in a scenario's tables."""
    for key, value in tables.items() if isinstance(tables, dict) else enumerate(tables):
        if isinstance(value, dict) or (isinstance(value, list) and isinstance(value[0], dict)):
            yield from leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


KEYS = list(leaves(EVERY_KEY))
BOUNDS = ("trust.response_acceleration_m_s2", "trust.response_jerk_m_s3")
"""Set together or not at all."""


def tables(scenario):
    return scenario.model_dump(mode="json")


@pytest.mark.parametrize(("key", "value"), KEYS, ids=[key for key, _ in KEYS])
def test_every_key_can_be_set(key, value):
    """JSON writes numbers, strings and lists as TOML does."""
    together = BOUNDS if key in BOUNDS else (key,)
    overrides = [f"{one}={json.dumps(dict(KEYS)[one])}" for one in together]
    before = dict(leaves(tables(load("emergency"))))
    after = dict(leaves(tables(load("emergency", overrides=overrides))))
    assert {changed for changed in after if after[changed] != before[changed]} <= set(together)
    assert after[key] == value


def test_the_table_above_has_every_key_there_is():
    assert dict(KEYS).keys() == dict(leaves(tables(load("emergency")))).keys()


FAULTS = {
    "motor_degradation": {"max_speed_fraction": 0.7, "offset_fraction": 0.2},
    "rotor": {"rotor": 3, "efficiency": 0.6, "speed_limit": 0.9},
    "compass_bias": {"bias_deg": -45.0},
    "stuck_velocity": {},
    "wind": {"speed_m_s": 6.0, "from_deg": 90.0, "gust_m_s": 1.0, "gust_time_s": 3.0, "everyone": True},
    "gps_drift": {"rate_m_s": 0.3, "towards_deg": 90.0},
    "gps_jump": {"distance_m": 8.0, "towards_deg": -90.0},
    "false_report": {"offset_m_s": 0.6, "towards_deg": 180.0},
    "lagging_telemetry": {"lag_s": 2.0},
    "frozen_telemetry": {},
}
"""Every kind of fault, and a value other than its own for each key that only it has."""
COMMON = {"vehicle": 2, "onset_s": 3.0, "end_s": 30.0, "grows_over_s": 5.0, "period_s": 4.0, "on_fraction": 0.25}


def fault_tables(kind, keys):
    told = {"vehicle": 1, "kind": kind} | ({"rotor": 1} if kind == "rotor" else {}) | keys
    return f"fault=[{{{', '.join(f'{key}={json.dumps(value)}' for key, value in told.items())}}}]"


def test_the_table_of_faults_has_every_kind_and_every_key_there_is():
    members = get_args(get_args(AnyFault)[0])
    assert {member.model_fields["kind"].annotation.__args__ for member in members} == {(kind,) for kind in FAULTS}
    for member in members:
        (kind,) = member.model_fields["kind"].annotation.__args__
        assert {"kind"} | COMMON.keys() | FAULTS[kind].keys() == member.model_fields.keys()


@pytest.mark.parametrize(("kind", "keys"), FAULTS.items(), ids=FAULTS)
def test_every_key_of_every_kind_of_fault_can_be_set_and_none_but_a_rotor_must_be(kind, keys):
    (bare,) = load("emergency", overrides=[fault_tables(kind, {})]).fault
    (full,) = load("emergency", overrides=[fault_tables(kind, COMMON | keys)]).fault
    for key, value in (COMMON | keys).items():
        assert getattr(full, key) == value != getattr(bare, key)


@pytest.mark.parametrize("kind", FAULTS)
def test_every_kind_of_fault_refuses_what_it_does_not_know_and_says_what_it_does(kind):
    with pytest.raises(ScenarioError) as refused:
        load("emergency", overrides=[fault_tables(kind, {"grows_ovr_s": 3})])
    said = str(refused.value)
    assert f"{kind}." not in said
    for word in ("fault.0.grows_ovr_s = 3: there is no such key", "did you mean grows_over_s?", *FAULTS[kind]):
        assert word in said
    for word in {key for keys in FAULTS.values() for key in keys} - FAULTS[kind].keys():
        assert not re.search(rf"\b{word}\b", said)


@pytest.mark.parametrize(
    ("kind", "key", "value", "allowed"),
    [
        ("gps_drift", "rate_m_s", -1, "greater than or equal to 0"),
        ("gps_jump", "distance_m", 1e9, "less than or equal to 1000"),
        ("gps_jump", "towards_deg", 999, "less than or equal to 360"),
        ("lagging_telemetry", "lag_s", 0, "greater than 0"),
        ("lagging_telemetry", "lag_s", 11, "less than or equal to 10"),
        ("compass_bias", "bias_deg", 270, "less than or equal to 180"),
        ("false_report", "offset_m_s", "much", "number"),
        ("wind", "everyone", "all", "boolean"),
        ("wind", "gust_time_s", 0, "greater than 0"),
        ("stuck_velocity", "grows_over_s", -1, "greater than or equal to 0"),
        ("frozen_telemetry", "period_s", 0, "greater than 0"),
        ("frozen_telemetry", "on_fraction", 0, "greater than 0"),
        ("motor_degradation", "on_fraction", 1.5, "less than or equal to 1"),
    ],
)
def test_a_severity_out_of_its_range_is_refused_by_its_key(kind, key, value, allowed):
    with pytest.raises(ScenarioError) as refused:
        load("emergency", overrides=[fault_tables(kind, {key: value})])
    assert f"fault.0.{key} = {value!r}: " in str(refused.value)
    assert allowed in str(refused.value)


def test_many_keys_can_be_set_at_once_and_the_last_one_counts():
    scenario = load("transit", overrides=["swarm.rows=4", "swarm.columns=5", "swarm.rows=3"])
    assert (scenario.swarm.rows, scenario.swarm.columns) == (3, 5)


def test_a_word_needs_no_quotes_and_spaces_do_not_matter():
    assert load("transit", overrides=[" control.rule = average "]).control.rule == "average"


def test_a_whole_list_can_be_set():
    (fault,) = load("demo", overrides=['fault=[{vehicle=2, kind="rotor", rotor=1}]']).fault
    assert (fault.vehicle, fault.rotor, fault.efficiency) == (2, 1, 1.0)


def test_setting_changes_neither_the_file_nor_the_next_load():
    before = load("transit")
    load("transit", overrides=["mission.cruise_m_s=1.0"])
    assert load("transit") == before


# --- refusals: (--set, words that the refusal must have)

MOTOR = 'fault=[{vehicle=2, kind="motor_degradation", %s}]'
REFUSED = [
    ("swarm.spacing=3", "swarm.spacing = 3", "no such key", "did you mean spacing_m?", "rows, columns, spacing_m"),
    ("swram.rows=2", "swram", "no such key", "did you mean swarm?", "mission, event, fault"),
    ("mission.leg.0.lenght_m=3", "mission.leg.0.lenght_m = 3", "did you mean length_m?", "task, heading_deg, length_m"),
    ("event.0.at_lenght_m=3", "event.0.at_lenght_m = 3", "did you mean at_length_m?"),
    ("fault.0.max_speed_frction=1", "fault.0.max_speed_frction = 1", "did you mean max_speed_fraction?"),
    ("zzz=1", "zzz = 1", "no such key; allowed here: title"),
    ("fault.0.vehicle=9", "fault.0.vehicle = 9", "no such vehicle", "1 to 6"),
    ("fault.0.vehicle=0", "fault.0.vehicle = 0", "greater than or equal to 1"),
    ("swarm.rows=1", "fault.0.vehicle = 5", "1 to 3"),
    ("swarm.leaders=[1, 9]", "leaders", "vehicle 9", "1 to 6"),
    ("swarm.leaders=[2, 2]", "leaders = [2, 2]", "twice"),
    ("swarm.leaders=[]", "leaders = []", "at least one"),
    ("wind.vehicles=[7]", "wind.vehicles", "vehicle 7", "1 to 6"),
    ("swarm.rows=100", "rows × columns = 300", "1 to 250"),
    ("swarm.rows=2.5", "swarm.rows = 2.5", "integer"),
    ("swarm.rows=", "swarm.rows = ''", "integer"),
    ("swarm=3", "swarm = 3", "a section of keys"),
    ("network.best_range_m=28", "best_range_m = 28.0", "below range_m = 28.0"),
    ("network.range_m=5", "best_range_m = 6.0", "below range_m = 5.0"),
    ("network.best_range_m=0", "network.best_range_m = 0", "greater than 0"),
    ("noise.gust_m_s=nan", "noise.gust_m_s = nan", "finite"),
    ("mission.cruise_m_s=inf", "mission.cruise_m_s = inf", "finite"),
    ("noise.gust_m_s=-1", "noise.gust_m_s = -1", "greater than or equal to 0"),
    ("mission.cruise_m_s=fast", "mission.cruise_m_s = 'fast'", "number"),
    ("mission.cruise_m_s=9", "mission.cruise_m_s = 9", "limits.speed_m_s = 5"),
    ("limits.fence.radius_m=30", "limits.fence.radius_m = 30", "goes 41.7 m", "3 m more", "must be 44.8 or more"),
    ("limits.fence.ceiling_m=10", "limits.fence.ceiling_m = 10", "flies at 10 m", "must be 11 or more"),
    ("limits.fence.floor_m=9.5", "limits.fence.floor_m = 9.5", "down to 10 m", "must be 9 or less"),
    ("limits.fence.radius_m=0", "limits.fence.radius_m = 0", "greater than 0"),
    ("limits.fence.radius=50", "limits.fence.radius = 50", "did you mean radius_m?", "ceiling_m, floor_m"),
    ("control.rule=best", "control", "rule = 'best'", "average, trust-r", "package.module:function"),
    ("vehicle.lag_s=-1", "vehicle.lag_s = -1", "greater than or equal to 0"),
    ("vehicle.jerk_m_s3=0", "vehicle.jerk_m_s3 = 0", "greater than 0"),
    ("vehicle.jerk=5", "vehicle.jerk = 5", "did you mean jerk_m_s3?", "lag_s, acceleration_m_s2, jerk_m_s3"),
    ("control.weights=none", "control.weights = 'none'", "'sender' or 'literal'"),
    ("control.profile=mine", "control.profile = 'mine'", "'paper' or 'recommended'"),
    ("control.eta=1.1", "control.eta = 1.1", "less than or equal to 1"),
    ("trust.source=oracle", "trust.source = 'oracle'", "'truth'", "'ratings'"),
    ("trust.faulty_rating=0.5", "trust.faulty_rating = 0.5", "greater than or equal to 1"),
    ("fault.0.kind=wing", "fault.0.kind = 'wing'", "'motor_degradation', 'rotor', 'compass_bias'", "'wind'"),
    ('fault=[{vehicle=1, kind="rotor", rotor=7}]', "fault.0.rotor = 7", "less than or equal to 4"),
    ('fault=[{vehicle=1, kind="rotor"}]', "fault.0.rotor", "missing"),
    (
        'fault=[{vehicle=1, kind="rotor", rotr=2}, {vehicle=2, kind="motor_degradation"}]',
        "fault.0.rotr = 2",
        "did you mean rotor?",
        "efficiency",
    ),
    ('control={weights="literal", eta=0}', "control", "eta = 0", "above 0"),
    ("fault=[3]", "fault.0 = 3", "a section of keys"),
    ("fault=3", "fault = 3", "must be a list"),
    ("fault=[{vehicle=2}]", "fault.0.kind", "missing"),
    ('fault=[{kind="motor_degradation"}]', "fault.0.vehicle", "missing"),
    (MOTOR % "onset_s=5, end_s=5", "fault.0", "end_s = 5.0", "onset_s = 5.0"),
    ("event.0.kind=detour", "event.0.kind = 'detour'", "'redirect'"),
    ("event.0.at_length_m=30", "event.0.at_length_m = 30.0", "between 0 m and 30 m"),
    ("event.0.at_length_m=99", "event.0.at_length_m = 99.0", "between 0 m and 30 m"),
    ("event.0.at_length_m=0", "event.0.at_length_m = 0", "greater than 0"),
    ("mission.leg=[]", "leg = []", "at least one [[mission.leg]]"),
    ("mission.leg.0.heading_deg=400", "mission.leg.0.heading_deg = 400", "less than or equal to 360"),
    ("mission.leg.0.length_m=0", "mission.leg.0.length_m = 0", "greater than 0"),
    ("time.period_s=0.0015", "period_s = 0.0015", "0.375 physics steps", "physics_hz = 250", "whole number"),
    ("time.period_s=0", "time.period_s = 0", "greater than 0"),
    ("time.physics_hz=10", "time.physics_hz = 10", "greater than or equal to 100"),
    ("time.period_s=0.5", "time.period_s = 0.5", "less than or equal to 0.4"),
    ("swarm.altitude_m=0.2", "swarm.altitude_m = 0.2", "greater than or equal to 2"),
    ("noise.position_m=1e300", "noise.position_m", "less than or equal to 100"),
    ("swarm", "--set swarm", "section.key=value"),
    ("=3", "--set =3", "section.key=value"),
    ("swarm..rows=3", "--set swarm..rows=3", "section.key=value"),
    ("title.x=1", "--set title.x=1", "title is a value, not a section"),
    ("mission.leg.9.length_m=1", "--set mission.leg.9.length_m=1", "'9'", "list of 1", "from 0"),
    ("mission.leg.first.length_m=1", "--set", "'first' is no place in a list"),
    ("mission.leg.-1.length_m=1", "--set", "'-1' is no place in a list"),
]  # fmt: skip


@pytest.mark.parametrize(("override", "words"), [(first, rest) for first, *rest in REFUSED], ids=lambda v: str(v)[:40])
def test_a_refusal_names_the_key_the_value_and_what_is_allowed(override, words):
    with pytest.raises(ScenarioError) as refused:
        load("emergency", overrides=[override])
    said = str(refused.value)
    for word in words:
        assert word in said
    assert "\n" not in said
    assert not re.search(r"pydantic|Value error|Input should|http", said)


def test_every_wrong_key_is_named_in_one_go():
    with pytest.raises(ScenarioError, match=r"^transit\.toml: .*swarm\.rows.*; .*noise\.gust_m_s"):
        load("transit", overrides=["swarm.rows=0", "noise.gust_m_s=-1"])


def test_missing_keys_of_a_file_are_named():
    with pytest.raises(ScenarioError, match=r"mine: title: this key is missing; mission: this key is missing"):
        parse("", source="mine")


def test_a_name_that_is_no_scenario_is_refused_with_those_that_are():
    with pytest.raises(ScenarioError, match=r"no scenario 'tranist'.*demo, emergency, transit"):
        load("tranist")


def test_a_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(ScenarioError, match=re.escape(str(tmp_path / "none.toml"))):
        load(tmp_path / "none.toml")


def test_a_folder_is_no_scenario(tmp_path):
    with pytest.raises(ScenarioError, match="no scenario"):
        load(tmp_path)


def test_broken_toml_is_refused_with_file_and_line(tmp_path):
    path = tmp_path / "broken.toml"
    path.write_text('title = "no end\n')
    with pytest.raises(ScenarioError, match=r"broken\.toml: not valid TOML: .*line 1"):
        load(path)


def test_a_file_that_is_no_text_is_refused(tmp_path):
    path = tmp_path / "binary.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ScenarioError, match=r"binary\.toml: cannot be read"):
        load(path)


def test_a_second_call_must_come_on_the_path_that_the_first_one_began():
    def calls(at_length_m):
        events = ", ".join(
            f'{{kind="redirect", at_length_m={at}, task="call", heading_deg=0, length_m=10}}' for at in (9, at_length_m)
        )
        return load("emergency", overrides=[f"event=[{events}]"])

    assert calls(18.9).event[1].at_length_m == 18.9
    for beside in (8, 9, 19, 25):
        with pytest.raises(ScenarioError, match=r"event\.1\.at_length_m = .*between 9 m and 19 m"):
            calls(beside)
