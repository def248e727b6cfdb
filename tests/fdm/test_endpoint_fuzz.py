"""Whatever well-formed frames come, in whatever order: a vehicle raises nothing, stays finite, and says no more than it
was asked for. 1500 datagrams an autopilot, forty times as many under TRUSTR_PROFILE=soak.
"""

import math
import os
import random
import struct

import pytest
from clients import ACCEPTED, SET_INTERVAL, Flight
from pymavlink.dialects.v20 import ardupilotmega as dialect

from fdm.commands import _HANDLERS
from fdm.parameters import table

DATAGRAMS = 60_000 if os.environ.get("TRUSTR_PROFILE") == "soak" else 1500
A_LIFE = 500
"""Datagrams; then another vehicle boots."""
ANSWERS = 6
"""Frames at most, to one."""
TAKEN = (
    dialect.MAVLink_command_long_message,
    dialect.MAVLink_command_int_message,
    dialect.MAVLink_set_mode_message,
    *(dialect.MAVLink_set_position_target_local_ned_message,) * 6,
    dialect.MAVLink_heartbeat_message,
    dialect.MAVLink_param_set_message,
    dialect.MAVLink_param_request_read_message,
    dialect.MAVLink_param_request_list_message,
    dialect.MAVLink_timesync_message,
    dialect.MAVLink_ping_message,
    dialect.MAVLink_mission_request_list_message,
    dialect.MAVLink_mission_count_message,
    dialect.MAVLink_mission_clear_all_message,
    dialect.MAVLink_request_data_stream_message,
    dialect.MAVLink_file_transfer_protocol_message,
    dialect.MAVLink_manual_control_message,
    dialect.MAVLink_set_position_target_global_int_message,
    dialect.MAVLink_gps_inject_data_message,
)
"""All that a vehicle takes in, and some that it does not."""
TAME, HUGE = (0.0, 1.0, -1.0, 0.5, 2.5, 12.0), (3.4e38, -3.4e38)
ODD = (1e3, -1e6, 1e9, 1e-40, math.nan, math.inf, -math.inf)
RANGES = {f"{sign}int{bits}_t": (bits, sign == "") for bits in (8, 16, 32, 64) for sign in ("", "u")}
"""Name of a type → bits, and whether it has a sign."""
FIELDS_OFTEN = {
    "target_system": (1, 1, 1, 0),
    "target_component": (1, 1, 1, 0),
    "command": tuple(_HANDLERS),
    "type_mask": (0x0DC7, 0x09C7, 0x05C7, 0x0FC7),
    "coordinate_frame": (1, 8, 8, 9),
    "frame": (0, 3, 5, 6),
    "type": (6,),
    "custom_mode": (4, 9, 17, 6 << 16, 4 << 16 | 3 << 24),
}
"""Values by which a frame gets further than the first check."""


class Stranger:
    """Frames of a few ground stations whose clocks, numbers and wishes make no sense."""

    def __init__(self, autopilot, seed):
        self.rng = random.Random(seed)
        self.names = [parameter.name.encode() for parameter in table(autopilot)]
        self.stations = [dialect.MAVLink(None, system, 190) for system in (255, 254, 1)]

    def frame(self):
        kind = self.rng.choice(TAKEN)
        self.reals = self.rng.choice((TAME, TAME, HUGE, (*TAME, *HUGE, *ODD)))
        lengths = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
        fields = zip(kind.fieldnames, kind.fieldtypes, strict=True)
        message = kind(*(self.value(name, type_, lengths[name]) for name, type_ in fields))
        return bytes(message.pack(self.rng.choice(self.stations)))

    def value(self, name, kind, length):
        if kind == "char":
            return self.rng.choice([*self.names, self.rng.randbytes(length)])
        if length:
            return [self.value(name, kind, 0) for _ in range(length)]
        if name in FIELDS_OFTEN and self.rng.random() < 0.9:
            return self.rng.choice(FIELDS_OFTEN[name])
        if kind in RANGES:
            return self.whole(*RANGES[kind])
        return self.rng.choice(self.reals) if self.rng.random() < 0.95 else self.bits()

    def bits(self):
        return struct.unpack("<f", self.rng.randbytes(4))[0]

    def whole(self, bits, signed):
        low = -(2 ** (bits - 1)) if signed else 0
        high = low + 2**bits - 1
        small = self.rng.randint(max(low, -300), min(high, 300))
        return self.rng.choice([low, high, small, self.rng.randint(low, high)])


def aloft(autopilot):
    """A vehicle in the air and under control, that streams all it knows."""
    flight = Flight(autopilot=autopilot, yaw=1.0)
    if autopilot == "px4":
        flight.hover(5.0).offboard()
    else:
        flight.guided(5.0)
    for message in dialect.mavlink_map:
        if flight.endpoint.knows(message):
            assert flight.ask(SET_INTERVAL, message, 20_000) == ACCEPTED
    return flight


def each_step(flight):
    """So many frames may it send by itself: each kind that it knows, and a few words."""
    return sum(flight.endpoint.knows(message) for message in dialect.mavlink_map) + 10


@pytest.mark.parametrize("autopilot", ["px4", "ardupilot"])
def test_whatever_is_asked_in_whatever_order_a_vehicle_flies_on(autopilot):
    stranger, told = Stranger(autopilot, seed=1), set()
    for life in range(DATAGRAMS // A_LIFE):
        flight = aloft(autopilot)
        endpoint, most = flight.endpoint, each_step(flight)
        for _ in range(A_LIFE):
            datagram = b"".join(stranger.frame() for _ in range(stranger.rng.randint(1, 3)))
            endpoint.receive(datagram)
            steps = stranger.rng.choice([0, 0, 1, 1, 5, 25])
            endpoint.step(steps)
            sent = endpoint.data_to_send()
            assert len(sent) <= most * steps + 3 * ANSWERS
            told.update(int.from_bytes(frame[7:10], "little") for _, frame in sent)
            assert not endpoint.lost, life
            assert all(map(math.isfinite, endpoint.vehicle.position_velocity()))
    assert dialect.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED in told
