"""Keys: what terminals send, and what a replay does with it."""

import re
from dataclasses import replace

import pytest
from flights import SHORT, recorded
from hypothesis import given
from hypothesis import strategies as st

from gcs.replay import timeline
from gcs.replay.controls import HELP, Controls, pressed
from gcs.replay.keys import keys
from gcs.replay.player import Player, Span


@pytest.fixture(scope="module")
def flight():
    return timeline.load(recorded("demo", *SHORT).path)


@pytest.fixture
def middle(flight):
    """Paused in the middle of the mission."""
    return Controls(Player(flight.start_ns, flight.end_ns, flight.place("3"), paused=True))


def after(controls, flight, *typed):
    for key in typed:
        controls = pressed(controls, key, flight).controls
    return controls


@pytest.mark.parametrize(
    ("data", "names"),
    [
        (b" ", ["space"]),
        (b"\x1b[C\x1b[D", ["right", "left"]),
        (b"\x1bOC\x1bOD", ["right", "left"]),
        (b"\x1b[1;5C", ["right"]),
        (b"\x1b[H\x1b[F\x1bOH\x1b[1~\x1b[4~\x1b[7~\x1b[8~", ["home", "end", "home", "home", "end", "home", "end"]),
        (b"g1:05\r", ["g", "1", ":", "0", "5", "enter"]),
        (b"\x7f\x08\n\x1b", ["backspace", "backspace", "enter", "escape"]),
        (b"+-=,.", ["+", "-", "=", ",", "."]),
        ("é".encode(), ["é"]),
        (b"\x1b[15~\x1b[Z\x00\xff", []),
    ],
)
def test_bytes_become_keys(data, names):
    assert keys(data) == names


@given(st.binary())
def test_whatever_a_terminal_sends_becomes_single_letters_or_names(data):
    assert all(re.fullmatch(r".|[a-z]+", key, re.DOTALL) for key in keys(data))


@given(typed=st.lists(st.sampled_from(["space", "left", "right", *"+-rnpg59:.", "home", "end", "enter", "up", "é"])))
def test_whatever_is_pressed_the_position_stays_within_the_recording(flight, typed):
    controls = Controls(Player(flight.start_ns, flight.end_ns, flight.start_ns))
    for key in typed:
        done = pressed(controls, key, flight)
        moved = done.controls.player.position_ns != controls.player.position_ns
        assert moved == (done.jumped or (done.played is not None and done.played.begin_ns != done.played.end_ns))
        assert not done.jumped or done.played is None
        controls = done.controls
        assert flight.start_ns <= controls.player.position_ns <= flight.end_ns


def test_space_pauses_and_goes_on(flight, middle):
    playing = after(middle, flight, "space")
    assert not playing.player.paused
    assert after(playing, flight, "space") == middle


@pytest.mark.parametrize("key", ["right", "."])
def test_a_step_passes_through_one_tick_and_stays_there(flight, middle, key):
    done = pressed(replace(middle, player=replace(middle.player, paused=False)), key, flight)
    assert done.controls.player.paused
    assert done.played == Span(middle.player.position_ns, done.controls.player.position_ns)
    assert sum(done.played.begin_ns <= time_ns < done.played.end_ns for time_ns in flight.ticks) == 1


def test_a_step_back_undoes_a_step(flight, middle):
    there = after(middle, flight, "right")
    assert after(there, flight, "right", "left") == there
    assert after(there, flight, ".", ",") == there


def test_speed_and_direction(flight, middle):
    fast = after(middle, flight, "+", "=", "r").player
    assert (fast.speed, fast.reverse) == (4, True)
    assert after(middle, flight, "-", "_", "r", "r").player == replace(middle.player, speed=middle.player.speed / 4)


def test_events_are_jumped_to_and_behind_the_last_one_it_says_so(flight, middle):
    done = pressed(middle, "n", flight)
    assert done.jumped
    assert done.controls.player.position_ns - 1 in flight.events
    assert after(done.controls, flight, "p").player.position_ns - 1 == max(
        time_ns for time_ns in flight.events if time_ns < middle.player.position_ns
    )
    last = after(middle, flight, "end", "n")
    assert last.note == "there is no event after this"
    assert after(middle, flight, "home", "p").note == "there is no event before this"


def test_home_and_end(flight, middle):
    assert after(middle, flight, "home").player.position_ns == flight.start_ns
    assert after(middle, flight, "end").player.position_ns == flight.end_ns


@pytest.mark.parametrize(
    ("typed", "place"), [("4.5", "4.5"), ("0:04", "4"), ("-1", "-1"), ("landing", "landing"), ("TAKING off", "taking")]
)
def test_a_place_is_typed(flight, middle, typed, place):
    letters = ["space" if letter == " " else letter for letter in typed]
    there = pressed(after(middle, flight, "g", *letters), "enter", flight)
    assert there.jumped
    assert there.controls.typed is None
    assert there.controls.player.position_ns == flight.place(place)


def test_what_is_typed_can_be_mended_and_left(flight, middle):
    assert after(middle, flight, "g", "4", "x", "backspace", ".", "5").typed == "4.5"
    assert after(middle, flight, "g", "4", "escape") == middle
    assert after(middle, flight, "g", "q").typed == "q"


def test_a_place_that_there_is_not_is_said_and_nothing_moves(flight, middle):
    lost = after(middle, flight, "g", "9", "9", "9", "enter")
    assert lost == replace(middle, note=lost.note)
    assert lost.note.startswith("999: the recording goes from ")
    assert after(lost, flight, "up").note == ""


def test_words_that_are_of_no_event_are_said_to_be_so_in_a_line(flight, middle):
    lost = after(middle, flight, "g", *"lunch", "enter")
    assert lost.note == "lunch: neither seconds (12.5, 1:05) nor words of an event"


def test_q_ends_it(flight, middle):
    assert after(middle, flight, "q").done


def test_every_key_on_the_bottom_line_does_something(flight, middle):
    names = {"space": ["space"], "←→": ["left", "right"], "+−": ["+", "-"], "Home End": ["home", "end"]}
    for shown, _ in HELP:
        for key in names.get(shown, shown.split()):
            assert pressed(middle, key, flight).controls != middle
