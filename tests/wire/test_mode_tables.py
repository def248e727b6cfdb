"""The autopilots' numbers: px4_custom_mode.h, and ArduCopter's mode.h."""

import pytest
from pymavlink import mavutil

from wire.modes import ARDUCOPTER_MODES, ARDUPILOT, PX4, PX4_MODES, Px4Mode, mode_name

PX4_NUMBERS = [
    ("manual", 1, 0, 0x00010000),
    ("altitude", 2, 0, 0x00020000),
    ("position", 3, 0, 0x00030000),
    ("takeoff", 4, 2, 33816576),
    ("hold", 4, 3, 50593792),
    ("mission", 4, 4, 67371008),
    ("return", 4, 5, 84148224),
    ("land", 4, 6, 100925440),
    ("offboard", 6, 0, 393216),
]
ARDUCOPTER_NAMES = {
    "STABILIZE": "stabilize", "ALT_HOLD": "altitude hold", "AUTO": "auto", "GUIDED": "guided", "LOITER": "loiter",
    "RTL": "return", "LAND": "land", "POSHOLD": "position hold", "BRAKE": "brake",
}  # fmt: skip


@pytest.mark.parametrize(("name", "main", "sub", "custom_mode"), PX4_NUMBERS)
def test_modes_have_the_numbers_that_px4_sends(name, main, sub, custom_mode):
    assert PX4_MODES[name] == Px4Mode(main, sub)
    assert PX4_MODES[name].custom_mode == custom_mode
    assert mode_name(PX4, custom_mode) == name


def test_the_table_above_has_every_mode():
    assert set(PX4_MODES) == {name for name, *_ in PX4_NUMBERS}


def test_modes_have_the_numbers_that_pymavlink_has_for_arducopter():
    theirs = {name: number for number, name in mavutil.mode_mapping_acm.items()}
    assert {name: theirs[code] for code, name in ARDUCOPTER_NAMES.items()} == ARDUCOPTER_MODES


def test_a_mode_we_have_no_name_for_is_told_by_its_numbers():
    assert mode_name(PX4, 4 << 16 | 9 << 24) == "mode 4.9"
    assert mode_name(PX4, 0) == "mode 0.0"
    assert mode_name(ARDUPILOT, 21) == "mode 21"
    assert mode_name(0, 4) == "mode 4"
