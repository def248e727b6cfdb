"""The last function before a set-point leaves."""

from math import inf, nan

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gcs.gate import PASSED, REFUSED, SLOWED, Limits, admit

DT = 0.1
LIMITS = Limits(speed=5.0, acceleration=10.0)


def velocities(elements):
    return arrays(float, (4, 3), elements=elements)


asked = velocities(st.floats(-1e6, 1e6) | st.sampled_from([nan, inf, -inf]))
sane = velocities(st.floats(-3, 3))  # no part is longer than √18 < 5 m/s
limits = st.builds(Limits, speed=st.floats(5, 20), acceleration=st.floats(0.1, 100))


def horizontal(vectors):
    return np.hypot(vectors[:, 0], vectors[:, 1])


def one(asked_ned, before_ned=(0.0, 0.0, 0.0), limits=LIMITS):
    (sent,), (verdict,) = admit(np.array([asked_ned], float), np.array([before_ned], float), limits, dt=DT)
    return sent, verdict


@given(asked, sane, limits)
def test_what_is_sent_is_finite_and_no_faster_than_allowed(asked_ned, before_ned, limits):
    sent, _ = admit(asked_ned, before_ned, limits, dt=DT)
    assert np.isfinite(sent).all()
    assert (horizontal(sent) <= limits.speed * (1 + 1e-12)).all()
    assert (np.abs(sent[:, 2]) <= limits.speed * (1 + 1e-12)).all()


@given(asked, sane, limits)
def test_what_is_sent_changes_no_faster_than_allowed(asked_ned, before_ned, limits):
    change = admit(asked_ned, before_ned, limits, dt=DT)[0] - before_ned
    assert (horizontal(change) <= limits.acceleration * DT + 1e-9).all()
    assert (np.abs(change[:, 2]) <= limits.acceleration * DT + 1e-9).all()


@given(asked, sane)
def test_a_set_point_that_is_no_number_is_refused_and_the_vehicle_slows_to_a_stop(asked_ned, before_ned):
    refused = ~np.isfinite(asked_ned).all(1)
    sent, verdict = admit(asked_ned, before_ned, LIMITS, dt=DT)
    assert ((verdict == REFUSED) == refused).all()
    assert (horizontal(sent)[refused] <= horizontal(before_ned)[refused]).all()
    stopped = sent
    for _ in range(5):  # √18 m/s at 1 m/s a tick
        stopped, _ = admit(np.full((4, 3), nan), stopped, LIMITS, dt=DT)
    assert stopped == pytest.approx(np.zeros((4, 3)), abs=1e-12)


@given(sane, sane)
def test_what_is_within_the_limits_is_sent_as_asked(asked_ned, before_ned):
    wide = Limits(speed=5.0, acceleration=1000.0)
    sent, verdict = admit(asked_ned, before_ned, wide, dt=DT)
    assert sent == pytest.approx(asked_ned, abs=1e-12)
    assert (verdict == PASSED).all()


@given(sane)
def test_what_was_sent_may_be_sent_again(before_ned):
    sent, verdict = admit(before_ned, before_ned, LIMITS, dt=DT)
    assert (sent == before_ned).all()
    assert (verdict == PASSED).all()


@given(asked, sane, st.integers(0, 3), sane)
def test_one_vehicles_set_point_is_no_matter_of_the_others(asked_ned, before_ned, row, other):
    changed = other.copy()
    changed[row] = asked_ned[row]
    sent, verdict = admit(asked_ned, before_ned, LIMITS, dt=DT)
    sent_beside_others, verdict_beside_others = admit(changed, before_ned, LIMITS, dt=DT)
    assert (sent[row] == sent_beside_others[row]).all()
    assert verdict[row] == verdict_beside_others[row]


@pytest.mark.parametrize("asked_ned", [(30, 40, 0), (-300, 400, 0), (0, -1e6, 0)])
def test_a_set_point_that_is_too_fast_keeps_its_direction(asked_ned):
    sent, verdict = one(asked_ned, limits=Limits(speed=5.0, acceleration=1e9))
    assert sent == pytest.approx(5 * np.array(asked_ned) / np.linalg.norm(asked_ned))
    assert verdict == SLOWED


@pytest.mark.parametrize("down", [9.0, -9.0])
def test_climb_and_descent_are_limited_by_themselves(down):
    sent, verdict = one((3, 4, down), before_ned=(3, 4, down / 9 * 4.5))
    assert sent == pytest.approx([3, 4, np.copysign(5, down)])
    assert verdict == SLOWED


def test_from_rest_the_first_set_point_goes_as_far_as_the_acceleration_allows():
    sent, verdict = one((1.5, 0, 0))
    assert sent.tolist() == [1.0, 0, 0]
    assert verdict == SLOWED


@given(sane, sane, st.floats(0.1, 100))
def test_asking_again_and_again_arrives_and_stays(asked_ned, before_ned, acceleration):
    assume(acceleration * DT * 100 > 12)
    sent, limits = before_ned, Limits(5.0, acceleration)
    for _ in range(100):
        sent, verdict = admit(asked_ned, sent, limits, dt=DT)
    assert sent == pytest.approx(asked_ned, abs=1e-9)
    assert (verdict == PASSED).all()


def test_what_is_asked_stays_as_it_was():
    asked_ned, before_ned = np.array([[9.0, nan, 0]]), np.array([[1.0, 2.0, 3.0]])
    admit(asked_ned, before_ned, LIMITS, dt=DT)
    assert np.array_equal(asked_ned, [[9.0, nan, 0]], equal_nan=True)
    assert before_ned.tolist() == [[1, 2, 3]]
