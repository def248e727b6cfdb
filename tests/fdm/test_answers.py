"""Answers to messages that are no command, read by pymavlink."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from fdm.answers import GROUPS, Answers
from fdm.parameter_service import LIST_PERIOD_S, LISTING, NO_INDEX
from fdm.parameter_tables import INT8, INT16, INT32, REAL32, Entry
from fdm.parameters import Parameters, table
from fdm.streams import Schedule
from wire.frames import Framer, Sender

PX4, ARDUPILOT = 12, 3
HZ = 250
NAMES = {PX4: "px4", ARDUPILOT: "ardupilot"}
both = pytest.mark.parametrize("autopilot", [PX4, ARDUPILOT])


class Client:
    """A ground station beside one vehicle's answers."""

    def __init__(self, autopilot, *, parameters=None, system=1):
        self.parameters = parameters or table(NAMES[autopilot], system=system)
        self.schedule = Schedule(HZ)
        self.answers = Answers(Sender(system, 1), self.parameters, self.schedule, autopilot=autopilot, physics_hz=HZ)
        self.mav = dialect.MAVLink(None, srcSystem=255, srcComponent=190)

    def ask(self, message, step=1000):
        """What comes back at once, by pymavlink."""
        return self.send(bytes(message.pack(self.mav)), step)

    def send(self, datagram, step=1000):
        (frame,) = Framer().frames(0, datagram)
        return [read(answer) for answer in self.answers.answer(frame, step=step)]

    def listed(self, first, last):
        """(step, PARAM_VALUE) of the list between two steps."""
        heard = []
        for step in range(first + 1, last + 1):
            for key in self.schedule.take_due(step):
                assert key == LISTING
                heard += [(step, read(frame)) for frame in self.answers.parameters.next_listed(step=step)]
        return heard

    def read(self, *, name=b"", index=-1, system=1, component=1):
        return self.ask(dialect.MAVLink_param_request_read_message(system, component, name, index))

    def set(self, name, value, kind, *, system=1, component=1):
        return self.ask(dialect.MAVLink_param_set_message(system, component, name, value, kind))


def read(frame):
    (message,) = dialect.MAVLink(None).parse_buffer(frame)
    return message


def bits(number):
    """The float whose bits a whole number has."""
    return struct.unpack("<f", struct.pack("<i", number))[0]


@both
def test_by_name_comes_the_value_of_that_name(autopilot):
    name = "MAV_SYS_ID" if autopilot == PX4 else "SYSID_THISMAV"
    (told,) = Client(autopilot, system=3).read(name=name.encode(), system=3)
    assert (told.param_id, told.get_srcSystem(), told.get_srcComponent()) == (name, 3, 1)
    if autopilot == PX4:
        assert (told.param_type, struct.pack("<f", told.param_value)) == (INT32, struct.pack("<i", 3))
    else:
        assert (told.param_type, told.param_value) == (INT16, 3.0)


def test_px4_adds_the_index_and_arducopter_only_where_it_was_asked_by_index():
    px4, ardupilot = Client(PX4), Client(ARDUPILOT)
    (told,) = px4.read(name=b"COM_OF_LOSS_T")
    assert px4.parameters.at(told.param_index).name == "COM_OF_LOSS_T"
    (told,) = ardupilot.read(name=b"GUID_TIMEOUT")
    assert told.param_index == NO_INDEX
    (told,) = ardupilot.read(index=4)
    assert (told.param_index, told.param_id) == (4, ardupilot.parameters.at(4).name)


@both
def test_what_does_not_exist_is_not_answered(autopilot):
    client = Client(autopilot)
    assert client.read(name=b"NO_SUCH_NAME") == []
    assert client.read(index=len(client.parameters)) == []
    assert client.read(index=32767) == []
    assert client.set(b"NO_SUCH_NAME", 1.0, REAL32) == []


@both
@pytest.mark.parametrize(("system", "component"), [(2, 1), (1, 200), (7, 0)])
def test_a_question_to_somebody_else_is_not_ours(autopilot, system, component):
    client = Client(autopilot)
    assert client.read(index=0, system=system, component=component) == []
    before = list(client.parameters)
    name = b"COM_OF_LOSS_T" if autopilot == PX4 else b"GUID_TIMEOUT"
    assert client.set(name, 2.0, REAL32, system=system, component=component) == []
    assert list(client.parameters) == before
    client.ask(dialect.MAVLink_param_request_list_message(system, component))
    client.ask(dialect.MAVLink_request_data_stream_message(system, component, 0, 4, 1))
    assert client.schedule.take_due(10**6) == []
    assert client.ask(dialect.MAVLink_mission_request_list_message(system, component, 0)) == []


@both
@pytest.mark.parametrize(("system", "component"), [(0, 0), (1, 0), (0, 1)])
def test_a_question_to_all_is_ours(autopilot, system, component):
    assert len(Client(autopilot).read(index=0, system=system, component=component)) == 1


@both
def test_set_answers_with_the_value_in_force_and_a_refused_one_with_the_old(autopilot):
    client = Client(autopilot)
    name = b"COM_OF_LOSS_T" if autopilot == PX4 else b"GUID_TIMEOUT"
    for asked, in_force in [(1.5, 1.5), (-3.0, 1.5), (math.nan, 1.5), (1e30, 1.5), (0.25, 0.25)]:
        (told,) = client.set(name, asked, REAL32)
        assert (told.param_id.encode(), told.param_value) == (name, in_force)
        assert client.parameters.get(name.decode()) == in_force


def test_px4_refuses_a_value_of_another_type_and_arducopter_does_not_look_at_it():
    px4, ardupilot = Client(PX4), Client(ARDUPILOT)
    (told,) = px4.set(b"NAV_DLL_ACT", 1.0, REAL32)
    assert struct.pack("<f", told.param_value) == struct.pack("<i", 3)
    (told,) = px4.set(b"COM_OF_LOSS_T", 2.0, INT32)
    assert told.param_value == 0.5
    (told,) = px4.set(b"NAV_DLL_ACT", bits(1), INT32)
    assert struct.pack("<f", told.param_value) == struct.pack("<i", 1)
    (told,) = ardupilot.set(b"FS_GCS_ENABLE", 1.0, REAL32)
    assert (told.param_value, told.param_type) == (1.0, INT8)


@pytest.mark.parametrize(("asked", "kept"), [(59.9, 59), (60.0, 60), (59.995, 60), (61.5, 61)])
def test_arducopter_cuts_what_is_behind_the_point_of_a_whole_number(asked, kept):
    (told,) = Client(ARDUPILOT).set(b"LAND_SPEED", asked, INT16)
    assert told.param_value == kept


def test_a_name_that_fills_its_field_has_no_end_and_is_found():
    client = Client(PX4)
    name = b"COM_DISARM_PRFLT"
    assert len(name) == 16
    (told,) = client.read(name=name)
    assert (told.param_id, told.param_value) == (name.decode(), 10.0)


LIMITS = {INT8: 2**7, INT16: 2**15, INT32: 2**31}
whole = st.sampled_from([INT8, INT16, INT32]).flatmap(
    lambda kind: st.tuples(st.just(kind), st.integers(-LIMITS[kind], LIMITS[kind] - 1))
)
real = st.tuples(st.just(REAL32), st.floats(width=32, allow_nan=False, allow_infinity=False))


def one(kind):
    """A list of one parameter that may be anything."""
    limit = LIMITS.get(kind, 3.5e38)
    low, high = (-limit, limit - 1) if kind in LIMITS else (-3.4028234663852886e38, 3.4028234663852886e38)
    return Parameters((Entry("ANY", kind, 0.0, low, high, 0.0),))


@given(number=st.integers(-(2**31), 2**31 - 1) | st.integers(0x7F800000, 0x7FFFFFFF) | st.integers(-0x7FFFFF, -1))
def test_px4_keeps_every_bit_of_a_whole_number_even_where_they_look_like_no_float(number):
    client = Client(PX4, parameters=one(INT32))
    payload = struct.pack("<iBB16sB", number, 1, 1, b"ANY", INT32)
    (frame,) = Framer().frames(0, Sender(255, 190).frame(dialect.MAVLINK_MSG_ID_PARAM_SET, payload))
    (answer,) = client.answers.answer(frame, step=1)
    (told,) = Framer().frames(0, answer)
    assert struct.unpack_from("<i", told.payload.ljust(25, b"\0")) == (number,)
    assert client.parameters.get("ANY") == number


@given(value=real | whole.filter(lambda pair: pair[0] == INT32))
def test_px4_gives_back_what_was_set_whatever_its_type(value):
    kind, number = value
    client = Client(PX4, parameters=one(kind))
    datagram = Sender(255, 190).frame(
        dialect.MAVLINK_MSG_ID_PARAM_SET,
        struct.pack("<i" if kind == INT32 else "<f", number) + struct.pack("<BB16sB", 1, 1, b"ANY", kind),
    )
    (told,) = client.send(datagram)
    assert (told.param_id, told.param_type) == ("ANY", kind)
    assert client.parameters.get("ANY") == number


@given(value=real | whole)
def test_arducopter_gives_back_what_was_set_as_nearly_as_a_float_can_say_it(value):
    kind, number = value
    client = Client(ARDUPILOT, parameters=one(kind))
    (told,) = client.set(b"ANY", number, kind)
    if kind != REAL32 and abs(number) >= 2**24:
        nearest = struct.unpack("<f", struct.pack("<f", number))[0]
        in_force = nearest if abs(nearest) < 2**31 or nearest == -(2**31) else 0.0
    else:
        in_force = number
    assert (told.param_value, told.param_type) == (in_force, kind)


@both
def test_a_list_tells_all_once_in_order_and_at_its_pace(autopilot):
    client = Client(autopilot)
    assert client.ask(dialect.MAVLink_param_request_list_message(1, 1), step=0) == []
    count = len(client.parameters)
    heard = client.listed(0, 5 * HZ)
    assert [message.param_index for _, message in heard] == list(range(count))
    assert [message.param_id for _, message in heard] == [parameter.name for parameter in client.parameters]
    assert {message.param_count for _, message in heard} == {count}
    assert [step for step, _ in heard] == [round(LIST_PERIOD_S * HZ * n) for n in range(1, count + 1)]


@both
def test_a_second_request_begins_the_list_again(autopilot):
    client = Client(autopilot)
    client.ask(dialect.MAVLink_param_request_list_message(1, 1), step=0)
    assert len(client.listed(0, 50)) == 10
    client.ask(dialect.MAVLink_param_request_list_message(1, 1), step=50)
    heard = client.listed(50, 5 * HZ)
    assert [message.param_index for _, message in heard] == list(range(len(client.parameters)))


@both
@given(data=st.data())
def test_a_client_that_loses_some_of_a_list_and_asks_for_them_by_index_gets_all(autopilot, data):
    client = Client(autopilot)
    client.ask(dialect.MAVLink_param_request_list_message(1, 1), step=0)
    lost = data.draw(st.sets(st.integers(0, len(client.parameters) - 1)))
    got = {m.param_index: m for _, m in client.listed(0, 2 * HZ) if m.param_index not in lost}
    for index in lost:
        (got[index],) = client.read(index=index)
    assert [got[index].param_id for index in range(len(got))] == [parameter.name for parameter in client.parameters]


@both
def test_timesync_gives_the_question_back_beside_our_own_clock(autopilot):
    client = Client(autopilot)
    (told,) = client.ask(dialect.MAVLink_timesync_message(0, 123_456_789_012), step=3 * HZ + 1)
    assert (told.tc1, told.ts1) == (3_004_000_000, 123_456_789_012)
    assert client.ask(dialect.MAVLink_timesync_message(5, 6)) == [], "an answer is no question"
    (told,) = client.ask(dialect.MAVLink_timesync_message(0, 1), step=0)
    assert told.tc1 > 0, "0 would be a question"


@both
def test_ping_comes_back_to_who_sent_it(autopilot):
    client = Client(autopilot)
    (told,) = client.ask(dialect.MAVLink_ping_message(77, 5, 0, 0))
    assert (told.time_usec, told.seq, told.target_system, told.target_component) == (77, 5, 255, 190)
    assert client.ask(dialect.MAVLink_ping_message(77, 5, 1, 1)) == [], "an answer is no question"


@both
@pytest.mark.parametrize("kind", [0, 1, 2])
def test_there_are_no_missions_fences_or_rally_points_and_none_can_be_brought(autopilot, kind):
    client = Client(autopilot)
    (told,) = client.ask(dialect.MAVLink_mission_request_list_message(1, 1, kind))
    assert told.get_type() == "MISSION_COUNT"
    assert (told.count, told.mission_type, told.target_system, told.target_component) == (0, kind, 255, 190)
    (told,) = client.ask(dialect.MAVLink_mission_count_message(1, 1, 4, kind))
    assert (told.get_type(), told.type, told.mission_type) == ("MISSION_ACK", dialect.MAV_MISSION_UNSUPPORTED, kind)
    (told,) = client.ask(dialect.MAVLink_mission_clear_all_message(1, 1, kind))
    assert (told.get_type(), told.type, told.mission_type) == ("MISSION_ACK", dialect.MAV_MISSION_ACCEPTED, kind)


@both
def test_there_are_no_files_and_whoever_looks_for_one_is_told_so_at_once(autopilot):
    client = Client(autopilot)

    def ask(opcode, name=b"@PARAM/param.pck"):
        payload = struct.pack("<HBBBBBBI", 65535, 84, opcode, len(name), 0, 0, 0, 0) + name
        return client.ask(dialect.MAVLink_file_transfer_protocol_message(0, 1, 1, payload.ljust(251, b"\0")))

    (told,) = ask(4)
    assert (told.target_system, told.target_component) == (255, 190)
    assert bytes(told.payload[:13]) == struct.pack("<HBBBBBBI", 0, 84, 129, 1, 4, 0, 0, 0) + bytes([10])
    assert ask(128) == ask(129) == [], "an answer is no question"


def rates(client):
    return {
        message: round(1.0 / client.schedule.interval_s(message))
        for group in GROUPS.values()
        for message in group
        if client.schedule.has(message)
    }


def test_arducopter_streams_a_group_or_all_when_asked_the_old_way_and_stops():
    client = Client(ARDUPILOT)

    def ask(group, rate, start):
        return client.ask(dialect.MAVLink_request_data_stream_message(1, 1, group, rate, start))

    assert ask(dialect.MAV_DATA_STREAM_POSITION, 10, 1) == []
    assert rates(client) == {32: 10, 33: 10}
    ask(dialect.MAV_DATA_STREAM_ALL, 4, 1)
    assert rates(client) == dict.fromkeys((1, 24, 33, 32, 30, 74, 2, 147, 193), 4)
    ask(dialect.MAV_DATA_STREAM_EXTRA1, 4, 0)
    assert 30 not in rates(client)
    ask(dialect.MAV_DATA_STREAM_ALL, 0, 1)
    assert rates(client) == {}
    assert ask(99, 4, 1) == []
    assert rates(client) == {}


def test_px4_does_not_know_the_old_way():
    client = Client(PX4)
    client.ask(dialect.MAVLink_request_data_stream_message(1, 1, 0, 4, 1))
    assert rates(client) == {}


asked = st.sampled_from([4, 20, 21, 23, 43, 44, 45, 66, 110, 111, 0, 22, 76, 84])


@both
@given(messages=st.lists(st.tuples(asked, st.binary(max_size=255)), max_size=5))
def test_no_payload_however_strange_is_an_error_and_answers_are_good_frames(autopilot, messages):
    client = Client(autopilot)
    for message, payload in messages:
        client.send(Sender(255, 190).frame(message, payload))
    for parameter in client.parameters:
        assert math.isfinite(parameter.value)
