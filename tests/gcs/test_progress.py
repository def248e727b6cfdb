"""The flight on a terminal, and where there is none."""

from dataclasses import replace
from io import StringIO

import numpy as np
import pytest
from flights import recorded
from rich.console import Console

from gcs.answers import Answer
from gcs.events import Rating
from gcs.flight import Flight
from gcs.flight_state import Phase
from gcs.hands import killed
from gcs.loop import fly
from gcs.progress import MOST_ROWS, WAITING_S, Display
from gcs.recording.reader import ticks
from gcs.replay.again import EndOfRecording, Recorded
from scenarios import load


class Turns:
    """A record that keeps every turn of the loop."""

    def __init__(self):
        self.turns = []

    def tick(self, tick):
        self.turns.append(tick)


def decided_again(recording):
    """A flight, and every turn of it."""
    flight, kept = Flight(recording.scenario, ratings=() if recording.read().rated else None), Turns()
    pages = Recorded(list(ticks(recording.path)))
    fly(pages, pages, flight, (kept,), period_ns=recording.scenario.time.period_ns, events=pages.events)
    return flight, kept.turns


@pytest.fixture(scope="module")
def flight():
    """Every turn of the emergency, decided again from its recording."""
    return decided_again(recorded("emergency"))


@pytest.fixture(scope="module")
def supervised():
    """Leader 1 fails for ten seconds, is left behind, and taken back when it is rated 4."""
    fault, hold = 'fault=[{vehicle=1, kind="motor_degradation", end_s=10}]', 'trust.beyond_repair="hold"'
    return decided_again(
        recorded("emergency", 'trust.source="fused"', hold, fault, ratings=(Rating("op1", 1, 4, 12.0),))
    )


def shown(flight, turns, **console):
    screen = Console(file=StringIO(), **console)
    with Display(flight, screen, title="emergency") as display:
        for turn in turns:
            display.tick(turn)
    return screen.file.getvalue()


def last_picture(screen):
    """A live picture is drawn over and over."""
    return screen.rpartition("emergency")[2]


def test_where_there_is_no_terminal_each_phase_is_one_line(flight):
    lines = shown(*flight, width=80).splitlines()
    phases = [line.split("  ")[-1] for line in lines]
    assert phases == ["joining", "taking off", "taking control", "running up", "mission", "landing", "done"]
    assert not any("\x1b" in line for line in lines)


def test_on_a_terminal_there_is_a_line_for_every_vehicle(flight):
    decided, turns = flight
    middle = next(turn for turn in turns if turn.diagnosis.mission_s >= 15.0)
    screen = shown(decided, [middle], force_terminal=True, width=110, color_system=None)
    assert screen.count("emergency") >= 1
    screen = last_picture(screen)
    assert "15.0 of 28.0 s" in screen
    assert "mission · car accident area" in screen
    rows = [line.split() for line in screen.splitlines() if line.strip()[:1].isdigit() and "offboard" in line]
    assert [row[:3] for row in rows] == [
        [str(system), "leader" if system in (1, 3) else "follower", "offboard"] for system in range(1, 7)
    ]
    assert [row[-1] for row in rows] == ["1.00", "1.00", "1.00", "1.00", "0.00", "1.00"]


def parts_shown(supervised, mission_s):
    """What the column "role" says at a time, vehicle by vehicle."""
    decided, turns = supervised
    now = next(turn for turn in turns if turn.diagnosis.mission_s >= mission_s)
    screen = last_picture(shown(decided, [now], force_terminal=True, width=110, color_system=None))
    rows = [line for line in screen.splitlines() if line.strip()[:1].isdigit() and "offboard" in line]
    return [row.partition("offboard")[0].strip()[1:].strip() for row in rows]


def test_the_leaders_shown_are_those_who_lead_now_and_who_was_left_behind_is_neither(supervised):
    follower = ["follower"]
    assert parts_shown(supervised, 0.5) == ["leader", "follower", "leader", *follower * 3]
    assert parts_shown(supervised, 3.0) == ["follower", "leader", "leader", *follower * 3]
    assert parts_shown(supervised, 9.0) == ["left behind", "leader", "leader", *follower * 3]
    assert parts_shown(supervised, 13.0) == ["follower", "leader", "leader", *follower * 3]


@pytest.mark.parametrize("terminal", [False, True])
def test_who_takes_over_who_is_left_behind_and_who_comes_back_is_said_once(supervised, terminal):
    screen = shown(*supervised, width=110, force_terminal=terminal, color_system=None)
    news = [line for line in screen.splitlines() if "robot" in line]
    assert [line.split("28.0 s")[-1].strip() for line in news] == [
        "robot 2 leads in place of robot 1", "robot 1 is left behind", "robot 1 is taken back",
    ]  # fmt: skip


def test_where_roles_stay_nothing_is_said_of_them(flight):
    assert "robot" not in shown(*flight, width=110)


@pytest.mark.parametrize("terminal", [False, True])
def test_a_command_that_was_refused_is_said_and_one_that_was_taken_is_not(flight, terminal):
    decided, turns = flight
    answers = (Answer(2, 400, 1), Answer(3, 400, 0), Answer(4, 511, 3))
    turn = replace(turns[20], swarm=replace(turns[20].swarm, answers=answers))
    screen = shown(decided, [turn], width=110, force_terminal=terminal, color_system=None)
    assert screen.count("vehicle 2: arming or disarming rejected for now\n") == 1
    assert not any(words in screen for words in ("accepted", "supported"))


def test_before_a_vehicle_is_heard_it_says_so(flight):
    decided, turns = flight
    screen = shown(decided, turns[:1], force_terminal=True, width=110, color_system=None)
    assert last_picture(screen).count("not heard") == 6
    assert "nan" not in screen
    assert "joining" in screen


def test_without_a_terminal_it_is_said_who_keeps_a_flight_waiting_and_for_what(flight):
    decided, turns = flight
    joined = next(turn for turn in turns if turn.diagnosis.phase is not Phase.JOIN)
    swarm = replace(joined.swarm, home_m=np.where(np.arange(6) == 2, np.nan, joined.swarm.home_m))
    waits = replace(turns[0], swarm=swarm, time_ns=joined.time_ns)
    later = replace(waits, number=decided.scenario.time.ticks(WAITING_S))
    assert shown(decided, [waits, later], width=80).splitlines()[-1].endswith("waiting for vehicle 3: its home")


def test_the_whole_flight_can_be_shown_and_leaves_the_terminal_as_it_was(flight):
    screen = shown(*flight, force_terminal=True, width=110)
    assert "nan" not in screen
    assert screen.rstrip().endswith("\x1b[2K")  # the last picture is wiped, line by line
    assert screen.count("\x1b[?25l") == screen.count("\x1b[?25h")  # and the cursor is back


@pytest.mark.parametrize(
    ("width", "missing"),
    [(110, set()), (84, {"battery"}), (72, {"battery", "role"}), (60, {"battery", "role", "speed"})],
)
def test_a_narrow_terminal_goes_without_the_least_needed_columns_and_cuts_no_word(flight, width, missing):
    decided, turns = flight
    middle = next(turn for turn in turns if turn.diagnosis.mission_s >= 15.0)
    picture = last_picture(shown(decided, [middle], force_terminal=True, width=width, color_system=None))
    (head,) = (line for line in picture.splitlines() if "UAV" in line)
    columns = {"role", "mode", "height", "speed", "battery", "link age", "trust"}
    assert {column for column in columns if column not in head} == missing
    assert picture.count("offboard") == 6
    assert "…" not in picture


def test_below_the_picture_there_is_a_line_for_what_the_terminal_itself_writes(flight):
    decided, turns = flight
    screen = Console(file=StringIO(), force_terminal=True, width=80)
    with Display(decided, screen, title="emergency") as display:
        display.tick(turns[0])
        assert screen.file.getvalue().endswith("\n")


def test_a_narrow_terminal_is_no_reason_to_fail(flight):
    decided, turns = flight
    assert "emergency" in shown(decided, turns[-1:], force_terminal=True, width=30)


def test_of_a_large_fleet_the_first_are_shown_and_the_rest_counted():
    large = load("demo", overrides=["swarm.rows=5", "swarm.columns=6"])
    flight, kept = Flight(large), Turns()

    class Nobody:
        """A link on which nobody speaks, for one turn, and its clock."""

        waited = 0

        def now(self):
            return 0

        def sleep_until(self, _time_ns):
            self.waited += 1
            if self.waited > 1:
                raise EndOfRecording

        def receive(self):
            return []

        def send(self, _system, _frame):
            pass

    nobody = Nobody()
    with pytest.raises(EndOfRecording):
        fly(nobody, nobody, flight, (kept,), period_ns=10**8)
    screen = shown(flight, kept.turns, force_terminal=True, width=110, height=60, color_system=None)
    assert last_picture(screen).count("not heard") == MOST_ROWS
    assert f"and {30 - MOST_ROWS} more" in screen


@pytest.mark.parametrize("terminal", [False, True])
def test_who_is_taken_from_us_is_said_once_and_shown(flight, terminal):
    decided, turns = flight
    middle = [turn for turn in turns if turn.diagnosis.mission_s >= 15.0][:3]
    theirs = [replace(t, state=replace(t.state, hands=killed(t.state.hands, 3, t.number))) for t in middle[1:]]
    screen = shown(decided, [middle[0], *theirs, middle[0]], width=110, force_terminal=terminal, color_system=None)
    assert screen.count("vehicle 4 is not ours any more: nothing is sent to it") == 1
    assert screen.count("vehicle 4 is ours\n") == 1
    if terminal:
        only = last_picture(shown(decided, [theirs[0]], width=110, force_terminal=True, color_system=None))
        assert [line.split()[:3] for line in only.splitlines() if "not ours" in line] == [["4", "not", "ours"]]
