"""Who is there: every vehicle and ground station that is heard on a link, while nothing is sent."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
import orjson
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs import messages
from gcs.guard import DONE, NOT_DONE
from gcs.links import refused
from gcs.live import Live
from gcs.roster import Roster
from gcs.telemetry import Swarm
from wire.frames import Frame, decode
from wire.ids import AUTOPILOT
from wire.modes import ARDUPILOT, PX4, mode_name

STEP_NS = 100_000_000
HEADS = (
    "id", "autopilot", "type", "mode", "armed", "height", "speed", "battery",
    "satellites", "accuracy", "from", "messages/s", "loss",
)  # fmt: skip
UNTOLD, GAP = "–", "  "
NO_SATELLITES = 255
"""What GPS_RAW_INT says where it does not know."""


@dataclass(frozen=True, slots=True)
class Vehicle:
    """One vehicle as it is heard; None where it was not told."""

    system: int
    autopilot: str
    type: str
    mode: str
    armed: bool
    latitude_deg: float | None
    longitude_deg: float | None
    height_m: float | None
    """Above home."""
    speed_m_s: float | None
    battery: float | None
    """0 … 1."""
    satellites: int | None
    accuracy_m: float | None
    """Horizontal."""
    link: str | None
    """Where it speaks from."""
    messages_per_s: float
    loss: float | None
    """Of its frames, 0 … 1."""


@dataclass(slots=True)
class Ear:
    """A fold of frames into vehicles."""

    roster: Roster = field(default_factory=Roster)
    _first_ns: dict[int, int] = field(default_factory=dict)
    _frames: dict[int, int] = field(default_factory=dict)
    _newest: dict[tuple[int, int], Frame] = field(default_factory=dict)
    """(system, message id) → the last frame, of messages that no swarm keeps."""

    def take(self, frames: Iterable[Frame]) -> None:
        """What came."""
        heard = [frame for frame in frames if frame.component == AUTOPILOT]
        self.roster.take(heard)
        for frame in heard:
            self._first_ns.setdefault(frame.system, frame.time_ns)
            self._frames[frame.system] = self._frames.get(frame.system, 0) + 1
            if frame.message in (messages.HEARTBEAT, messages.GPS_RAW_INT, messages.GLOBAL_POSITION_INT):
                self._newest[frame.system, frame.message] = frame

    def vehicle(self, system: int, now_ns: int, *, link: str | None, loss: float | None) -> Vehicle:
        """What is known of one whose heartbeat has come."""
        swarm = self.roster.swarms[system]
        place, receiver = (self._told(system, id_) for id_ in (messages.GLOBAL_POSITION_INT, messages.GPS_RAW_INT))
        beat = self._told(system, messages.HEARTBEAT)
        known = place is not None and (place.lat or place.lon)
        seconds = max(1.0, (now_ns - self._first_ns[system]) / 1e9)
        return Vehicle(
            system=system,
            autopilot=autopilot_name(int(swarm.autopilot[0])),
            type="?" if beat is None else _named("MAV_TYPE", beat.type),
            mode=mode_name(int(swarm.autopilot[0]), int(swarm.custom_mode[0])),
            armed=bool(swarm.armed[0]),
            latitude_deg=place.lat / 1e7 if known else None,
            longitude_deg=place.lon / 1e7 if known else None,
            height_m=place.relative_alt / 1e3 if place is not None else height_of(swarm),
            speed_m_s=_rounded(float(np.linalg.norm(swarm.velocity_ned[0]))),
            battery=_rounded(float(swarm.battery[0])),
            satellites=_unless(receiver and receiver.satellites_visible, NO_SATELLITES),
            accuracy_m=_rounded(float(swarm.accuracy_m[0])),
            link=link,
            messages_per_s=round(self._frames[system] / seconds, 1),
            loss=loss,
        )

    def _told(self, system: int, message: int) -> Any:
        frame = self._newest.get((system, message))
        try:
            return None if frame is None else decode(frame)
        except dialect.MAVError:
            return None


def autopilot_name(number: int) -> str:
    """As people call it."""
    return {PX4: "PX4", ARDUPILOT: "ArduPilot"}.get(number) or _named("MAV_AUTOPILOT", number)


def height_of(swarm: Swarm) -> float | None:
    """m above home of a swarm's only vehicle; None until told."""
    return _rounded(-float(swarm.position_ned[0, 2]))


def list_heard(live: Live, *, seconds: float, as_json: bool, console: Any, write: Callable[[bytes], None]) -> int:
    """Hear for so long, or until Ctrl-C, and say who was there; sends nothing. 0 if anybody was, else 3."""
    ear = Ear()
    until_ns = live.now() + round(seconds * 1e9)
    try:
        while live.now() < until_ns:
            live.sleep_until(min(until_ns, live.now() + STEP_NS))
            ear.take(live.receive())
    except KeyboardInterrupt:  # has heard enough
        ear.take(live.receive())
    found = [_found(ear, live, system) for system in sorted(ear.roster.swarms)]
    if as_json:
        told = {
            "vehicles": [asdict(vehicle) for vehicle in found],
            "ground_stations": [station._asdict() for station in live.stations],
            "duplicates": sorted(live.duplicates),
            "refused": dict(live.rejections),
        }
        write(orjson.dumps(told))
    else:
        _show(found, live, console)
    return DONE if found else NOT_DONE


def _found(ear: Ear, live: Live, system: int) -> Vehicle:
    quality = live.quality.get(system)
    loss = None if quality is None else quality.loss
    return ear.vehicle(system, live.now(), link=live.address(system), loss=loss)


def _show(found: list[Vehicle], live: Live, console: Any) -> None:
    room = console.width if console.is_terminal else math.inf
    for line in table([HEADS, *map(_cells, found)], room) if found else ["nobody is heard"]:
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    lines = [
        *(f"two vehicles call themselves {system}: give each an id of its own" for system in sorted(live.duplicates)),
        *(f"ground station {one.system}.{one.component} is heard from {one.address}" for one in live.stations),
    ]
    if not found and live.speaks_first:
        lines.append("who waits to be spoken to stays silent: listening sends nothing")
    if (words := refused(live.rejections)) is not None:
        lines.append(words)
    for line in lines:
        console.print(line, highlight=False, markup=False, soft_wrap=True)


def table(rows: list[tuple[str, ...]], room: float) -> list[str]:
    """Lines of columns as wide as their widest cell, without those that nobody told anything for.

    room: letters that a line has; columns beyond it stand below, beside the first column again.
    """
    name, *others = (
        [cell.ljust(max(map(len, column))) for cell in column]
        for column in zip(*rows, strict=True)
        if {*column[1:]} != {UNTOLD}
    )
    blocks, taken = [[name]], len(name[0])
    for column in others:
        width = len(GAP) + len(column[0])
        if taken + width > room and len(blocks[-1]) > 1:
            blocks.append([name])
            taken = len(name[0])
        blocks[-1].append(column)
        taken += width
    return [GAP.join(line).rstrip() for block in blocks for line in zip(*block, strict=True)]


def _cells(vehicle: Vehicle) -> tuple[str, ...]:
    return (
        str(vehicle.system),
        vehicle.autopilot,
        vehicle.type,
        vehicle.mode,
        "armed" if vehicle.armed else "disarmed",
        _cell(vehicle.height_m, "{:.1f} m"),
        _cell(vehicle.speed_m_s, "{:.1f} m/s"),
        _cell(vehicle.battery, "{:.0%}"),
        _cell(vehicle.satellites, "{}"),
        _cell(vehicle.accuracy_m, "{:.1f} m"),
        vehicle.link or UNTOLD,
        f"{vehicle.messages_per_s:.1f}",
        _cell(vehicle.loss, "{:.1%}"),
    )


def _cell(value: float | None, form: str) -> str:
    return UNTOLD if value is None else form.format(value)


def _named(enum: str, number: int) -> str:
    """pymavlink's name of it, in small letters and without the enum's."""
    entry = dialect.enums[enum].get(number)
    if entry is None:
        return f"{enum.removeprefix('MAV_').lower()} {number}"
    return str(entry.name).removeprefix(f"{enum}_").lower().replace("_", " ")


def _rounded(value: float) -> float | None:
    return round(value, 2) if np.isfinite(value) else None


def _unless(value: int | None, unknown: int) -> int | None:
    return None if value == unknown else value
