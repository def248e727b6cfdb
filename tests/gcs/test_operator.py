"""People while a flight goes on: signals, words of other commands, ratings; and a terminal that has gone."""

import os
import signal

import pytest

from gcs.events import HOLD, LAND, kill, killed, take_back, taken_back
from gcs.operator import Operator


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_the_first_signal_lands_the_swarm_once_and_the_second_ends_at_once(number):
    said = []
    with Operator(said.append) as operator:
        assert operator.events() == ()
        os.kill(os.getpid(), number)
        assert operator.interrupted
        assert operator.events() == (LAND,)
        assert operator.events() == ()
        assert said == ["Landing the swarm. Ctrl-C once more ends at once and lands nothing."]
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), number)


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
