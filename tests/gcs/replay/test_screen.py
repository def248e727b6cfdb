"""What a replay shows: the flight as the ground station knew it then, in whatever room the terminal has."""

import math
from dataclasses import replace
from io import StringIO

import numpy as np
import pytest
from excerpts import frames_alone
from flights import SHORT, recorded
from rich.console import Console

from gcs.replay import timeline
from gcs.replay.bar import MARKS, bar, marks
from gcs.replay.controls import Controls
from gcs.replay.player import Player
from gcs.replay.reel import Reel
from gcs.replay.screen import Screen, picture
from gcs.replay.view import OfFrames, OfTicks, View, seer

SECOND = 1_000_000_000


@pytest.fixture(scope="module")
def flight():
    return timeline.load(recorded("emergency").path)


@pytest.fixture(scope="module")
def imported():
    def keep(name, seconds):
        return not 4.0 <= seconds < 7.0 and not (name[0] == 3 and 8.0 <= seconds < 11.0)

    return timeline.load(frames_alone(recorded("demo", *SHORT).path, keep=keep))


def at(whole, place, **how):
    return Controls(Player(whole.start_ns, whole.end_ns, whole.place(place), **how))


def shown(whole, controls, *, view=None, width=80, height=24):
    """The lines of the picture."""
    with Reel(whole.path) as reel:
        view = seer(whole, reel)(controls.player.position_ns) if view is None else view
    console = Console(file=StringIO(), force_terminal=True, color_system=None, width=width, height=height)
    console.print(picture(controls, whole, view, title="emergency", width=width, height=height), end="")
    return console.file.getvalue().splitlines()


def rows(lines):
    """Cells of the table, by vehicle."""
    found = {}
    for line in lines:
        number, _, cells = line.strip().partition("  ")
        if number.isdigit():
            found[int(number)] = cells.split()
    return found


def test_the_head_says_when_it_is_what_goes_on_and_how_it_moves(flight):
    lines = shown(flight, at(flight, "10"))
    assert lines[0].startswith("emergency ")
    assert lines[0].endswith(" UTC")
    assert lines[1].startswith("10.0 s since mission start   mission · car accident area")
    assert lines[1].endswith(" ▶ 1×")
    assert shown(flight, at(flight, "-5", paused=True))[1].startswith("-5.0 s since mission start   taking")
    backwards = Player(flight.start_ns, flight.end_ns, flight.place("10"), paused=True).turned().slower()
    assert shown(flight, Controls(backwards))[1].endswith(" paused ◀ 0.5×")


def test_the_log_time_is_that_of_the_position(flight):
    head = shown(flight, at(flight, "0"))[0]
    moment = np.datetime64(flight.origin_ns // 10_000_000 * 10, "ms")
    assert head.endswith(f" {str(moment).replace('T', ' ')[:-1]} UTC")


def test_every_vehicle_is_told_as_the_ground_station_knew_it(flight):
    history, cells = flight.flight, rows(shown(flight, at(flight, "10"), width=120))
    row = int(np.searchsorted(history.time_ns, flight.place("10"))) - 1
    assert list(cells) == [1, 2, 3, 4, 5, 6]
    for column, told in enumerate(cells.values()):
        north, east, height = history.reported[row, column]
        speed = math.hypot(*history.velocity_ned[row, column, :2])
        assert told[:10:2] == ["follower" if column in (1, 3, 4, 5) else "leader", *(
            f"{value:z.1f}" for value in (north, east, height, speed))]  # fmt: skip
        assert told[1] == "offboard"
        assert told[-1] == f"{history.trust[row, column]:.2f}"
    assert float(cells[5][-1]) < 0.5


def test_a_distrusted_vehicle_and_what_happened_to_it_stand_out(flight):
    console = Console(file=StringIO(), force_terminal=True, color_system="standard", width=80, height=24)
    controls = at(flight, "distrust")
    view = OfTicks(flight.flight)(controls.player.position_ns)
    console.print(picture(controls, flight, view, title="emergency", width=80, height=24))
    assert "\x1b[1;31m5 " in console.file.getvalue()
    assert any(line.startswith("D ") and "robot 5 is distrusted" in line for line in shown(flight, controls))


def test_what_has_not_happened_yet_is_not_told(flight):
    before = shown(flight, at(flight, "0"))
    assert not any("distrusted" in line for line in before)
    assert "next task" in "\n".join(shown(flight, at(flight, "10")))


def test_what_several_vehicles_said_at_once_is_one_line(flight):
    said = [line for line in shown(flight, at(flight, "-5")) if "Armed" in line]
    assert len(said) == 1
    assert "vehicles 1–6: Armed" in said[0]


@pytest.mark.parametrize("size", [(80, 24), (120, 40), (60, 16), (40, 12), (200, 60), (20, 5)])
@pytest.mark.parametrize("place", ["-10", "3", "30"])
def test_it_fits_whatever_the_terminal(flight, size, place):
    width, height = size
    lines = shown(flight, at(flight, place), width=width, height=height)
    assert max(len(line) for line in lines) <= width
    assert len(lines) == height
    assert lines[-1].startswith("space pause")
    assert len(rows(lines)) == 6 if height >= 12 else "more, for" in "\n".join(lines) or "…" in lines[-2]


@pytest.mark.parametrize("height", [24, 16, 12])
def test_where_there_are_too_many_vehicles_those_with_trouble_have_a_line(flight, height):
    controls = at(flight, "10")
    one = OfTicks(flight.flight)(controls.player.position_ns).vehicles[0]
    many = [replace(one, system=system, trust=0.2 if system == 19 else 1.0) for system in range(1, 21)]
    many[16] = replace(many[16], age_s=7.0)
    lines = shown(flight, controls, view=View("mission", "", tuple(many)), height=height)
    assert len(lines) == height
    assert {1, 17, 19} <= rows(lines).keys()
    assert f"and {20 - len(rows(lines))} more" in "\n".join(lines)
    assert lines[-1].startswith("space pause")


def test_what_is_typed_and_what_was_said_of_it_take_the_place_of_the_keys(flight):
    controls = at(flight, "10")
    assert shown(flight, replace(controls, typed="1:0"))[-1].startswith("go to 1:0▏")
    assert shown(flight, replace(controls, note="999: the recording ends"))[-1] == "999: the recording ends"


@pytest.mark.parametrize(
    ("width", "keys"),
    [
        (40, "space pause  q quit  ←→ step  +− speed"),
        (20, "space pause  q quit"),
        (60, "space pause  q quit  ←→ step  +− speed  r reverse  n p event"),
    ],
)
def test_the_keys_that_fit_are_told_the_most_needed_first(flight, width, keys):
    assert shown(flight, at(flight, "10"), width=width, height=12)[-1] == keys


def test_what_has_not_changed_is_not_drawn_again(flight):
    console = Console(file=StringIO(), force_terminal=True, width=80, height=24)
    screen = Screen(console, flight, OfTicks(flight.flight), "emergency")
    paused = at(flight, "10", paused=True)
    drawn = []
    screen.enter()
    for tenth, controls in enumerate((paused, paused, paused, replace(paused, note="there is no event after this"))):
        screen.show(controls, tenth * SECOND)
        drawn.append(len(console.file.getvalue()))
    screen.leave()
    assert drawn[0] == drawn[1] == drawn[2] < drawn[3]


def test_at_the_very_beginning_nothing_is_known_of_anybody(flight):
    controls = Controls(Player(flight.start_ns, flight.end_ns, flight.start_ns))
    assert rows(shown(flight, controls)) == {}


def test_the_bar_is_as_far_as_it_is_played_and_has_its_events_below(flight):
    middle = (flight.start_ns + flight.end_ns) // 2
    assert bar(flight, flight.start_ns, 40).plain == "●" + "─" * 39
    assert bar(flight, middle, 40).plain in ("━" * 19 + "●" + "─" * 20, "━" * 20 + "●" + "─" * 19)
    assert bar(flight, flight.end_ns, 40).plain == "━" * 39 + "●"
    below = marks(flight, 400).plain
    share = (flight.place("distrust") - flight.start_ns) / (flight.end_ns - flight.start_ns)
    assert below.index("D") == pytest.approx(400 * share, abs=1)
    assert set(below) <= {letter for letter, _ in MARKS.values()} | {" "}


def test_gaps_are_seen_in_the_bar_and_said_while_they_last(imported):
    line = bar(imported, imported.end_ns, 100).plain
    length_s = imported.seconds(imported.end_ns)
    nobody, one = (round(100 * begin_s / length_s) for begin_s in (5.5, 9.5))
    assert (line[nobody], line[one], line[nobody - 15], line[-2]) == (" ", "╌", "━", "━")
    assert "nobody is heard" in shown(imported, at(imported, "5.5"))[1]
    assert "silent: 3" in shown(imported, at(imported, "9.5"))[1]
    assert "silent" not in shown(imported, at(imported, "12"))[1]


def test_of_another_ground_stations_log_vehicles_are_shown_by_what_they_said(imported):
    cells = rows(shown(imported, at(imported, "14"), width=100))
    own = timeline.load(recorded("demo", *SHORT).path)
    there = OfTicks(own.flight)(own.start_ns + 14 * SECOND).vehicles
    assert [row[0] for row in cells.values()] == ["offboard"] * 6
    for told, known in zip(cells.values(), there, strict=True):
        _, _, height_m = known.place
        assert float(told[5]) == pytest.approx(height_m, abs=0.15)
        assert float(told[7]) == pytest.approx(known.speed, abs=0.15)
        assert told[9] == f"{known.battery:.0%}"


def test_who_jumps_there_sees_what_he_sees_who_plays_on(imported):
    with Reel(imported.path) as one, Reel(imported.path) as other:
        playing, jumping = (OfFrames(reel, imported.senders.vehicles) for reel in (one, other))
        for tenth in range(130, 160):
            position_ns = imported.start_ns + tenth * SECOND // 10
            seen = playing(position_ns)
        assert jumping(imported.start_ns + 2 * SECOND) != seen
        assert jumping(position_ns) == seen
        assert playing(position_ns - SECOND).vehicles[0].place != seen.vehicles[0].place
