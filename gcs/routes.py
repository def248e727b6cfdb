"""Which peer speaks for which vehicle: one at a time, introduced by an autopilot's heartbeat, until it falls silent."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as dialect

from wire.frames import Frame
from wire.hub import Peer
from wire.ids import AUTOPILOT

ALIVE_NS = 3_000_000_000
"""Three heartbeats: a peer that was silent for longer is gone, and another address may speak for its vehicle."""

NAMESAKE = 256
"""The second vehicle that calls itself 7 has number 263, where namesakes are told apart, and the third 519."""
NAMESAKES_AT_MOST = 4

OTHER_SYSTEM = "other system"
NOT_INTRODUCED = "no heartbeat yet"
WRONG_ADDRESS = "wrong address"
"""Why a good frame is refused."""
IGNORED = frozenset({OTHER_SYSTEM, NOT_INTRODUCED})
"""Refusals that mean nothing: others fly too, and a vehicle may be heard in the middle of its second."""

NO_VEHICLES = frozenset(
    {
        dialect.MAV_TYPE_ANTENNA_TRACKER,
        dialect.MAV_TYPE_GCS,
        dialect.MAV_TYPE_ONBOARD_CONTROLLER,
        dialect.MAV_TYPE_GIMBAL,
        dialect.MAV_TYPE_ADSB,
        dialect.MAV_TYPE_CAMERA,
        dialect.MAV_TYPE_CHARGING_STATION,
        dialect.MAV_TYPE_FLARM,
        dialect.MAV_TYPE_SERVO,
        dialect.MAV_TYPE_ODID,
        dialect.MAV_TYPE_BATTERY,
        dialect.MAV_TYPE_PARACHUTE,
        dialect.MAV_TYPE_LOG,
        dialect.MAV_TYPE_OSD,
        dialect.MAV_TYPE_IMU,
        dialect.MAV_TYPE_GPS,
        dialect.MAV_TYPE_WINCH,
    }
)
"""MAV_TYPE of what never flies by itself."""


@dataclass(slots=True)
class _Route:
    peer: Peer
    heard_ns: int
    rival_ns: int | None = None
    """When another peer last sent a heartbeat of this vehicle's."""


class Routes:
    """Binds each system id to the peer that speaks for it. Knows no socket: a peer is only compared."""

    def __init__(self, ids: Collection[int] | None) -> None:
        """ids: whom to hear; None hears anybody."""
        self._ids = None if ids is None else frozenset(ids)
        self._routes: dict[int, _Route] = {}

    def refusal(self, frame: Frame, peer: Peer) -> str | None:
        """Why this frame from this peer is not admitted; None where it is. A heartbeat may bind its system to it."""
        if self._ids is not None and frame.system not in self._ids:
            return OTHER_SYSTEM
        route = self._routes.get(frame.system)
        if route is not None and route.peer == peer:
            route.heard_ns = frame.time_ns
            return None
        introduced = introduces(frame)
        if route is not None and self._alive(frame.system, frame.time_ns):
            if introduced:
                route.rival_ns = frame.time_ns
            return WRONG_ADDRESS
        if not introduced:
            return NOT_INTRODUCED
        self._routes[frame.system] = _Route(peer, frame.time_ns)
        return None

    def numbered(self, frame: Frame, peer: Peer) -> Frame:
        """The frame under its sender's own number: its system id, or 256 more for each namesake that came earlier.

        Where more than NAMESAKES_AT_MOST are alive, the others have the number of the first.
        """
        numbers = range(frame.system, NAMESAKE * NAMESAKES_AT_MOST, NAMESAKE)
        its = next((number for number in numbers if self.peer(number) == peer), None)
        if its is None:
            its = next((number for number in numbers if not self._alive(number, frame.time_ns)), frame.system)
        return frame if its == frame.system else frame._replace(system=its)

    def peer(self, system: int) -> Peer | None:
        """Who speaks for a system; None before its first heartbeat."""
        route = self._routes.get(system)
        return None if route is None else route.peer

    @property
    def peers(self) -> frozenset[Peer]:
        """Everybody who speaks for any system."""
        return frozenset(route.peer for route in self._routes.values())

    def duplicates(self, now_ns: int) -> frozenset[int]:
        """System ids whose heartbeats come from two peers that are both alive."""
        return frozenset(
            system
            for system, route in self._routes.items()
            if route.rival_ns is not None and now_ns - route.rival_ns <= ALIVE_NS and self._alive(system, now_ns)
        )

    def _alive(self, system: int, now_ns: int) -> bool:
        route = self._routes.get(system)
        return route is not None and now_ns - route.heard_ns <= ALIVE_NS


def id_of(number: int) -> int:
    """The system id under which the vehicle of this number goes."""
    return number % NAMESAKE


def name_of(number: int) -> str:
    """As people call it."""
    place, system = divmod(number, NAMESAKE)
    return str(system) if place == 0 else f"{system} (no. {place + 1} of that id)"


def introduces(frame: Frame) -> bool:
    """Whether this is the heartbeat of a vehicle's autopilot. Page: https://mavlink.io/en/services/heartbeat.html"""
    if frame.message != dialect.MAVLINK_MSG_ID_HEARTBEAT or frame.component != AUTOPILOT or len(frame.payload) < 6:
        return False
    kind, autopilot = frame.payload[4:6]
    return kind not in NO_VEHICLES and autopilot != dialect.MAV_AUTOPILOT_INVALID


def of_station(frame: Frame) -> bool:
    """Whether this heartbeat is a ground station's."""
    return len(frame.payload) >= 5 and frame.payload[4] == dialect.MAV_TYPE_GCS
