"""What keeps a fleet on the ground, and in which words."""

import struct
from dataclasses import replace

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs.preflight import refusals
from gcs.telemetry import Swarm, observe
from scenarios import load
from wire import parameters
from wire.frames import Framer, Sender
from wire.ids import AUTOPILOT
from wire.modes import ARDUPILOT, PX4

PROTECTED = {
    PX4: {"COM_OF_LOSS_T": 0.5, "COM_OBL_RC_ACT": 4, "NAV_DLL_ACT": 3, "COM_DL_LOSS_T": 10, "MPC_XY_VEL_MAX": 12.0},
    ARDUPILOT: {
        "GUID_TIMEOUT": 0.5,
        "FS_GCS_ENABLE": 5,
        "FS_GCS_TIMEOUT": 5.0,
        "SYSID_MYGCS": 255,
        "WPNAV_SPEED": 1000.0,
    },
}
AS_DELIVERED = {
    PX4: PROTECTED[PX4] | {"COM_OF_LOSS_T": 1.0, "COM_OBL_RC_ACT": 0, "NAV_DLL_ACT": 0},
    ARDUPILOT: PROTECTED[ARDUPILOT] | {"GUID_TIMEOUT": 3.0, "FS_GCS_ENABLE": 0},
}
SCENARIO = load("demo")


def fleet(*vehicles, accuracy_m=0.3):
    """Vehicles as (autopilot, parameters)."""
    n = len(vehicles)
    return replace(
        Swarm.of(range(1, n + 1)),
        autopilot=np.array([autopilot for autopilot, _ in vehicles]),
        parameters=tuple(told for _, told in vehicles),
        accuracy_m=np.full(n, accuracy_m) if np.isscalar(accuracy_m) else np.array(accuracy_m),
    )


def said_of(autopilot, *, overrides=(), without=(), **changes):
    """What is said of one vehicle whose parameters protect but for these changes."""
    told = {name: value for name, value in (PROTECTED[autopilot] | changes).items() if name not in without}
    return refusals(fleet((autopilot, told)), load("demo", overrides=overrides))


@pytest.mark.parametrize("autopilot", [PX4, ARDUPILOT])
def test_vehicles_that_protect_themselves_may_be_armed(autopilot):
    assert refusals(fleet(*[(autopilot, PROTECTED[autopilot])] * 6), SCENARIO) == ()


def test_px4_as_delivered_stays_where_it_is_when_the_ground_station_is_lost_and_there_are_sticks():
    (why,) = refusals(fleet((PX4, AS_DELIVERED[PX4])), SCENARIO)
    assert why == (
        "vehicle 1: COM_OBL_RC_ACT = 0 (position mode, or return without sticks, when set-points are lost) and "
        "NAV_DLL_ACT = 0 (nothing when the ground station is lost, after COM_DL_LOSS_T = 10 s); COM_OBL_RC_ACT must be "
        "3 or 4, or else 0 or 5 with NAV_DLL_ACT 2 or 3 and COM_DL_LOSS_T at most 10"
    )


def test_arducopter_as_delivered_hovers_until_its_battery_is_empty():
    (why,) = refusals(fleet((ARDUPILOT, AS_DELIVERED[ARDUPILOT])), SCENARIO)
    assert why == (
        "vehicle 1: FS_GCS_ENABLE = 0 (nothing happens when the ground station is lost); must be 1, 3, 4, 5, 6 or 7"
    )


@pytest.mark.parametrize("seconds", [-1.0, 0.0, 1.01, 60.0])
def test_px4_must_notice_missing_set_points_within_a_second(seconds):
    (why,) = said_of(PX4, COM_OF_LOSS_T=seconds)
    assert why.startswith(f"vehicle 1: COM_OF_LOSS_T = {seconds:g} (")
    assert why.endswith("must be above 0 and at most 1")


@pytest.mark.parametrize("seconds", [0.01, 0.5, 1.0])
def test_px4_may_notice_sooner(seconds):
    assert said_of(PX4, COM_OF_LOSS_T=seconds) == ()


@pytest.mark.parametrize("after_setpoints", range(-1, 9))
@pytest.mark.parametrize("after_link", [0, 1, 2, 3, 5, 6])
@pytest.mark.parametrize("link_s", [10, 11])
def test_px4_comes_down_or_home_by_one_of_two_ways(after_setpoints, after_link, link_s):
    """Return and land after set-points; or a harmless mode, out of which the lost link brings it in ten seconds.

    Terminate and disarm let it fall, and in altitude mode or stabilized, where there are sticks, it drifts or falls.
    """
    protected = after_setpoints in (3, 4) or (after_setpoints in (0, 5) and after_link in (2, 3) and link_s == 10)
    why = said_of(PX4, COM_OBL_RC_ACT=after_setpoints, NAV_DLL_ACT=after_link, COM_DL_LOSS_T=link_s)
    assert (why == ()) is protected


@pytest.mark.parametrize("action", range(-1, 9))
def test_arducopter_must_come_down_or_home(action):
    assert (said_of(ARDUPILOT, FS_GCS_ENABLE=action) == ()) is (action in (1, 3, 4, 5, 6, 7))


@pytest.mark.parametrize(
    ("name", "allowed", "refused"),
    [
        ("GUID_TIMEOUT", (0.1, 0.5, 3.0), (0.0, -1.0, 3.1, 5.0)),
        ("FS_GCS_TIMEOUT", (2.0, 5.0, 10.0), (0.0, 10.5, 120.0)),
        ("SYSID_MYGCS", (255,), (1, 254, 252)),
    ],
)
def test_arducopter_must_notice_soon_and_listen_for_our_heartbeat(name, allowed, refused):
    for value in allowed:
        assert said_of(ARDUPILOT, **{name: value}) == ()
    for value in refused:
        (why,) = said_of(ARDUPILOT, **{name: value})
        assert why.startswith(f"vehicle 1: {name} = {value:g} (")
        assert "must be " in why


def test_a_parameter_under_its_newer_name_is_held_to_the_same():
    renamed = {"MAV_GCS_SYSID": 1, "WP_SPD": 10.0}
    (why,) = said_of(ARDUPILOT, without=("SYSID_MYGCS", "WPNAV_SPEED"), **renamed)
    assert why == "vehicle 1: MAV_GCS_SYSID = 1 (whose heartbeat is the ground station's); must be 255"


@pytest.mark.parametrize("autopilot", [PX4, ARDUPILOT])
def test_a_parameter_that_is_never_told_is_named(autopilot):
    for name in PROTECTED[autopilot]:
        (why,) = said_of(autopilot, without=(name,))
        assert why.startswith("vehicle 1: does not tell its parameter ")
        assert name in why


WAYS_DOWN = "COM_OBL_RC_ACT must be 3 or 4, or else 0 or 5 with NAV_DLL_ACT 2 or 3 and COM_DL_LOSS_T at most 10"
HOLDS = {"COM_OBL_RC_ACT": 5}
"""A PX4 that only a lost link brings down."""
WRONG = [
    (PX4, "COM_OF_LOSS_T", 1.5, {}, "must be above 0 and at most 1"),
    (PX4, "COM_OBL_RC_ACT", 1, {}, WAYS_DOWN),
    (PX4, "NAV_DLL_ACT", 0, HOLDS, WAYS_DOWN),
    (PX4, "COM_DL_LOSS_T", 11, HOLDS, WAYS_DOWN),
    (PX4, "MPC_XY_VEL_MAX", 4.5, {}, "is below limits.speed_m_s = 5"),
    (ARDUPILOT, "GUID_TIMEOUT", 3.5, {}, "must be above 0 and at most 3"),
    (ARDUPILOT, "FS_GCS_ENABLE", 2, {}, "must be 1, 3, 4, 5, 6 or 7"),
    (ARDUPILOT, "FS_GCS_TIMEOUT", 10.5, {}, "must be above 0 and at most 10"),
    (ARDUPILOT, "SYSID_MYGCS", 254, {}, "must be 255"),
    (ARDUPILOT, "MAV_GCS_SYSID", 254, {}, "must be 255"),
    (ARDUPILOT, "WPNAV_SPEED", 450, {}, "is below limits.speed_m_s = 5"),
    (ARDUPILOT, "WP_SPD", 4.5, {}, "is below limits.speed_m_s = 5"),
]
NEWER = {"SYSID_MYGCS": ("MAV_GCS_SYSID", 1.0), "WPNAV_SPEED": ("WP_SPD", 0.01)}
"""Old name → new name, and the new unit's size of the old one's."""


def told_over_the_wire(autopilot, told):
    """A fleet of three of whom the last has told these parameters, as its autopilot writes them."""
    heard = [dialect.MAVLink_heartbeat_message(2, autopilot, 1, 0, 3, 3)]
    for name, value in told.items():
        kind = dialect.MAV_PARAM_TYPE_INT32 if isinstance(value, int) else dialect.MAV_PARAM_TYPE_REAL32
        (wire,) = struct.unpack("<f", parameters.encode(value, kind, autopilot))
        heard.append(dialect.MAVLink_param_value_message(name.encode(), wire, kind, 900, 1))
    sender = Sender(3, AUTOPILOT)
    return observe(Swarm.of((1, 2, 3)), Framer().frames(0, b"".join(map(sender.pack, heard))))


def test_every_parameter_is_tried():
    tried = {(autopilot, name) for autopilot, name, *_ in WRONG}
    assert {name for _, name in tried} - {new for new, _ in NEWER.values()} == {
        n for p in PROTECTED.values() for n in p
    }


@pytest.mark.parametrize(("autopilot", "name", "value", "beside", "allowed"), WRONG, ids=[case[1] for case in WRONG])
def test_one_wrong_value_keeps_everybody_on_the_ground_and_is_named(autopilot, name, value, beside, allowed):
    told = PROTECTED[autopilot] | beside
    renamed = {NEWER[old][0]: right * NEWER[old][1] for old, right in told.items() if old in NEWER}
    if name in renamed:
        told = {old: right for old, right in told.items() if old not in NEWER} | renamed
    assert refusals(told_over_the_wire(autopilot, told), SCENARIO) == ()
    (why,) = refusals(told_over_the_wire(autopilot, told | {name: value}), SCENARIO)
    assert why.startswith("vehicle 3: ")
    assert f"{name} = {value:g} " in why
    assert why.endswith(allowed)


# --- speed


@pytest.mark.parametrize(
    ("autopilot", "limit", "words"),
    [
        (PX4, {"MPC_XY_VEL_MAX": 4.9}, "MPC_XY_VEL_MAX = 4.9 m/s"),
        (ARDUPILOT, {"WPNAV_SPEED": 490.0}, "WPNAV_SPEED = 490 cm/s"),
        (ARDUPILOT, {"WP_SPD": 4.9}, "WP_SPD = 4.9 m/s"),
    ],
)
def test_a_vehicle_that_flies_slower_than_the_scenario_may_ask_is_refused(autopilot, limit, words):
    without = ("WPNAV_SPEED",) if "WP_SPD" in limit else ()
    assert said_of(autopilot, without=without, **limit) == (f"vehicle 1: {words} is below limits.speed_m_s = 5",)
    assert said_of(autopilot, without=without, overrides=["limits.speed_m_s=4.9"], **limit) == ()


# --- accuracy, battery, strangers


def test_robots_closer_than_three_times_their_accuracy_are_refused_by_the_worst_of_them():
    swarm = fleet(*[(PX4, PROTECTED[PX4])] * 3, accuracy_m=[0.3, 1.4, 1.1])
    assert refusals(swarm, load("demo", overrides=["swarm.spacing_m=3"])) == (
        "swarm.spacing_m = 3 is below 3 × 1.4 m, the horizontal accuracy that vehicle 2 reports",
    )
    assert refusals(swarm, load("demo", overrides=["swarm.spacing_m=4.2"])) == ()


def test_a_vehicle_that_does_not_know_its_accuracy_is_refused():
    swarm = fleet(*[(PX4, PROTECTED[PX4])] * 2, accuracy_m=[np.inf, 0.3])
    (why,) = refusals(swarm, SCENARIO)
    assert why.startswith("vehicle 1 does not know its horizontal accuracy")
    assert f"swarm.spacing_m = {SCENARIO.swarm.spacing_m:g}" in why


@pytest.mark.parametrize(("left", "count"), [(0.19, 1), (0.2, 0), (1.0, 0), (np.nan, 0)])
def test_nobody_takes_off_with_less_than_a_fifth_of_the_battery(left, count):
    swarm = replace(fleet((PX4, PROTECTED[PX4])), battery=np.array([left]))
    why = refusals(swarm, SCENARIO)
    assert len(why) == count
    assert all("battery at 19%; must be 20% or more" in words for words in why)


def test_an_autopilot_that_we_do_not_know_is_refused_and_one_that_is_not_heard_is_somebody_elses_matter():
    (why,) = refusals(fleet((8, {})), SCENARIO)
    assert why == "vehicle 1: flown by MAV_AUTOPILOT 8; must be 3 (ArduPilot) or 12 (PX4)"
    assert refusals(fleet((0, {})), SCENARIO) == ()


def test_what_holds_for_several_vehicles_is_said_once():
    swarm = fleet((PX4, PROTECTED[PX4]), *[(ARDUPILOT, AS_DELIVERED[ARDUPILOT])] * 3)
    (why,) = refusals(swarm, SCENARIO)
    assert why.startswith("vehicles 2, 3, 4: FS_GCS_ENABLE = 0 (")


def test_every_vehicle_is_named_with_everything_that_is_wrong_with_it():
    swarm = fleet(
        (PX4, PROTECTED[PX4] | {"COM_OF_LOSS_T": 5.0, "MPC_XY_VEL_MAX": 1.0}),
        (ARDUPILOT, PROTECTED[ARDUPILOT]),
        (ARDUPILOT, AS_DELIVERED[ARDUPILOT]),
    )
    assert [why.split(" = ")[0] for why in refusals(swarm, SCENARIO)] == [
        "vehicle 1: COM_OF_LOSS_T",
        "vehicle 1: MPC_XY_VEL_MAX",
        "vehicle 3: FS_GCS_ENABLE",
    ]
