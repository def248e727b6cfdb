"""Ratings as lines of a file, and as a model of a person says them."""

import orjson
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcs import cli
from gcs.events import Rating
from gcs.ratings import NAME_LENGTH, RatingsError, chosen, parse, read, schedule, written
from scenarios import load
from trustr.raters import MODELS

LINE = {"time_s": 12.3, "rater": "op1", "vehicle": 5, "rating": 2}


def line(**changes):
    """A good line but for these keys; None leaves a key out."""
    return orjson.dumps({key: value for key, value in (LINE | changes).items() if value is not None})


@pytest.fixture
def file(tmp_path):
    """Write a file of these lines."""

    def write(*lines):
        path = tmp_path / "ratings.jsonl"
        path.write_bytes(b"\n".join(lines))
        return path

    return write


# --- a line


def test_the_line_of_the_contract():
    text = b'{"time_s": 12.3, "rater": "op1", "vehicle": 5, "rating": 2}'
    assert parse(text, count=6) == Rating(rater="op1", vehicle=5, rating=2, time_s=12.3)
    assert parse(text.replace(b"5", b'"swarm"'), count=6).vehicle is None


@given(
    st.builds(
        Rating,
        rater=st.text(min_size=1, max_size=NAME_LENGTH).filter(str.isprintable),
        vehicle=st.none() | st.integers(1, 6),
        rating=st.integers(1, 5),
        time_s=st.none() | st.floats(0, 1e6),
    )
)
def test_what_is_written_is_read_back(rating):
    assert parse(written(rating), count=6, live=rating.time_s is None) == rating


REFUSED = [
    (b"{", "not valid JSON"),
    (b"\xff\xfe", "not valid JSON"),
    (b"[" * 5000, "not valid JSON"),
    (b"[]", "must be a JSON object"),
    (b"5", "must be a JSON object"),
    (line(rating=0), "rating = 0: must be a whole number from 1, completely distrust, to 5"),
    (line(rating=6), "rating = 6: must be"),
    (line(rating=2.5), "rating = 2.5: must be"),
    (line(rating=True), "rating = True: must be"),
    (line(rating="2"), "rating = '2': must be"),
    (line(vehicle=7), 'vehicle = 7: there is no such vehicle; allowed are 1 to 6, or "swarm"'),
    (line(vehicle=0), "vehicle = 0: there is no such vehicle"),
    (line(vehicle="all"), "vehicle = 'all': there is no such vehicle"),
    (line(vehicle=[5]), "vehicle = [5]: there is no such vehicle"),
    (line(time_s=-1), "time_s = -1: must be a number of seconds since mission start, 0 or more"),
    (line(time_s="1"), "time_s = '1': must be"),
    (b'{"time_s": 1e999, "rater": "op1", "vehicle": 5, "rating": 2}', "not valid JSON"),
    (line(rater=""), "rater = '': must be a name of 1 to 40 printable characters"),
    (line(rater="x" * 41), "printable characters"),
    (line(rater="\x1b[2J"), "printable characters"),
    (line(rater=3), "rater = 3: must be"),
    (line(rating=None), "rating: this key is missing"),
    (line(time_s=None), "time_s: this key is missing"),
    (line(vehicel=4), "vehicel = 4: there is no such key; did you mean vehicle? allowed here: time_s, rater"),
]


@pytest.mark.parametrize(("text", "said"), REFUSED)
def test_a_bad_line_is_refused_with_its_place_the_key_the_value_and_what_is_allowed(file, text, said):
    path = file(line(), b"", text)
    with pytest.raises(RatingsError) as refused:
        read(path, count=6)
    words = str(refused.value)
    assert words.startswith(f"{path}:3: ")
    assert said in words
    assert words.isprintable()
    assert len(words) < len(str(path)) + 250


def test_a_live_line_has_no_time():
    with pytest.raises(RatingsError, match=r"time_s = 12.3: a live rating counts at once"):
        parse(line(), count=6, live=True)


@given(st.binary(max_size=60))
def test_garbage_is_refused_and_does_nothing_else(garbage):
    with pytest.raises(RatingsError):
        parse(garbage, count=6)


def test_a_line_of_the_recordings_topic_is_a_line_of_a_file():
    recorded = line(tick=412, trust=[1.0] * 6)
    assert parse(recorded, count=6) == parse(line(), count=6)
    with pytest.raises(RatingsError, match="tick = 412: there is no such key"):
        parse(line(tick=412, time_s=None), count=6, live=True)


# --- a file


def test_a_file_is_sorted_by_time_and_equal_times_keep_their_order(file):
    path = file(line(time_s=5, rater="b"), b"", b"  \r", line(time_s=1), line(time_s=5, rater="a"), b"")
    assert [(rating.time_s, rating.rater) for rating in read(path, count=6)] == [(1, "op1"), (5, "b"), (5, "a")]


def test_a_file_that_cannot_be_read_or_says_nothing_is_refused(file, tmp_path):
    with pytest.raises(RatingsError, match="cannot be read"):
        read(tmp_path, count=6)
    with pytest.raises(RatingsError, match="holds no rating"):
        read(file(b"", b""), count=6)


# --- a person's model


@pytest.mark.parametrize("model", MODELS)
def test_a_models_ratings_could_be_a_file(model, tmp_path):
    ratings = schedule(model, load("emergency"), seed=1)
    path = tmp_path / "ratings.jsonl"
    path.write_bytes(b"\n".join(written(rating) for rating in ratings))
    assert read(path, count=6) == ratings


def test_a_true_rater_names_the_faulty_robot_of_the_scenario():
    ratings = schedule("true", load("emergency", overrides=["fault.0.onset_s=9"]), seed=1)
    assert {rating.vehicle for rating in ratings if rating.rating == 1} == {5}
    assert min(rating.time_s for rating in ratings if rating.rating == 1) == 12.0


def test_a_model_is_chosen_by_its_name_and_a_file_by_its_path(file):
    scenario = load("emergency")
    assert chosen("realistic", scenario, seed=2) == schedule("realistic", scenario, 2)
    assert chosen("realistic", scenario, seed=2) != chosen("realistic", scenario, seed=3)
    assert chosen(str(file(line())), scenario, seed=1) == (Rating("op1", 5, 2, 12.3),)
    with pytest.raises(RatingsError, match=r"no ratings 'realstic': neither a file nor a model .*realistic"):
        chosen("realstic", scenario, seed=1)


# --- the options


@pytest.mark.parametrize("command", [("run", "demo"), ("fly", "demo", "--link", "udpin:127.0.0.1:14777")])
@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("--ratings true --trust truth", "trust from truth takes no ratings"),
        ("--ratings true --trust auto", "trust from auto takes no ratings"),
        ("--ratings-port 0 --trust truth", "trust from truth takes no ratings"),
        ("--ratings nobody --trust ratings", "neither a file nor a model"),
        ("--ratings-port 70000 --trust ratings", "--ratings-port 70000: must be 0 to 65535"),
        ("--ratings-port -1 --trust ratings", "--ratings-port -1: must be 0 to 65535"),
    ],
)
def test_options_that_cannot_be_obeyed_are_refused_in_one_sentence(capfd, tmp_path, command, options, said):
    with pytest.raises(SystemExit) as ended:
        cli.main([*command, *options.split(), "--out", str(tmp_path / "out")])
    _, err = capfd.readouterr()
    assert ended.value.code == 2
    assert said in err
    assert err.startswith("gcs: ")
    assert err.count("\n") == 1
    assert not (tmp_path / "out").exists()
