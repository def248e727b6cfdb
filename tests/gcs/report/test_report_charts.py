"""What is drawn over time is what the score measures; and a crowd, a lone robot or a torn flight is drawn as well."""

import re
from dataclasses import replace

import numpy as np
import pytest
from pages import AUTO, AVERAGE, believing, dragged, flown, live, unreached

from gcs.recording.history import Links
from gcs.report.believed import trust, weights
from gcs.report.beneath import batteries, gate, lateness, links
from gcs.report.courses import courses
from gcs.report.judged import closeness, distance, heading
from gcs.report.page import SECTIONS
from gcs.report.robots import key
from gcs.report.series import closest_pair, distance_to_target, heeded, lost_share, off_course_deg
from gcs.report.told import Told
from scenarios import offsets_ne


def told(history):
    return Told("a flight", history)


def mean_of(flight):
    place = flight.history.position[flight.mission, :, :2] - offsets_ne(flight.history.scenario)
    return place[:, flight.scored].mean(axis=1, keepdims=True)


@pytest.mark.parametrize("overrides", [(AVERAGE,), (AUTO,)])
def test_the_curves_end_at_the_score(overrides):
    flight = told(flown(*overrides))
    time_s = flight.history.mission_s[flight.mission]
    off, away = (measure(time_s, mean_of(flight), flight.plan) for measure in (off_course_deg, distance_to_target))
    assert off[-1, 0] == pytest.approx(flight.score.heading_error_deg)
    assert away[-1, 0] == pytest.approx(flight.score.distance_to_target_m)


def test_who_flies_as_planned_is_on_course_all_the_way_and_ends_at_the_target():
    flight = told(dragged(2, 3))
    time_s = flight.history.mission_s
    off = off_course_deg(time_s, mean_of(flight), flight.plan)
    assert np.nanmax(off) == pytest.approx(0.0, abs=1e-6)
    assert distance_to_target(time_s, mean_of(flight), flight.plan)[-1, 0] == pytest.approx(0.0, abs=1e-9)


def test_equal_weights_are_an_equal_share_and_rows_that_do_not_count_do_not():
    table = np.array([[[0.5, 0.5, 0.0], [0.5, 0.5, 0.0], [0.0, 0.0, 1.0]]])
    assert heeded(np.full((1, 3, 3), 1 / 3), np.ones(3, bool)) == pytest.approx(1 / 3)
    assert heeded(table, np.array([True, True, False]))[0].tolist() == [0.5, 0.5, 0.0]


def test_losses_are_reckoned_moment_by_moment():
    counts = Links(np.arange(3), np.array([[10], [19], [19]]), np.array([[0], [1], [1]]))
    assert lost_share(counts).tolist() == [[0.1], [0.0]]


def test_the_closest_two_are_named():
    assert closest_pair(np.array([[0.0, 0, 0], [9, 0, 0], [0, 2, 0]])) == (0, 2)


def test_captions_tell_the_figures_of_the_score():
    flight = told(flown(AVERAGE))
    for section, figure in ((heading, "14.0°"), (distance, "11.2 m"), (closeness, "2.4")):
        assert figure in section([flight]).charts[0].words
    assert "asks for no trust" in trust([flight]).charts[0].words
    assert "an equal share is 16.7%" in weights([flight]).charts[0].words
    assert "every frame arrives" in links([flight]).charts[0].words
    assert "on time" in lateness([flight]).charts[0].words
    assert "left as they were asked for" in gate([flight]).charts[0].words


def test_flights_side_by_side_have_one_scale():
    alone = distance([told(flown(AUTO))]).charts[0].svg
    beside = distance([told(flown(AUTO)), told(flown(AVERAGE))]).charts
    ticks = [re.findall(r'class="tick y"[^>]*>([^<]*)', chart.svg) for chart in beside]
    assert ticks[0] == ticks[1]
    assert alone != beside[0].svg


@pytest.mark.parametrize(("rows", "columns"), [(2, 3), (4, 5), (6, 10)])
def test_a_chart_of_many_robots_has_as_many_lines_as_of_few(rows, columns):
    flight = told(dragged(rows, columns))
    drawn = trust([flight]).charts[0].svg
    assert drawn.count('class="robot') == (6 if rows * columns <= 12 else 2)
    assert ('class="band"' in drawn) is (rows * columns > 12)
    assert re.findall(r'class="name failed"[^>]*>(\w+)', drawn) == ["5"]
    assert len(drawn) < 20_000


def test_a_robot_doubted_without_a_fault_is_drawn_as_such():
    history = dragged(2, 3)
    trusts = history.trust.copy()
    trusts[50:60, 1] = 0.2
    flight = told(believing(history, trusts))
    assert flight.looks == ("healthy", "doubted", "healthy", "healthy", "failed", "healthy")
    assert ("robot doubted", "healthy, but distrusted") in key([flight])
    assert "robot 2 was distrusted at 5.0 s without a fault" in trust([flight]).charts[0].words


def test_the_truth_is_drawn_under_trust_a_strip_for_each_who_failed():
    drawn = trust([told(dragged(2, 3))]).charts[0].svg
    assert drawn.count('class="fault bar"') == 1
    assert "robot 5 at 40% speed" in drawn


def test_ratings_are_marks_with_their_values():
    said = [("op1", 5, 2, 3.0), ("op1", 5, 1, 9.0), ("op2", None, 4, 12.0)]
    drawn = trust([told(dragged(2, 3, said=said))]).charts[0].svg
    assert re.findall(r'class="value"[^>]*>(\d)', drawn) == ["2", "1", "4"]
    assert "op1 rates robot 5 2 of 5" in drawn


def test_a_flood_of_ratings_is_thinned_and_lies_beneath_the_lines():
    said = [(f"op{system}", system, 1, 0.1 * tick) for tick in range(240) for system in range(1, 7)]
    plain, drawn = (trust([told(dragged(2, 3, said=some))]).charts[0].svg for some in ((), said))
    assert drawn.count("<circle") <= 60
    assert len(drawn) < len(plain) + 10_000
    assert drawn.rindex('class="rating') < drawn.index('class="robot')
    assert "11 more of 1 up to" in drawn


def test_a_robot_that_fell_silent_counts_for_nothing_where_nobody_knows_its_place():
    history = live(dragged(2, 3), silent=[2])
    said = closeness([told(history)]).charts[0].words
    assert "2 and" not in said
    assert said.endswith("While silent, robot 2 did not count: nobody knows where it was.")
    truly = replace(history, measured=False)
    assert "Robots 2 and 6 came closest, 0.08 m" in closeness([told(truly)]).charts[0].words


def test_links_name_who_fell_silent():
    said = links([told(live(dragged(2, 3), silent=[3]))]).charts[0].words
    assert "Robot 3 was not heard for " in said
    assert "to the end; telemetry of the others was never older than 0.00 s." in said


def test_where_nobody_told_the_truth_nobody_is_called_healthy_or_failed():
    flight = told(live(dragged(2, 3)))
    assert flight.looks == ("healthy", "healthy", "healthy", "healthy", "doubted", "healthy")
    assert [words for _, words in key([flight])] == ["each robot", "distrusted"]
    assert "Trust fell below one half in robot 5 at 2.0 s" in trust([flight]).charts[0].words
    assert flight.mean == "the mean of all robots"
    for section in SECTIONS:
        chart = section([flight])
        legend = [words for _, words in chart.legend]
        assert "healthy" not in f"{chart.look_for} {chart.charts[0].words} {legend}"


def test_where_nobody_is_healthy_no_mean_of_the_healthy_is_told():
    lone = told(dragged(1, 1, "fault.0.vehicle=1", "swarm.leaders=[1]"))
    for section in (courses, heading, distance):
        drawn = section([lone])
        assert "healthy robots" not in f"{drawn.look_for} {drawn.legend} {drawn.charts}"


@pytest.mark.parametrize("rule", ["average", "wmsr-1"])
def test_of_a_rule_that_asks_for_no_trust_nothing_else_is_claimed(rule):
    assert trust([told(dragged(2, 3, f'control.rule="{rule}"'))]).charts[0].words == "This rule asks for no trust."


def test_set_points_that_the_gate_changed_are_drawn_robot_by_robot():
    history = dragged(2, 3)
    verdict = history.verdict.copy()
    verdict[10:20, 2], verdict[30, 4] = 1, 3
    chart = gate([told(replace(history, verdict=verdict))]).charts[0]
    assert "10 slowed" in chart.words
    assert "1 kept inside the fence" in chart.words
    assert (chart.svg.count("slowed bar"), chart.svg.count("fenced bar")) == (1, 1)


def test_no_line_is_drawn_across_ticks_that_are_missing():
    history = dragged(2, 3)
    torn = replace(history, number=np.where(np.arange(len(history.number)) < 100, 0, 50) + history.number)
    whole, broken = (batteries([told(one)]).charts[0].svg for one in (history, torn))
    assert whole.count("M") + 6 == broken.count("M")


def test_a_live_link_tells_its_losses_and_the_loop_its_lateness():
    history = dragged(2, 3)
    count = len(history.ids)
    received = np.array([[0] * count, [90] * count])
    lost = np.zeros((2, count), np.int64)
    lost[1, 3] = 10
    live = replace(
        history,
        links=Links(history.time_ns[[0, -1]], received, lost),
        age_s=np.full_like(history.age_s, 0.05),
        lateness_s=np.full_like(history.lateness_s, 0.003),
    )
    said = links([told(live)]).charts[0]
    assert "of robot 4 the most: 10.0%" in said.words
    assert 'class="loss"' in said.svg
    assert "3.0 ms at p99" in lateness([told(live)]).charts[0].words


@pytest.mark.parametrize("section", SECTIONS)
def test_a_flight_without_a_mission_has_every_chart_or_says_why_not(section):
    for chart in section([told(unreached()), told(dragged(2, 3))]).charts:
        assert chart.svg or chart.words
        assert "nan" not in chart.svg
        assert chart.words.endswith(".")


def test_one_robot_alone_is_drawn():
    lone = dragged(1, 1, "fault.0.vehicle=1", "swarm.leaders=[1]")
    for section in SECTIONS:
        chart = section([told(lone)]).charts[0]
        assert chart.words
        assert "nan" not in chart.svg
    assert "alone" in closeness([told(lone)]).charts[0].words


def test_the_map_is_as_wide_as_it_is_high():
    svg = courses([told(dragged(2, 3))]).charts[0].svg
    across = [float(x) for x in re.findall(r'<text x="([\d.]+)"[^>]*class="tick x"', svg)]
    down = [float(y) for y in re.findall(r'<text x="[\d.]+" y="([\d.]+)" class="tick y"', svg)]
    assert np.diff(across) == pytest.approx(-np.diff(down)[0], abs=0.11)
