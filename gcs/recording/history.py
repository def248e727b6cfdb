"""A recording as arrays over its ticks: what replay, report and video show.

T ticks of the whole flight, take-off and landing included; N vehicles in the order of their system ids. NaN where
nothing was told.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from gcs.events import Rating
from gcs.flight_state import Phase
from gcs.recording import happenings as find
from gcs.recording.faults import FaultsBy, FaultSpan, faults_by, spans
from gcs.recording.files import METADATA
from gcs.recording.happenings import Found, Happening, Kind
from gcs.recording.heard import Heard, Links, Told, column, held
from gcs.recording.reader import (
    CUT_SHORT,
    Recording,
    UnreadableRecording,
    located,
    opened,
    parts_of,
    rating_of,
    track_of,
)
from gcs.recording.recovery import RECOVERED
from gcs.scoring import min_separation, separation, struck
from gcs.summary import collision, trust_of
from gcs.track import Parts, Track
from scenarios import Scenario

__all__ = ["FaultSpan", "FaultsBy", "Happening", "History", "Kind", "Links", "load"]

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Integers = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class History:
    """One flight, tick by tick."""

    path: Path
    scenario: Scenario
    metadata: Mapping[str, str]
    """Versions, seed, wall time."""
    problem: str | None
    """Why the flight could not be completed, or why the recording ends before it."""
    ids: tuple[int, ...]
    """System ids."""
    number: Integers
    """(T,) of each tick; there are gaps where a damaged recording was recovered."""
    time_ns: Integers
    """(T,) when it was decided."""
    lateness_s: Array
    """(T,) after its deadline."""
    frames: Integers
    """(T,) how many received frames it consumed."""
    phase: tuple[str, ...]
    """(T,) as gcs.flight_state.Phase calls it."""
    mission_s: Array
    """(T,) since mission start; NaN outside the mission."""
    task: tuple[str, ...]
    """(T,) of the mission; "" outside it."""
    position: Array
    """(T, N, 3) m: north, east of the swarm's origin, height above home; the truth where it was told."""
    measured: bool
    """Whether positions are telemetry, because nothing told the truth."""
    reported: Array
    """(T, N, 3) the same by telemetry."""
    velocity_ned: Array
    """(T, N, 3) m/s, by telemetry."""
    age_s: Array
    """(T, N) of telemetry."""
    attitude_rpy: Array
    """(T, N, 3) rad, as last told."""
    battery: Array
    """(T, N) 0 … 1, as last told."""
    armed: Flags
    """(T, N) as last told."""
    custom_mode: Integers
    """(T, N) the autopilot's number of its mode, as last told."""
    asked_ned: Array
    """(T, N, 3) m/s that the controller asked for."""
    sent_ned: Array
    """(T, N, 3) m/s that passed the gate; NaN for vehicles that were sent nothing."""
    verdict: Integers
    """(T, N) of the gate; −1 where it was not asked."""
    trust: Array
    """(T, N) 0 … 1; NaN outside the mission."""
    weights: Array
    """(T, N, N) row i is how much robot i heeds each; NaN where no control law ran."""
    virtual_ne: Array
    """(T, 2) m: the virtual leader; NaN outside the mission."""
    virtual_velocity_ne: Array
    """(T, 2) m/s."""
    ratings: tuple[Rating, ...]
    """What people said, with the time at which it counted."""
    parts: tuple[Parts, ...]
    """Who led and who was left behind, whenever it changed."""
    faults: tuple[FaultSpan, ...]
    """In the order in which they began; none where nobody knows."""
    happenings: tuple[Happening, ...]
    """In the order of time."""
    links: Links | None
    track: Track | None
    """The mission up to its read-out, for its score."""
    summary: Mapping[str, Any] | None
    """What the run reported, as in summary.json; None where the recording ends before it."""
    recovered: Mapping[str, str] | None
    """What `gcs log recover` found, lost and added, where it made this recording."""
    autopilot: Integers
    """(N,) MAV_AUTOPILOT of the heartbeats; 0 where none came."""
    faults_by: FaultsBy = "made"
    """Whence it is known what was wrong."""

    @property
    def acted(self) -> tuple[FaultSpan, ...]:
        """The faults that began before the mission was read out, or came to its end: those it can be told of."""
        until_s = -math.inf if self.track is None else float(self.track.time_s[-1])
        return tuple(span for span in self.faults if span.from_s < until_s - 1e-9)

    @property
    def onsets(self) -> dict[int, float]:
        """System id → seconds since mission start at which the first fault blamed on it began, of those that `acted`.

        Whoever is not in it was healthy, as far as is known: scores count from the same onsets.
        """
        return {} if self.track is None else struck(self.track, self.scenario)


def load(path: Path) -> History:
    """Read a recording, or the one in a run's folder. Raises UnreadableRecording."""
    path = located(path)
    with opened(path) as recording:
        heard = Heard.of(recording.messages, recording.scenario.swarm.count)
        if not heard.times:
            raise UnreadableRecording(f"{path}: holds no tick of a flight")
        history = _history(path, recording, heard)
        return replace(history, happenings=tuple(_happenings(history, heard)))


def _history(path: Path, recording: Recording, heard: Heard) -> History:
    """All but what is found in it."""
    scenario, told = recording.scenario, heard.topics
    ids = tuple(range(1, scenario.swarm.count + 1))
    n, states = len(ids), [told[f"/uav/{system}/state"] for system in ids]
    number = np.array(sorted(heard.times), np.int64)
    turns = [told["/tick"][tick] for tick in number.tolist()]
    mission, fleet, setpoint = told["/mission"], told["/swarm/state"], told["/setpoint"]
    reported = column(fleet, "position_m", number, n, 3) * (1.0, 1.0, -1.0)
    truth = column(told["/truth/pose"], "position_m", number, n, 3)
    commanded = column(setpoint, "commanded", number, n) > 0.0
    parts = tuple(map(parts_of, heard.events["/roles"]))
    known_by = faults_by(recording.metadata[METADATA], measured=not told["/truth/pose"])
    return History(
        path=path,
        scenario=scenario,
        metadata=recording.metadata[METADATA],
        problem=recording.problem,
        ids=ids,
        number=number,
        time_ns=np.array([heard.times[tick] for tick in number.tolist()], np.int64),
        lateness_s=np.array([turn["lateness_ns"] for turn in turns]) / 1e9,
        frames=np.array([turn["frames"] for turn in turns], np.int64),
        phase=tuple(turn["phase"] for turn in turns),
        mission_s=column(mission, "mission_s", number),
        task=tuple(mission[tick]["task"] if tick in mission else "" for tick in number.tolist()),
        position=np.where(np.isnan(truth), reported, truth),
        measured=not told["/truth/pose"],
        reported=reported,
        velocity_ned=column(fleet, "velocity_m_s", number, n, 3),
        age_s=column(fleet, "age_s", number, n),
        attitude_rpy=held(states, "attitude_rad", number, 3),
        battery=held(states, "battery", number),
        armed=held(states, "armed", number) > 0.0,
        custom_mode=_integers(held(states, "custom_mode", number), 0),
        asked_ned=column(setpoint, "asked", number, n, 3),
        sent_ned=np.where(commanded[..., None], column(setpoint, "sent", number, n, 3), np.nan),
        verdict=_integers(column(setpoint, "verdict", number, n), -1),
        trust=column(told["/trust"], "trust", number, n),
        weights=column(told["/weights"], "weights", number, n, n),
        virtual_ne=_pair(mission, "north_m", "east_m", number),
        virtual_velocity_ne=_pair(mission, "velocity_north_m_s", "velocity_east_m_s", number),
        ratings=tuple(map(rating_of, heard.events["/ratings"])),
        parts=parts,
        faults=() if known_by == "unknown" else tuple(spans(heard.events["/truth/fault"], scenario)),
        happenings=(),
        links=Links.of(told["/link"], heard.link_times),
        track=track_of(recording, told, parts),
        summary=recording.summary,
        recovered=recording.metadata.get(RECOVERED),
        autopilot=heard.autopilot,
        faults_by=known_by,
    )


def _pair(told: Told, north: str, east: str, number: Integers) -> Array:
    return np.column_stack([column(told, north, number), column(told, east, number)])


def _integers(values: Array, untold: int) -> Integers:
    return np.nan_to_num(values, nan=untold).astype(np.int64)


def _happenings(history: History, heard: Heard) -> Iterator[Happening]:
    """All of them, in the order of time: as /log has them, or else as they show; the truth and the end beside it."""
    row_at = partial(find.row_at, history.time_ns)
    logged = [(row_at(time_ns), kind, vehicle, said) for time_ns, kind, vehicle, said in heard.log]
    found = logged or list(_shown(history, heard))
    found += find.faults(history.faults, history.mission_s)
    if history.problem is not None and not any(history.problem == said for *_, said in found):
        found.append((_turned(history, logged=bool(logged)), Kind.PROBLEM, None, history.problem))
    for row, kind, vehicle, said in find.ordered(found):
        yield Happening(int(history.time_ns[row]), row, float(history.mission_s[row]), kind, vehicle, said)


def _shown(history: History, heard: Heard) -> Iterator[Found]:
    """What /log would have, of a recording that is older than it, in its order; who flies whom was not told then."""
    number, ids = history.number, history.ids
    ratings = ((find.row_at(number, content["tick"]), rating_of(content)) for content in heard.events["/ratings"])
    turns = ((row, heard.topics["/tick"][tick]["events"]) for row, tick in enumerate(number.tolist()))
    yield from find.operators_words((row, event) for row, events in turns for event in events)
    yield from find.ratings(ratings)
    yield from find.vehicles_words((find.row_at(number, tick), system, text) for tick, system, text in heard.spoken)
    yield from find.silences(history.age_s, ids)
    yield from find.phases(history.phase, history.task)
    if trust_of(history.scenario) is not None:
        flying = np.array([phase == Phase.MISSION.value for phase in history.phase])
        yield from find.distrust(np.where(flying[:, None], history.trust, np.nan), ids)
    yield from find.roles(history.parts, history.mission_s)


def _turned(history: History, *, logged: bool) -> int:
    """The row of a problem that /log does not have: where two vehicles touched, or the flight turned to its end.

    What the flight did not know of, as a disk that was full, stands at its last row.
    """
    last, track = len(history.phase) - 1, history.track
    if track is not None and history.problem == collision(min_separation(track.position)):
        return find.row_at(history.mission_s, float(track.time_s[separation(track.position).argmin()]))
    if logged or history.problem == CUT_SHORT:
        return last
    return next((row for row, phase in enumerate(history.phase) if phase in ENDS), last)


ENDS = (Phase.HOLD.value, Phase.LAND.value, Phase.DONE.value)
"""Phases in which a flight that cannot go on ends."""
