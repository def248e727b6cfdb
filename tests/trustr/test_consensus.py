"""Update rules: eq. 1, eq. 12, and why the one collapses where the other does not."""

from dataclasses import replace
from math import hypot

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gcs.control import settings
from scenarios import load
from trustr.consensus import RULES, Heard, average, trust_r
from trustr.network import neighbours
from trustr.rating import study_trust

TRANSIT = settings(load("transit"))
R, RHO = TRANSIT.range_m, TRANSIT.best_range_m


def graph_of(position):
    return neighbours(np.asarray(position, float), np.ones(len(position), bool), range_m=R)


def close_together(count):
    """A complete graph within ρ."""
    return graph_of(np.random.default_rng(count).uniform(0, 0.7 * RHO, (count, 2)))


def agree(rule, graph, trust, velocity=None, chosen=TRANSIT):
    """What a rule makes of these at the first tick of a mission."""
    velocity = np.zeros((graph.count, 2)) if velocity is None else np.asarray(velocity, float)
    heard = Heard(graph, velocity, np.asarray(trust, float), 0.0, velocity, np.zeros(graph.count))
    return (RULES[rule] if isinstance(rule, str) else rule)(heard, chosen)


positions = st.integers(1, 8).flatmap(lambda n: arrays(float, (n, 2), elements=st.floats(-30, 30)))
velocities = st.floats(-3, 3)


@given(positions)
def test_average_gives_each_robot_heard_one_part_of_all(position):
    graph = graph_of(position)
    heard = graph.dense(np.ones(len(graph.sender)))
    others = heard.sum(1, keepdims=True) - 1
    assert graph.dense(agree(average, graph, np.ones(len(position))).weights) == pytest.approx(heard / (others + 1))


@given(st.integers(1, 8), st.floats(0.5, 1))
def test_where_all_are_trusted_alike_within_rho_trust_r_is_the_average(count, trust):
    graph, same = close_together(count), np.full(count, trust)
    assert agree(trust_r, graph, same).weights == pytest.approx(agree(average, graph, same).weights, abs=1e-12)


@given(arrays(float, (6, 2), elements=velocities), st.sampled_from(sorted(RULES)))
def test_a_complete_graph_of_trusted_robots_keeps_its_mean_velocity_and_agrees_at_once(velocity, rule):
    graph = close_together(6)
    agreed = agree(rule, graph, np.ones(6), velocity).velocity_ne
    assert agreed == pytest.approx(np.tile(velocity.mean(0), (6, 1)), abs=1e-12)


@given(positions, st.data(), st.sampled_from(sorted(RULES)))
def test_no_robot_is_told_to_fly_faster_than_those_it_hears(position, data, rule):
    n = len(position)
    velocity = data.draw(arrays(float, (n, 2), elements=velocities))
    graph = graph_of(position)
    trust = data.draw(arrays(float, n, elements=st.floats(0, 1)))
    told = agree(rule, graph, trust, velocity).velocity_ne
    for row in range(n):
        heard = velocity[graph.sender[graph.receiver == row]]
        assert (told[row] >= heard.min(0) - 1e-12).all()
        assert (told[row] <= heard.max(0) + 1e-12).all()


@given(positions, velocities, velocities, st.sampled_from(sorted(RULES)))
def test_robots_that_agree_go_on_agreeing(position, north, east, rule):
    graph = graph_of(position)
    velocity = np.tile([north, east], (len(position), 1))
    trust = np.linspace(0, 1, len(position))
    assert agree(rule, graph, trust, velocity).velocity_ne == pytest.approx(velocity, abs=1e-12)


@pytest.mark.parametrize("rule", sorted(RULES))
@pytest.mark.parametrize("trust", [0.0, 0.3, 1.0])
def test_a_lone_robot_keeps_its_own_velocity(rule, trust):
    graph, velocity = graph_of([(5, 5)]), np.array([[1.2, -0.3]])
    assert (agree(rule, graph, [trust], velocity).velocity_ne == velocity).all()


@pytest.mark.parametrize("rule", sorted(RULES))
def test_a_distrusted_robot_keeps_its_own_velocity_when_alone_in_range(rule):
    graph, velocity = graph_of([(0, 0), (R, 0)]), np.array([[1.0, 0], [0, 1.0]])
    assert (agree(rule, graph, np.zeros(2), velocity).velocity_ne == velocity).all()


# --- why the baseline collapses: six robots within ρ, one of them dragging, ratings of scenario 1

STUDY = study_trust(np.arange(6) == 4, faulty_rating=1.94, others_rating=3.83)
FIGURES = [  # w_f, Λ at 40 % and at 70 % as printed in the reference
    ("average", "sender", 0.167, 1.27, 0.93),
    ("trust-r", "literal", 0.118, 0.90, 0.65),
    ("trust-r", "sender", 0.0066, 0.05, 0.04),
]


@pytest.mark.parametrize(("rule", "weights", "weight", "drag_40", "drag_70"), FIGURES)
def test_weight_and_drag_of_the_failed_robot(rule, weights, weight, drag_40, drag_70):
    graph = close_together(6)
    matrix = graph.dense(agree(rule, graph, STUDY, chosen=replace(TRANSIT, weights=weights)).weights)
    healthy = np.arange(6) != 4
    given_to_it = matrix[healthy, 4]
    assert given_to_it == pytest.approx(weight, abs=0.0006)
    for max_speed, drag in ((0.4, drag_40), (0.7, drag_70)):
        lag = hypot(1 - max_speed, 0.47)  # ‖v_f − v‖ in cruise
        leaders, cap = 2, 0.25
        assert 5 * given_to_it[0] * lag / (leaders * cap) == pytest.approx(drag, abs=0.006)
