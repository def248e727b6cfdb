"""How far a mission goes, and the fence that holds it."""

import pytest

from scenarios import ScenarioError, load, parse
from scenarios.fence import BELOW, CEILING_MARGIN_M, FLOOR_M, MARGIN_M, ROOM_ABOVE_M, ROOM_M, reach_m
from scenarios.models import LOWEST_TO_LEAVE

ALONE = """
title = "one robot, no run-up"
swarm = {rows = 1, columns = 1, leaders = [1]}
mission = {run_up_s = 0, leg = [{task = "out", heading_deg = 0, length_m = 30}]}
"""


def alone(*overrides):
    return parse(ALONE, source="alone", overrides=overrides)


@pytest.mark.parametrize(
    ("overrides", "reach"),
    [
        ((), 30.0),
        (("mission.run_up_s=4",), 30.0 + 0.75 * 4 * 1.5),
        (("swarm.columns=3", "swarm.spacing_m=4"), (30**2 + 4**2) ** 0.5),
        (("swarm.rows=3", "swarm.spacing_m=4"), 34.0),
        (("mission.leg.0.heading_deg=77", "swarm.rows=3", "swarm.spacing_m=4"), 34.0),
        (('event=[{kind="redirect", at_length_m=10, task="call", heading_deg=90, length_m=24}]',), 26.0),
        (
            (
                'mission.leg=[{task="a", heading_deg=0, length_m=30}, {task="b", heading_deg=90, length_m=40}]',
                'event=[{kind="redirect", at_length_m=36, task="call", heading_deg=-90, length_m=6}]',
            ),
            (30**2 + 6**2) ** 0.5,
        ),
        (('mission.leg=[{task="a", heading_deg=0, length_m=30}, {task="b", heading_deg=180, length_m=40}]',), 30.0),
    ],
    ids=["a leg", "its run-up", "beside it", "before it", "turned", "called away", "called later", "farthest between"],
)
def test_how_far_a_mission_goes_is_known_from_its_legs(overrides, reach):
    assert reach_m(alone(*overrides)) == pytest.approx(reach)


@pytest.mark.parametrize("name", ["demo", "emergency", "transit"])
def test_what_ships_has_no_fence_until_it_is_given_one_and_then_all_of_it(name):
    scenario = load(name)
    assert set(dict(scenario.limits.fence).values()) == {None}
    fence = scenario.fenced().limits.fence
    assert reach_m(scenario) + MARGIN_M <= fence.radius_m < reach_m(scenario) + MARGIN_M + 1
    assert fence.ceiling_m == scenario.swarm.altitude_m + CEILING_MARGIN_M
    assert fence.floor_m == FLOOR_M
    assert scenario.fenced().model_copy(update={"limits": scenario.limits}) == scenario


def test_a_bound_that_a_scenario_names_is_kept():
    fence = alone("limits.fence.radius_m=40").fenced().limits.fence
    assert (fence.radius_m, fence.ceiling_m) == (40.0, 10.0 + CEILING_MARGIN_M)
    fenced = alone("limits.fence.floor_m=3").fenced()
    assert fenced.limits.fence.floor_m == 3.0
    assert fenced.fenced() == fenced


@pytest.mark.parametrize("altitude_m", [2.0, LOWEST_TO_LEAVE, 500.0])
@pytest.mark.parametrize("beyond_repair", ["keep", "hold", "land"])
def test_every_height_that_may_be_flown_has_a_fence_that_holds_it(altitude_m, beyond_repair):
    if beyond_repair == "keep" or altitude_m >= LOWEST_TO_LEAVE:
        alone(f"swarm.altitude_m={altitude_m}", f"trust.beyond_repair={beyond_repair}").fenced()


@pytest.mark.parametrize(
    ("least", "less"),
    [
        (f"limits.fence.radius_m={30 + ROOM_M}", f"limits.fence.radius_m={30 + ROOM_M - 0.01}"),
        (f"limits.fence.ceiling_m={10 + ROOM_ABOVE_M}", f"limits.fence.ceiling_m={10 + ROOM_ABOVE_M - 0.01}"),
        (f"limits.fence.floor_m={10 - ROOM_ABOVE_M}", f"limits.fence.floor_m={10 - ROOM_ABOVE_M + 0.01}"),
    ],
)
def test_a_mission_that_would_leave_its_own_fence_is_refused(least, less):
    alone(least)
    with pytest.raises(ScenarioError, match=less.split("=")[0]):
        alone(less)


def test_robots_that_leave_the_swarm_need_room_below_it():
    floor = f"limits.fence.floor_m={10 - BELOW}"
    alone(floor)
    with pytest.raises(ScenarioError, match="down to 7 m; it must be 6 or less"):
        alone(floor, "trust.beyond_repair=hold")
