"""What is known of the fleet: a fold of frames."""

import struct
from copy import deepcopy
from dataclasses import fields, replace
from math import inf, nan

import numpy as np
import pymap3d
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs.telemetry import REBOOTED_MS, UNTOLD_NS, Swarm, observe
from wire import parameters
from wire.frames import Framer, Sender
from wire.ids import AUTOPILOT, TRUTH
from wire.modes import ARDUPILOT, PX4
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
        said(dialect.MAVLink_home_position_message(0, 0, 318500, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0)),
        said(gps(h_acc=1400)),
        said(dialect.MAVLink_ekf_status_report_message(0x33F, 0, 0, 0, 0, 0)),
        said(dialect.MAVLink_command_ack_message(400, 4, target_system=255, target_component=190)),
    ]


def gps(*, h_acc, fix=3):
    """GPS_RAW_INT that claims this accuracy [mm]."""
    return dialect.MAVLink_gps_raw_int_message(0, fix, 0, 0, 0, 0, 0, 0, 0, 9, h_acc=h_acc)


def parameter(name, value, kind=9):
    return dialect.MAVLink_param_value_message(name.encode(), value, kind, 900, 17)


def beat(autopilot):
    return said(dialect.MAVLink_heartbeat_message(2, autopilot, 1, 0, 3, 3))


def test_of_a_fleet_never_heard_nothing_is_known():
    assert np.isnan(FLEET.position_ned).all()
    assert np.isnan(FLEET.origin).all()
    assert not (FLEET.armed | FLEET.ready).any()
    assert not FLEET.fresh(NOW, within_ns=10**18).any()


def test_every_message_tells_its_vehicle_and_nobody_else():
    swarm = observe(FLEET, messages())
    assert swarm.position_ned[1].tolist() == [1, 2, -12]  # home is 2 m lower than the origin
    assert swarm.velocity_ned[1].tolist() == [0.5, 0.25, 0]
    assert swarm.boot_ms[1] == 1000
    assert swarm.position_ns[1] == swarm.heartbeat_ns[1] == NOW
    assert swarm.custom_mode[1] == 393216
    assert swarm.battery[1] == 0.85
    assert swarm.origin[1] == pytest.approx([41.1512, -81.4161, 320.5])
    assert swarm.attitude_rpy[1] == pytest.approx([0.1, -0.2, 0.3])
    assert (swarm.armed[1], swarm.ready[1]) == (True, True)
    assert swarm.words == ((2, 6, "hello"),)
    assert (swarm.home_m[1], swarm.home_down[1], swarm.accuracy_m[1]) == (318.5, 2.0, 1.4)
    assert (swarm.landed_state[1], swarm.estimator[1]) == (2, 0x33F)
    assert [answer.words for answer in swarm.answers] == ["vehicle 2: arming or disarming failed"]
    others = [0, 2]
    for field in fields(Swarm):
        before, after = getattr(FLEET, field.name), getattr(swarm, field.name)
        if isinstance(before, np.ndarray):
            assert np.array_equal(before[others], after[others], equal_nan=before.dtype.kind == "f")


def test_no_frames_change_nothing_but_words_and_answers():
    told = observe(FLEET, messages())
    silent = observe(told, [])
    assert (silent.words, silent.answers) == ((), ())
    assert same(observe(silent, []), silent)


def test_a_swarm_that_went_in_comes_out_of_nothing_changed():
    before = observe(FLEET, [position(boot_ms=500)])
    copies = deepcopy(before)
    observe(before, messages())
    assert same(before, copies)


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


def told_at(*boot_ms):
    """The vehicle after reports of these times of its own clock, each from a place as far north as its time [m]."""
    return observe(FLEET, [position(boot_ms=at, place=(float(at), 0.0, 0.0)) for at in boot_ms])


@pytest.mark.parametrize("late_ms", [REBOOTED_MS, 4900])
def test_a_vehicle_that_booted_again_is_believed_when_its_new_clock_goes_on(late_ms):
    late = 5000 - late_ms
    assert told_at(5000, late).boot_ms[1] == 5000
    assert told_at(5000, late, late + 50).position_ned[1, 0] == late + 50
    assert told_at(5000, late, late + 50).boot_ms[1] == late + 50
    assert told_at(9000, late + 2000, late, late + 50).boot_ms[1] == late + 50


@pytest.mark.parametrize(
    "boot_ms",
    [
        (5000, 2000),
        (5000, 2000, 2000),
        (5000, 2050, 2000),
        (5000, 2000, 5000 - 50, 2050),
        (9000, 1000, 1000 + REBOOTED_MS),
    ],
    ids=["late", "played again", "in the wrong order", "beside the others", "far apart"],
)
def test_reports_that_are_merely_late_or_played_again_are_no_reboot(boot_ms):
    swarm = told_at(*boot_ms)
    assert (swarm.boot_ms[1], swarm.position_ned[1, 0]) == (boot_ms[0],) * 2


def test_a_report_of_the_old_clock_ends_the_doubt():
    assert told_at(5000, 2000, 5050, 2050).boot_ms[1] == 5050


def test_the_interval_is_that_of_the_last_second_by_the_vehicles_own_clock():
    assert np.isnan(told_at(1000).interval_s[1])
    assert told_at(1000, 2000).interval_s[1] == 1.0
    often = told_at(1000, *range(2000, 5000, 50))
    assert often.interval_s[1] == pytest.approx(0.05 + 0.95 * 0.95**59)
    assert told_at(1000, 2000, *range(2050, 4000, 50), 6000).interval_s[1] > 1.9


@pytest.mark.parametrize("boot_ms", [(1000, 1100), (1000, 1100, 1100), (1000, 1100, 1050)])
def test_reports_that_are_dropped_make_no_stream_denser(boot_ms):
    assert told_at(*boot_ms).interval_s[1] == pytest.approx(0.1)


def test_the_first_position_counts_whatever_its_clock_says():
    assert observe(FLEET, [position(boot_ms=0)]).boot_ms[1] == 0


@given(st.permutations(range(8)))
def test_in_whatever_order_positions_arrive_the_newest_stands(order):
    arriving = [position(boot_ms=1000 + 50 * k, place=(float(k), 0.0, 0.0)) for k in order]
    assert observe(FLEET, arriving).position_ned[1, 0] == 7


@given(st.permutations(range(len(messages()))), st.integers(0, len(messages())))
def test_frames_may_come_in_one_tick_or_in_two(order, split):
    heard = [messages()[k] for k in order]
    at_once, in_two = observe(FLEET, heard), observe(observe(FLEET, heard[:split]), heard[split:])
    assert same(replace(at_once, words=(), answers=()), replace(in_two, words=(), answers=()))


# --- what is no number


@pytest.mark.parametrize("value", [nan, inf, -inf, 3e38, -1.1e5])
@pytest.mark.parametrize("axis", range(6))
def test_a_position_or_velocity_that_no_vehicle_has_is_refused_and_counted(value, axis):
    numbers = [1.0] * 6
    numbers[axis] = value
    known = observe(FLEET, [position(boot_ms=100)])
    swarm = observe(known, [position(boot_ms=200, place=numbers[:3], velocity=numbers[3:])] * 2)
    assert swarm.impossible == known.impossible + 2
    assert swarm.position_ned[1].tolist() == [1, 2, -10]
    assert (swarm.boot_ms[1], swarm.position_ns[1]) == (100, NOW)


@pytest.mark.parametrize(("speed", "refused"), [(100.0, 0), (-100.0, 0), (100.1, 1), (-100.1, 1)])
def test_a_hundred_metres_a_second_is_the_fastest_that_is_believed(speed, refused):
    assert observe(FLEET, [position(boot_ms=100, velocity=(0.0, speed, 0.0))]).impossible == refused


def test_refusals_are_counted_over_the_whole_flight():
    swarm = FLEET
    for tick in range(5):
        swarm = observe(swarm, [position(boot_ms=tick, place=(nan, 0.0, 0.0))])
    assert swarm.impossible == 5


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


# --- height


def home(altitude_mm):
    return said(dialect.MAVLink_home_position_message(0, 0, altitude_mm, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0))


def origin(altitude_mm):
    return said(dialect.MAVLink_gps_global_origin_message(0, 0, altitude_mm))


@pytest.mark.parametrize("order", [(0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)])
def test_height_counts_from_home_wherever_the_origin_is_and_whatever_is_told_first(order):
    heard = [position(place=(1.0, 2.0, -10.0)), origin(320_000), home(325_000)]
    one_by_one = FLEET
    for k in order:
        one_by_one = observe(one_by_one, [heard[k]])
    assert one_by_one.position_ned[1].tolist() == [1, 2, -5]


def test_home_moved_at_arming_moves_the_height_with_it():
    known = observe(FLEET, [position(place=(1.0, 2.0, -10.0)), origin(320_000), home(320_000)])
    assert known.position_ned[1, 2] == -10
    assert observe(known, [home(319_000)]).position_ned[1, 2] == -11


# --- an origin that nobody tells


LATER = NOW + UNTOLD_NS


def place(latitude, longitude, altitude, boot_ms, *, time_ns=LATER):
    scaled = round(latitude * 1e7), round(longitude * 1e7), round(altitude * 1e3)
    return said(dialect.MAVLink_global_position_int_message(boot_ms, *scaled, 0, 0, 0, 0, 0), time_ns=time_ns)


@pytest.mark.parametrize("late_ms", [-250, 0, 100, 250])
def test_an_origin_that_is_not_told_follows_from_two_reports_of_one_moment(late_ms):
    north, east, down = -40.0, 30.0, -10.0
    moved = late_ms / 1e3 * np.array([2.0, -1.0, 0.0])
    there = pymap3d.ned2geodetic(*(moved + np.array([north, east, down])), 41.1512, -81.4161, 320.5)
    at = position(boot_ms=5000, place=(north, east, down), velocity=(2.0, -1.0, 0.0))
    swarm = observe(FLEET, [beat(ARDUPILOT), at, place(*there, 5000 + late_ms)])
    back = pymap3d.geodetic2ned(*swarm.origin[1], 41.1512, -81.4161, 320.5)
    assert back == pytest.approx((0, 0, 0), abs=0.02)  # 1e-7 degrees are 1 cm


@pytest.mark.parametrize("late_ms", [-251, 251, 10_000])
def test_reports_of_different_moments_tell_nothing_of_the_origin(late_ms):
    heard = [beat(ARDUPILOT), position(boot_ms=20_000), place(41.0, -81.0, 320.0, 20_000 + late_ms)]
    assert np.isnan(observe(FLEET, heard).origin).all()


@pytest.mark.parametrize(
    "heard",
    [
        [beat(ARDUPILOT), place(41.0, -81.0, 320.0, 1000)],
        [position(), place(41.0, -81.0, 320.0, 1000)],
        [beat(ARDUPILOT), position(), place(41.0, -81.0, 320.0, 1000, time_ns=LATER - 1)],
    ],
    ids=["without a local position", "before the first heartbeat", "while it may still be told"],
)
def test_nor_does_a_place_alone_or_one_that_comes_too_early(heard):
    assert np.isnan(observe(FLEET, heard).origin).all()


def test_an_origin_that_is_told_stands():
    known, told, derived = [beat(ARDUPILOT), position()], origin(320_500), place(41.0, -81.0, 300.0, 1000)
    for heard in ([told, derived], [derived, told]):
        assert observe(FLEET, known + heard).origin[1].tolist() == [0, 0, 320.5]


# --- accuracy


@pytest.mark.parametrize(("h_acc", "fix", "accuracy_m"), [(900, 3, 0.9), (12, 6, 0.012), (0, 3, inf), (900, 2, inf)])
def test_accuracy_is_what_a_receiver_with_a_fix_claims_and_infinite_where_it_claims_none(h_acc, fix, accuracy_m):
    assert observe(FLEET, [said(gps(h_acc=h_acc, fix=fix))]).accuracy_m[1] == pytest.approx(accuracy_m)


# --- parameters


@pytest.mark.parametrize("autopilot", [PX4, ARDUPILOT])
@pytest.mark.parametrize(("kind", "value"), [(9, 0.5), (9, 3.0), (6, 4), (2, 5), (4, 255), (6, -1)])
def test_a_parameter_is_read_as_its_autopilot_writes_it(autopilot, kind, value):
    name = {PX4: "NAV_DLL_ACT", ARDUPILOT: "FS_GCS_ENABLE"}[autopilot]
    told = said(parameter(name, *struct.unpack("<f", parameters.encode(value, kind, autopilot)), kind))
    swarm = observe(FLEET, [beat(autopilot), told])
    assert swarm.parameters == ({}, {name: value}, {})


def test_parameters_add_up_and_the_newest_value_stands():
    first = observe(FLEET, [beat(ARDUPILOT), said(parameter("GUID_TIMEOUT", 3.0))])
    later = observe(first, [said(parameter("FS_GCS_TIMEOUT", 5.0)), said(parameter("GUID_TIMEOUT", 0.5))])
    assert first.parameters[1] == {"GUID_TIMEOUT": 3.0}
    assert later.parameters[1] == {"GUID_TIMEOUT": 0.5, "FS_GCS_TIMEOUT": 5.0}


@pytest.mark.parametrize(
    "heard",
    [
        [beat(ARDUPILOT), said(parameter("RTL_ALT", 1500.0))],
        [beat(PX4), said(parameter("GUID_TIMEOUT", 3.0))],
        [said(parameter("GUID_TIMEOUT", 3.0))],
        [beat(ARDUPILOT), said(parameter("GUID_TIMEOUT", nan))],
        [beat(ARDUPILOT), said(parameter("GUID_TIMEOUT", inf))],
    ],
    ids=["nobody asked", "another autopilot's", "before the first heartbeat", "no number", "infinite"],
)
def test_parameters_on_which_no_flight_depends_are_not_kept(heard):
    assert observe(FLEET, heard).parameters == ({}, {}, {})


# --- answers and words


@pytest.mark.parametrize(("system", "component"), [(254, 190), (255, 1), (1, 0)])
def test_answers_to_somebody_else_are_not_ours(system, component):
    ack = dialect.MAVLink_command_ack_message(400, 0, target_system=system, target_component=component)
    assert observe(FLEET, [said(ack)]).answers == ()


@pytest.mark.parametrize(
    ("result", "refused"), [(0, False), (5, False), (1, True), (2, True), (3, True), (4, True), (99, True)]
)
def test_an_answer_says_who_took_what_and_how(result, refused):
    (answer,) = observe(FLEET, [said(dialect.MAVLink_command_ack_message(22, result))]).answers
    assert (answer.system, answer.command, answer.result) == (2, 22, result)
    assert answer.refused is refused
    assert answer.words.startswith("vehicle 2: taking off ")


@pytest.mark.parametrize("command", [511, 512])
def test_a_message_that_a_vehicle_does_not_have_is_no_refusal(command):
    (answer,) = observe(FLEET, [said(dialect.MAVLink_command_ack_message(command, 2))]).answers
    assert not answer.refused


def chunks(text, *, text_id=7, severity=4):
    pieces = [text[at : at + 50] for at in range(0, len(text) + 1, 50)]
    return [
        said(dialect.MAVLink_statustext_message(severity, piece.encode(), id=text_id, chunk_seq=k))
        for k, piece in enumerate(pieces)
    ]


@pytest.mark.parametrize("length", [0, 1, 49, 50, 51, 99, 100, 101, 250])
@pytest.mark.parametrize("split", [0, 1, 2])
def test_a_text_in_pieces_is_told_when_it_is_complete(length, split):
    text = ("PreArm: needs a better fix. " * 20)[:length]
    heard = chunks(text)
    begun = observe(FLEET, heard[:split])
    done = observe(begun, heard[split:])
    assert begun.words + done.words == ((2, 4, text),)
    assert done.pieces == (None, None, None)


@pytest.mark.parametrize("text_id", [0, 3])
def test_what_a_terminal_would_obey_is_not_handed_on(text_id):
    text = b"a\x1b[2Jb\r\nc\x9bd\x07e" + 20 * b"\xff"
    (words,) = observe(FLEET, [said(dialect.MAVLink_statustext_message(4, text, id=text_id))]).words
    assert words == (2, 4, "a�[2Jb��c�d�e" + 20 * "�")


def test_where_a_piece_was_lost_the_text_says_so():
    first, _, last = chunks("a" * 50 + "b" * 50 + "c")
    assert observe(FLEET, [first, last]).words == ((2, 4, "a" * 50 + "…"), (2, 4, "…c"))


def test_a_text_that_never_ends_is_told_in_the_end():
    swarm = FLEET
    told = []
    for seq in range(100):
        swarm = observe(swarm, [said(dialect.MAVLink_statustext_message(4, b"x" * 50, id=9, chunk_seq=seq))])
        told += swarm.words
    assert told
    assert max(len(text) for _, _, text in told) <= 401
