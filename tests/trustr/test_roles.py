"""Who leads, who is left behind, and who closes the gap."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gcs.control import settings
from scenarios import load
from trustr.roles import GAINS, HOPELESS, LOSES, PATIENCE_S, Roles, closed_up, hand_over, leave_behind, taken_back

TRANSIT = settings(load("transit"))
OFFSET = TRANSIT.offset_ne
"""Rows of three, the front first: 0 1 2 / 3 4 5. Robots 0 and 2 lead."""
DT = 0.1


def handed(trust, *, leaders=(0, 2), heard=None, left=(), offset=OFFSET):
    """Who leads after one tick."""
    count = len(trust)
    roles = replace(Roles.of(count, np.array(leaders)), left=np.isin(np.arange(count), left))
    heard = np.ones(count, bool) if heard is None else np.array(heard, bool)
    return hand_over(roles, trust=np.array(trust, float), heard=heard, offset_ne=offset).leaders.tolist()


# --- hand-over


def test_leaders_who_are_trusted_lead_on_whoever_is_trusted_more():
    assert handed([LOSES, 1, LOSES, 1, 1, 1]) == [0, 2]


def test_a_distrusted_leader_passes_its_role_to_the_most_trusted():
    assert handed([0.1, 0.8, 1, 0.8, 0.8, 1.0]) == [5, 2]


@pytest.mark.parametrize(
    ("leader", "follower", "led_by"), [(0.5, 1, 0), (0.499, 0.7, 3), (0.499, 0.699, 0), (0, 0.5, 0)]
)
def test_between_losing_and_gaining_nobody_changes(leader, follower, led_by):
    assert handed([leader, 0, 1, follower, 0, 0]) == [led_by, 2]
    assert (LOSES, GAINS) == (0.5, 0.7)


@pytest.mark.parametrize(("lost", "successor"), [(0, 1), (2, 1), (3, 0), (5, 2)])
def test_of_robots_trusted_alike_the_nearest_in_the_formation_takes_over(lost, successor):
    """Columns and rows are as far apart, so of two as near the first takes over."""
    trust = np.ones(6)
    trust[lost] = 0.0
    assert handed(trust, leaders=[lost]) == [successor]


def test_to_a_tenth_trust_is_alike():
    assert handed([0, 0.96, 1, 0.99, 1, 1]) == [1, 2]
    assert handed([0, 0.94, 1, 0.99, 1, 1]) == [3, 2]


def test_whichever_way_the_formation_points_the_first_of_two_as_near_takes_over():
    for angle in np.linspace(0, 2 * np.pi, 37):
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        assert handed([0, 1, 1, 1, 1, 1], offset=OFFSET @ turn) == [1, 2]


def test_where_nobody_is_trusted_enough_leaders_keep_their_roles():
    assert handed([0, 0.6, 0, 0.6, 0.6, 0.6]) == [0, 2]


def test_where_one_is_trusted_enough_the_first_of_two_lost_leaders_is_replaced():
    assert handed([0, 0.6, 0, 0.6, 1, 0.6]) == [4, 2]


def test_two_lost_leaders_are_replaced_by_two_others():
    assert handed([0, 1, 0, 1, 1, 1]) == [1, 5]


def test_a_silent_leader_passes_its_role_however_trusted():
    assert handed(np.ones(6), heard=[0, 1, 1, 1, 1, 1]) == [1, 2]


def test_who_is_silent_takes_no_role():
    assert handed([0, 1, 1, 1, 1, 1], heard=[1, 0, 1, 1, 1, 1]) == [3, 2]


def test_who_is_left_behind_neither_keeps_nor_takes_a_role():
    assert handed(np.ones(6), left=[0, 1]) == [3, 2]


def test_a_role_is_not_given_back_by_itself():
    roles = Roles.of(6, np.array([0, 2]))
    for trust in ([0, 1, 1, 1, 1, 1], [1, 1, 1, 1, 1, 1], [1, 0.6, 1, 1, 1, 1]):
        roles = hand_over(roles, trust=np.array(trust, float), heard=np.ones(6, bool), offset_ne=OFFSET)
        assert roles.leaders.tolist() == [1, 2]


@pytest.mark.parametrize("count", [1, 2])
def test_the_last_robots_lead_for_want_of_others(count):
    leaders = list(range(count))
    assert handed(np.zeros(count), leaders=leaders, offset=np.zeros((count, 2))) == leaders


@st.composite
def swarms(draw):
    """(trust, heard, left, leaders) of 1 to 8 robots."""
    count = draw(st.integers(1, 8))
    leaders = draw(st.permutations(range(count)))[: draw(st.integers(1, count))]
    trust = draw(arrays(float, count, elements=st.floats(0, 1) | st.sampled_from([LOSES, GAINS, 0.0, 1.0])))
    return trust, draw(arrays(bool, count)), draw(arrays(bool, count)), np.array(leaders)


@given(swarms(), st.data())
def test_every_role_is_held_by_one_robot_and_passes_only_from_the_lost_to_the_fit(swarm, data):
    trust, heard, left, leaders = swarm
    offset = data.draw(arrays(float, (len(trust), 2), elements=st.floats(-9, 9)))
    before = replace(Roles.of(len(trust), leaders), left=left)
    now = hand_over(before, trust=trust, heard=heard, offset_ne=offset).leaders
    assert len(set(now.tolist())) == len(now) == len(leaders)
    fit = heard & ~left
    for was, became in zip(leaders, now, strict=True):
        if became != was:
            assert trust[was] < LOSES or not fit[was]
            assert trust[became] >= GAINS
            assert fit[became]
    lost = [place for place in now if trust[place] < LOSES or not fit[place]]
    free = fit & (trust >= GAINS) & ~np.isin(np.arange(len(trust)), now)
    assert not (lost and free.any())
    assert before.leaders is leaders


@given(swarms(), st.randoms(use_true_random=False))
def test_where_no_two_are_as_near_names_do_not_matter(swarm, random):
    trust, heard, left, leaders = swarm
    count = len(trust)
    line = np.stack([2.0 ** np.arange(count), np.zeros(count)], axis=1)
    order = list(range(count))
    random.shuffle(order)
    name = np.argsort(order)
    one = handed(trust, leaders=leaders, heard=heard, left=np.flatnonzero(left), offset=line)
    renamed = handed(
        trust[order],
        leaders=name[leaders],
        heard=heard[order],
        left=np.flatnonzero(left[order]),
        offset=line[order],
    )
    assert renamed == name[one].tolist()


# --- leaving behind


def hopeless(ticks, *, roles=None, trust=0.0, dt=DT):
    """Roles of one robot after so many ticks with this trust."""
    roles = Roles.of(1, np.array([0])) if roles is None else roles
    for _ in range(ticks):
        roles = leave_behind(roles, trust=np.array([trust]), dt=dt)
    return roles


@pytest.mark.parametrize("dt", [0.05, 0.1, 0.2])
def test_a_robot_is_left_behind_after_five_seconds_without_hope_and_not_a_tick_earlier(dt):
    ticks = round(PATIENCE_S / dt)
    assert PATIENCE_S == 5.0
    assert not hopeless(ticks - 1, dt=dt).left.any()
    assert hopeless(ticks, dt=dt).left.all()


def test_a_robot_at_the_threshold_is_not_without_hope():
    assert not hopeless(1000, trust=HOPELESS).left.any()
    assert hopeless(1000, trust=np.nextafter(HOPELESS, 0)).left.all()


def test_hope_in_between_begins_the_count_anew():
    roles = hopeless(1, roles=hopeless(49), trust=HOPELESS)
    assert not hopeless(49, roles=roles).left.any()
    assert hopeless(50, roles=roles).left.all()


def test_who_was_left_behind_stays_so_however_trusted_later():
    assert hopeless(100, roles=hopeless(50), trust=1.0).left.all()


def test_who_is_taken_back_has_to_be_hopeless_anew():
    back = taken_back(hopeless(80), np.array([True]))
    assert not back.left.any()
    assert not hopeless(49, roles=back).left.any()
    assert hopeless(50, roles=back).left.all()


def test_taking_one_back_leaves_the_others_where_they_are():
    roles = replace(
        Roles.of(3, np.array([0])), left=np.array([True, True, False]), hopeless_s=np.array([9.0, 8.0, 3.0])
    )
    back = taken_back(roles, np.array([True, False, False]))
    assert back.left.tolist() == [False, True, False]
    assert back.hopeless_s.tolist() == [0.0, 8.0, 3.0]


# --- closing up

FILES = TRANSIT.files


def test_the_files_are_the_columns_front_to_rear():
    assert [file.tolist() for file in FILES] == [[0, 3], [1, 4], [2, 5]]


def test_where_nobody_is_missing_everybody_keeps_its_place():
    assert (closed_up(OFFSET, FILES, np.zeros(6, bool)) == OFFSET).all()


def test_who_is_behind_one_that_is_left_moves_up_into_its_place():
    places = closed_up(OFFSET, FILES, np.arange(6) == 1)
    assert (places[4] == OFFSET[1]).all()
    others = [0, 2, 3, 5]
    assert (places[others] == OFFSET[others]).all()


def test_a_hole_at_the_rear_moves_nobody():
    remain = [0, 1, 2, 3, 5]
    assert (closed_up(OFFSET, FILES, np.arange(6) == 4)[remain] == OFFSET[remain]).all()


@given(st.integers(1, 4), st.integers(1, 5), st.data())
def test_in_each_file_those_who_remain_fill_it_from_the_front_in_their_order(columns, rows, data):
    count = rows * columns
    files = tuple(np.arange(count).reshape(rows, columns).T)
    offset = np.stack([-np.arange(count) // columns, np.arange(count) % columns], axis=1).astype(float)
    left = data.draw(arrays(bool, count))
    places = closed_up(offset, files, left)
    for file in files:
        remain = [robot for robot in file if not left[robot]]
        assert [places[robot].tolist() for robot in remain] == [offset[robot].tolist() for robot in file[: len(remain)]]
    assert len({tuple(place) for place in places[~left]}) == np.count_nonzero(~left)
