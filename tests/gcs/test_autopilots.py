"""How each autopilot is asked for things: one step at a time, from what telemetry says of it."""

from dataclasses import replace

import numpy as np
import pytest

from gcs.autopilots import Fleet
from gcs.autopilots.fleet import HEARD_NS
from gcs.commands import (
    Arm,
    ChangeMode,
    Land,
    RequestMessage,
    RequestParameter,
    RequestStream,
    TakeOff,
    TakeOffAboveHome,
)
from gcs.gate import LOST_NS
from gcs.telemetry import Swarm
from wire.modes import ARDUCOPTER_MODES, ARDUPILOT, PX4, PX4_MODES

NOW = 10**18
HEIGHT = 10.0
FLEET = Fleet(height_m=HEIGHT, position_s=0.1)
ON_GROUND, IN_AIR, TAKING_OFF, LANDING = 1, 2, 3, 4
TOLD = {
    PX4: dict.fromkeys(("COM_OF_LOSS_T", "COM_OBL_RC_ACT", "NAV_DLL_ACT", "COM_DL_LOSS_T", "MPC_XY_VEL_MAX"), 1.0),
    ARDUPILOT: dict.fromkeys(("GUID_TIMEOUT", "FS_GCS_ENABLE", "FS_GCS_TIMEOUT", "SYSID_MYGCS", "WPNAV_SPEED"), 1.0),
}
MODES = {
    PX4: {name: mode.custom_mode for name, mode in PX4_MODES.items()},
    ARDUPILOT: dict(ARDUCOPTER_MODES),
}
HOLDING = {PX4: "hold", ARDUPILOT: "brake"}
OBEYING = {PX4: "offboard", ARDUPILOT: "guided"}
OURS = {PX4: {"takeoff", "hold", "offboard", "land"}, ARDUPILOT: {"guided", "brake", "land"}}
both = pytest.mark.parametrize("autopilot", [PX4, ARDUPILOT])


def vehicle(autopilot, mode="hold", *, height=0.0, armed=False, landed=None, **changes):
    """One vehicle of which everything is known, standing still."""
    landed = (IN_AIR if height else ON_GROUND) if landed is None else landed
    known = {
        "position_ned": np.array([[0.0, 0.0, -height]]),
        "velocity_ned": np.zeros((1, 3)),
        "position_ns": np.array([NOW]),
        "interval_s": np.array([0.1]),
        "origin": np.array([[41.0, -81.0, 300.0]]),
        "home_m": np.array([320.0]),
        "heartbeat_ns": np.array([NOW]),
        "autopilot": np.array([autopilot]),
        "custom_mode": np.array([MODES[autopilot].get(mode, 0)]),
        "armed": np.array([armed]),
        "ready": np.array([True]),
        "estimator": np.array([0x33F]),
        "landed_state": np.array([landed]),
        "accuracy_m": np.array([0.3]),
        "parameters": (TOLD.get(autopilot, {}),),
    }
    return replace(Swarm.of((1,)), **(known | changes))


def known(swarm):
    return not FLEET.lacking(swarm, 0, NOW)


# --- what must be known


@both
def test_a_vehicle_of_which_everything_is_known_is_asked_for_nothing(autopilot):
    swarm = vehicle(autopilot)
    assert known(swarm)
    assert FLEET.next_to_know(swarm, 0, NOW) == ()


LACKING = {
    "position_ned": (np.full((1, 3), np.nan), RequestStream(32, 0.1), "position and velocity"),
    "position_ns": (np.array([NOW - LOST_NS - 1]), RequestStream(32, 0.1), "position and velocity"),
    "interval_s": (np.array([1.0]), RequestStream(32, 0.1), "positions every 0.1 s"),
    "heartbeat_ns": (np.array([NOW - HEARD_NS - 1]), RequestStream(1, 1.0), "a heartbeat"),
    "origin": (np.full((1, 3), np.nan), RequestMessage(49), "its origin"),
    "home_m": (np.full(1, np.nan), RequestMessage(242), "its home"),
    "accuracy_m": (np.full(1, np.nan), RequestMessage(24), "its horizontal accuracy"),
    "ready": (np.zeros(1, bool), RequestStream(1, 1.0), "its own readiness to arm"),
    "landed_state": (np.zeros(1, int), RequestStream(245, 1.0), "whether it stands on the ground"),
}


@both
@pytest.mark.parametrize("lacking", LACKING)
def test_what_is_not_known_is_asked_for(autopilot, lacking):
    unknown, request, words = LACKING[lacking]
    swarm = vehicle(autopilot, **{lacking: unknown})
    assert not known(swarm)
    assert FLEET.lacking(swarm, 0, NOW) == (words,)
    assert request in FLEET.next_to_know(swarm, 0, NOW)


@both
@pytest.mark.parametrize(
    ("interval_s", "enough"), [(0.02, True), (0.1, True), (0.3, True), (0.31, False), (np.nan, False)]
)
def test_a_stream_may_come_a_third_as_often_as_asked_for(autopilot, interval_s, enough):
    swarm = vehicle(autopilot, interval_s=np.array([interval_s]))
    assert known(swarm) is enough
    assert FLEET.next_to_hear(swarm, 0, NOW) == (None if enough else RequestStream(32, 0.1))


@pytest.mark.parametrize(("interval_s", "enough"), [(0.2, True), (0.21, False)])
def test_but_five_positions_a_second_are_enough_however_many_were_asked_for(interval_s, enough):
    swarm = vehicle(PX4, interval_s=np.array([interval_s]))
    assert (Fleet(height_m=HEIGHT, position_s=0.02).lacking(swarm, 0, NOW) == ()) is enough


@both
def test_a_vehicle_in_the_air_that_is_not_heard_is_asked_for_its_positions_again(autopilot):
    flying = {"armed": True, "height": HEIGHT, "interval_s": np.array([0.1])}
    for age_ns, again in ((LOST_NS, None), (LOST_NS + 1, RequestStream(32, 0.1))):
        swarm = vehicle(autopilot, position_ns=np.array([NOW - age_ns]), **flying)
        assert FLEET.next_to_hear(swarm, 0, NOW) == again


@both
def test_an_origin_that_may_never_be_told_is_looked_for_by_the_global_position_too(autopilot):
    asked = FLEET.next_to_know(vehicle(autopilot, origin=np.full((1, 3), np.nan)), 0, NOW)
    assert {RequestMessage(49), RequestMessage(33)} < set(asked)
    assert RequestMessage(33) not in FLEET.next_to_know(vehicle(autopilot, ready=np.zeros(1, bool)), 0, NOW)


@both
def test_every_parameter_is_asked_for_until_it_is_told(autopilot):
    told = TOLD[autopilot]
    for name in told:
        rest = {other: value for other, value in told.items() if other != name}
        swarm = vehicle(autopilot, parameters=(rest,))
        asked = [command for command in FLEET.next_to_know(swarm, 0, NOW) if isinstance(command, RequestParameter)]
        assert not known(swarm)
        assert name in FLEET.lacking(swarm, 0, NOW)[0]
        assert RequestParameter(name) in asked
        assert not {command.name for command in asked} & set(rest)


@pytest.mark.parametrize(("old", "new"), [("SYSID_MYGCS", "MAV_GCS_SYSID"), ("WPNAV_SPEED", "WP_SPD")])
def test_a_parameter_that_newer_firmware_has_renamed_is_known_by_either_name(old, new):
    told = {new if name == old else name: value for name, value in TOLD[ARDUPILOT].items()}
    assert known(vehicle(ARDUPILOT, parameters=(told,)))
    neither = {name: value for name, value in told.items() if name != new}
    asked = FLEET.next_to_know(vehicle(ARDUPILOT, parameters=(neither,)), 0, NOW)
    assert {RequestParameter(old), RequestParameter(new)} < set(asked)


@pytest.mark.parametrize("flags", [0, 0x33E, 0x23F, 0x400])
def test_an_arducopter_is_ready_only_with_its_whole_estimator(flags):
    swarm = vehicle(ARDUPILOT, estimator=np.array([flags]))
    assert not known(swarm)
    assert RequestMessage(193) in FLEET.next_to_know(swarm, 0, NOW)


def test_px4_is_ready_when_it_says_so():
    assert known(vehicle(PX4, estimator=np.array([0])))


@both
@pytest.mark.parametrize("of", ["nobody heard", "another autopilot"])
def test_of_strangers_nothing_is_asked(autopilot, of):
    unheard = Swarm.of((1,))
    strange = {"heartbeat_ns": unheard.heartbeat_ns, "autopilot": unheard.autopilot}
    strange = strange if of == "nobody heard" else {"autopilot": np.array([8])}
    swarm = replace(vehicle(autopilot, armed=True, height=HEIGHT), **strange)
    assert FLEET.next_to_know(swarm, 0, NOW) == ()
    assert not known(swarm)
    assert not FLEET.hovering(swarm).any()
    steps = (FLEET.next_to_fly, FLEET.next_to_obey, FLEET.next_to_land, FLEET.next_to_hold)
    assert [step(swarm, 0) for step in steps] == [None] * 4


def test_another_autopilot_obeys_nothing():
    swarm = replace(vehicle(PX4, "offboard", armed=True), autopilot=np.array([8]))
    assert not (FLEET.obeying(swarm) | FLEET.ours(swarm) | FLEET.landing(swarm)).any()


# --- into the air


def guided(**situation):
    return vehicle(ARDUPILOT, "guided", **situation)


@pytest.mark.parametrize(
    ("swarm", "step"),
    [
        (vehicle(PX4), Arm()),
        *((vehicle(PX4, mode), ChangeMode(4, 3)) for mode in ("land", "return", "mission", "offboard", "manual")),
        (vehicle(PX4, armed=True), TakeOff(330.0)),
        (vehicle(PX4, "takeoff", armed=True, height=3.0), None),
        (vehicle(PX4, armed=True, height=HEIGHT), None),
        (vehicle(PX4, armed=True, height=7.0), TakeOff(330.0)),
        (vehicle(ARDUPILOT, "stabilize"), ChangeMode(4, 0)),
        (vehicle(ARDUPILOT, "land"), ChangeMode(4, 0)),
        (guided(), Arm()),
        (guided(armed=True), TakeOffAboveHome(10.0)),
        (guided(armed=True, height=0.5, landed=TAKING_OFF), None),
        (guided(armed=True, height=HEIGHT), None),
    ],
)
def test_the_next_step_towards_hovering(swarm, step):
    assert FLEET.next_to_fly(swarm, 0) == step


@both
@pytest.mark.parametrize("landed", [0, IN_AIR, TAKING_OFF, LANDING])
def test_nobody_is_armed_but_on_the_ground(autopilot, landed):
    for mode in MODES[autopilot]:
        swarm = vehicle(autopilot, mode, height=5.0, landed=landed)
        assert FLEET.next_to_fly(swarm, 0) is None


@both
def test_rotors_that_turn_in_a_mode_that_is_not_ours_to_take_off_from_are_left_alone(autopilot):
    """A pilot who armed first has the vehicle."""
    for mode in set(MODES[autopilot]) - {"hold", "guided"}:
        for height in (0.0, 3.0):
            swarm = vehicle(autopilot, mode, armed=True, height=height, landed=ON_GROUND)
            assert FLEET.next_to_fly(swarm, 0) is None


@pytest.mark.parametrize(
    ("swarm", "climbing"),
    [
        (vehicle(PX4, "takeoff", armed=True, height=3.0), True),
        (vehicle(PX4, armed=True, height=HEIGHT), True),
        (vehicle(PX4, armed=True, height=3.0), False),
        (vehicle(PX4, "takeoff"), False),
        (guided(armed=True, height=3.0, landed=TAKING_OFF), True),
        (guided(armed=True, height=3.0), True),
        (guided(armed=True), False),
        (vehicle(ARDUPILOT, "brake", armed=True, height=3.0), False),
    ],
)
def test_climbing_is_off_the_ground_and_not_stopped(swarm, climbing):
    assert FLEET.climbing(swarm).tolist() == [climbing]


@pytest.mark.parametrize(
    ("swarm", "hovering"),
    [
        (vehicle(PX4, armed=True, height=HEIGHT), True),
        (vehicle(PX4, "takeoff", armed=True, height=HEIGHT), False),
        (vehicle(PX4, armed=True, height=9.0), False),
        (vehicle(PX4, height=HEIGHT), False),
        (guided(armed=True, height=9.8), True),
        (guided(armed=True, height=HEIGHT, landed=TAKING_OFF), False),
        (guided(armed=True, height=9.0), False),
        (guided(height=HEIGHT), False),
        (vehicle(ARDUPILOT, "brake", armed=True, height=HEIGHT), False),
    ],
)
def test_hovering_is_at_height_with_the_take_off_over(swarm, hovering):
    assert FLEET.hovering(swarm).tolist() == [hovering]


# --- under our control, and down


@both
def test_asked_to_obey_until_it_does(autopilot):
    step = {PX4: ChangeMode(6, 0), ARDUPILOT: ChangeMode(4, 0)}[autopilot]
    for mode in MODES[autopilot]:
        swarm = vehicle(autopilot, mode, armed=True, height=HEIGHT)
        there = mode == OBEYING[autopilot]
        assert FLEET.obeying(swarm).tolist() == [there]
        assert FLEET.next_to_obey(swarm, 0) == (None if there else step)


@both
def test_nobody_obeys_with_rotors_off(autopilot):
    assert not FLEET.obeying(vehicle(autopilot, OBEYING[autopilot])).any()


def test_an_arducopter_that_takes_off_in_guided_does_not_obey_yet():
    assert not FLEET.obeying(guided(armed=True, height=3.0, landed=TAKING_OFF)).any()


@both
def test_our_modes_are_those_that_we_ask_for(autopilot):
    ours = {mode for mode in MODES[autopilot] if FLEET.ours(vehicle(autopilot, mode)).all()}
    assert ours == OURS[autopilot]


@both
def test_whoever_flies_is_asked_to_land_until_it_is_landing(autopilot):
    for mode in MODES[autopilot]:
        flying = vehicle(autopilot, mode, armed=True, height=HEIGHT)
        assert FLEET.landing(flying).tolist() == [mode == "land"]
        assert FLEET.next_to_land(flying, 0) == (None if mode == "land" else Land())
        assert FLEET.next_to_land(vehicle(autopilot, mode), 0) is None


@both
def test_to_hold_is_a_mode_that_does_not_descend_without_a_radio(autopilot):
    step = {PX4: ChangeMode(4, 3), ARDUPILOT: ChangeMode(17, 0)}[autopilot]
    for mode in MODES[autopilot]:
        flying = vehicle(autopilot, mode, armed=True, height=HEIGHT)
        assert FLEET.next_to_hold(flying, 0) == (None if mode == HOLDING[autopilot] else step)
        assert FLEET.next_to_hold(vehicle(autopilot, mode), 0) is None


# --- mixed


def mixed(*vehicles):
    """Rows of several fleets of one."""
    first = vehicles[0]
    rows = {
        name: np.concatenate([getattr(one, name) for one in vehicles])
        for name in first.__dataclass_fields__
        if isinstance(getattr(first, name), np.ndarray)
    }
    told = tuple(one.parameters[0] for one in vehicles)
    return replace(Swarm.of(range(1, len(vehicles) + 1)), parameters=told, **rows)


def test_in_a_mixed_fleet_each_is_asked_in_its_own_way():
    swarm = mixed(vehicle(PX4, armed=True), guided(armed=True), vehicle(PX4), vehicle(ARDUPILOT, "land"))
    steps = [FLEET.next_to_fly(swarm, row) for row in range(4)]
    assert steps == [TakeOff(330.0), TakeOffAboveHome(10.0), Arm(), ChangeMode(4, 0)]


def test_in_a_mixed_fleet_each_is_seen_by_its_own_modes():
    """PX4's custom modes and ArduPilot's are different numbers for the same things, and the same for different ones."""
    swarm = mixed(
        *(vehicle(PX4, mode, armed=True, height=HEIGHT) for mode in ("offboard", "land")),
        *(vehicle(ARDUPILOT, mode, armed=True, height=HEIGHT) for mode in ("guided", "land", "loiter")),
    )
    crossed = replace(swarm, autopilot=np.where(swarm.autopilot == PX4, ARDUPILOT, PX4))
    assert FLEET.obeying(swarm).tolist() == [True, False, True, False, False]
    assert FLEET.landing(swarm).tolist() == [False, True, False, True, False]
    assert FLEET.ours(swarm).tolist() == [True, True, True, True, False]
    assert not (FLEET.obeying(crossed) | FLEET.landing(crossed) | FLEET.ours(crossed)).any()
