"""Robots beyond repair, flown: how they are left behind, that nobody is endangered, and how they come back."""

import numpy as np
import pytest
from flights import column, recorded, told

from gcs.events import Rating
from scenarios import ScenarioError, load

AUTO, FUSED, RATINGS = ('trust.source="auto"', 'trust.source="fused"', 'trust.source="ratings"')
HOLD, LAND = 'trust.beyond_repair="hold"', 'trust.beyond_repair="land"'
RECOMMENDED = 'control.profile="recommended"'
PASSES = 'fault=[{vehicle=5, kind="motor_degradation", end_s=10}]'
ALTITUDE, LOWER = 10.0, 7.0
FIVE = 4
"""The row of robot 5."""


def heights(flight, row=FIVE):
    """(seconds, m) of one robot, as far as the read-out."""
    time_s, position = column(flight, "/truth/pose", "position_m")
    return time_s, position[:, row, 2]


def left_at(flight, system=5):
    """When a robot is first left behind."""
    return next(row["mission_s"] for row in told(flight, "/roles") if system in row["left_behind"])


def aside(flight, row=FIVE):
    """(T,) m, horizontal, from one robot to the closest other."""
    _, position = column(flight, "/truth/pose", "position_m")
    distance = np.linalg.norm(position[..., :2] - position[:, row, None, :2], axis=-1)
    return np.delete(distance, row, axis=1).min(axis=1)


@pytest.fixture(scope="module", params=[HOLD, LAND], ids=["hold", "land"])
def left(request):
    return recorded("emergency", AUTO, request.param)


def test_a_robot_is_left_behind_after_five_seconds_of_hardly_any_trust(left):
    time_s, trust = column(left, "/trust", "trust")
    hopeless = time_s[np.flatnonzero(trust[:, FIVE] < 0.05)[0]]
    assert left_at(left) - hopeless == pytest.approx(5.0, abs=0.15)


def test_it_sinks_three_metres_while_it_flies_on_and_only_there_it_stops(left):
    since = left_at(left)
    ticks = {row["tick"]: row["mission_s"] for row in told(left, "/mission")}
    sent = {ticks[row["tick"]]: row["sent"][FIVE] for row in told(left, "/setpoint") if row["tick"] in ticks}
    time_s, height = heights(left)
    for when, high in zip(time_s, height, strict=True):
        if since + 0.2 < when < since + 4.0 and when in sent:
            north, east, _ = sent[when]
            if high > 7.8:
                assert np.hypot(north, east) > 0.3
            elif high < 7.4:
                assert np.hypot(north, east) == pytest.approx(0.0, abs=1e-9)
    assert np.interp(since + 3.5, time_s, height) < 7.6


def test_nobody_comes_close_the_mission_passes_and_the_summary_says_who_is_missing(left):
    summary = left.summary
    assert summary.left_behind == [5]
    assert summary.problem is None
    assert summary.completed
    assert summary.passed
    assert summary.min_separation_m >= 1.0


def test_who_holds_stays_three_metres_below_until_the_others_have_arrived():
    time_s, height = heights(recorded("emergency", AUTO, HOLD))
    assert height[time_s > 14.0] == pytest.approx(LOWER, abs=0.1)


def test_who_lands_stands_on_the_ground_while_the_others_fly_on():
    flight = recorded("emergency", AUTO, LAND)
    _, position = column(flight, "/truth/pose", "position_m")
    assert position[-1, FIVE, 2] == pytest.approx(0.0, abs=0.1)
    assert np.delete(position[-1, :, 2], FIVE) == pytest.approx(ALTITUDE, abs=0.3)


@pytest.mark.parametrize("how", [HOLD, LAND], ids=["hold", "land"])
@pytest.mark.parametrize("system", [1, 2])
def test_who_stood_in_front_makes_room_for_who_closes_up(system, how):
    """The robot behind takes the place, above the one that sinks."""
    flight = recorded("emergency", AUTO, RECOMMENDED, how, f"fault.0.vehicle={system}")
    assert flight.summary.left_behind == [system]
    assert flight.summary.min_separation_m >= 1.0
    assert flight.summary.passed


def test_two_may_be_left_behind_one_after_the_other():
    both = 'fault=[{vehicle=2, kind="motor_degradation"}, {vehicle=5, kind="motor_degradation", onset_s=6}]'
    summary = recorded("emergency", AUTO, RECOMMENDED, LAND, both).summary
    assert summary.left_behind == [2, 5]
    assert summary.min_separation_m >= 1.0
    assert summary.passed


# --- it comes back


@pytest.fixture(scope="module")
def taken_back():
    """Its fault has passed when somebody wants it back."""
    return recorded("emergency", FUSED, HOLD, PASSES, ratings=(Rating("op1", 5, 4, 12.0),))


def test_a_rating_of_four_takes_it_back_at_once_and_it_is_trusted_anew(taken_back):
    assert [(row["mission_s"], row["left_behind"]) for row in told(taken_back, "/roles")][1:] == [
        (left_at(taken_back), [5]),
        (pytest.approx(12.0), []),
    ]
    time_s, trust = column(taken_back, "/trust", "trust")
    assert (trust[time_s < 11.95, FIVE][-10:] < 0.5).all()
    assert (trust[time_s > 11.95, FIVE] > 0.9).all()
    assert taken_back.summary.left_behind == []


def test_it_climbs_back_to_the_others(taken_back):
    time_s, height = heights(taken_back)
    assert np.interp(12.0, time_s, height) == pytest.approx(LOWER, abs=0.1)
    assert height[time_s > 20.0] == pytest.approx(ALTITUDE, abs=0.1)
    assert taken_back.summary.min_separation_m >= 1.0


@pytest.mark.parametrize("rating", [3, None], ids=["rated 3", "the swarm is rated 5"])
def test_nothing_less_takes_it_back(rating):
    said = Rating("op1", None, 5, 12.0) if rating is None else Rating("op1", 5, rating, 12.0)
    flight = recorded("emergency", FUSED, HOLD, PASSES, ratings=(said,))
    assert flight.summary.left_behind == [5]


SLANDERED = tuple(Rating("op1", 5, 1, time_s) for time_s in (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 2.0, 4.0, 6.0))
"""It is healthy, and keeps its place among the others."""
WANTED = tuple(Rating("op1", 5, 5, 8.5 + 0.1 * number) for number in range(6))
IN_ITS_PLACE = (RATINGS, RECOMMENDED, HOLD, "fault=[]")


def test_it_does_not_climb_where_somebody_is_above():
    flight = recorded("emergency", *IN_ITS_PLACE, ratings=(*SLANDERED, *WANTED))
    assert flight.summary.left_behind == []
    time_s, height = heights(flight)
    near = (aside(flight) < 2.9) & (time_s > 9.0)
    assert np.count_nonzero(near) > 20
    assert (height[near] < 7.8).all()
    assert flight.summary.min_separation_m >= 1.0


@pytest.mark.xfail(strict=True, reason="others count as above up to 3 m away, and in formation they are 3 m away")
def test_it_does_climb_in_its_own_place_between_the_others():
    _, height = heights(recorded("emergency", *IN_ITS_PLACE, ratings=(*SLANDERED, *WANTED)))
    assert height[-1] == pytest.approx(ALTITUDE, abs=0.2)


@pytest.mark.xfail(strict=True, reason="it is wanted back, cannot come, and so is missed")
def test_who_has_landed_is_not_missed_because_somebody_wants_it_back():
    assert recorded("emergency", FUSED, LAND, PASSES, ratings=(Rating("op1", 5, 5, 18.0),)).summary.completed


# --- only where it is wanted


def test_nobody_is_left_behind_unless_a_scenario_says_so():
    flight = recorded("emergency", AUTO)
    assert flight.scenario.trust.beyond_repair == "keep"
    assert flight.summary.left_behind == []
    time_s, trust = column(flight, "/trust", "trust")
    assert (trust[time_s > 5.0, FIVE] < 0.05).all()
    assert heights(flight)[1] == pytest.approx(ALTITUDE, abs=0.3)


@pytest.mark.parametrize("how", [HOLD, LAND])
def test_there_must_be_room_below(how):
    with pytest.raises(ScenarioError, match=r"swarm.altitude_m = 5.9: .* it must be 6 m or more"):
        load("emergency", overrides=[how, "swarm.altitude_m=5.9"])
    assert load("emergency", overrides=[how, "swarm.altitude_m=6"])
