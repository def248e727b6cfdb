"""Rules by name, and a researcher's own from a file."""

import re
import subprocess
import sys
from itertools import count
from pathlib import Path
from textwrap import dedent

import numpy as np
import orjson
import pytest
from flights import GCS, SHORT

from gcs.control import settings
from gcs.rules import RuleError, rule
from scenarios import load
from scenarios.models import RULES as NAMES
from trustr.consensus import RULES, Heard
from trustr.network import neighbours

BRIEFLY = [word for override in SHORT for word in ("--set", override)]
PAGE = Path(__file__).parents[2] / "docs" / "your-own-rule.md"
WHOLE = """
import numpy as np
from trustr.consensus import Agreement, agreed
from trustr.network import normalised
"""
fresh = (f"a_rule_of_test_{number}" for number in count())


@pytest.fixture
def written(tmp_path, monkeypatch):
    """Write a module into the current directory and get its name, one that no test had before."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path])

    def write(source):
        name = next(fresh)
        (tmp_path / f"{name}.py").write_text(WHOLE + dedent(source))
        return name

    return write


def tried(name):
    """Settings of a flight with this rule, or RuleError."""
    return settings(load("demo", overrides=[f"control.rule={name}"]))


def test_rules_that_ship_are_found_by_their_names():
    assert all(rule(name) is RULES[name] for name in NAMES)


def test_help_names_every_rule():
    done = subprocess.run([GCS, "run", "--help"], capture_output=True, text=True, check=True)
    said = re.sub(r"[\s│]+", "", done.stdout)
    assert all(name in said for name in NAMES)
    assert "package.module:function" in said


def test_the_pages_example_flies_and_is_replayed_where_its_file_is_and_missed_where_it_is_not(tmp_path):
    (example,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    (tmp_path / "nearest.py").write_text(example)
    flight = [GCS, "run", "demo", *BRIEFLY, "--controller", "nearest:rule", "--out", "flown", "--json"]
    done = subprocess.run(flight, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert orjson.loads(done.stdout)["controller"] == "nearest:rule"
    replay = [GCS, "replay", "--verify", tmp_path / "flown"]
    done = subprocess.run(replay, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "identical to the bit" in done.stdout
    done = subprocess.run(replay, cwd=tmp_path / "flown", capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("gcs: control.rule = 'nearest:rule': there is no module nearest")
    assert done.stderr.count("\n") == 1


def test_a_rule_of_ones_own_decides_as_the_same_rule_does_that_ships(written):
    name = written(
        "def mine(heard, _): return agreed(heard, normalised(heard.graph, np.ones(len(heard.graph.sender))))"
    )
    mine, average = tried(f"{name}:mine"), tried("average")
    assert mine.rule is not average.rule
    seen = []
    for chosen in (mine, average):
        velocity = np.arange(12.0).reshape(6, 2)
        graph = neighbours(chosen.offset_ne, np.ones(6, bool), range_m=28.0)
        seen.append(chosen.rule(Heard(graph, velocity, np.ones(6), 0.0, velocity, np.zeros(6)), chosen))
    assert (seen[0].velocity_ne == seen[1].velocity_ne).all()
    assert (seen[0].weights == seen[1].weights).all()


FAULTY = [
    ("def f(heard, settings): return heard.velocity_ne", "it returned a ndarray, not a trustr.consensus.Agreement"),
    ("def f(heard, settings): pass", "it returned a NoneType"),
    (
        "def f(heard, settings): return Agreement(np.zeros((2, 6)), np.ones(36))",
        "velocity_ne of shape (2, 6), not (6, 2)",
    ),
    ("def f(heard, settings): return Agreement(np.zeros((6, 2)), np.eye(6))", "weights of shape (6, 6), not (36,)"),
    ("def f(heard, settings): return Agreement([[1], [2, 3]], np.eye(6))", "velocity_ne that make no array"),
    (
        "def f(heard, settings): return Agreement(np.full((6, 2), 'a'), np.eye(6))",
        "velocity_ne of type <U1, not numbers",
    ),
    ("def f(heard, settings): return Agreement(np.full((6, 2), np.nan), np.eye(6))", "not all finite"),
    ("def f(heard, settings): return agreed(heard, np.full(36, np.inf))", "not all finite"),
    ("def f(heard, settings): return agreed(heard, np.ones(36))", "weights for vehicle 1 sum to 6, not 1"),
    (
        "def f(heard, settings):\n w = np.full(36, 1 / 6)\n w[:2] += -1, 1\n return agreed(heard, w)",
        "a weight of -0.833333; none may be below 0",
    ),
    (
        "def f(heard, settings): heard.velocity_ne[0] = 9",
        "it raised ValueError: assignment destination is read-only at",
    ),
    (
        "def f(heard, settings): heard.graph.sender[0] = 9",
        "it raised ValueError: assignment destination is read-only at",
    ),
    ("def f(heard, settings):\n\n  return 1 / 0", "it raised ZeroDivisionError: division by zero at"),
    ("def f(heard): return heard", "it raised TypeError: f() takes 1 positional argument but 2 were given"),
    ("def g(heard, settings): pass", "has no function f"),
    ("f = 3", "f is no function but a int"),
    ("1 / 0", "raised ZeroDivisionError: division by zero"),
    ("import nosuchthing", "raised ModuleNotFoundError: No module named 'nosuchthing'"),
    ("f = (", "raised SyntaxError: '(' was never closed"),
    ("raise SystemExit(4)", "raised SystemExit: 4"),
    ("raise ValueError('two\\nlines')", "raised ValueError: two lines"),
]


@pytest.mark.parametrize(("source", "said"), FAULTY, ids=[said for _, said in FAULTY])
def test_what_is_wrong_with_a_rule_is_told_in_a_sentence_that_names_it(written, source, said):
    name = written(source)
    with pytest.raises(RuleError, match=re.escape(said)) as refusal:
        tried(f"{name}:f")
    assert str(refusal.value).startswith(f"control.rule = '{name}:f': ")
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("words", ["run demo", "fly demo --link udpin:127.0.0.1:14999 --arm --yes"])
@pytest.mark.parametrize(
    ("rule_name", "said"),
    [
        ("nosuchmodule:f", "there is no module nosuchmodule"),
        ("numpy.nosuchmodule:f", "there is no module numpy.nosuchmodule"),
        ("nosuch.module:f", "there is no module nosuch"),
        ("numpy:zeros", "'numpy:zeros': it raised TypeError"),
        ("numpy:pi", "pi is no function but a float"),
        (
            "numpy:",
            "allowed are average, trust-r, median, wmsr-1, wmsr-2, confidence-decay, or package.module:function",
        ),
        (":f", "package.module:function"),
        ("a..b:f", "package.module:function"),
        ('"', "package.module:function"),
    ],
)
def test_a_rule_that_cannot_be_flown_is_refused_before_anything_is_made(gcs, written, tmp_path, words, rule_name, said):
    written("")
    before = sorted(tmp_path.iterdir())
    code, out, err = gcs(*words.split(), "--controller", rule_name)
    assert (code, out) == (2, "")
    assert err.startswith("gcs: ")
    assert err.count("\n") == 1
    assert said in err
    assert sorted(tmp_path.iterdir()) == before


FAILS = "def f(heard, _): return agreed(heard, heard.time_s + normalised(heard.graph, heard.graph.distance + 1))"
LEAVES = """
import sys
def f(heard, _):
    if heard.time_s > 1.0:
        sys.exit("enough")
    return agreed(heard, normalised(heard.graph, heard.graph.distance + 1))
"""


@pytest.mark.parametrize(
    ("source", "said"),
    [(FAILS, "its weights for vehicle 1 sum to"), (LEAVES, "it raised SystemExit: enough at")],
    ids=["weights", "sys.exit"],
)
def test_a_rule_that_fails_in_the_air_lands_the_swarm_and_says_why(gcs, written, tmp_path, source, said):
    name = written(source)
    code, out, err = gcs("run", "demo", *BRIEFLY, "--controller", f"{name}:f", "--out", tmp_path / "flown", "--json")
    result = orjson.loads(out)
    assert code == 3
    assert f"control.rule = '{name}:f': {said}" in result["problem"]
    assert "Traceback" not in err
    assert result["passed"] is False
