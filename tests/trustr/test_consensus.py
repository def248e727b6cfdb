"""Update rules: eq. 1 and eq. 12, why the one collapses where the other does not, and the baselines from literature."""

from dataclasses import replace
from functools import partial
from math import exp, hypot

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gcs.control import settings
from scenarios import load
from scenarios.models import RULES as NAMES
from trustr.consensus import RULES, Heard, average, trust_r, w_msr
from trustr.network import Graph, neighbours
from trustr.rating import study_trust

TRANSIT = settings(load("transit"))
R, RHO = TRANSIT.range_m, TRANSIT.best_range_m


def graph_of(position):
    return neighbours(np.asarray(position, float), np.ones(len(position), bool), range_m=R)


def close_together(count):
    """A complete graph within ρ."""
    return graph_of(np.random.default_rng(count).uniform(0, 0.7 * RHO, (count, 2)))


def agree(rule, graph, trust=None, velocity=None, chosen=TRANSIT, *, time_s=0.0, first=None, standing=None):
    """What a rule makes of these; where nothing else is said, at the first tick of a mission."""
    trust = np.ones(graph.count) if trust is None else np.asarray(trust, float)
    velocity = np.zeros((graph.count, 2)) if velocity is None else np.asarray(velocity, float)
    first = velocity if first is None else np.asarray(first, float)
    standing = np.zeros(graph.count) if standing is None else np.asarray(standing, float)
    heard = Heard(graph, velocity, trust, time_s, first, standing)
    return (RULES[rule] if isinstance(rule, str) else rule)(heard, chosen)


positions = st.integers(1, 8).flatmap(lambda n: arrays(float, (n, 2), elements=st.floats(-30, 30)))
velocities = st.floats(-3, 3)
rules = st.sampled_from(sorted(RULES))
MEANS = ("average", "trust-r", "confidence-decay")
"""Rules that weigh whole velocities; the others pick for each axis."""


@st.composite
def swarms(draw):
    """All that a rule may go by, of 1 to 8 robots in and out of range; some say the same."""
    position = draw(positions)
    n = len(position)
    some_alike = velocities | st.sampled_from([-1.0, 0.0, 1.0])
    return {
        "graph": graph_of(position),
        "velocity": draw(arrays(float, (n, 2), elements=some_alike)),
        "trust": draw(arrays(float, n, elements=st.floats(0, 1))),
        "time_s": draw(st.floats(0, 100)),
        "first": draw(arrays(float, (n, 2), elements=velocities)),
        "standing": draw(arrays(float, n, elements=st.floats(-50, 50) | st.just(0.0))),
    }


def large_swarm(count=200, seed=0):
    """(graph, velocity) of robots most of whom are out of each other's range; velocities in steps, so that many tie."""
    rng = np.random.default_rng(seed)
    return graph_of(rng.uniform(0, 90, (count, 2))), rng.integers(-20, 20, (count, 2)) / 8


def said_to(graph, velocity, robot):
    """(own velocity (2,), the others' (n, 2)) as a robot hears them."""
    others = graph.sender[(graph.receiver == robot) & (graph.sender != robot)]
    return velocity[robot], velocity[others]


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


@given(swarms(), rules)
def test_weights_are_not_negative_and_each_robots_sum_to_one(swarm, rule):
    weights = agree(rule, **swarm).weights
    assert (weights >= 0).all()
    assert swarm["graph"].sum_by_receiver(weights) == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("rule", sorted(RULES))
def test_weights_of_two_hundred_robots_sum_to_one(rule):
    graph, velocity = large_swarm()
    weights = agree(rule, graph, None, velocity).weights
    assert (weights >= 0).all()
    assert graph.sum_by_receiver(weights) == pytest.approx(1, abs=1e-12)


@given(swarms(), rules, st.randoms(use_true_random=False))
def test_robots_that_change_names_change_commands_and_nothing_else(swarm, rule, random):
    graph = swarm["graph"]
    order = list(range(graph.count))
    random.shuffle(order)
    name = np.argsort(order)
    renamed = swarm | {key: swarm[key][order] for key in ("velocity", "trust", "first", "standing")}
    renamed["graph"] = Graph(graph.count, name[graph.receiver], name[graph.sender], graph.distance)
    one, other = agree(rule, **swarm), agree(rule, **renamed)
    assert other.velocity_ne == pytest.approx(one.velocity_ne[order], abs=1e-12)
    assert other.weights == pytest.approx(one.weights, abs=1e-12)


@given(swarms(), rules)
def test_what_is_heard_stays_as_it_was(swarm, rule):
    before = swarm["velocity"].copy(), swarm["first"].copy()
    agree(rule, **swarm).velocity_ne[:] = 99
    assert (swarm["velocity"] == before[0]).all()
    assert (swarm["first"] == before[1]).all()


@given(swarms(), st.sampled_from(MEANS[:2]))
def test_of_the_papers_rules_the_weights_are_those_of_the_mean(swarm, rule):
    agreement = agree(rule, **swarm)
    assert agreement.velocity_ne == pytest.approx(swarm["graph"].dense(agreement.weights) @ swarm["velocity"], abs=1e-9)


@given(arrays(float, (6, 2), elements=velocities), st.sampled_from(MEANS))
def test_means_over_a_complete_graph_of_trusted_robots_agree_at_once_on_its_mean(velocity, rule):
    graph = close_together(6)
    agreed = agree(rule, graph, np.ones(6), velocity, replace(TRANSIT, confidence=0.0)).velocity_ne
    assert agreed == pytest.approx(np.tile(velocity.mean(0), (6, 1)), abs=1e-12)


@given(positions, st.data(), rules)
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


@given(positions, velocities, velocities, rules)
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


# --- the median


@given(swarms())
def test_the_median_is_numpys_of_what_each_robot_hears(swarm):
    graph, velocity = swarm["graph"], swarm["velocity"]
    told = agree("median", **swarm).velocity_ne
    for robot in range(graph.count):
        own, others = said_to(graph, velocity, robot)
        assert told[robot] == pytest.approx(np.median([own, *others], axis=0), abs=1e-12)


def test_the_median_of_two_hundred_robots_is_numpys():
    graph, velocity = large_swarm()
    told = agree("median", graph, None, velocity).velocity_ne
    expected = [np.median(velocity[graph.sender[graph.receiver == robot]], axis=0) for robot in range(graph.count)]
    assert told == pytest.approx(np.array(expected), abs=1e-12)


@given(arrays(float, (6, 2), elements=velocities), arrays(float, (2, 2), elements=st.floats(-1e6, 1e6)))
def test_two_liars_of_six_cannot_move_the_median_beyond_what_the_others_say(velocity, lies):
    velocity[4:] = lies
    told = agree("median", close_together(6), None, velocity).velocity_ne
    assert (told >= velocity[:4].min(0) - 1e-12).all()
    assert (told <= velocity[:4].max(0) + 1e-12).all()


# --- W-MSR


def reduced_mean(own, others, faults):
    """The algorithm as its paper tells it, for one robot and one axis."""
    others = np.sort(others)
    larger, same, smaller = others[others > own], others[others == own], others[others < own]
    kept_larger = larger[: max(len(larger) - faults, 0)]
    kept_smaller = smaller[min(faults, len(smaller)) :]
    return np.mean([own, *kept_smaller, *same, *kept_larger])


def reduced_means(graph, velocity, faults):
    heard = [said_to(graph, velocity, robot) for robot in range(graph.count)]
    return np.array([[reduced_mean(own[axis], others[:, axis], faults) for axis in (0, 1)] for own, others in heard])


@given(swarms(), st.integers(1, 4))
def test_w_msr_is_what_its_paper_says(swarm, faults):
    told = agree(partial(w_msr, faults=faults), **swarm).velocity_ne
    assert told == pytest.approx(reduced_means(swarm["graph"], swarm["velocity"], faults), abs=1e-12)


@pytest.mark.parametrize("faults", [1, 2])
def test_w_msr_of_two_hundred_robots_is_what_its_paper_says(faults):
    graph, velocity = large_swarm()
    told = agree(f"wmsr-{faults}", graph, None, velocity).velocity_ne
    assert told == pytest.approx(reduced_means(graph, velocity, faults), abs=1e-12)


@pytest.mark.parametrize("faults", [1, 2])
@given(arrays(float, (6, 2), elements=velocities), arrays(float, (2, 2), elements=st.floats(-1e6, 1e6)))
def test_as_many_liars_as_w_msr_expects_cannot_move_the_others_beyond_what_they_say_themselves(faults, velocity, lies):
    healthy = velocity[: 6 - faults]
    velocity[6 - faults :] = lies[:faults]
    told = agree(f"wmsr-{faults}", close_together(6), None, velocity).velocity_ne[: 6 - faults]
    assert (told >= healthy.min(0) - 1e-9).all()
    assert (told <= healthy.max(0) + 1e-9).all()


@pytest.mark.parametrize(("rule", "told"), [("wmsr-1", 1.0), ("wmsr-2", 0.0)])
def test_one_liar_more_than_w_msr_expects_moves_it(rule, told):
    """Four at rest, two that claim 5 m/s: with F = 1 one of the lies stays, a fifth of the mean."""
    velocity = np.array([(0, 0)] * 4 + [(5, 0)] * 2, float)
    assert agree(rule, close_together(6), None, velocity).velocity_ne[0] == pytest.approx([told, 0])


def test_w_msr_never_removes_a_robots_own_velocity():
    velocity = np.array([(9, -9), (0, 0), (0, 0)], float)
    told = agree("wmsr-2", close_together(3), None, velocity)
    assert told.velocity_ne.tolist() == velocity.tolist()
    assert close_together(3).dense(told.weights)[0].tolist() == [1, 0, 0]


def test_the_weight_of_a_robot_removed_on_one_axis_is_the_mean_of_both():
    """The last is the fastest north, and in the middle east."""
    graph, velocity = close_together(3), np.array([(0, 0), (1, 2), (2, 1)], float)
    assert graph.dense(agree("wmsr-1", graph, None, velocity).weights)[0] == pytest.approx([0.5, 0.25, 0.25])


# --- confidence


def test_at_mission_start_confidence_decay_keeps_nine_tenths_of_the_first_velocity():
    velocity = np.array([(0, 0)] * 5 + [(6, 0)], float)
    agreement = agree("confidence-decay", close_together(6), None, velocity)
    assert agreement.velocity_ne[0] == pytest.approx([0.1, 0])
    assert agreement.velocity_ne[5] == pytest.approx([0.9 * 6 + 0.1, 0])
    assert close_together(6).dense(agreement.weights)[0, 0] == pytest.approx(0.9 + 0.1 / 6)


@pytest.mark.parametrize("time_s", [0.0, 0.1, 2.0, 30.0])
@pytest.mark.parametrize(("confidence", "decay"), [(0.9, 0.5), (0.5, 0.1), (0.0, 1.0)])
def test_the_first_velocity_fades_exponentially(time_s, confidence, decay):
    chosen = replace(TRANSIT, confidence=confidence, confidence_decay=decay)
    zero, first = np.zeros((4, 2)), np.arange(8.0).reshape(4, 2)
    told = agree("confidence-decay", close_together(4), None, zero, chosen, time_s=time_s, first=first).velocity_ne
    assert told == pytest.approx(confidence * exp(-decay * time_s) * first, rel=1e-12)


@given(swarms())
def test_who_has_more_doubt_than_trust_behind_it_counts_for_nobody_but_itself(swarm):
    graph, standing = swarm["graph"], swarm["standing"]
    matrix = graph.dense(agree("confidence-decay", **swarm).weights)
    others = ~np.eye(graph.count, dtype=bool)
    assert not matrix[others & (standing < 0)].any()
    share = (1 - 0.9 * exp(-0.5 * swarm["time_s"])) / ((matrix * others > 0).sum(1, keepdims=True) + 1)
    assert matrix[others] == pytest.approx(np.where(matrix > 0, share, 0)[others], rel=1e-9)


def test_a_distrusted_robot_still_listens_to_the_others():
    velocity = np.array([(1, 0), (1, 0), (0, 0)], float)
    late = {"time_s": 1e3, "standing": [5, 5, -5]}
    told = agree("confidence-decay", close_together(3), None, velocity, **late).velocity_ne
    assert told == pytest.approx(np.array([(1, 0), (1, 0), (2 / 3, 0)]))


def test_a_swarm_that_all_distrust_goes_on_as_it_is():
    velocity = np.arange(6.0).reshape(3, 2)
    told = agree("confidence-decay", close_together(3), None, velocity, time_s=1e3, standing=[-1, -1, -1])
    assert told.velocity_ne == pytest.approx(velocity)


def test_the_names_of_rules_are_those_that_a_scenario_may_give():
    assert tuple(RULES) == tuple(NAMES)
