"""How low robots fly that leave the swarm or come back to it, and when they stand still."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gcs.events import Rating
from gcs.leaving import ABOVE, LOWER, lowered, settled, wanted_back
from gcs.telemetry import Swarm
from scenarios.fence import BELOW
from trustr.roles import GONE_S, Roles

NOBODY = (np.nan, np.nan)


def swarm(*heights):
    """Robots at these heights [m]."""
    place = np.array([(0.0, 0.0, -height) for height in heights])
    return replace(Swarm.of(range(1, len(heights) + 1)), position_ned=place)


def left(*since_s):
    """Roles of robots that were left behind so long ago [s]; NaN is never."""
    return replace(Roles.of(len(since_s), np.array([0])), left_s=np.array(since_s))


# --- how low


@pytest.mark.parametrize(
    ("higher_m", "aside_m", "under"),
    [
        (3.0, 0.0, True),
        (LOWER + 0.01, ABOVE - 0.01, True),
        (LOWER - 0.01, 0.0, False),
        (3.0, ABOVE + 0.01, False),
        (-3.0, 0.0, False),
        (np.nan, 0.0, False),
        (3.0, np.nan, False),
    ],
)
def test_a_robot_stays_low_while_another_is_a_metre_higher_and_closer_than_a_metre_and_a_half(higher_m, aside_m, under):
    low = lowered(left(*NOBODY), swarm(7.0, 7.0 + higher_m), np.array([[0.0, 0.0], [0.0, aside_m]]))
    assert low[0] == (BELOW if under else 0.0)


@pytest.mark.parametrize("since_s", [0.0, GONE_S, 60.0])
def test_who_is_left_behind_is_to_fly_below_the_others(since_s):
    assert lowered(left(np.nan, since_s), swarm(10.0, 10.0), np.eye(2) * 9.0).tolist() == [0.0, BELOW]


# --- standing still

velocities = arrays(float, (3, 3), elements=st.floats(-5, 5))


@given(velocities)
def test_who_is_out_of_the_others_way_stands_still(velocity_ned):
    asked = settled(velocity_ned, left(np.nan, GONE_S - 0.1, GONE_S))
    assert (asked[:2] == velocity_ned[:2]).all()
    assert not asked[2].any()


@given(velocities)
def test_what_was_asked_stays_as_it_was(velocity_ned):
    before = velocity_ned.copy()
    settled(velocity_ned, left(GONE_S, GONE_S, GONE_S))
    assert (velocity_ned == before).all()


# --- wanted back


@pytest.mark.parametrize(
    ("rating", "since_s", "flying", "wanted"),
    [
        (Rating("op1", 2, 4), 9.0, True, True),
        (Rating("op1", 2, 5), 0.0, True, True),
        (Rating("op1", 2, 3), 9.0, True, False),
        (Rating("op1", 1, 5), 9.0, True, False),
        (Rating("op1", None, 5), 9.0, True, False),
        (Rating("op1", 2, 5), np.nan, True, False),
        (Rating("op1", 2, 5), 9.0, False, False),
    ],
)
def test_taken_back_is_who_was_left_and_praised_by_name_and_still_flies(rating, since_s, flying, wanted):
    back = wanted_back([rating], left(np.nan, since_s), swarm(10.0, 7.0), np.array([True, flying]))
    assert back.tolist() == [False, wanted]
