"""Who leads, who is left behind, and who closes the gap."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gcs.control import settings
from scenarios import load
from trustr.roles import (
    GAINS,
    GONE_S,
    HOPELESS,
    LOSES,
    MISSED_S,
    PATIENCE_S,
    Roles,
    closed_up,
    hand_over,
    leave_behind,
    taken_back,
)

TRANSIT = settings(load("transit"))
OFFSET = TRANSIT.offset_ne
"""Rows of three, the front first: 0 1 2 / 3 4 5. Robots 0 and 2 lead."""
DT = 0.1


def since(robots):
    """left_s of these robots (N,): just now, or never."""
    return np.where(robots, 0.0, np.nan)


def handed(trust, *, leaders=(0, 2), places=None, heard=None, left=(), offset=OFFSET):
    """Who leads after one tick. Who is not heard has not been for long; places: the scenario's own leaders."""
    count = len(trust)
    heard = np.ones(count, bool) if heard is None else np.array(heard, bool)
    roles = replace(
        Roles.of(count, np.array(leaders)),
        silent_s=np.where(heard, 0.0, MISSED_S),
        left_s=since(np.isin(np.arange(count), left)),
    )
    return hand_over(
        roles,
        trust=np.array(trust, float),
        heard=heard,
        offset_ne=offset,
        places=np.array(leaders if places is None else places),
        dt=DT,
    ).leaders.tolist()


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


@pytest.mark.parametrize("led_by", [1, 3, 5])
def test_near_is_whoever_is_near_the_place_of_the_scenarios_leader_whoever_led_last(led_by):
    trust = np.ones(6)
    trust[led_by] = 0.0
    assert handed(trust, leaders=[led_by], places=[0]) == [0]


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


@pytest.mark.parametrize("dt", [0.05, 0.1, 0.2])
def test_a_leader_is_missed_after_a_second_to_a_tick_and_not_earlier(dt):
    silent, all_heard = np.arange(6) != 0, np.ones(6, bool)
    second = round(MISSED_S / dt)
    roles, led_by = Roles.of(6, np.array([0, 2])), []
    for heard in [silent] * (second - 1) + [all_heard] + [silent] * (second + 1):
        roles = hand_over(roles, trust=np.ones(6), heard=heard, offset_ne=OFFSET, places=np.array([0, 2]), dt=dt)
        led_by.append(int(roles.leaders[0]))
    assert led_by[:-2] == [0] * (2 * second - 1)
    assert led_by[-1] == 1


def test_who_is_silent_takes_no_role():
    assert handed([0, 1, 1, 1, 1, 1], heard=[1, 0, 1, 1, 1, 1]) == [3, 2]


def test_who_is_left_behind_neither_keeps_nor_takes_a_role():
    assert handed(np.ones(6), left=[0, 1]) == [3, 2]


def test_who_is_missing_for_a_tick_takes_no_role_either():
    heard = np.arange(6) != 1
    trust = np.array([0, 1, 1, 1, 1, 1.0])
    roles = Roles.of(6, np.array([0, 2]))
    assert hand_over(
        roles, trust=trust, heard=heard, offset_ne=OFFSET, places=roles.leaders, dt=DT
    ).leaders.tolist() == [3, 2]


def test_of_a_leader_left_behind_the_best_there_is_takes_over_trusted_enough_or_not():
    assert handed([0, 0.1, 0.6, 0.3, 0.2, 0.3], left=[0]) == [3, 2]
    assert handed(np.zeros(6), left=[0, 2]) == [1, 5]


def test_a_role_is_not_given_back_by_itself():
    roles = Roles.of(6, np.array([0, 2]))
    for trust in ([0, 1, 1, 1, 1, 1], [1, 1, 1, 1, 1, 1], [1, 0.6, 1, 1, 1, 1]):
        roles = hand_over(
            roles,
            trust=np.array(trust, float),
            heard=np.ones(6, bool),
            offset_ne=OFFSET,
            places=np.array([0, 2]),
            dt=DT,
        )
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
    count = len(trust)
    offset = data.draw(arrays(float, (count, 2), elements=st.floats(-9, 9)))
    silent_s = data.draw(arrays(float, count, elements=st.sampled_from([0.0, MISSED_S])))
    before = replace(Roles.of(count, leaders), silent_s=silent_s, left_s=since(left))
    now = hand_over(before, trust=trust, heard=heard, offset_ne=offset, places=leaders, dt=DT).leaders
    assert len(set(now.tolist())) == len(now) == len(leaders)
    fit, missed = heard & ~left, ~heard & (silent_s > 0.0)
    lost = left | missed | (trust < LOSES)
    for was, became in zip(leaders, now, strict=True):
        if became != was:
            assert lost[was]
            assert fit[became]
            assert left[was] or trust[became] >= GAINS
    free = fit & ~np.isin(np.arange(count), now)
    assert not (lost[now].any() and (free & (trust >= GAINS)).any())
    assert not (left[now].any() and free.any())
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
    """Roles of three after so many ticks at which the first was trusted so much, and the others entirely."""
    roles = Roles.of(3, np.array([1])) if roles is None else roles
    for _ in range(ticks):
        roles = leave_behind(roles, trust=np.array([trust, 1.0, 1.0]), dt=dt)
    return roles


@pytest.mark.parametrize("dt", [0.05, 0.1, 0.2])
def test_a_robot_is_left_behind_after_five_seconds_without_hope_and_not_a_tick_earlier(dt):
    ticks = round(PATIENCE_S / dt)
    assert PATIENCE_S == 5.0
    assert not hopeless(ticks - 1, dt=dt).left.any()
    assert hopeless(ticks, dt=dt).left.tolist() == [True, False, False]


@pytest.mark.parametrize("dt", [0.05, 0.1, 0.5])
def test_who_is_left_is_gone_when_its_time_to_sink_is_over_and_not_a_tick_earlier(dt):
    left, ticks = hopeless(round(PATIENCE_S / dt), dt=dt), round(GONE_S / dt)
    assert not hopeless(ticks - 1, roles=left, dt=dt).gone.any()
    assert hopeless(ticks, roles=left, dt=dt).gone.tolist() == [True, False, False]


def test_a_robot_at_the_threshold_is_not_without_hope():
    assert not hopeless(1000, trust=HOPELESS).left.any()
    assert hopeless(1000, trust=np.nextafter(HOPELESS, 0)).left[0]


def test_hope_in_between_begins_the_count_anew():
    roles = hopeless(1, roles=hopeless(49), trust=HOPELESS)
    assert not hopeless(49, roles=roles).left.any()
    assert hopeless(50, roles=roles).left[0]


def test_who_was_left_behind_stays_so_however_trusted_later():
    assert hopeless(100, roles=hopeless(50), trust=1.0).left[0]


@pytest.mark.parametrize("count", range(1, 9))
def test_those_who_stay_are_always_more_than_half(count):
    roles = Roles.of(count, np.array([0]))
    for _ in range(200):
        roles = leave_behind(roles, trust=np.zeros(count), dt=DT)
    assert np.count_nonzero(roles.left) == (count - 1) // 2


def test_where_not_all_may_be_left_behind_it_is_those_trusted_least_and_the_others_when_there_is_room():
    trust = np.array([0.04, 0.01, 0.03, 1.0, 0.02, 1.0])
    roles = Roles.of(6, np.array([5]))
    for _ in range(60):
        roles = leave_behind(roles, trust=trust, dt=DT)
    assert np.flatnonzero(roles.left).tolist() == [1, 4]
    back = leave_behind(taken_back(roles, np.arange(6) == 1), trust=trust, dt=DT)
    assert np.flatnonzero(back.left).tolist() == [2, 4]


def test_who_is_taken_back_has_to_be_hopeless_anew():
    back = taken_back(hopeless(120), np.arange(3) == 0)
    assert not back.left.any()
    assert not back.gone.any()
    assert not hopeless(49, roles=back).left.any()
    assert hopeless(50, roles=back).left[0]


def test_taking_one_back_leaves_the_others_where_they_are():
    roles = replace(
        Roles.of(3, np.array([0])), left_s=np.array([4.0, 3.0, np.nan]), hopeless_s=np.array([9.0, 8.0, 3.0])
    )
    back = taken_back(roles, np.array([True, False, False]))
    assert back.left.tolist() == [False, True, False]
    assert back.left_s[1] == 3.0
    assert back.hopeless_s.tolist() == [0.0, 8.0, 3.0]


# --- closing up

FILES = TRANSIT.files


def test_the_files_are_the_columns_front_to_rear():
    assert [file.tolist() for file in FILES] == [[0, 3], [1, 4], [2, 5]]


def test_where_nobody_is_missing_everybody_keeps_its_place():
    assert (closed_up(OFFSET, FILES, np.zeros(6, bool)) == OFFSET).all()


def test_who_is_behind_one_that_is_left_moves_up_into_its_place_beside_the_others():
    places = closed_up(OFFSET, FILES, np.arange(6) == 1)
    others = [0, 2, 3, 5]
    expected = OFFSET[others] - OFFSET[1]
    assert places[others] - places[4] == pytest.approx(expected)


def test_a_hole_at_the_rear_moves_nobody():
    remain = [0, 1, 2, 3, 5]
    assert closed_up(OFFSET, FILES, np.arange(6) == 4)[remain] == pytest.approx(OFFSET[remain], abs=1e-12)


@given(st.integers(1, 4), st.integers(1, 5), st.data())
def test_those_who_remain_fill_each_file_from_the_front_in_their_order_and_their_mean_stays(columns, rows, data):
    count = rows * columns
    files = tuple(np.arange(count).reshape(rows, columns).T)
    offset = np.stack([-np.arange(count) // columns, np.arange(count) % columns], axis=1).astype(float)
    left = data.draw(arrays(bool, count))
    places = closed_up(offset, files, left)
    assert (places[left] == offset[left]).all()
    if left.all():
        return
    assert places[~left].mean(0) == pytest.approx(offset[~left].mean(0), abs=1e-12)
    moved = places.copy()
    for file in files:
        remain = file[~left[file]]
        moved[remain] -= offset[file[: len(remain)]]
    together = moved[~left]
    assert together == pytest.approx(np.tile(together[0], (len(together), 1)), abs=1e-12)
