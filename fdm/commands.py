"""Commands to a vehicle, as COMMAND_LONG, COMMAND_INT or the old SET_MODE, and what it does about each.

Pages: https://mavlink.io/en/services/command.html, https://mavlink.io/en/messages/common.html#mav_commands
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple, Protocol

from pymavlink.dialects.v20 import ardupilotmega as dialect

from fdm.modes import Mode, Outcome, Pilot, Result, Situation
from fdm.personality import Personality
from fdm.rules import Rules
from wire.frames import Frame, decode
from wire.ids import AUTOPILOT

MESSAGES = frozenset(
    {
        dialect.MAVLINK_MSG_ID_COMMAND_LONG,
        dialect.MAVLINK_MSG_ID_COMMAND_INT,
        dialect.MAVLINK_MSG_ID_SET_MODE,
    }
)
"""Messages that carry a command."""

FORCE_DISARM = 21196
"""param2 of MAV_CMD_COMPONENT_ARM_DISARM that disarms in the air."""
ABOVE_HOME = frozenset({dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT, dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT})
ABOVE_SEA = frozenset({dialect.MAV_FRAME_GLOBAL, dialect.MAV_FRAME_GLOBAL_INT})


class Request(NamedTuple):
    """A command, whichever message brought it."""

    command: int
    params: tuple[float, ...]
    """param1 to param7; 5 and 6 as they came, and read by nobody."""
    frame: int | None
    """MAV_FRAME of param7; None where the message has none."""
    acknowledged: int
    """The command that the answer names."""


class Host(Protocol):
    """The vehicle that commands are for."""

    personality: Personality

    def act(self, event: Callable[[Pilot, Situation, Rules], Outcome], /) -> Result:
        """Let the mode machine answer an event."""

    def knows(self, message: float, /) -> bool:
        """Whether it can report this message id."""

    def tell(self, message: int, /) -> None:
        """Report this message now."""

    def tell_interval(self, message: int, /) -> None:
        """Report how often this message is sent."""

    def stream(self, message: int, interval_s: float, /) -> None:
        """Send this message so often; 0 is off."""

    def height(self, altitude_m: float, /) -> float:
        """m above home, of an altitude above sea level."""


def request(frame: Frame, system: int, personality: Personality) -> Request | None:
    """The command in a frame; None where it is meant for others, or cannot be read."""
    try:
        message = decode(frame)
    except dialect.MAVError:
        return None
    if message.target_system not in (0, system):
        return None
    if frame.message == dialect.MAVLINK_MSG_ID_SET_MODE:
        return _old_set_mode(message.base_mode, message.custom_mode, personality)
    if message.target_component not in (0, AUTOPILOT):
        return None
    first = message.param1, message.param2, message.param3, message.param4
    if frame.message == dialect.MAVLINK_MSG_ID_COMMAND_INT:
        return Request(message.command, (*first, message.x, message.y, message.z), message.frame, message.command)
    params = (*first, message.param5, message.param6, message.param7)
    return Request(message.command, params, None, message.command)


def obey(asked: Request, host: Host) -> Result:
    """Do what is asked, and say whether."""
    handler = _HANDLERS.get(asked.command)
    return Result.UNSUPPORTED if handler is None else handler(asked, host)


def _old_set_mode(base_mode: int, custom_mode: int, personality: Personality) -> Request:
    main, sub = (custom_mode >> 16 & 0xFF, custom_mode >> 24) if personality.mode_has_parts else (custom_mode, 0)
    params = (float(base_mode), float(main), float(sub), 0.0, 0.0, 0.0, 0.0)
    return Request(dialect.MAV_CMD_DO_SET_MODE, params, None, personality.set_mode_acknowledged)


def _arm_disarm(asked: Request, host: Host) -> Result:
    """param1: 1 arm, 0 disarm."""
    machine = host.personality.machine
    arms, magic, *_ = asked.params
    if arms == 1.0:
        return host.act(machine.arm)
    if arms == 0.0:
        return host.act(lambda pilot, now, _: machine.disarm(pilot, now, force=magic == FORCE_DISARM))
    return Result.UNSUPPORTED


def _take_off(asked: Request, host: Host) -> Result:
    """param7: PX4 reads an altitude above mean sea level, ArduCopter a height above home; NaN names none."""
    machine, named = host.personality.machine, asked.params[6]
    if asked.frame is None:
        above_home = host.personality.takeoff_above_home
    elif asked.frame in ABOVE_HOME:
        above_home = True
    elif asked.frame in ABOVE_SEA and not host.personality.takeoff_above_home:
        above_home = False
    else:
        return Result.DENIED
    height = None if not math.isfinite(named) else named if above_home else host.height(named)
    return host.act(lambda pilot, now, rules: machine.take_off(pilot, now, rules, height))


def _do_set_mode(asked: Request, host: Host) -> Result:
    """param1: MAV_MODE_FLAG, param2 the mode, param3 PX4's sub mode."""
    base, main, sub, *_ = asked.params
    if not all(map(math.isfinite, (base, main, sub))):
        return Result.DENIED
    if not int(base) & dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
        return Result.DENIED
    return _change_mode(host, host.personality.mode_of(int(main), int(sub)))


def _change_mode(host: Host, mode: Mode | None) -> Result:
    return host.act(lambda pilot, now, rules: host.personality.machine.set_mode(pilot, now, rules, mode))


def _set_message_interval(asked: Request, host: Host) -> Result:
    """param1 message id, param2 interval in µs: 0 the default rate, −1 off."""
    message, interval_us, *_ = asked.params
    if not math.isfinite(interval_us) or not host.knows(message):
        return Result.DENIED
    default_hz = host.personality.streams_hz.get(int(message), 0.0)
    default_s = 1.0 / default_hz if default_hz else 0.0
    host.stream(int(message), interval_us / 1e6 if interval_us else default_s)
    return Result.ACCEPTED


def _get_message_interval(asked: Request, host: Host) -> Result:
    """param1 message id; the answer is a MESSAGE_INTERVAL."""
    if not host.knows(asked.params[0]):
        return Result.DENIED
    host.tell_interval(int(asked.params[0]))
    return Result.ACCEPTED


def _request_message(asked: Request, host: Host) -> Result:
    """param1 message id; of MESSAGE_INTERVAL param2 says whose."""
    message, whose, *_ = asked.params
    if message == dialect.MAVLINK_MSG_ID_MESSAGE_INTERVAL and host.knows(whose):
        host.tell_interval(int(whose))
        return Result.ACCEPTED
    if not host.knows(message):
        return host.personality.unknown_message
    host.tell(int(message))
    return Result.ACCEPTED


def _tells(message: int) -> Callable[[Request, Host], Result]:
    """A command of the times before REQUEST_MESSAGE."""

    def handler(_asked: Request, host: Host) -> Result:
        host.tell(message)
        return Result.ACCEPTED

    return handler


_HANDLERS: Mapping[int, Callable[[Request, Host], Result]] = MappingProxyType(
    {
        dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda _, host: _change_mode(host, Mode.RETURN),
        dialect.MAV_CMD_NAV_LAND: lambda _, host: _change_mode(host, Mode.LAND),
        dialect.MAV_CMD_NAV_TAKEOFF: _take_off,
        dialect.MAV_CMD_DO_SET_MODE: _do_set_mode,
        dialect.MAV_CMD_COMPONENT_ARM_DISARM: _arm_disarm,
        dialect.MAV_CMD_GET_HOME_POSITION: _tells(dialect.MAVLINK_MSG_ID_HOME_POSITION),
        dialect.MAV_CMD_GET_MESSAGE_INTERVAL: _get_message_interval,
        dialect.MAV_CMD_SET_MESSAGE_INTERVAL: _set_message_interval,
        dialect.MAV_CMD_REQUEST_MESSAGE: _request_message,
        dialect.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: _tells(dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION),
    }
)
