"""To a ground control station by UDP: what the vehicles sent, when they sent it. Never what commands anybody.

Between this socket and vehicles in the air there may be a router that hands on what it gets. So there is no list of
what is held back: TELEMETRY names what may leave, and of that only what vehicles said does.
"""

from __future__ import annotations

import ipaddress
import re
import socket
from collections import Counter
from collections.abc import Sequence

from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs.choices import BadUsageError
from gcs.recording.channels import RAW
from gcs.replay.outputs import Played
from gcs.replay.senders import Senders
from wire.connection import Connection, ConnectionRefused, parse
from wire.frames import Frame, Framer
from wire.ports import UdpPort

_NAMES = """
    HEARTBEAT SYS_STATUS EXTENDED_SYS_STATE AUTOPILOT_VERSION PARAM_VALUE STATUSTEXT COMMAND_ACK
    HIGH_LATENCY HIGH_LATENCY2 NAMED_VALUE_FLOAT NAMED_VALUE_INT NAMED_VALUE_STRING
    LOCAL_POSITION_NED LOCAL_POSITION_NED_COV LOCAL_POSITION_NED_SYSTEM_GLOBAL_OFFSET GLOBAL_POSITION_INT
    GLOBAL_POSITION_INT_COV ALTITUDE VFR_HUD NAV_CONTROLLER_OUTPUT AOA_SSA PID_TUNING
    ATTITUDE ATTITUDE_QUATERNION ATTITUDE_QUATERNION_COV AHRS AHRS2 AHRS3 HOME_POSITION GPS_GLOBAL_ORIGIN
    GPS_RAW_INT GPS2_RAW GPS_STATUS GPS_RTK GPS2_RTK ESTIMATOR_STATUS EKF_STATUS_REPORT VIBRATION FENCE_STATUS
    HIGHRES_IMU RAW_IMU SCALED_IMU SCALED_IMU2 SCALED_IMU3 RAW_PRESSURE SCALED_PRESSURE SCALED_PRESSURE2
    SCALED_PRESSURE3 AIRSPEED WIND WIND_COV RANGEFINDER TERRAIN_REPORT
    BATTERY2 BATTERY_STATUS SMART_BATTERY_INFO POWER_STATUS MCU_STATUS HWSTATUS MEMINFO
    SERVO_OUTPUT_RAW ACTUATOR_OUTPUT_STATUS RC_CHANNELS_RAW RC_CHANNELS_SCALED
    ESC_TELEMETRY_1_TO_4 ESC_TELEMETRY_5_TO_8 ESC_TELEMETRY_9_TO_12 RPM EFI_STATUS SENSOR_OFFSETS
    ATTITUDE_TARGET POSITION_TARGET_LOCAL_NED POSITION_TARGET_GLOBAL_INT MISSION_CURRENT MISSION_ITEM_REACHED
    CAMERA_TRIGGER FLIGHT_INFORMATION MAG_CAL_PROGRESS MAG_CAL_REPORT
"""
TELEMETRY = frozenset(_NAMES.split())
"""Messages in which a vehicle says how it is. Page: https://mavlink.io/en/messages/ardupilotmega.html

Those named …_TARGET report what an autopilot steers by, to whoever listens; what sets it is named SET_…. RC_CHANNELS is
not among them: from component 140, PX4 takes it for a pilot's sticks (MavlinkReceiver, handle_message_rc_channels). Nor
is what has an address, as MOUNT_STATUS.
"""
_MAY_LEAVE = frozenset(number for number, kind in dialect.mavlink_map.items() if kind.msgname in TELEMETRY)


_ONE_PORT = re.compile(r"udpout:(//)?[^:/\s]+:\d+")
NOBODY = {
    "0.0.0.0": "no address of a machine",
    "255.255.255.255": "the address of all machines",
    "127.255.255.255": "no address of a machine",
}
"""Addresses to which a socket either sends nothing, or not what one thinks."""


def checked(text: str, *, network: bool) -> Connection:
    """Where --to points, its host as a number. Raises BadUsageError; network: whether it may be another machine."""
    if _ONE_PORT.fullmatch(text) is None:
        shown = text or repr(text)
        raise BadUsageError(f"--to {shown}: must be one port that is spoken to, as in udpout:127.0.0.1:14550")
    try:
        (connection,) = parse(text)
    except ConnectionRefused as error:
        raise BadUsageError(f"--to {error}") from None
    host, port = connection.host, connection.port
    try:
        found = socket.getaddrinfo(host, port, socket.AF_INET, socket.SOCK_DGRAM)
    except OSError as error:
        raise BadUsageError(f"--to {text}: {host} is not known: {error.strerror or error}") from None
    address = str(found[0][4][0])
    if address in NOBODY:
        raise BadUsageError(f"--to {text}: {address} is {NOBODY[address]}; 127.0.0.1 is this machine")
    if not network and not ipaddress.ip_address(address).is_loopback:
        raise BadUsageError(
            f"--to {text}: is another machine, and a replay that reaches vehicles or their operators is mistaken for a "
            "flight; --to-network says that it may"
        )
    return Connection("udpout", address, port)


class UdpOutput:
    """Telemetry, frame by frame, to one address; what comes back is thrown away."""

    def __init__(self, connection: Connection, senders: Senders) -> None:
        """Raises BadUsageError where there is no way there."""
        self.connection = connection
        self.sent = 0
        """Frames that left; whether anybody took them, UDP does not say."""
        self.refused = 0
        """How often that machine has said that nobody listens on the port: not for each of these frames."""
        self.held_back = Counter[str]()
        """Message → frames of vehicles that did not leave, for it is no telemetry."""
        self._senders = senders
        try:
            self._port = UdpPort(connection)
        except ConnectionRefused as error:
            raise BadUsageError(f"--to {error}") from None
        self._framer = Framer()

    def put(self, messages: Sequence[Played]) -> None:
        """Each frame of a vehicle in a datagram of its own, as it was recorded; one that nobody takes is gone."""
        self._port.receive()
        for message in messages:
            if message.encoding == RAW:
                for frame in self._framer.frames(message.time_ns, message.data):
                    if may_leave(frame, self._senders):
                        self.sent += self._left(frame.raw)
                    elif self._senders.of_vehicle(frame):
                        self.held_back[dialect.mavlink_map[frame.message].msgname] += 1

    def _left(self, raw: bytes) -> bool:
        """A refusal is of a datagram before: it says nothing of this one, which is sent once more."""
        if self._port.send(raw):
            return True
        self.refused += 1
        self._port.receive()
        return self._port.send(raw)

    def jumped(self, time_ns: int) -> None:
        """Nothing to say: each of the next frames tells how its vehicle is now."""

    def close(self) -> None:
        """Give the port back."""
        self._port.close()


def may_leave(frame: Frame, senders: Senders) -> bool:
    """Whether this is a vehicle telling how it is."""
    return frame.message in _MAY_LEAVE and senders.of_vehicle(frame)
