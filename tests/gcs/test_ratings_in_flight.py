"""What people say, flown: when it counts, how far it reaches, how it is recorded and decided again."""

from math import exp, log

import numpy as np
import pytest
from flights import SHORT, column, fly_and_record, recorded, rewritten, told

from gcs.beliefs import UNTOLD
from gcs.events import Rating
from gcs.ratings import schedule
from gcs.replay.verify import decide_again
from scenarios import load

RATINGS, FUSED = 'trust.source="ratings"', 'trust.source="fused"'
SAYS = 1.5
"""Log odds of a rating of 1: log(0.41 / 0.02), clipped."""
AGE_OUT_S = 20.0
HEALTHY = [0, 1, 2, 3, 5]


def trust_of(log_odds):
    return 1.0 / (1.0 + exp(log_odds))


def rated(*ratings, source=RATINGS):
    """A flight in which nothing fails, and this is said: (seconds, vehicle, rating) each."""
    said = tuple(Rating("op1", vehicle, rating, time_s) for time_s, vehicle, rating in ratings)
    return recorded("emergency", source, "fault=[]", ratings=said)


def spoken_at(events):
    """A short flight in which this is said live: tick → ratings."""
    said = iter([events.get(tick, ()) for tick in range(10_000)])
    return fly_and_record("demo", *SHORT, RATINGS, ratings=(), events=lambda: next(said))


TWICE = ((3.0, 5, 1), (3.05, 5, 1), (5.0, 2, 1))


# --- when a rating counts


def test_a_rating_of_a_file_counts_at_the_first_tick_at_or_after_its_time():
    flight = rated(*TWICE)
    assert [row["time_s"] for row in told(flight, "/ratings")] == pytest.approx([3.0, 3.1, 5.0])
    begins = told(flight, "/mission")[0]["tick"]
    assert [row["tick"] - begins for row in told(flight, "/ratings")] == [30, 31, 50]


def test_a_rating_at_mission_start_counts_at_its_first_tick():
    flight = rated((0.0, 5, 1), (1.0, 5, 1))
    begins = told(flight, "/mission")[0]["tick"]
    assert [row["tick"] - begins for row in told(flight, "/ratings")] == [0, 10]
    assert told(flight, "/trust")[0]["trust"][4] == pytest.approx(trust_of(UNTOLD + SAYS))


def test_it_is_recorded_with_its_rater_and_with_the_trust_that_it_left():
    flight = rated(*TWICE)
    said = told(flight, "/ratings")
    assert [(row["rater"], row["vehicle"], row["rating"]) for row in said] == [
        ("op1", 5, 1), ("op1", 5, 1), ("op1", 2, 1),
    ]  # fmt: skip
    believed = {row["tick"]: row["trust"] for row in told(flight, "/trust")}
    assert [row["trust"] for row in said] == [believed[row["tick"]] for row in said]


def test_what_is_said_while_joining_climbing_and_running_up_still_counts_when_the_mission_begins():
    ticks = (0, 30, 100)
    flight = spoken_at({tick: (Rating("op1", 5, 1),) for tick in ticks})
    turns, said = told(flight, "/tick"), told(flight, "/ratings")
    assert [turns[tick]["phase"] for tick in ticks] == ["joining", "taking off", "running up"]
    assert [(row["tick"], row["time_s"]) for row in said] == [(tick, None) for tick in ticks]
    assert said[0]["trust"] == pytest.approx([trust_of(UNTOLD + SAYS * (row == 4)) for row in range(6)])
    begins = told(flight, "/mission")[0]["tick"]
    left = sum(SAYS * exp(-(begins - tick) * 0.1 / AGE_OUT_S) for tick in ticks)
    assert told(flight, "/trust")[0]["trust"][4] == pytest.approx(trust_of(UNTOLD + left))
    assert decide_again(flight.path).difference is None


# --- how far it reaches


def test_one_bad_rating_shakes_trust_a_second_one_breaks_it_and_nobody_elses():
    first, second, _ = told(rated(*TWICE), "/ratings")
    assert first["trust"][4] == pytest.approx(trust_of(UNTOLD + SAYS))
    assert first["trust"][4] > 0.5 > second["trust"][4]
    assert np.array(second["trust"])[HEALTHY] == pytest.approx(trust_of(UNTOLD))


def test_ratings_age_out():
    time_s, trust = column(rated(*TWICE), "/trust", "trust")
    after = time_s > 5.0
    left = SAYS * (np.exp(-(time_s - 3.0) / AGE_OUT_S) + np.exp(-(time_s - 3.1) / AGE_OUT_S))
    assert trust[after, 4] == pytest.approx(1.0 / (1.0 + np.exp(UNTOLD + left[after])))
    alone = 3.1 + AGE_OUT_S * log((1.0 + exp(-0.1 / AGE_OUT_S)) * SAYS / -UNTOLD)
    assert time_s[np.flatnonzero(trust[:, 4] < 0.5)[-1]] == pytest.approx(alone, abs=0.1)


def test_a_bad_word_on_the_whole_swarm_breaks_nobodys_trust():
    _, trust = column(rated(*((second, None, 1) for second in range(1, 20, 3))), "/trust", "trust")
    assert trust.min() > 0.5


ADVERSARY = schedule("adversarial", load("emergency"), seed=1)
SLANDER = tuple(Rating("adversary", vehicle, 1, tick / 10) for tick in range(281) for vehicle in range(1, 7))


def test_an_adversary_who_rates_at_every_tick_brings_no_healthy_robot_below_a_half_and_does_not_hide_the_faulty_one():
    flight = recorded("emergency", FUSED, ratings=ADVERSARY)
    _, trust = column(flight, "/trust", "trust")
    assert trust[:, HEALTHY].min() >= 0.5
    assert 0.0 < flight.summary.detected["5"] <= 4.0
    assert flight.summary.false_alarms == 0
    assert flight.summary.passed


def test_an_adversary_who_slanders_a_healthy_swarm_does_not_lose_it():
    flight = recorded("emergency", FUSED, "fault=[]", ratings=SLANDER)
    _, trust = column(flight, "/trust", "trust")
    assert trust.min() >= 0.5
    assert flight.summary.passed


def test_an_adversary_who_begins_before_the_mission_does_no_more():
    slander = tuple(Rating("adversary", vehicle, 1) for vehicle in range(1, 7))
    flight = fly_and_record("demo", *SHORT, FUSED, ratings=(), events=lambda: slander)
    assert flight.summary.false_alarms == 0


# --- who nobody rates


def test_where_nobody_rates_trust_is_the_studys_means():
    flight = recorded("emergency", RATINGS)
    _, trust = column(flight, "/trust", "trust")
    assert trust[:, 4] == pytest.approx((2.18 - 1) / 4)
    assert trust[:, HEALTHY] == pytest.approx((4.08 - 1) / 4)
    assert not flight.read().rated


def test_where_somebody_might_rate_and_says_nothing_nothing_is_known():
    """Were the study's means used, the ground station would know who fails."""
    flight = recorded("emergency", RATINGS, ratings=())
    _, trust = column(flight, "/trust", "trust")
    assert trust == pytest.approx(trust_of(UNTOLD))
    assert flight.read().rated


# --- decided again


@pytest.mark.parametrize("ratings", [None, (), ADVERSARY], ids=["nobody rates", "nobody says anything", "a file"])
def test_a_replay_decides_as_the_flight_did_whoever_rated(ratings):
    source = FUSED if ratings else RATINGS
    assert decide_again(recorded("emergency", source, ratings=ratings).path).difference is None


def test_a_replay_that_lacks_the_ratings_is_found_out():
    flight = recorded("emergency", FUSED, ratings=ADVERSARY)
    mute = rewritten(flight.path, lambda _at, topic, _time, data: None if topic == "/ratings" else data)
    assert decide_again(mute).difference.tick >= told(flight, "/ratings")[0]["tick"]
