"""Experiments from TOML: what a file expands to, and what is refused in which words."""

from pathlib import Path

import pytest

from scenarios import ScenarioError, load
from scenarios.experiment import EXPERIMENTS, experiment_names, load_experiment, parse_experiment

ARM = '[[arm]]\nname = "truth"\ncontroller = "trust-r"\ntrust = "truth"\n'
SUITE = '[[suite]]\nname = "base"\n'
HEAD = 'title = "T"\nscenarios = ["transit", "emergency"]\n'


def parsed(text, folder=Path()):
    return parse_experiment(text, source="mine.toml", folder=folder)


def names(experiment):
    return [str(condition) for condition in experiment.conditions]


@pytest.mark.parametrize("name", experiment_names())
def test_every_experiment_that_ships_can_be_built(name):
    experiment = load_experiment(name)
    assert experiment.conditions
    assert load_experiment(EXPERIMENTS / f"{name}.toml") == experiment


def test_the_base_experiment_is_the_papers_conditions_and_the_healthy_flights():
    experiment = load_experiment("base")
    assert names(experiment) == [
        "base/transit 40 %", "base/transit 70 %", "base/emergency 40 %", "base/emergency 70 %",
        "fault-free/transit", "fault-free/emergency",
    ]  # fmt: skip
    assert experiment.seeds == 30
    assert experiment.reference == "truth"
    assert [arm.name for arm in experiment.arm] == [
        "average", "median", "wmsr-1", "wmsr-2", "confidence-decay", "truth", "ratings", "auto", "fused"
    ]  # fmt: skip


def test_a_suite_is_the_product_of_scenarios_severities_and_cases():
    cases = '[suite.cases]\n"1 m" = ["noise.position_m=1"]\n"2 m" = ["noise.position_m=2"]\n'
    experiment = parsed(HEAD + SUITE + "severities = [0.4, 0.7]\n" + cases + ARM)
    assert len(experiment.conditions) == 2 * 2 * 2
    last = experiment.conditions[-1]
    assert last.name == "emergency 70 %, 2 m"
    scenario = last.build(experiment.arm[0])
    assert scenario == load("emergency", overrides=["noise.position_m=2", 'trust.source="truth"']).with_severity(0.7)


def test_overrides_count_from_the_experiment_to_the_suite_to_the_case_to_the_arm():
    cases = 'set = ["noise.velocity_m_s=2", "noise.gust_m_s=2"]\n'
    cases += '[suite.cases]\n"c" = ["noise.gust_m_s=3", "wind.speed_m_s=3"]\n'
    arm = ARM + 'set = ["wind.speed_m_s=4"]\n'
    text = HEAD + 'set = ["noise.position_m=1", "noise.velocity_m_s=1"]\n' + SUITE + cases + arm
    experiment = parsed(text)
    scenario = experiment.conditions[0].build(experiment.arm[0])
    noise = scenario.noise
    assert (noise.position_m, noise.velocity_m_s, noise.gust_m_s, scenario.wind.speed_m_s) == (1, 2, 3, 4)


def test_what_the_experiment_says_for_all_suites_a_suite_may_say_otherwise():
    text = (
        HEAD + "severities = [0.4]\n" + SUITE + '[[suite]]\nname = "free"\nno_fault = true\nscenarios = ["demo"]\n'
        '[[suite]]\nname = "own"\nseverities = []\n' + ARM
    )
    experiment = parsed(text)
    assert names(experiment) == [
        "base/transit 40 %", "base/emergency 40 %", "free/demo", "own/transit", "own/emergency",
    ]  # fmt: skip
    assert experiment.conditions[2].build(experiment.arm[0]).fault == ()
    assert experiment.conditions[3].build(experiment.arm[0]).fault == load("transit").fault


def test_an_arm_may_fly_in_some_suites_only():
    text = HEAD + SUITE + '[[suite]]\nname = "other"\n' + ARM + '[[arm]]\nname = "some"\nsuites = ["other"]\n'
    experiment = parsed(text)
    flown = {
        condition.suite: [arm.name for arm in experiment.arms_of(condition)] for condition in experiment.conditions
    }
    assert flown == {"base": ["truth"], "other": ["truth", "some"]}


def test_a_scenarios_path_begins_at_the_experiments_file(tmp_path):
    source = Path(EXPERIMENTS.parent / "transit.toml").read_text(encoding="utf-8")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "own.toml").write_text(source.replace("8\n", "9\n", 1), encoding="utf-8")
    (tmp_path / "e.toml").write_text('title = "T"\nscenarios = ["mine/own.toml"]\n' + SUITE + ARM, encoding="utf-8")
    experiment = load_experiment(tmp_path / "e.toml")
    assert names(experiment) == ["base/own"]
    assert experiment.conditions[0].build(experiment.arm[0]).mission.leg[0].length_m == 9


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("title = ", "not valid TOML"),
        (HEAD + ARM, "suite: this key is missing"),
        (HEAD + SUITE, "arm: this key is missing"),
        ("suite = []\n" + HEAD + ARM, "at least one"),
        (HEAD + "seeds = 0\n" + SUITE + ARM, "seeds = 0: must be greater than or equal to 1"),
        (
            HEAD + SUITE + "nofault = true\n" + ARM,
            "suite.0.nofault = True: there is no such key; did you mean no_fault?",
        ),
        (HEAD + SUITE + ARM + 'kind = "x"\n', "arm.0.kind = 'x': there is no such key"),
        (HEAD + SUITE + "severities = [1.5]\n" + ARM, "suite.0.severities.0 = 1.5: must be less than or equal to 1"),
        (HEAD + SUITE + "severities = [0.4]\nno_fault = true\n" + ARM, "with no_fault = true"),
        ('title = "T"\nscenarios = ["nope"]\n' + SUITE + ARM, "scenarios.0: no scenario 'nope'"),
        ('title = "T"\n' + SUITE + ARM, "no scenarios"),
        (HEAD + SUITE + SUITE + ARM, "name 'base' is there 2 times"),
        (HEAD + SUITE + ARM + ARM, "name 'truth' is there 2 times"),
        (HEAD + SUITE + "severities = [0.4, 0.4]\n" + ARM, "'transit 40 %' is there 2 times"),
        ('reference = "auto"\n' + HEAD + SUITE + ARM, "reference = 'auto': there is no such arm; allowed are truth"),
        (HEAD + SUITE + ARM + 'suites = ["x"]\n', "arm.0.suites names 'x': there is no such suite; allowed are base"),
        (
            HEAD + SUITE + ARM + "suites = []\n",
            "arm.0.suites = []: truth would fly nowhere; without the key, everywhere",
        ),
        (HEAD + SUITE + SUITE.replace("base", "b") + ARM + 'suites = ["b"]\n', "suite.0 (base): no arm flies there"),
        (
            HEAD + SUITE + ARM + 'ratings = "lazy"\n',
            "base/transit, arm truth: ratings = 'lazy': trust from truth takes none; allowed are ratings, fused",
        ),
        (
            HEAD + SUITE + ARM.replace("trust-r", "median").replace('"truth"\n', '"fused"\n') + 'ratings = "lazy"\n',
            "ratings = 'lazy': the rule median asks for no trust",
        ),
        (HEAD + SUITE + 'set = ["noise"]\n' + ARM, "base/transit, arm truth: set noise: must read section.key=value"),
        (HEAD + SUITE + 'set = ["noise.foo=1"]\n' + ARM, "base/transit, arm truth: transit.toml: noise.foo = 1"),
        (
            HEAD + SUITE + ARM + '[[arm]]\nname = "x"\ncontroller = "best"\n',
            "base/transit, arm x: transit.toml: control",
        ),
        (HEAD + SUITE + 'severities = [0.4]\nset = ["fault=[]"]\n' + ARM, "there is no degraded motor in this flight"),
        (HEAD + '[[suite]]\nname = "a|b"\n' + ARM, "suite.0.name = 'a|b'"),
    ],
)
def test_a_refusal_names_the_key_the_value_and_what_is_allowed(text, said):
    with pytest.raises(ScenarioError) as refused:
        parsed(text)
    words = str(refused.value)
    assert words.startswith("mine.toml: ")
    assert said in words
    assert "\n" not in words


def test_an_experiment_that_is_not_there_is_told_with_those_that_are():
    with pytest.raises(
        ScenarioError, match=r"no experiment 'nope': neither a file nor one of those that ship \(.*base"
    ):
        load_experiment("nope")


def test_a_folder_or_a_file_of_bytes_is_no_experiment(tmp_path):
    with pytest.raises(ScenarioError, match="neither a file"):
        load_experiment(tmp_path)
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(ScenarioError, match="cannot be read"):
        load_experiment(tmp_path / "bytes.toml")
