"""Lines are thinned without losing a spike; labels make way; ticks are round."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcs.report.axes import Scale, round_values
from gcs.report.svg import LETTER, TOLERANCE, Label, apart, element, in_lanes, path, thinned, words

SERIES = st.lists(st.floats(0.0, 130.0), min_size=2, max_size=400).map(np.array)


@given(SERIES)
def test_every_point_lies_within_the_tolerance_of_the_thinned_line(y):
    x = np.linspace(34.0, 326.0, len(y))
    kept = thinned(x, y)
    assert np.abs(np.interp(x, *kept.T) - y).max() <= 60 * TOLERANCE  # steep lines: near across, not near in height
    assert max(_away(point, kept) for point in np.column_stack([x, y])) <= TOLERANCE + 1e-9


def _away(point, line):
    """Distance of a point from a line through points."""
    start, along = line[:-1], np.diff(line, axis=0)
    length = np.maximum((along**2).sum(axis=1), 1e-12)
    share = np.clip(((point - start) * along).sum(axis=1) / length, 0.0, 1.0)
    return np.hypot(*(point - start - share[:, None] * along).T).min()


@given(st.integers(0, 99_999), st.floats(1.0, 100.0))
def test_a_spike_of_one_tick_in_three_hours_is_drawn_in_full(place, height):
    y = np.zeros(100_000)
    y[place] = height
    assert thinned(np.linspace(34.0, 326.0, len(y)), y)[:, 1].max() == height


def test_a_long_noisy_line_is_drawn_with_few_points():
    y = 60.0 + np.random.default_rng(1).normal(size=100_000)
    assert len(thinned(np.linspace(34.0, 326.0, len(y)), y)) < 4 * 2 * 292 + 4


def test_a_straight_line_is_two_points():
    x = np.linspace(0.0, 300.0, 5000)
    assert len(thinned(x, 3.0 * x)) == 2


def test_a_line_is_broken_where_nothing_is_known():
    y = np.array([1.0, 2.0, np.nan, 4.0, 5.0])
    assert path(np.arange(5.0), y, "mean").count("M") == 2
    assert path(np.arange(5.0), np.full(5, np.nan), "mean") == ""


def test_numbers_are_short_and_words_escaped():
    assert element("line", x1=-0.04, x2=12.0, y1=3.14159) == '<line x1="0" x2="12" y1="3.1"/>'
    assert "<b>" not in words(0.0, 0.0, "<b>&", '"><b>')


@given(st.lists(st.floats(0.0, 100.0), max_size=9))
def test_labels_beside_a_plot_keep_apart_in_their_order_and_inside(wanted):
    placed = apart(wanted, least=11.0, low=0.0, high=100.0)
    order = np.argsort(wanted, kind="stable")
    assert (np.diff(np.array(placed)[order]) >= 11.0 - 1e-9).all()
    assert all(-1e-9 <= place <= 100.0 + 1e-9 for place in placed)


def test_a_label_with_room_stands_where_it_wants_to():
    assert apart([80.0, 20.0], least=11.0, low=0.0, high=100.0) == [80.0, 20.0]


@given(st.lists(st.tuples(st.floats(0.0, 360.0), st.text("ab ", min_size=1, max_size=20)), max_size=12))
def test_labels_in_a_lane_do_not_touch(marks):
    labels = [Label(at, said) for at, said in marks]
    placed = in_lanes(labels, low=30.0, high=360.0)
    for lane in {number for number, _ in placed}:
        spans = sorted(
            (left, left + LETTER * len(label.said))
            for label, (number, left) in zip(labels, placed, strict=True)
            if number == lane
        )
        assert all(end <= begin for (_, end), (begin, _) in pairwise(spans))


@given(st.floats(-1e4, 1e4), st.floats(1e-3, 1e5), st.integers(3, 8))
def test_ticks_are_inside_few_and_evenly_spaced(low, width, most):
    ticks = round_values(low, low + width, most)
    assert len(ticks) <= most
    assert all(low - 1e-6 * width <= tick <= low + width * (1 + 1e-6) for tick in ticks)
    assert np.ptp(np.diff(ticks)) < 1e-6 * width if len(ticks) > 2 else True


def test_a_scale_may_run_upwards():
    scale = Scale(0.0, 10.0, 140.0, 20.0)
    assert scale(5.0) == pytest.approx(80.0)
    assert scale.within(99.0) == pytest.approx(20.0)
