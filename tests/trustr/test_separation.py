"""Keeping apart: pushes between pairs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from trustr.network import neighbours
from trustr.separation import separation

RADIUS, GAIN = 2.0, 0.3


def pushes(position, *, radius=RADIUS, heard=None):
    position = np.array(position, float)
    heard = np.ones(len(position), bool) if heard is None else np.array(heard)
    return separation(neighbours(position, heard, range_m=28.0), position, radius=radius, gain=GAIN)


@pytest.mark.parametrize("distance", [0.1, 0.5, 1.0, 1.9])
def test_the_push_grows_linearly_as_a_pair_comes_closer(distance):
    push = GAIN * (RADIUS - distance)
    assert pushes([(0, 0), (0, distance)]) == pytest.approx(np.array([[0, -push], [0, push]]))


@pytest.mark.parametrize("distance", [RADIUS, np.nextafter(RADIUS, 9), 3.0, 27.0, 1e6])
def test_there_is_no_push_at_the_radius_and_beyond(distance):
    assert not pushes([(0, 0), (distance, 0)]).any()


def test_the_push_is_along_the_line_between_the_two():
    push = GAIN * (RADIUS - 0.5)
    assert pushes([(0.3, 0.4), (0, 0)])[0] == pytest.approx([0.6 * push, 0.8 * push])


@given(st.integers(1, 8).flatmap(lambda n: arrays(float, (n, 2), elements=st.floats(-3, 3))))
def test_pushes_are_equal_and_opposite_so_their_sum_is_zero(position):
    assert pushes(position).sum(0) == pytest.approx([0, 0], abs=1e-9)


def test_robots_in_exactly_one_place_get_no_push_and_no_nan():
    assert not pushes([(1, 1), (1, 1)]).any()


def test_in_the_middle_between_two_robots_pushes_cancel():
    middle, *outer = pushes([(0, 0), (-1, 0), (1, 0)])
    assert middle.tolist() == [0, 0]
    assert np.array(outer) == pytest.approx(np.array([[-GAIN, 0], [GAIN, 0]]))


def test_a_silent_robot_pushes_nobody():
    assert not pushes([(0, 0), (0.5, 0)], heard=[True, False]).any()


def test_a_radius_of_zero_turns_separation_off():
    assert not pushes([(0, 0), (0.001, 0)], radius=0.0).any()


# --- a wide berth


def shunning(position, *, shunned, berth=3.0, berth_gain=1.0):
    position = np.array(position, float)
    graph = neighbours(position, np.ones(len(position), bool), range_m=28.0)
    return separation(
        graph, position, radius=RADIUS, gain=GAIN, shunned=np.array(shunned), berth=berth, berth_gain=berth_gain
    )


@pytest.mark.parametrize("distance", [0.1, 1.0, 2.0, 2.9])
def test_who_is_shunned_is_given_a_wide_berth_and_gives_none_itself(distance):
    away, ordinary = -(3.0 - distance), GAIN * max(RADIUS - distance, 0)
    push = shunning([(0, 0), (0, distance)], shunned=[False, True])
    assert push == pytest.approx(np.array([[0, away], [0, ordinary]]))


@pytest.mark.parametrize("distance", [3.0, 3.5, 20.0])
def test_beyond_the_berth_nobody_is_pushed(distance):
    assert not shunning([(0, 0), (0, distance)], shunned=[True, True]).any()


def test_where_the_berth_is_less_than_the_radius_the_stronger_push_counts():
    push = shunning([(0, 0), (0, 1)], shunned=[False, True], berth=0.5)
    assert push[0] == pytest.approx([0, -GAIN * (RADIUS - 1)])


@given(st.integers(1, 8).flatmap(lambda n: arrays(float, (n, 2), elements=st.floats(-3, 3))))
def test_where_nobody_is_shunned_the_berth_makes_no_difference(position):
    assert shunning(position, shunned=[False] * len(position)) == pytest.approx(pushes(position), abs=1e-12)
