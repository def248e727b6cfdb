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
