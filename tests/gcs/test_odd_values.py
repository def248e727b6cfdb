"""Odd values that people type, and what is said of odd flights."""

import matplotlib.pyplot as plt
import pytest
from flights import SHORT, recorded

from gcs import cli
from gcs.choices import MOST_SEED, BadUsageError, check_seed
from gcs.picture import draw
from gcs.ratings import RatingsError, parse
from gcs.words import faults
from scenarios import load


def test_a_seed_is_no_larger_than_a_summary_can_hold():
    check_seed(MOST_SEED)
    with pytest.raises(BadUsageError, match=f"--seed 99999999999999999999: must not be above {MOST_SEED}"):
        check_seed(99999999999999999999)


@pytest.mark.parametrize("ratings", ["x" * 300, "x" * 100_000, "nobody"])
def test_ratings_by_any_name_that_is_none_are_refused_in_a_sentence(ratings, capfd, tmp_path):
    with pytest.raises(SystemExit) as ended:
        cli.main(["run", "demo", "--trust", "ratings", "--ratings", ratings, "--out", str(tmp_path / "out")])
    out, err = capfd.readouterr()
    assert (ended.value.code, out) == (2, "")
    assert err.startswith("gcs: no ratings '")
    assert "neither a file nor a model" in err
    assert len(err) < 300


@pytest.mark.parametrize("line", [b"[]", b"5", b'"x"'])
def test_what_is_no_object_is_told_the_keys_that_are_allowed_there(line):
    with pytest.raises(RatingsError, match=r"with the keys rater, vehicle, rating$"):
        parse(line, count=6, live=True)
    with pytest.raises(RatingsError, match=r"with the keys time_s, rater, vehicle, rating$"):
        parse(line, count=6)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ("max_speed_fraction=1, offset_fraction=0.2", "robot 5 pushed to its left by 20% of cruise"),
        ("max_speed_fraction=0.9, offset_fraction=0.2", "robot 5 at 90% speed"),
        ("max_speed_fraction=1, offset_fraction=0", "robot 5 at 100% speed"),
    ],
)
def test_a_motor_fault_that_leaves_all_the_speed_is_called_by_its_offset(keys, words):
    fault = f'fault=[{{vehicle=5, kind="motor_degradation", {keys}}}]'
    assert faults(load("demo", overrides=[fault])) == [words]


@pytest.mark.parametrize(("allowed", "said"), [(1.0, False), (50.0, True)])
def test_a_picture_names_the_separation_where_it_fails(allowed, said, tmp_path, monkeypatch):
    flight = recorded("demo", *SHORT)
    flown, figures = flight.read(), []
    monkeypatch.setattr(plt, "close", figures.append)
    expect = flown.scenario.expect.model_copy(update={"min_separation_m": allowed})
    draw(flown.track, flown.scenario.model_copy(update={"expect": expect}), tmp_path / "p.png")
    monkeypatch.undo()
    (figure,) = figures
    title = figure.axes[0].get_title()
    plt.close(figure)
    closest = f"robots as close as {flight.summary.min_separation_m:.2f} m (allowed {allowed:g} m)"
    assert (closest in title) == said
