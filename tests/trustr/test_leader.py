"""Navigational feedback of eq. 11."""

from math import hypot

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from trustr.leader import VirtualLeader, navigational_feedback

C1, C2, CAP = 0.1, 0.6, 0.375

vectors = arrays(float, 2, elements=st.floats(-100, 100))


def leader_at(position=(0, 0), velocity=(0, 0), acceleration=(0, 0)):
    return VirtualLeader(*(np.array(v, float) for v in (position, velocity, acceleration)))


def feedback(place, velocity, virtual, *, cap=CAP, lead_s=0.0):
    return navigational_feedback(
        np.atleast_2d(place), np.atleast_2d(velocity), virtual, c1=C1, c2=C2, cap=cap, lead_s=lead_s
    )


@given(vectors, vectors)
def test_a_leader_at_the_virtual_leader_and_as_fast_gets_no_feedback(position, velocity):
    assert not feedback(position, velocity, leader_at(position, velocity)).any()


@given(vectors, vectors, vectors, vectors, st.floats(0.01, 5))
def test_feedback_is_never_longer_than_the_cap(place, velocity, position, goal_velocity, cap):
    (pull,) = feedback(place, velocity, leader_at(position, goal_velocity), cap=cap)
    assert hypot(*pull) <= cap * (1 + 1e-12)


def test_below_the_cap_feedback_is_eq_11():
    virtual = leader_at(position=(1, 2), velocity=(1.5, 0))
    (pull,) = feedback((0.5, 2.5), (1.4, 0.1), virtual)
    assert pull == pytest.approx([-C1 * (0.5 - 1) - C2 * (1.4 - 1.5), -C1 * (2.5 - 2) - C2 * 0.1])
    assert hypot(*pull) < CAP


@pytest.mark.parametrize("error", [(100, 0), (0, -100), (-30, 40)])
def test_far_off_it_pulls_straight_back_as_hard_as_the_cap_allows(error):
    (pull,) = feedback(error, (0, 0), leader_at())
    assert pull == pytest.approx(-CAP * np.array(error) / hypot(*error))


def test_a_leader_that_is_too_fast_is_slowed():
    (pull,) = feedback((0, 0), (2.0, 0), leader_at(velocity=(1.5, 0)))
    assert pull == pytest.approx([-C2 * 0.5, 0])


@given(vectors, vectors, vectors)
def test_feed_forward_is_added_outside_the_cap(place, velocity, acceleration):
    capped = feedback(place, velocity, leader_at(acceleration=acceleration))
    assert feedback(place, velocity, leader_at(acceleration=acceleration), lead_s=0.5) == pytest.approx(
        capped + 0.5 * acceleration
    )


def test_a_cap_of_zero_leaves_the_feed_forward_alone():
    virtual = leader_at(acceleration=(1, -1))
    assert feedback((9, 9), (9, 9), virtual, cap=0.0, lead_s=0.25).tolist() == [[0.25, -0.25]]


@given(arrays(float, (3, 2), elements=st.floats(-50, 50)))
def test_every_leader_answers_for_itself(places):
    virtual, still = leader_at((1, 1)), np.zeros((3, 2))
    together = feedback(places, still, virtual)
    assert (together == np.concatenate([feedback(place, still[0], virtual) for place in places])).all()


@given(vectors, vectors, st.floats(-np.pi, np.pi))
def test_turning_the_world_turns_the_feedback(place, position, angle):
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    turned = feedback(turn @ place, (0, 0), leader_at(turn @ position))
    assert turned[0] == pytest.approx(turn @ feedback(place, (0, 0), leader_at(position))[0], abs=1e-9)
