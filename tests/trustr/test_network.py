"""Who hears whom (N_i), how well (eq. 13), with what weight (eq. 17)."""

import itertools
from math import exp, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from trustr.network import DENSE_BELOW, communication_quality, neighbours, normalised

RANGE, BEST, DECAY, ETA, THRESHOLD = 28.0, 6.0, 2.0, 0.05, 0.5


def heard_by_all(position):
    return neighbours(np.array(position, float), np.ones(len(position), bool), range_m=RANGE)


def quality(graph, trust, *, weights="sender", eta=ETA):
    return communication_quality(
        graph,
        np.array(trust, float),
        range_m=RANGE,
        best_range_m=BEST,
        decay=DECAY,
        eta=eta,
        threshold=THRESHOLD,
        weights=weights,
    )


def weight_matrix(position, heard, trust, **how):
    graph = neighbours(position, heard, range_m=RANGE)
    return graph.dense(normalised(graph, quality(graph, trust, **how)))


def brute_force(position, heard):
    """Edges as a set of (receiver, sender), straight from the definition of N_i."""
    edges = {(i, i) for i in range(len(position))}
    for i in np.flatnonzero(heard):
        for j in np.flatnonzero(heard):
            if np.hypot(*(position[i] - position[j])) < RANGE:
                edges.add((int(i), int(j)))
    return edges


@st.composite
def swarms(draw, least=1, most=8):
    """(position, heard, trust) of a swarm; nobody knows where the silent ones are."""
    n = draw(st.integers(least, most))
    position = draw(arrays(float, (n, 2), elements=st.floats(-40, 40)))
    heard = draw(arrays(bool, n))
    trust = draw(arrays(float, n, elements=st.floats(1e-6, 1) | st.sampled_from([0.0, THRESHOLD, 1.0])))
    return np.where(heard[:, None], position, nan), heard, trust


large_swarms = swarms(DENSE_BELOW + 1, DENSE_BELOW + 12)

# --- eq. 13


@pytest.mark.parametrize(
    ("distance", "expected"),
    [
        (0.0, 1.0),
        (BEST / 2, 1.0),
        (BEST, 1.0),
        ((BEST + RANGE) / 2, exp(-DECAY / 2)),
        (BEST + (RANGE - BEST) / 4, exp(-DECAY / 4)),
        (np.nextafter(RANGE, 0), exp(-DECAY)),
    ],
)
def test_quality_is_one_up_to_rho_and_then_falls_exponentially(distance, expected):
    graph = heard_by_all([(0, 0), (0, distance)])
    assert graph.dense(quality(graph, [1, 1])) == pytest.approx(np.array([[1, expected], [expected, 1]]), rel=1e-12)


@pytest.mark.parametrize("distance", [RANGE, np.nextafter(RANGE, 99), 2 * RANGE, 1e9])
def test_nothing_is_heard_at_the_range_and_beyond(distance):
    graph = heard_by_all([(0, 0), (distance, 0)])
    assert graph.dense(np.ones(2)).tolist() == [[1, 0], [0, 1]]


def test_quality_carries_the_mean_of_both_ends_trust():
    graph = heard_by_all([(0, 0), (0, 1)])
    assert graph.dense(quality(graph, [0.6, 0.8])) == pytest.approx(np.array([[0.6, 0.7], [0.7, 0.8]]))


def test_eta_of_a_distrusted_sender_lowers_what_it_says_and_not_what_it_hears():
    graph = heard_by_all([(0, 0), (0, 1)])
    said = graph.dense(quality(graph, [0.2, 0.8]))
    assert said == pytest.approx(np.array([[0.2 * ETA, 0.5], [0.5 * ETA, 0.8]]))


def test_a_sender_exactly_at_the_threshold_keeps_its_voice():
    graph = heard_by_all([(0, 0), (0, 1)])
    assert graph.dense(quality(graph, [THRESHOLD, 1]))[1, 0] == pytest.approx((1 + THRESHOLD) / 2)
    below = np.nextafter(THRESHOLD, 0)
    assert graph.dense(quality(graph, [below, 1]))[1, 0] == pytest.approx(ETA * (1 + THRESHOLD) / 2)


def test_literal_eta_is_one_constant_for_all():
    graph = heard_by_all([(0, 0), (0, 1)])
    said = graph.dense(quality(graph, [0.2, 0.8], weights="literal", eta=0.3))
    assert said == pytest.approx(0.3 * np.array([[0.2, 0.5], [0.5, 0.8]]))


@given(swarms())
def test_quality_is_a_fraction(swarm):
    position, heard, trust = swarm
    values = quality(neighbours(position, heard, range_m=RANGE), trust)
    assert ((values >= 0) & (values <= 1)).all()


@given(swarms())
def test_quality_among_the_trusted_is_symmetric(swarm):
    position, heard, trust = swarm
    graph = neighbours(position, heard, range_m=RANGE)
    values = graph.dense(quality(graph, np.maximum(trust, THRESHOLD)))
    assert (values == values.T).all()


# --- the graph


@given(swarms() | large_swarms)
def test_edges_and_distances_are_those_of_the_definition(swarm):
    position, heard, _ = swarm
    graph = neighbours(position, heard, range_m=RANGE)
    pairs = list(zip(graph.receiver.tolist(), graph.sender.tolist(), strict=True))
    assert set(pairs) == brute_force(position, heard)
    assert len(pairs) == len(set(pairs))
    gaps = np.where((graph.receiver == graph.sender)[:, None], 0, position[graph.receiver] - position[graph.sender])
    assert (graph.distance == np.hypot(gaps[:, 0], gaps[:, 1])).all()


@pytest.mark.parametrize("side", [5, 9], ids=["dense", "tree"])
def test_a_pair_exactly_at_the_range_is_no_edge(side):
    """On a lattice of whole metres, 3-4-5 triangles have exact lengths."""
    lattice = np.stack(np.meshgrid(np.arange(side), np.arange(side)), -1).reshape(-1, 2).astype(float)
    graph = neighbours(lattice, np.ones(len(lattice), bool), range_m=5.0)
    squares = ((lattice[:, None] - lattice) ** 2).sum(-1)
    assert (graph.dense(np.ones_like(graph.distance)) == (squares < 25)).all()


def test_sixty_strangers_out_of_range_change_nothing_among_six():
    """Six robots alone go through all pairs, with the strangers through the tree."""
    rng = np.random.default_rng(1)
    six = rng.uniform(0, 30, (6, 2))
    strangers = 1000 + 50 * np.arange(60)[:, None] * np.ones(2)
    alone, among = heard_by_all(six), heard_by_all(np.concatenate([six, strangers]))
    assert len(among.sender) == len(alone.sender) + 60
    assert (among.dense(among.distance)[:6, :6] == alone.dense(alone.distance)).all()


@pytest.mark.parametrize("count", [1, 6, DENSE_BELOW, DENSE_BELOW + 1])
def test_robots_that_are_all_silent_hear_only_themselves(count):
    graph = neighbours(np.full((count, 2), nan), np.zeros(count, bool), range_m=RANGE)
    assert (graph.dense(np.ones(count)) == np.eye(count)).all()
    assert not graph.distance.any()


@given(swarms())
def test_dense_and_sum_by_receiver_tell_the_same(swarm):
    position, heard, trust = swarm
    graph = neighbours(position, heard, range_m=RANGE)
    values = trust[graph.sender]
    assert graph.sum_by_receiver(values) == pytest.approx(graph.dense(values).sum(1))


@given(swarms() | large_swarms)
def test_what_each_robot_hears_is_sorted_robot_by_robot(swarm):
    position, heard, trust = swarm
    graph = neighbours(position, heard, range_m=RANGE)
    ordered, begins = graph.sorted_by_receiver(trust)
    for robot, (begin, end) in enumerate(itertools.pairwise(begins)):
        assert ordered[begin:end].tolist() == sorted(trust[graph.sender[graph.receiver == robot]])


@given(swarms(), st.data())
def test_who_is_taken_out_speaks_to_nobody_but_itself_and_still_listens(swarm, data):
    position, heard, _ = swarm
    graph = neighbours(position, heard, range_m=RANGE)
    out = data.draw(arrays(bool, len(heard)))
    everybody = graph.dense(np.ones_like(graph.distance))
    without = graph.without(out)
    expected = np.where(np.eye(len(heard), dtype=bool) | ~out, everybody, 0)
    assert (without.dense(np.ones_like(without.distance)) == expected).all()


# --- eq. 17


@given(swarms() | large_swarms, st.sampled_from(["sender", "literal"]))
def test_weights_are_not_negative_and_sum_to_one(swarm, weights):
    matrix = weight_matrix(*swarm, weights=weights)
    assert (matrix >= 0).all()
    assert matrix.sum(1) == pytest.approx(1, abs=1e-12)


@given(swarms() | large_swarms)
def test_a_silent_robot_has_weight_exactly_zero_with_the_others_and_one_with_itself(swarm):
    position, heard, trust = swarm
    matrix = weight_matrix(position, heard, trust)
    assert not matrix[np.ix_(heard, ~heard)].any()
    assert (matrix[~heard] == np.eye(len(heard))[~heard]).all()


@given(swarms(), st.randoms(use_true_random=False))
def test_names_of_robots_do_not_matter(swarm, random):
    position, heard, trust = swarm
    order = list(range(len(heard)))
    random.shuffle(order)
    renamed = weight_matrix(position[order], heard[order], trust[order])
    assert renamed == pytest.approx(weight_matrix(position, heard, trust)[np.ix_(order, order)], abs=1e-12)


def test_robots_that_all_distrust_keep_their_own_velocity():
    position = np.arange(8.0).reshape(4, 2)
    assert (weight_matrix(position, np.ones(4, bool), np.zeros(4)) == np.eye(4)).all()


def test_a_distrusted_robot_among_trusted_ones_listens_to_them_and_not_to_itself():
    position = np.arange(8.0).reshape(4, 2) / 10
    matrix = weight_matrix(position, np.ones(4, bool), np.array([0, 1, 1, 1.0]))
    assert matrix[0] == pytest.approx([0, 1 / 3, 1 / 3, 1 / 3])
    assert matrix[1, 0] == pytest.approx(0.5 * ETA / (3 + 0.5 * ETA))


@given(swarms(), st.floats(0.01, 1))
def test_literal_eta_cancels(swarm, eta):
    one = weight_matrix(*swarm, weights="literal", eta=1.0)
    assert weight_matrix(*swarm, weights="literal", eta=eta) == pytest.approx(one, abs=1e-12)


@given(swarms(), st.floats(0.01, 1))
def test_trust_counts_against_other_trust_only(swarm, share):
    """Lowering everybody's by one factor changes no weight, where η does not look at it."""
    position, heard, trust = swarm
    whole = weight_matrix(position, heard, trust, weights="literal")
    assert weight_matrix(position, heard, share * trust, weights="literal") == pytest.approx(whole, abs=1e-9)
