"""One tick of the swarm's control."""

from dataclasses import replace
from math import exp, inf, nan

import numpy as np
import pytest
from hypothesis import given, note
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gcs.control import settings
from scenarios import load
from trustr.consensus import RULES
from trustr.controller import Memory, Observation
from trustr.controller import decide as remember_and_decide
from trustr.leader import VirtualLeader
from trustr.roles import GONE_S, Roles
from trustr.separation import separation

PROFILES = ("paper", "recommended")


def bound_to(profile, *overrides):
    return settings(load("transit", overrides=[f"control.profile={profile}", *overrides]))


SETTINGS = {name: bound_to(name) for name in PROFILES}
WITHOUT_BERTH = {name: bound_to(name, "control.berth_m=0") for name in PROFILES}
VIRTUAL = VirtualLeader(np.array([3.0, 4.0]), np.array([1.2, 0.9]), np.array([0.5, -0.5]))
REST = VirtualLeader(*np.zeros((3, 2)))

profiles = pytest.mark.parametrize("profile", PROFILES)
rules = pytest.mark.parametrize("rule", RULES)


def flown_by(rule, profile):
    return replace(SETTINGS[profile], rule=RULES[rule])


def controllers(*profiles):
    """Every rule in these profiles: all see one observation, which takes forty times longer to draw than to use."""
    for profile in profiles:
        for rule in RULES:
            note(f"{rule}, {profile} profile")
            yield flown_by(rule, profile)


def decide(observation, virtual, chosen, memory=None):
    """The decision of one tick, the mission's first unless there is a memory."""
    return remember_and_decide(memory, observation, virtual, chosen)[1]


@st.composite
def observations(draw):
    def six(columns, elements):
        return draw(arrays(float, (6, columns), elements=elements))

    wild = st.sampled_from([nan, inf, -inf])
    return Observation(
        position_ne=six(2, st.floats(-40, 40) | wild),
        velocity_ne=six(2, st.floats(-3, 3) | wild),
        heard=draw(arrays(bool, 6)),
        trust=six(1, st.floats(0, 1))[:, 0],
        beside_ne=six(2, st.floats(-40, 40) | wild) if draw(st.booleans()) else None,
    )


@profiles
def test_robots_keep_apart_from_one_that_is_not_heard_where_it_is_thought_to_be(profile):
    """And it counts for nothing else: half a metre beside robot 2 it moves robot 2 alone, away from it."""
    chosen = SETTINGS[profile]
    seen = replace(in_formation(chosen), heard=np.arange(6) != 4)
    there = np.full((6, 2), nan)
    there[4] = seen.position_ne[1] + np.array([0.0, 0.5])
    nobody, beside = (decide(replace(seen, beside_ne=place), REST, chosen) for place in (None, there))
    push = beside.velocity_ne - nobody.velocity_ne
    assert push[1] == pytest.approx([0.0, -chosen.separation_gain * (chosen.separation_radius - 0.5)])
    assert not push[[0, 2, 3, 4, 5]].any()
    assert (beside.graph.dense(beside.weights) == nobody.graph.dense(nobody.weights)).all()


@given(observations())
def test_whoever_is_heard_is_where_he_says_and_nowhere_else(observation):
    heard = replace(observation, heard=np.ones(6, bool))
    known = np.isfinite(heard.position_ne).all(1) & np.isfinite(heard.velocity_ne).all(1)
    there = None if heard.beside_ne is None else np.where(known[:, None], heard.beside_ne, nan)
    one, other = (decide(replace(heard, beside_ne=place), VIRTUAL, SETTINGS["paper"]) for place in (there, None))
    assert (one.velocity_ne == other.velocity_ne).all()


def in_formation(chosen, *, velocity=(0.0, 0.0), trust=1.0):
    return Observation(
        chosen.offset_ne.copy(), np.tile(np.array(velocity), (6, 1)), np.ones(6, bool), np.full(6, trust)
    )


@given(observations())
def test_every_command_is_finite_and_the_unheard_are_told_to_stand_still(observation):
    known = np.isfinite(observation.position_ne).all(1) & np.isfinite(observation.velocity_ne).all(1)
    for chosen in controllers(*PROFILES):
        decision = decide(observation, VIRTUAL, chosen)
        assert np.isfinite(decision.velocity_ne).all()
        assert not decision.velocity_ne[~(observation.heard & known)].any()


@given(observations())
def test_between_a_robot_that_is_not_heard_and_any_other_the_weight_is_exactly_zero(observation):
    known = np.isfinite(observation.position_ne).all(1) & np.isfinite(observation.velocity_ne).all(1)
    silent = ~(observation.heard & known)
    for chosen in controllers("paper"):
        memory, _ = remember_and_decide(None, observation, VIRTUAL, chosen)
        decision = decide(replace(observation, time_s=3.0), VIRTUAL, chosen, memory)
        matrix = decision.graph.dense(decision.weights)
        assert not matrix[np.ix_(~silent, silent)].any()
        assert matrix[silent] == pytest.approx(np.eye(6)[silent], abs=1e-12)
        assert matrix.sum(1) == pytest.approx(1, abs=1e-12)


@given(observations(), st.integers(0, 5), st.sampled_from([nan, inf, -inf]))
def test_a_robot_that_tells_no_number_is_as_good_as_silent(observation, robot, value):
    """Whatever else it says, nobody's command changes."""
    silent, babbling = observation.heard.copy(), observation.velocity_ne.copy()
    silent[robot], babbling[robot, 1] = False, value
    for chosen in controllers(*PROFILES):
        one = decide(replace(observation, velocity_ne=babbling), VIRTUAL, chosen)
        other = decide(replace(observation, heard=silent), VIRTUAL, chosen)
        assert (one.velocity_ne == other.velocity_ne).all()


@profiles
@given(observations(), st.integers(0, 5), arrays(float, 4, elements=st.floats(-99, 99)))
def test_what_a_silent_robot_was_last_heard_to_say_does_not_count(profile, observation, robot, said):
    heard, position, velocity = (
        value.copy() for value in (observation.heard, observation.position_ne, observation.velocity_ne)
    )
    heard[robot], position[robot], velocity[robot] = False, said[:2], said[2:]
    silent = replace(observation, heard=heard)
    one = decide(silent, VIRTUAL, SETTINGS[profile])
    other = decide(replace(silent, position_ne=position, velocity_ne=velocity), VIRTUAL, SETTINGS[profile])
    assert (one.velocity_ne == other.velocity_ne).all()


@given(observations(), st.permutations(range(6)))
def test_names_of_robots_do_not_matter(observation, order):
    renamed = replace(
        observation,
        position_ne=observation.position_ne[order],
        velocity_ne=observation.velocity_ne[order],
        heard=observation.heard[order],
        trust=observation.trust[order],
        beside_ne=None if observation.beside_ne is None else observation.beside_ne[order],
    )
    for drawn in controllers(*PROFILES):
        chosen = replace(drawn, hand_over=False)  # of two equally near, the lower id takes over
        leaders = np.array([order.index(leader) for leader in chosen.leaders])
        called_so = replace(chosen, offset_ne=chosen.offset_ne[order], leaders=leaders)
        command = decide(renamed, VIRTUAL, called_so).velocity_ne
        assert command == pytest.approx(decide(observation, VIRTUAL, chosen).velocity_ne[order], abs=1e-9)


@profiles
@given(observations(), st.floats(-np.pi, np.pi))
def test_turning_the_world_turns_the_commands(profile, observation, angle):
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    # one range for all, no separation, no hand-over: rounding must not decide who is just inside a radius, on which
    # side, or the nearer of two
    chosen = replace(WITHOUT_BERTH[profile], range_m=1e6, best_range_m=1e5, separation_gain=0.0, hand_over=False)
    position, velocity = (np.nan_to_num(value) for value in (observation.position_ne, observation.velocity_ne))
    seen = replace(observation, position_ne=position.clip(-40, 40), velocity_ne=velocity.clip(-3, 3))
    turned = decide(
        replace(seen, position_ne=seen.position_ne @ turn, velocity_ne=seen.velocity_ne @ turn),
        VirtualLeader(VIRTUAL.position_ne @ turn, VIRTUAL.velocity_ne @ turn, VIRTUAL.acceleration_ne @ turn),
        replace(chosen, offset_ne=chosen.offset_ne @ turn),
    )
    still = decide(seen, VIRTUAL, chosen)
    assert turned.velocity_ne == pytest.approx(still.velocity_ne @ turn, abs=1e-6)


@profiles
def test_a_formation_in_its_place_and_at_cruise_flies_on_as_it_is(profile):
    chosen = SETTINGS[profile]
    cruise = VirtualLeader(np.zeros(2), np.array([1.2, 0.9]), np.zeros(2))
    command = decide(in_formation(chosen, velocity=(1.2, 0.9)), cruise, chosen).velocity_ne
    assert command == pytest.approx(np.tile([1.2, 0.9], (6, 1)))


@profiles
def test_only_leaders_know_of_the_virtual_leader(profile):
    chosen = SETTINGS[profile]
    near, far = (
        decide(in_formation(chosen), VirtualLeader(np.array([north, 0.0]), np.zeros(2), np.zeros(2)), chosen)
        for north in (0.0, 1.0)
    )
    moved = (far.velocity_ne - near.velocity_ne)[:, 0]
    followers = np.setdiff1d(np.arange(6), chosen.leaders)
    assert moved[chosen.leaders] == pytest.approx(chosen.c1)
    assert not moved[followers].any()


def test_in_the_papers_profile_nothing_but_feedback_and_separation_is_added_to_the_consensus():
    chosen = SETTINGS["paper"]
    rng = np.random.default_rng(3)
    seen = replace(in_formation(chosen), position_ne=rng.uniform(0, 4, (6, 2)), velocity_ne=rng.uniform(-1, 1, (6, 2)))
    decision = decide(seen, REST, replace(chosen, c1=0.0, c2=0.0))
    consensus = decision.graph.dense(decision.weights) @ seen.velocity_ne
    push = separation(decision.graph, seen.position_ne, radius=chosen.separation_radius, gain=chosen.separation_gain)
    assert push.any()
    assert decision.velocity_ne == pytest.approx(consensus + push)


def test_the_formation_gain_brings_a_displaced_robot_back_without_moving_the_mean():
    chosen = replace(SETTINGS["recommended"], c1=0.0, c2=0.0)
    displaced = in_formation(chosen)
    displaced.position_ne[4] += [0.6, 0.0]
    command = decide(displaced, REST, chosen).velocity_ne
    back = -chosen.formation_gain * (np.eye(6)[4] - 1 / 6) * 0.6
    assert command == pytest.approx(np.column_stack([back, np.zeros(6)]), abs=1e-3)  # ρ is 6 m, and two are 7 m apart
    assert command.sum(0) == pytest.approx([0, 0], abs=1e-2)


def test_a_distrusted_robot_out_of_its_place_does_not_draw_the_others_along():
    chosen = replace(WITHOUT_BERTH["recommended"], eta=0.0)
    trust = np.array([1, 1, 1, 1, 0, 1.0])
    seen = replace(in_formation(chosen), trust=trust)
    seen.position_ne[4] += [-2.0, -2.0]
    command = decide(seen, REST, chosen).velocity_ne
    assert command[trust > 0] == pytest.approx(np.zeros((5, 2)), abs=1e-12)
    assert (command[4] > 0).all()


@rules
@profiles
def test_what_is_observed_stays_as_it_was(profile, rule):
    chosen = flown_by(rule, profile)
    seen = in_formation(chosen, velocity=(1.0, 0.0))
    before = seen.position_ne.copy(), seen.velocity_ne.copy()
    decide(seen, VIRTUAL, chosen)
    assert (seen.position_ne == before[0]).all()
    assert (seen.velocity_ne == before[1]).all()


# --- what one tick leaves to the next


def ticks(trusts, *, dt=0.1, rule="trust-r"):
    """Memories after ticks at which everybody was trusted so much; velocities are the tick's number."""
    chosen, memory, left = flown_by(rule, "paper"), None, []
    for number, trust in enumerate(trusts):
        seen = replace(in_formation(chosen, velocity=(number, 0.0), trust=trust), time_s=number * dt)
        memory, _ = remember_and_decide(memory, seen, REST, chosen)
        left.append(memory)
    return left


def test_standing_is_the_time_integral_of_trust_above_one_half():
    *_, last = ticks([1.0] * 21 + [0.0] * 50)
    assert last.standing == pytest.approx(np.full(6, 0.5 * 2.0 - 0.5 * 5.0))


def test_standing_begins_at_nothing():
    (first,) = ticks([0.0])
    assert not first.standing.any()


def test_the_first_velocity_is_kept():
    *_, last = ticks([1.0] * 30)
    assert not last.first_ne.any()


def test_confidence_in_the_first_velocity_fades_from_tick_to_tick():
    chosen = replace(flown_by("confidence-decay", "paper"), c1=0.0, c2=0.0)
    begun = in_formation(chosen, velocity=(1.0, 0.0))
    memory, first = remember_and_decide(None, begun, REST, chosen)
    stopped = replace(in_formation(chosen), time_s=2.0)
    later = decide(stopped, REST, chosen, memory)
    assert first.velocity_ne == pytest.approx(begun.velocity_ne)
    assert later.velocity_ne == pytest.approx(0.9 * exp(-0.5 * 2.0) * begun.velocity_ne)


# --- parts that trust gives and takes


def remembering(chosen, *, left=(), for_s=0.0):
    """A memory in which these robots were left behind so long ago."""
    roles = replace(Roles.of(6, chosen.leaders), left_s=np.where(np.isin(np.arange(6), left), for_s, nan))
    return Memory(0.0, np.zeros((6, 2)), np.zeros(6), roles)


@given(observations(), st.sets(st.integers(0, 5), min_size=1))
def test_between_others_and_a_robot_left_behind_the_weight_is_exactly_zero(observation, left):
    away = np.isin(np.arange(6), list(left))
    for chosen in controllers("recommended"):
        decision = decide(replace(observation, time_s=0.1), VIRTUAL, chosen, remembering(chosen, left=list(left)))
        matrix = decision.graph.dense(decision.weights)
        assert not (matrix * ~np.eye(6, dtype=bool))[:, away].any()
        assert matrix.sum(1) == pytest.approx(1, abs=1e-12)
        assert np.isfinite(decision.velocity_ne).all()


@profiles
@pytest.mark.parametrize(("for_s", "keeps"), [(0.0, 1), (GONE_S - 0.1, 1), (GONE_S, 0), (60.0, 0)])
def test_the_others_keep_apart_from_a_robot_left_behind_until_it_is_out_of_their_plane(profile, for_s, keeps):
    chosen = replace(SETTINGS[profile], c1=0.0, c2=0.0, formation_gain=0.0)
    seen = in_formation(chosen)
    seen.position_ne[4] = seen.position_ne[5] + [-1.0, 0.0]
    command = decide(seen, REST, chosen, remembering(chosen, left=[4], for_s=for_s)).velocity_ne
    assert command[5, 0] == pytest.approx(keeps * chosen.separation_gain * (chosen.separation_radius - 1.0))


def test_a_robot_left_behind_is_left_after_fifty_ticks_without_hope():
    chosen, memory = SETTINGS["recommended"], None
    chosen = replace(chosen, leave_behind=True)
    trust = np.where(np.arange(6) == 4, 0.0, 1.0)
    left = []
    for tick in range(60):
        seen = replace(in_formation(chosen), trust=trust, time_s=tick * 0.1)
        memory, decision = remember_and_decide(memory, seen, REST, chosen)
        left.append(decision.roles.left.tolist())
    assert not np.any(left[:50])
    assert left[50:] == [[False] * 4 + [True, False]] * 10


@profiles
def test_who_takes_a_leaders_role_is_steered_in_its_stead(profile):
    chosen = replace(SETTINGS[profile], hand_over=True, eta=0.0, berth=0.0)
    ahead = VirtualLeader(np.array([1.0, 0.0]), np.zeros(2), np.zeros(2))
    trust = np.array([0.0, 1, 1, 1, 1, 1])
    decision = decide(replace(in_formation(chosen), trust=trust), ahead, chosen)
    assert decision.roles.leaders.tolist() == [1, 2]
    assert decision.velocity_ne[[1, 2], 0] == pytest.approx(chosen.c1)
    assert not decision.velocity_ne[[0, 3, 4, 5]].any()


@profiles
def test_a_tick_at_which_a_leader_is_not_heard_changes_no_role(profile):
    chosen, memory = replace(SETTINGS[profile], hand_over=True), None
    seen = in_formation(chosen)
    for tick in range(30):
        heard = np.arange(6) != (0 if tick % 10 else -1)
        memory, decision = remember_and_decide(memory, replace(seen, heard=heard, time_s=tick * 0.1), REST, chosen)
        assert decision.roles.leaders.tolist() == [0, 2]


@profiles
def test_where_all_leaders_are_left_behind_nobody_is_steered(profile):
    chosen = replace(SETTINGS[profile], hand_over=False, formation_gain=0.0)
    ahead = VirtualLeader(np.array([9.0, 0.0]), np.zeros(2), np.ones(2))
    command = decide(in_formation(chosen), ahead, chosen, remembering(chosen, left=[0, 2])).velocity_ne
    assert command == pytest.approx(np.zeros((6, 2)), abs=1e-12)


def test_the_robot_behind_one_that_is_left_is_drawn_into_its_place():
    chosen = replace(SETTINGS["recommended"], c1=0.0, c2=0.0)
    command = decide(in_formation(chosen), REST, chosen, remembering(chosen, left=[1])).velocity_ne
    gap = chosen.offset_ne[1] - chosen.offset_ne[4]
    assert command[4] == pytest.approx(chosen.formation_gain * (1 - 1 / 5) * gap, rel=0.01)
    assert not command[1].any()


@profiles
@pytest.mark.parametrize("trust", [0.0, 1.0])
@pytest.mark.parametrize("rule", ["average", "trust-r", "median", "wmsr-1", "wmsr-2"])
def test_a_follower_out_of_everyones_range_flies_on(profile, rule, trust):
    chosen = flown_by(rule, profile)
    seen = in_formation(chosen, velocity=(1.0, -0.5))
    seen.position_ne[4] += 1e4
    seen.trust[4] = trust
    assert decide(seen, REST, replace(chosen, hand_over=False)).velocity_ne[4] == pytest.approx([1.0, -0.5])
