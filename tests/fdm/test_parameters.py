"""The two parameter tables, what may be set, and the rules that come of it."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fdm.modes import HOLD_GAIN
from fdm.parameter_tables import INT8, INT16, INT32, REAL32, Entry
from fdm.parameters import Parameters, table
from fdm.rules import Action, rules

AUTOPILOTS = ["px4", "ardupilot"]
KINDS = {"px4": {INT32, REAL32}, "ardupilot": {INT8, INT16, INT32, REAL32}}
BITS = {INT8: 8, INT16: 16, INT32: 32}

both = pytest.mark.parametrize("autopilot", AUTOPILOTS)
either = pytest.mark.parametrize("stock", [False, True])


def single(value):
    return struct.unpack("<f", struct.pack("<f", value))[0]


@both
@either
def test_names_fit_the_wire_are_told_in_order_and_only_once(autopilot, stock):
    names = [parameter.name for parameter in table(autopilot, stock)]
    assert all(0 < len(name) <= 16 and name.isascii() for name in names)
    assert names == sorted(set(names))


@both
@either
def test_every_value_is_of_its_kind_and_may_be_set_to_itself(autopilot, stock):
    parameters = table(autopilot, stock)
    for parameter in parameters:
        assert parameter.kind in KINDS[autopilot]
        if parameter.kind == REAL32:
            assert parameter.value == single(parameter.value)
        else:
            assert parameter.value == int(parameter.value)
            assert abs(parameter.value) < 2 ** (BITS[parameter.kind] - 1)
        assert parameters.set(parameter.name, parameter.value), parameter.name
    assert parameters.changes == 0


@both
def test_a_place_in_the_list_and_a_name_lead_to_the_same(autopilot):
    parameters = table(autopilot)
    for place, parameter in enumerate(parameters):
        assert parameter.index == place
        assert parameters.at(place) == parameters.named(parameter.name) == parameter
        assert parameters.get(parameter.name) == parameter.value
    assert len(parameters) == place + 1


@both
@pytest.mark.parametrize("outside", [-1, 10_000])
def test_a_place_outside_the_list_is_an_error_that_says_what_there_is(autopilot, outside):
    with pytest.raises(IndexError, match=f"no parameter {outside}: they are 0 to"):
        table(autopilot).at(outside)


@pytest.mark.parametrize(
    ("name", "ours", "stock"),
    [
        ("COM_OF_LOSS_T", 0.5, 1.0),
        ("COM_OBL_RC_ACT", 4, 0),
        ("NAV_DLL_ACT", 3, 0),
        ("COM_FAIL_ACT_T", 5.0, 5.0),
        ("GUID_TIMEOUT", 0.5, 3.0),
        ("FS_GCS_ENABLE", 5, 0),
        ("FS_GCS_TIMEOUT", 5.0, 5.0),
    ],
)
def test_our_failsafes_protect_where_the_autopilots_own_do_not(name, ours, stock):
    autopilot = "px4" if name.startswith(("COM", "NAV")) else "ardupilot"
    assert table(autopilot).get(name) == ours
    assert table(autopilot, stock=True).get(name) == stock


@both
def test_stock_changes_failsafes_and_nothing_else(autopilot):
    ours, stock = table(autopilot), table(autopilot, stock=True)
    differ = {a.name for a, b in zip(ours, stock, strict=True) if a != b}
    assert (
        differ
        == {
            "px4": {"COM_OF_LOSS_T", "COM_OBL_RC_ACT", "NAV_DLL_ACT"},
            "ardupilot": {"GUID_TIMEOUT", "FS_GCS_ENABLE"},
        }[autopilot]
    )


@pytest.mark.parametrize(("autopilot", "name"), [("px4", "MAV_SYS_ID"), ("ardupilot", "SYSID_THISMAV")])
def test_a_vehicle_knows_its_own_number(autopilot, name):
    assert table(autopilot, system=6).get(name) == 6


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("COM_OF_LOSS_T", math.nan),
        ("COM_OF_LOSS_T", math.inf),
        ("COM_OF_LOSS_T", 1e300),
        ("COM_OF_LOSS_T", -0.1),
        ("COM_OF_LOSS_T", 60.1),
        ("COM_DL_LOSS_T", 4),
        ("COM_DL_LOSS_T", math.nan),
        ("COM_DL_LOSS_T", -math.inf),
        ("COM_OBL_RC_ACT", 6),
        ("NAV_DLL_ACT", 5),
        ("MAV_SYS_ID", 7),
        ("SYS_HITL", 1),
        ("NO_SUCH_THING", 1.0),
    ],
)
def test_what_this_vehicle_cannot_do_is_refused_and_nothing_changes(name, value):
    parameters = table("px4")
    before = list(parameters)
    assert not parameters.set(name, value)
    assert list(parameters) == before
    assert parameters.changes == 0


def test_codes_between_the_known_ones_are_refused():
    parameters = table("ardupilot")
    taken = [code for code in range(-1, 10) if parameters.set("FS_GCS_ENABLE", code)]
    assert taken == [0, 1, 5]


def test_a_value_is_kept_as_the_autopilot_keeps_it_and_its_bounds_are_inside():
    parameters = table("px4")
    assert parameters.set("COM_OF_LOSS_T", 0.1)
    assert parameters.get("COM_OF_LOSS_T") == single(0.1) != 0.1
    assert parameters.set("MPC_LAND_SPEED", 0.6), "the least, though 0.6 is no float32"
    assert parameters.changes == 2


def test_unknown_names_are_not_there():
    parameters = table("px4")
    assert "GUID_TIMEOUT" not in parameters
    assert parameters.named("GUID_TIMEOUT") is None
    with pytest.raises(KeyError):
        parameters.get("GUID_TIMEOUT")


numbers = st.floats() | st.integers(-(2**40), 2**40).map(float)


@given(data=st.data(), autopilot=st.sampled_from(AUTOPILOTS))
def test_whatever_is_set_the_value_in_force_is_possible(data, autopilot):
    parameters = table(autopilot)
    names = [parameter.name for parameter in parameters]
    for _ in range(5):
        name, value = data.draw(st.sampled_from([*names, "NONE"])), data.draw(numbers)
        before = list(parameters)
        agreed = parameters.set(name, value)
        after = list(parameters)
        changed = [a.name for a, b in zip(after, before, strict=True) if a != b]
        assert changed in ([], [name])
        if agreed:
            assert abs(parameters.get(name) - value) <= max(0.5, abs(value) * 2**-24)
        else:
            assert after == before
        rules(parameters)  # any table has rules


@given(value=st.integers(-(2**31), 2**31 - 1))
def test_a_whole_number_of_32_bits_is_kept_exactly(value):
    parameters = Parameters((Entry("X", INT32, 0, -(2**31), 2**31 - 1, 0),))
    assert parameters.set("X", value)
    assert parameters.get("X") == value


def test_our_px4_holds_half_a_second_after_the_last_set_point_and_lands_five_later():
    told = rules(table("px4"))
    assert (told.setpoint_silence_s, told.after_setpoints, told.action_delay_s) == (0.5, Action.LAND, 5.0)
    assert (told.station_silence_s, told.after_station) == (10.0, Action.LAND)
    assert (told.landed_disarm_s, told.idle_disarm_s, told.takeoff_height_m) == (2.0, 10.0, 2.5)
    assert (told.level_m_s, told.climb_m_s, told.descent_m_s) == (12.0, 3.0, 1.5)


def test_stock_px4_holds_after_a_second_then_returns_and_never_misses_its_ground_station():
    told = rules(table("px4", stock=True))
    assert (told.setpoint_silence_s, told.after_setpoints) == (1.0, Action.RETURN)
    assert (told.station_silence_s, told.after_station) == (math.inf, Action.NOTHING)


def test_our_arducopter_stops_after_half_a_second_and_lands_five_after_its_ground_station_fell_silent():
    told = rules(table("ardupilot"))
    assert (told.setpoint_silence_s, told.after_setpoints) == (0.5, Action.NOTHING)
    assert (told.station_silence_s, told.after_station, told.action_delay_s) == (5.0, Action.LAND, 0.0)
    assert (told.level_m_s, told.climb_m_s, told.descent_m_s, told.landing_slow_m_s) == (10.0, 2.5, 1.5, 0.5)
    assert (told.takeoff_height_m, told.slow_below_m, told.return_height_m) == (None, 10.0, 15.0)


def test_stock_arducopter_stops_after_three_seconds_and_never_misses_its_ground_station():
    told = rules(table("ardupilot", stock=True))
    assert (told.setpoint_silence_s, told.station_silence_s) == (3.0, math.inf)


def test_never_is_written_in_each_autopilots_own_way():
    px4, ardupilot = table("px4"), table("ardupilot")
    assert px4.set("COM_DISARM_LAND", -1.0)
    assert px4.set("COM_DISARM_PRFLT", -1.0)
    assert (rules(px4).landed_disarm_s, rules(px4).idle_disarm_s) == (math.inf, math.inf)
    assert ardupilot.set("DISARM_DELAY", 0)
    assert rules(ardupilot).idle_disarm_s == math.inf


@pytest.mark.parametrize(
    ("code", "action"),
    [
        (0, Action.RETURN),
        (1, Action.RETURN),
        (2, Action.RETURN),
        (3, Action.RETURN),
        (4, Action.LAND),
        (5, Action.HOLD),
    ],
)
def test_each_code_of_lost_set_points_is_an_action(code, action):
    px4 = table("px4")
    assert px4.set("COM_OBL_RC_ACT", code)
    assert rules(px4).after_setpoints is action


def test_the_gain_that_px4_names_is_the_one_with_which_a_place_is_held():
    assert table("px4").get("MPC_XY_P") == pytest.approx(HOLD_GAIN, rel=1e-6)
    assert not table("px4").set("MPC_XY_P", 0.5)
