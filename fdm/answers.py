"""What a vehicle answers to messages that are no command: parameters, clocks, missions, old ways to ask for streams.

Pages: https://mavlink.io/en/services/parameter.html, https://mavlink.io/en/services/timesync.html,
https://mavlink.io/en/services/ping.html, https://mavlink.io/en/services/mission.html,
https://mavlink.io/en/services/ftp.html
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from types import MappingProxyType
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from fdm.parameter_service import ParameterService
from fdm.parameters import Parameters
from fdm.streams import Schedule
from wire.frames import Frame, Sender, decode
from wire.ids import AUTOPILOT

GROUPS = MappingProxyType(
    {
        dialect.MAV_DATA_STREAM_EXTENDED_STATUS: (
            dialect.MAVLINK_MSG_ID_SYS_STATUS,
            dialect.MAVLINK_MSG_ID_GPS_RAW_INT,
        ),
        dialect.MAV_DATA_STREAM_POSITION: (
            dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
            dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
        ),
        dialect.MAV_DATA_STREAM_EXTRA1: (dialect.MAVLINK_MSG_ID_ATTITUDE,),
        dialect.MAV_DATA_STREAM_EXTRA2: (dialect.MAVLINK_MSG_ID_VFR_HUD,),
        dialect.MAV_DATA_STREAM_EXTRA3: (
            dialect.MAVLINK_MSG_ID_SYSTEM_TIME,
            dialect.MAVLINK_MSG_ID_BATTERY_STATUS,
            dialect.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
        ),
    }
)
"""What REQUEST_DATA_STREAM asks for, of what we know. Source: ArduCopter's GCS_Mavlink.cpp, STREAM_…_msgs."""

_FILE_HEADER = struct.Struct("<HBBBBBBI")
"""seq, session, opcode, size, opcode that is answered, burst complete, padding, offset: then data fill the payload."""
FILE_ACK, FILE_NACK, FILE_NOT_FOUND = 128, 129, 10


class Answers:
    """One vehicle's answers. Streams that messages ask for, and the list of parameters, go through the schedule.

    autopilot: MAV_AUTOPILOT, 12 or 3, whose manners these are
    """

    def __init__(
        self, sender: Sender, parameters: Parameters, schedule: Schedule, *, autopilot: int, physics_hz: int
    ) -> None:
        self._sender = sender
        self._schedule = schedule
        self._hz = physics_hz
        self.parameters = ParameterService(sender, parameters, schedule, autopilot=autopilot)
        """The list is sent by it, when LISTING is due."""
        self._answers: dict[int, Callable[[Frame, Any, int], list[bytes]]] = {
            dialect.MAVLINK_MSG_ID_TIMESYNC: self._timesync,
            dialect.MAVLINK_MSG_ID_PING: self._ping,
            dialect.MAVLINK_MSG_ID_MISSION_REQUEST_LIST: self._mission_list,
            dialect.MAVLINK_MSG_ID_MISSION_COUNT: self._mission_upload,
            dialect.MAVLINK_MSG_ID_MISSION_CLEAR_ALL: self._mission_clear,
            dialect.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL: self._file,
        }
        if autopilot == dialect.MAV_AUTOPILOT_ARDUPILOTMEGA:
            self._answers[dialect.MAVLINK_MSG_ID_REQUEST_DATA_STREAM] = self._data_stream

    def answer(self, frame: Frame, *, step: int) -> list[bytes]:
        """Frames that answer this one now; none to what is not for us, or asks for nothing."""
        if frame.message in self.parameters.messages:
            return self.parameters.answer(frame, step=step)
        answer = self._answers.get(frame.message)
        if answer is None:
            return []
        try:
            message = decode(frame)
        except dialect.MAVError:
            return []
        return [] if _is_for_somebody_else(message, self._sender.system) else answer(frame, message, step)

    def _pack(self, message: Any) -> list[bytes]:
        return [self._sender.pack(message)]

    def _timesync(self, _frame: Frame, message: Any, step: int) -> list[bytes]:
        """ts1 is the asker's clock, untouched; tc1 is ours, nanoseconds since boot. A request's tc1 is 0."""
        if message.tc1 != 0:
            return []
        return self._pack(dialect.MAVLink_timesync_message(max(1, step * 1_000_000_000 // self._hz), message.ts1))

    def _ping(self, frame: Frame, message: Any, _step: int) -> list[bytes]:
        """To all is a request, to one an answer."""
        if (message.target_system, message.target_component) != (0, 0):
            return []
        return self._pack(dialect.MAVLink_ping_message(message.time_usec, message.seq, frame.system, frame.component))

    def _mission_list(self, frame: Frame, message: Any, _step: int) -> list[bytes]:
        """There are no missions, fences or rally points on board."""
        return self._pack(dialect.MAVLink_mission_count_message(frame.system, frame.component, 0, message.mission_type))

    def _mission_upload(self, frame: Frame, message: Any, _step: int) -> list[bytes]:
        """Nor can there be any: only one without items is accepted."""
        result = dialect.MAV_MISSION_ACCEPTED if message.count == 0 else dialect.MAV_MISSION_UNSUPPORTED
        return self._mission_ack(frame, message, result)

    def _mission_clear(self, frame: Frame, message: Any, _step: int) -> list[bytes]:
        return self._mission_ack(frame, message, dialect.MAV_MISSION_ACCEPTED)

    def _mission_ack(self, frame: Frame, message: Any, result: int) -> list[bytes]:
        return self._pack(
            dialect.MAVLink_mission_ack_message(frame.system, frame.component, result, message.mission_type)
        )

    def _file(self, frame: Frame, message: Any, _step: int) -> list[bytes]:
        """There are no files on board. MAVProxy looks for one with all parameters, and asks for them when told so."""
        sequence, session, opcode, *_ = _FILE_HEADER.unpack(bytes(message.payload[: _FILE_HEADER.size]))
        if opcode >= FILE_ACK:
            return []
        header = _FILE_HEADER.pack((sequence + 1) % 65536, session, FILE_NACK, 1, opcode, 0, 0, 0)
        payload = (header + bytes([FILE_NOT_FOUND])).ljust(len(message.payload), b"\0")
        return self._pack(dialect.MAVLink_file_transfer_protocol_message(0, frame.system, frame.component, payload))

    def _data_stream(self, _frame: Frame, message: Any, step: int) -> list[bytes]:
        """One rate for a group of messages, or for all groups."""
        rate_hz = message.req_message_rate if message.start_stop else 0
        everything = message.req_stream_id == dialect.MAV_DATA_STREAM_ALL
        for group in GROUPS if everything else (message.req_stream_id,):
            for kind in GROUPS.get(group, ()):
                self._schedule.set_interval(kind, 1.0 / rate_hz if rate_hz else 0.0, step=step)
        return []


def _is_for_somebody_else(message: Any, system: int) -> bool:
    """TIMESYNC names nobody, and a PING's target is the answer to a question."""
    if message.get_msgId() == dialect.MAVLINK_MSG_ID_PING or not hasattr(message, "target_system"):
        return False
    return message.target_system not in (0, system) or message.target_component not in (0, AUTOPILOT)
