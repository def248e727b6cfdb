"""What is known of the fleet: a fold of frames."""

from dataclasses import fields
from math import inf, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs.telemetry import REBOOTED_MS, Swarm, observe
from wire.frames import Framer, Sender
from wire.ids import AUTOPILOT, TRUTH
from wire.payloads import LOCAL_POSITION_NED, LocalPosition, pack_local_position

NOW = 1_577_836_800_000_000_000
FLEET = Swarm.of((1, 2, 3))


def frame(packed, time_ns=NOW):
    (only,) = Framer().frames(time_ns, packed)
    return only


def position(
    system=2, boot_ms=1000, *, place=(1.0, 2.0, -10.0), velocity=(0.5, 0.25, 0.0), component=AUTOPILOT, time_ns=NOW
):
    payload = pack_local_position(LocalPosition(boot_ms, *place, *velocity))
    return frame(Sender(system, component).frame(LOCAL_POSITION_NED, payload), time_ns)


def said(message, system=2, component=AUTOPILOT, time_ns=NOW):
    return frame(Sender(system, component).pack(message), time_ns)


def same(one, other):
    """Whether two swarms know exactly the same."""
    return all(
        np.array_equal(a, b, equal_nan=a.dtype.kind == "f") if isinstance(a, np.ndarray) else a == b
        for a, b in ((getattr(one, field.name), getattr(other, field.name)) for field in fields(Swarm))
    )


def messages():
    """One of each message that is read, to vehicle 2."""
    return [
        position(),
        said(dialect.MAVLink_heartbeat_message(2, 12, dialect.MAV_MODE_FLAG_SAFETY_ARMED, 393216, 4, 3)),
        said(dialect.MAVLink_sys_status_message(0, 0, dialect.MAV_SYS_STATUS_PREARM_CHECK, 0, 0, 0, 85, *[0] * 6)),
        said(dialect.MAVLink_extended_sys_state_message(0, dialect.MAV_LANDED_STATE_IN_AIR)),
        said(dialect.MAVLink_gps_global_origin_message(411512000, -814161000, 320500)),
        said(dialect.MAVLink_attitude_message(1000, 0.1, -0.2, 0.3, 0, 0, 0)),
        said(dialect.MAVLink_statustext_message(6, b"hello")),
    ]


def test_of_a_fleet_never_heard_nothing_is_known():
    assert np.isnan(FLEET.position_ned).all()
    assert np.isnan(FLEET.origin).all()
    assert not (FLEET.armed | FLEET.ready).any()
    assert not FLEET.fresh(NOW, within_ns=10**18).any()


def test_every_message_tells_its_vehicle_and_nobody_else():
    swarm = observe(FLEET, messages())
    assert swarm.position_ned[1].tolist() == [1, 2, -10]
    assert swarm.velocity_ned[1].tolist() == [0.5, 0.25, 0]
    assert swarm.boot_ms[1] == 1000
    assert swarm.position_ns[1] == swarm.heartbeat_ns[1] == NOW
    assert swarm.custom_mode[1] == 393216
    assert swarm.battery[1] == 0.85
    assert swarm.origin[1] == pytest.approx([41.1512, -81.4161, 320.5])
    assert swarm.attitude_rpy[1] == pytest.approx([0.1, -0.2, 0.3])
    assert (swarm.armed[1], swarm.ready[1]) == (True, True)
    assert swarm.words == ((2, 6, "hello"),)
    others = [0, 2]
    for field in fields(Swarm):
        before, after = getattr(FLEET, field.name), getattr(swarm, field.name)
        if isinstance(before, np.ndarray):
            assert np.array_equal(before[others], after[others], equal_nan=before.dtype.kind == "f")


def test_no_frames_change_nothing_but_the_words():
    told = observe(FLEET, messages())
    silent = observe(told, [])
    assert silent.words == ()
    assert same(observe(silent, []), silent)


def test_a_swarm_that_went_in_comes_out_of_nothing_changed():
    before = observe(FLEET, [position(boot_ms=500)])
    copies = {field.name: np.copy(getattr(before, field.name)) for field in fields(Swarm)}
    observe(before, messages())
    for name, copy in copies.items():
        assert np.array_equal(getattr(before, name), copy, equal_nan=copy.dtype.kind == "f")


@pytest.mark.parametrize("component", [TRUTH, 0, 100, 191])
def test_components_other_than_the_autopilot_tell_nothing(component):
    heard = [entry._replace(component=component) for entry in messages()]
    assert same(observe(FLEET, heard), FLEET)


@pytest.mark.parametrize("system", [0, 4, 255])
def test_strangers_tell_nothing(system):
    heard = [entry._replace(system=system) for entry in messages()]
    assert same(observe(FLEET, heard), FLEET)


def test_rows_follow_the_ids_and_not_their_numbers():
    swarm = observe(Swarm.of((30, 10)), [position(10, place=(7.0, 0.0, 0.0))])
    assert swarm.position_ned[1, 0] == 7
    assert np.isnan(swarm.position_ned[0]).all()


# --- order


@pytest.mark.parametrize("late_ms", [0, 1, 50, REBOOTED_MS - 1])
def test_a_position_that_was_overtaken_on_the_way_is_dropped(late_ms):
    swarm = observe(FLEET, [position(boot_ms=5000), position(boot_ms=5000 - late_ms, place=(9.0, 9.0, 9.0))])
    assert same(swarm, observe(FLEET, [position(boot_ms=5000)]))


@pytest.mark.parametrize("late_ms", [REBOOTED_MS, 4999])
def test_a_vehicle_that_booted_again_is_believed(late_ms):
    swarm = observe(FLEET, [position(boot_ms=5000), position(boot_ms=5000 - late_ms, place=(9.0, 9.0, 9.0))])
    assert swarm.position_ned[1].tolist() == [9, 9, 9]
    assert swarm.boot_ms[1] == 5000 - late_ms


def test_the_first_position_counts_whatever_its_clock_says():
    assert observe(FLEET, [position(boot_ms=0)]).boot_ms[1] == 0


@given(st.permutations(range(8)))
def test_in_whatever_order_positions_arrive_the_newest_stands(order):
    arriving = [position(boot_ms=1000 + 50 * k, place=(float(k), 0.0, 0.0)) for k in order]
    assert observe(FLEET, arriving).position_ned[1, 0] == 7


@given(st.permutations(range(7)), st.integers(0, 7))
def test_frames_may_come_in_one_tick_or_in_two(order, split):
    heard = [messages()[k] for k in order]
    at_once, in_two = observe(FLEET, heard), observe(observe(FLEET, heard[:split]), heard[split:])
    for field in fields(Swarm):
        if field.name != "words":
            assert np.array_equal(
                getattr(at_once, field.name),
                getattr(in_two, field.name),
                equal_nan=field.name in ("position_ned", "velocity_ned", "origin", "attitude_rpy", "battery"),
            )


# --- what is no number


@pytest.mark.parametrize("value", [nan, inf, -inf])
@pytest.mark.parametrize("axis", range(6))
def test_a_position_or_velocity_that_is_no_number_is_refused_and_counted(value, axis):
    numbers = [1.0] * 6
    numbers[axis] = value
    known = observe(FLEET, [position(boot_ms=100)])
    swarm = observe(known, [position(boot_ms=200, place=numbers[:3], velocity=numbers[3:])] * 2)
    assert swarm.not_finite == known.not_finite + 2
    assert swarm.position_ned[1].tolist() == [1, 2, -10]
    assert (swarm.boot_ms[1], swarm.position_ns[1]) == (100, NOW)


def test_refusals_are_counted_over_the_whole_flight():
    swarm = FLEET
    for tick in range(5):
        swarm = observe(swarm, [position(boot_ms=tick, place=(nan, 0.0, 0.0))])
    assert swarm.not_finite == 5


def test_a_battery_that_is_not_measured_stays_unknown():
    unknown = said(dialect.MAVLink_sys_status_message(0, 0, 0, 0, 0, 0, -1, *[0] * 6))
    assert np.isnan(observe(FLEET, [unknown]).battery).all()
    assert not observe(observe(FLEET, messages()), [unknown]).ready[1]


@given(st.lists(st.tuples(st.sampled_from(sorted(dialect.mavlink_map)), st.binary(max_size=64)), max_size=5))
def test_payloads_of_any_content_raise_nothing(pieces):
    sender = Sender(2, AUTOPILOT)
    heard = [frame(sender.frame(number, payload)) for number, payload in pieces]
    assert observe(FLEET, heard).ids == FLEET.ids


# --- age


@pytest.mark.parametrize(("age_ns", "fresh"), [(0, True), (300, True), (301, False)])
def test_positions_are_fresh_up_to_an_age(age_ns, fresh):
    swarm = observe(FLEET, [position()])
    assert swarm.fresh(NOW + age_ns, within_ns=300).tolist() == [False, fresh, False]


def test_a_position_that_was_dropped_makes_nobody_fresher():
    swarm = observe(FLEET, [position(boot_ms=5000), position(boot_ms=4990, time_ns=NOW + 10**9)])
    assert swarm.position_ns[1] == NOW
