"""Robots beyond repair, flown: how they are left behind, that nobody is endangered, and how they come back."""

import numpy as np
import pytest
from flights import column, recorded, told

from gcs.events import Rating
from gcs.leaving import ABOVE
from gcs.steering import CLIMB_SPEED
from scenarios import ScenarioError, load, offsets_ne
from trustr.roles import GONE_S

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


def test_it_flies_on_while_it_sinks_and_when_that_is_over_it_stops(left):
    since = left_at(left)
    ticks = {row["tick"]: row["mission_s"] for row in told(left, "/mission")}
    sent = {ticks[row["tick"]]: row["sent"][FIVE] for row in told(left, "/setpoint") if row["tick"] in ticks}
    time_s, speed = np.array(list(sent)), np.array([np.hypot(north, east) for north, east, _ in sent.values()])
    assert (speed[(time_s > since) & (time_s < since + GONE_S - 0.05)] > 0.3).all()
    assert speed[time_s > since + GONE_S + 0.3] == pytest.approx(0.0, abs=1e-9)
    assert np.interp(since + GONE_S, *heights(left)) < 7.6


def test_nobody_comes_close_the_mission_passes_and_the_summary_says_who_is_missing(left):
    summary = left.summary
    assert summary.left_behind == [5]
    assert summary.problem is None
    assert summary.completed
    assert summary.passed
    assert summary.min_separation_m >= 1.0


def test_who_holds_stays_three_metres_below_until_the_others_have_arrived():
    time_s, height = heights(recorded("emergency", AUTO, HOLD))
    assert height[time_s > 14.0] == pytest.approx(LOWER, abs=0.2)


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


def test_nobody_judges_it_any_more(left):
    time_s, trust = column(left, "/trust", "trust")
    since = trust[time_s > left_at(left) + 0.05, FIVE]
    assert (since == since[0]).all()


def test_whose_telemetry_is_frozen_sinks_for_so_long_and_no_longer_and_stands_still():
    """It says to the end that it flies with the others, 10 m high."""
    flight = recorded("emergency", AUTO, HOLD, 'fault=[{vehicle=5, kind="frozen_telemetry", onset_s=4}]')
    assert flight.summary.left_behind == [5]
    time_s, position = column(flight, "/truth/pose", "position_m")
    gone = position[time_s > left_at(flight) + GONE_S + 2.0, FIVE]
    assert position[:, FIVE, 2].min() > 2.0
    assert len(gone) > 20
    assert np.ptp(gone, axis=0) == pytest.approx(np.zeros(3), abs=0.2)
    assert ALTITUDE - gone[:, 2] == pytest.approx(GONE_S * CLIMB_SPEED, abs=0.5)
    assert flight.summary.min_separation_m >= 1.0


SLANDER = tuple(Rating("adversary", system, 1, tick / 10) for tick in range(281) for system in range(1, 7))
"""Of everybody, at every tick."""


def test_an_adversary_leaves_nobody_behind_where_behaviour_is_asked_too():
    summary = recorded("emergency", FUSED, HOLD, "fault=[]", ratings=SLANDER).summary
    assert summary.left_behind == []
    assert summary.passed


def test_an_adversary_whom_everybody_believes_leaves_a_minority_behind_and_the_others_arrive():
    """As a whole the mission fails: healthy robots are missing where it ends."""
    flight = recorded("emergency", RATINGS, HOLD, "fault=[]", ratings=SLANDER)
    _, trust = column(flight, "/trust", "trust")
    assert (trust[-1] < 0.05).all()
    assert len(flight.summary.left_behind) == 2
    assert flight.summary.completed
    assert flight.summary.min_separation_m >= 1.0
    remain = ~np.isin(np.arange(1, 7), flight.summary.left_behind)
    track = flight.read().track
    off = track.position[-1, remain, :2] - offsets_ne(flight.scenario)[remain] - track.virtual_ne[-1]
    assert np.linalg.norm(off.mean(axis=0)) < flight.scenario.expect.distance_to_target_m


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
    assert np.interp(12.0, time_s, height) == pytest.approx(LOWER, abs=0.2)
    assert height[time_s > 20.0] == pytest.approx(ALTITUDE, abs=0.1)
    assert taken_back.summary.min_separation_m >= 1.0


@pytest.mark.parametrize("rating", [3, None], ids=["rated 3", "the swarm is rated 5"])
def test_nothing_less_takes_it_back(rating):
    said = Rating("op1", None, 5, 12.0) if rating is None else Rating("op1", 5, rating, 12.0)
    flight = recorded("emergency", FUSED, HOLD, PASSES, ratings=(said,))
    assert flight.summary.left_behind == [5]


def slandered(system, *, wanted_s):
    """Ratings for which a healthy robot is left behind, and wanted back at this time."""
    when = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 2.0, 4.0, 6.0)
    said = [Rating("op1", system, 1, time_s) for time_s in when]
    return (*said, *(Rating("op1", system, 5, wanted_s + 0.1 * number) for number in range(6)))


HEALTHY = (RATINGS, RECOMMENDED, HOLD, "fault=[]")


def test_it_climbs_in_its_own_place_between_the_others():
    flight = recorded("emergency", *HEALTHY, ratings=slandered(5, wanted_s=8.5))
    assert flight.summary.left_behind == []
    assert heights(flight)[1][-1] == pytest.approx(ALTITUDE, abs=0.2)
    assert flight.summary.min_separation_m >= 1.0


def test_it_does_not_climb_while_somebody_is_above():
    """Robot 2 stood in front, and robot 5 passes over it."""
    flight = recorded("emergency", *HEALTHY, ratings=slandered(2, wanted_s=10.4))
    time_s, height = heights(flight, row=1)
    above = (aside(flight, row=1) < ABOVE) & (time_s > 10.5)
    assert np.count_nonzero(above) > 8
    assert (height[above] < 7.4).all()
    assert height[-1] == pytest.approx(ALTITUDE, abs=0.2)
    assert flight.summary.min_separation_m >= 1.0


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
