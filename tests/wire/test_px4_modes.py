"""PX4's numbers: https://docs.px4.io/main/en/flight_modes/ and px4_custom_mode.h."""

import pytest

from wire.modes import PX4_MODES, Px4Mode, px4_mode_name

NUMBERS = [("offboard", 6, 0, 393216), ("takeoff", 4, 2, 33816576), ("hold", 4, 3, 50593792), ("land", 4, 6, 100925440)]


@pytest.mark.parametrize(("name", "main", "sub", "custom_mode"), NUMBERS)
def test_modes_have_the_numbers_that_px4_sends(name, main, sub, custom_mode):
    assert PX4_MODES[name] == Px4Mode(main, sub)
    assert PX4_MODES[name].custom_mode == custom_mode
    assert px4_mode_name(custom_mode) == name


def test_the_table_above_has_every_mode():
    assert set(PX4_MODES) == {name for name, *_ in NUMBERS}


def test_a_mode_we_have_no_name_for_is_told_by_its_numbers():
    assert px4_mode_name(3 << 16) == "mode 3.0"  # POSCTL
    assert px4_mode_name(4 << 16 | 5 << 24) == "mode 4.5"  # AUTO.RTL
    assert px4_mode_name(0) == "mode 0.0"
