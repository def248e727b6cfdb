"""Where each robot stands in the formation."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios import load, names, offsets_ne

sizes = st.integers(1, 6)
headings = st.floats(-360, 360)


def formation(rows=2, columns=3, *, spacing=3.0, heading=0.0):
    return offsets_ne(
        load(
            "demo",
            overrides=[
                f"swarm.rows={rows}",
                f"swarm.columns={columns}",
                f"swarm.spacing_m={spacing}",
                "swarm.leaders=[1]",
                f"mission.leg.0.heading_deg={heading:.17g}",
            ],
        )
    )


def test_the_papers_formation_seen_northwards_row_by_row_from_the_front_left():
    front = [(1.5, -3), (1.5, 0), (1.5, 3)]
    rear = [(-1.5, -3), (-1.5, 0), (-1.5, 3)]
    assert formation() == pytest.approx(np.array(front + rear))


def test_eastwards_the_front_is_east_and_the_left_is_north():
    assert formation(heading=90)[0] == pytest.approx([3, 1.5])
    assert formation(heading=90)[5] == pytest.approx([-3, -1.5])


def test_a_lone_robot_stands_at_the_mean():
    assert formation(1, 1).tolist() == [[0, 0]]


@given(sizes, sizes, headings)
def test_offsets_have_mean_zero(rows, columns, heading):
    offsets = formation(rows, columns, heading=heading)
    assert offsets.shape == (rows * columns, 2)
    assert offsets.mean(0) == pytest.approx([0, 0], abs=1e-9)


@given(sizes, sizes, headings, st.floats(0.5, 20))
def test_neighbours_in_a_row_and_in_a_column_stand_one_spacing_apart(rows, columns, heading, spacing):
    grid = formation(rows, columns, heading=heading, spacing=spacing).reshape(rows, columns, 2)
    for axis in (0, 1):
        gaps = np.linalg.norm(np.diff(grid, axis=axis), axis=-1)
        assert gaps == pytest.approx(spacing, rel=1e-9)


@given(sizes, sizes, headings)
def test_rows_fall_back_along_the_first_heading_and_columns_go_to_the_right_of_it(rows, columns, heading):
    ahead = np.array([np.cos(np.radians(heading)), np.sin(np.radians(heading))])
    right = np.array([-ahead[1], ahead[0]])
    grid = formation(rows, columns, heading=heading).reshape(rows, columns, 2)
    assert np.diff(grid @ ahead, axis=0) == pytest.approx(-3.0)
    assert np.diff(grid @ right, axis=1) == pytest.approx(3.0)
    assert np.diff(grid @ ahead, axis=1) == pytest.approx(0.0, abs=1e-9)


def test_the_formation_does_not_turn_with_the_second_leg():
    assert (offsets_ne(load("demo", overrides=["mission.leg.1.heading_deg=-90"])) == offsets_ne(load("demo"))).all()


@pytest.mark.parametrize("name", names())
def test_leaders_of_shipped_scenarios_are_the_front_corners_and_the_failed_robot_the_rear_middle(name):
    scenario = load(name)
    grid = np.arange(1, 7).reshape(scenario.swarm.rows, scenario.swarm.columns)
    assert scenario.swarm.leaders == (grid[0, 0], grid[0, -1])
    assert {fault.vehicle for fault in scenario.fault} <= {grid[-1, 1]}
