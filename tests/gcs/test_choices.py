"""The options that `run` and `fly` share: what they make of a scenario, and what is refused in a sentence."""

import pytest

from gcs import cli
from gcs.choices import AS_IT_IS, BadUsageError, Choices, check_many, check_seed
from gcs.rules import RuleError
from scenarios import ScenarioError, load


def test_without_a_choice_a_scenario_stays_as_it_is():
    assert AS_IT_IS.scenario("emergency") == load("emergency")


def test_each_choice_changes_its_key_and_no_other():
    chosen = Choices(controller="average", trust="fused", severity=0.7, set_=("control.c1=0.2",)).scenario("emergency")
    told = ["control.rule=average", "trust.source=fused", "fault.0.max_speed_fraction=0.7", "control.c1=0.2"]
    assert chosen == load("emergency", overrides=told)


def test_an_option_of_its_own_says_more_than_a_key():
    chosen = Choices(controller="median", trust="auto", set_=("control.rule=average", "trust.source=ratings"))
    assert (chosen.scenario("demo").control.rule, chosen.scenario("demo").trust.source) == ("median", "auto")


def test_no_fault_is_no_fault_whatever_the_keys_say():
    chosen = Choices(no_fault=True, set_=('fault=[{vehicle=1, kind="frozen_telemetry"}]',)).scenario("emergency")
    assert chosen.fault == ()


def test_severity_is_of_every_degraded_motor_and_of_nothing_else():
    three = (
        'fault=[{vehicle=1, kind="motor_degradation"}, {vehicle=2, kind="frozen_telemetry"}, '
        '{vehicle=3, kind="motor_degradation"}]'
    )
    first, other, last = Choices(severity=0.0, set_=(three,)).scenario("demo").fault
    assert first.max_speed_fraction == last.max_speed_fraction == 0.0
    assert other.kind == "frozen_telemetry"


@pytest.mark.parametrize(
    ("chosen", "error", "said"),
    [
        ({"severity": -0.1}, BadUsageError, "--severity -0.1: must be 0 to 1"),
        ({"severity": 1.01}, BadUsageError, "--severity 1.01: must be 0 to 1"),
        ({"severity": float("nan")}, BadUsageError, "--severity nan: must be 0 to 1"),
        ({"severity": 0.4, "no_fault": True}, BadUsageError, "there is no degraded motor"),
        ({"controller": "guess"}, ScenarioError, "rule = 'guess'"),
        ({"controller": "no.such:rule"}, RuleError, "no.such"),
        ({"trust": "guess"}, ScenarioError, "trust.source"),
        ({"set_": ("trust.beyond_repair=hold", "swarm.altitude_m=5")}, ScenarioError, "swarm.altitude_m = 5.0"),
        ({"set_": ("trust.age_out_s=0",)}, ScenarioError, "age_out_s"),
        ({"set_": ("trust.response_jerk_m_s3=5",)}, ScenarioError, "it takes both bounds, or neither"),
    ],
    ids=lambda value: str(value) if isinstance(value, dict) else "",
)
def test_what_cannot_be_obeyed_is_refused_in_a_sentence(chosen, error, said):
    with pytest.raises(error) as refused:
        Choices(**chosen).scenario("emergency")
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_seed_is_any_number_from_nothing_up():
    check_seed(None)
    check_seed(0)
    with pytest.raises(BadUsageError, match="--seed -1: must not be negative"):
        check_seed(-1)


def test_many_are_at_least_one_flown_by_somebody():
    check_many(None, -1)
    check_many(1, 8)
    with pytest.raises(BadUsageError, match="--seeds 0: must be at least 1"):
        check_many(0, 1)
    with pytest.raises(BadUsageError, match="--jobs 0: must be"):
        check_many(1, 0)


@pytest.mark.parametrize("command", [("run", "emergency"), ("fly", "emergency", "--link", "udpin:127.0.0.1:14777")])
@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("--trust guess", "guess"),
        ("--severity 2", "--severity 2.0: must be 0 to 1"),
        ("--controller no.such:rule", "no.such"),
        ("--set trust.beyond_repair=hold --set swarm.altitude_m=5", "it must be 6 m or more"),
    ],
)
def test_run_and_fly_refuse_alike(capfd, tmp_path, command, options, said):
    with pytest.raises(SystemExit) as ended:
        cli.main([*command, *options.split(), "--out", str(tmp_path / "out")])
    out, err = capfd.readouterr()
    assert (ended.value.code, out) == (2, "")
    assert said in err
    assert err.startswith("gcs: ")
    assert err.count("\n") == 1
    assert not (tmp_path / "out").exists()
