"""People while a flight goes on: signals, words of other commands, ratings; and a terminal that has gone."""

import os
import signal

import pytest

from gcs.events import HOLD, LAND, kill, killed, take_back, taken_back
from gcs.operator import Operator

LANDS = "Landing the swarm."
ENDS = f"{LANDS} Ctrl-C once more ends at once and lands nothing."


def press(number):
    os.kill(os.getpid(), number)


@pytest.mark.parametrize(
    ("number", "words"), [(signal.SIGINT, ENDS), (signal.SIGTERM, LANDS), (signal.SIGHUP, LANDS)], ids=repr
)
def test_a_signal_lands_the_swarm_once(number, words):
    said = []
    with Operator(said.append) as operator:
        assert operator.events() == ()
        assert not operator.interrupted
        press(number)
        assert operator.interrupted
        assert operator.events() == (LAND,)
        assert operator.events() == ()
        assert said == [words]


def test_a_second_ctrl_c_ends_between_two_ticks_and_tears_no_record():
    with Operator(str) as operator:
        press(signal.SIGINT)
        assert operator.events() == (LAND,)
        press(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            operator.events()


def test_a_third_ends_wherever_it_is():
    with Operator(str):
        press(signal.SIGINT)
        press(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            press(signal.SIGINT)


@pytest.mark.parametrize("first", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("second", [signal.SIGTERM, signal.SIGHUP])
def test_a_terminal_that_hangs_up_and_a_polite_kill_land_again_and_end_nothing(first, second):
    with Operator(str) as operator:
        for number in (first, second, second):
            press(number)
        assert operator.events() == (LAND,)
        press(second)
        assert operator.events() == (LAND,)
        assert operator.events() == ()


def test_ctrl_c_after_other_signals_is_the_first_of_its_kind():
    with Operator(str) as operator:
        press(signal.SIGHUP)
        press(signal.SIGINT)
        assert operator.events() == (LAND,)
        press(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            operator.events()


def test_a_signal_that_comes_while_the_last_is_handed_out_is_not_lost():
    pressed = []

    def say(_words):
        if not pressed:
            pressed.append(press(signal.SIGTERM))

    with Operator(say) as operator:
        press(signal.SIGTERM)
        assert operator.events() == (LAND,)
        assert operator.events() == (LAND,)
        assert operator.events() == ()


def test_who_was_started_to_outlive_its_terminal_is_not_landed_by_a_logout():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with Operator(str) as operator:
            press(signal.SIGHUP)
            assert operator.events() == ()
            press(signal.SIGTERM)
            assert operator.events() == (LAND,)
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_terminal_that_has_gone_does_not_keep_the_word_from_the_flight():
    def gone(_words):
        raise OSError("Input/output error")

    with Operator(gone) as operator:
        os.kill(os.getpid(), signal.SIGHUP)
        assert operator.events() == (LAND,)


def test_words_of_other_commands_come_behind_the_keyboards_and_interrupt_nobody():
    words = [(HOLD, kill(3)), (), (take_back(2),)]
    with Operator(str, words=lambda: words.pop(0)) as operator:
        os.kill(os.getpid(), signal.SIGINT)
        assert operator.events() == (LAND, "hold", "kill 3")
        assert operator.events() == ()
        assert operator.events() == ("take back 2",)


def test_signals_mean_what_they_meant_before_when_it_is_over():
    before = signal.getsignal(signal.SIGTERM)
    with Operator(str):
        assert signal.getsignal(signal.SIGTERM) != before
    assert signal.getsignal(signal.SIGTERM) == before


@pytest.mark.parametrize("system", [1, 9, 255])
def test_a_word_names_its_vehicle_and_is_read_back(system):
    assert killed(kill(system)) == taken_back(take_back(system)) == system
    assert killed(take_back(system)) is taken_back(kill(system)) is None


@pytest.mark.parametrize("event", ["kill", "kill x", "kill 1 2", "killed 1", " kill 1", LAND, HOLD, ""])
def test_what_is_no_such_word_names_nobody(event):
    assert killed(event) is taken_back(event) is None
