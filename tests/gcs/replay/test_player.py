"""A replay's position in recorded time: exact however real time is sliced, the same both ways, held at the ends."""

from bisect import bisect_left
from dataclasses import replace
from fractions import Fraction

from hypothesis import given
from hypothesis import strategies as st

from gcs.replay.player import FASTEST, SLOWEST, SPEEDS, Player

START, END = 1_577_836_800_000_000_000, 1_577_836_860_000_000_001
SECOND = 1_000_000_000

speeds = st.sampled_from(SPEEDS) | st.fractions(SLOWEST, FASTEST, max_denominator=1000)
slices = st.lists(st.integers(0, 3 * SECOND), max_size=30)
positions = st.integers(START, END)
marks = st.lists(st.integers(START, END - 1), max_size=20, unique=True).map(sorted)


def playing(position_ns=START, **how):
    return Player(START, END, position_ns, **how)


@given(speed=speeds, wall=slices, reverse=st.booleans())
def test_speed_times_real_time_is_recorded_time_to_the_nanosecond_however_it_is_sliced(speed, wall, reverse):
    player = playing(END if reverse else START, speed=speed, reverse=reverse)
    for wall_ns in wall:
        player, _ = player.advance(wall_ns)
    gone = min(sum(wall) * speed // 1, END - START)
    assert player.position_ns == (END - gone if reverse else START + gone)


@given(start=positions, speed=speeds, wall=slices, reverse=st.booleans())
def test_one_span_begins_where_the_last_ended(start, speed, wall, reverse):
    player = playing(start, speed=speed, reverse=reverse)
    for wall_ns in wall:
        before = player.position_ns
        player, span = player.advance(wall_ns)
        assert span == (before, player.position_ns)
        assert span.end_ns <= span.begin_ns if reverse else span.begin_ns <= span.end_ns


@given(speed=speeds, wall=slices, turned=st.sets(st.integers(0, 30)))
def test_who_goes_back_passes_through_what_he_came_through(speed, wall, turned):
    player, covered = playing(START + 30 * SECOND, speed=speed), []
    for turn, wall_ns in enumerate(wall):
        player = player.turned() if turn in turned else player
        player, span = player.advance(wall_ns)
        covered.append(span)
    assert START + 30 * SECOND + sum(span.end_ns - span.begin_ns for span in covered) == player.position_ns


@given(position=positions, reverse=st.booleans())
def test_it_pauses_at_the_end_and_space_begins_anew_from_the_other(position, reverse):
    player, _ = playing(position, reverse=reverse).advance(100 * SECOND)
    assert player.paused
    assert player.at_the_end
    assert player.position_ns == (START if reverse else END)
    again = player.toggled()
    assert not again.paused
    assert again.position_ns == (END if reverse else START)


@given(position=positions, wall_ns=st.integers(0, 100 * SECOND))
def test_nothing_moves_while_it_is_paused(position, wall_ns):
    player = playing(position, paused=True)
    assert player.advance(wall_ns) == (player, (position, position))


@given(position=positions, there=st.integers(START - SECOND, END + SECOND), speed=speeds, wall=slices)
def test_to_jump_and_play_is_to_play_from_there(position, there, speed, wall):
    before, _ = playing(position, speed=speed).advance(1)
    jumped, fresh = replace(before.at(there), paused=False), playing(min(max(there, START), END), speed=speed)
    for wall_ns in wall:
        (jumped, one), (fresh, other) = jumped.advance(wall_ns), fresh.advance(wall_ns)
        assert one == other


@given(marks=marks)
def test_steps_visit_every_tick_once_and_back_again(marks):
    player, there = playing(paused=True), []
    while (after := player.onward(marks)) != player:
        player = after
        there.append(player.position_ns - 1)
    assert there == marks
    back = []
    while (before := player.back(marks)) != player:
        player = before
        back.append(player.position_ns - 1)
    assert back == marks[-2::-1]


@given(marks=marks, position=positions)
def test_a_step_lands_behind_its_tick_so_that_the_tick_is_seen(marks, position):
    after = playing(position, paused=True).onward(marks)
    due = bisect_left(marks, position)
    assert after.position_ns == (marks[due] + 1 if due < len(marks) else position)


def test_who_sees_an_event_go_by_and_asks_for_the_last_one_gets_the_one_before_it():
    events = [START + SECOND, START + 20 * SECOND]
    player, _ = playing(events[1] + 1, speed=Fraction(2)).advance(SECOND // 2)
    assert player.back(events, reaction_ns=SECOND).position_ns == events[0] + 1
    looked_at = replace(player, paused=True)
    assert looked_at.back(events, reaction_ns=SECOND).position_ns == events[1] + 1
    later, _ = player.advance(2 * SECOND)
    assert later.back(events, reaction_ns=SECOND).position_ns == events[1] + 1


def test_the_same_backwards():
    events = [START + 10 * SECOND, START + 30 * SECOND]
    player, _ = playing(events[0] + 1, reverse=True).advance(SECOND // 2)
    assert player.onward(events, reaction_ns=SECOND).position_ns == events[1] + 1
    assert replace(player, paused=True).onward(events, reaction_ns=SECOND).position_ns == events[0] + 1


def test_speeds_go_up_and_down_and_stay_within_bounds():
    player, went = playing(), []
    for _ in range(5):
        player = player.faster()
        went.append(player.speed)
    assert went == [2, 4, 10, 10, 10]
    for _ in range(7):
        player = player.slower()
    assert player.speed == Fraction(1, 4)
    assert playing(speed=Fraction("3.3")).faster().speed == 4
    assert playing(speed=Fraction("3.3")).slower().speed == 2
