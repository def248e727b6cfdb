"""Histories of tests: recorded ones, read once, and one made by hand of any number of robots."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from flights import SHORT, fly_and_record, recorded

from gcs.events import Rating
from gcs.gate import LOST_NS
from gcs.mission import plan
from gcs.recording.history import FaultSpan, load
from gcs.track import Parts, Track
from scenarios import load as scenario_of
from scenarios import offsets_ne

AVERAGE = 'control.rule="average"'
AUTO = 'trust.source="auto"'


@cache
def flown(*overrides):
    """The emergency as `gcs run` flies it."""
    return load(recorded("emergency", *overrides).path)


@cache
def unreached():
    """A demo that ran out of time before its mission began."""
    return load(fly_and_record("demo", *SHORT, "time.timeout_s=4").path)


def believing(history, trust):
    """The same flight, but with this trust (T, N)."""
    return replace(history, trust=trust, track=replace(history.track, trust=trust))


def live(history, *, silent=(), from_s=5.0):
    """The same flight as telemetry told it: nothing tells the truth, and some robots fall silent for good."""
    rows = [system - 1 for system in silent]
    since = np.maximum(history.mission_s - from_s, 0.0)
    position, age_s, last = history.position.copy(), history.age_s.copy(), int(np.argmax(since > 0.0))
    position[last:, rows], age_s[:, rows] = position[last, rows], since[:, None]
    known = np.where((age_s > LOST_NS / 1e9)[..., None], np.nan, position)
    track = replace(history.track, position=known, measured=True, faults_known=False)
    return replace(history, position=position, age_s=age_s, measured=True, faults=(), faults_by="unknown", track=track)


def dragged(rows, columns, *overrides, said=()):
    """The emergency of any number of robots that keep to the plan, but the failed one, which stays at home.

    It is distrusted 2 s after mission start. said: ratings;  the fault begins when the scenario has it.
    """
    scenario = scenario_of("emergency", overrides=(f"swarm.rows={rows}", f"swarm.columns={columns}", *overrides))
    path, count = plan(scenario), scenario.swarm.count
    mission_s = np.round(np.arange(0.0, path.read_out_s + 0.05, 0.1), 6)
    ticks = len(mission_s)
    virtual = np.array([_on_the_way(path, at_s) for at_s in mission_s])
    position = np.full((ticks, count, 3), scenario.swarm.altitude_m)
    position[..., :2] = virtual[:, None] + offsets_ne(scenario)
    failed = scenario.fault[0].vehicle - 1
    position[:, failed, :2] = offsets_ne(scenario)[failed]
    trust = np.ones((ticks, count))
    trust[mission_s >= 2.0, failed] = 0.1
    weights = np.full((ticks, count, count), 1.0 / count)
    onset_s = scenario.fault[0].onset_s
    nothing = np.zeros((ticks, count, 3))
    parts = (Parts(0.0, scenario.swarm.leaders, ()),)
    return replace(
        flown(AUTO),
        path=Path("runs/made/run.mcap"),
        scenario=scenario,
        metadata={"scenario": "emergency", "seed": "1", "ratings": ""},
        problem=None,
        ids=tuple(range(1, count + 1)),
        number=np.arange(ticks),
        time_ns=np.round(mission_s * 1e9).astype(np.int64),
        lateness_s=np.zeros(ticks),
        frames=np.full(ticks, 2 * count),
        phase=("mission",) * ticks,
        mission_s=mission_s,
        task=tuple(path.segment_at(at_s).task for at_s in mission_s),
        position=position,
        measured=False,
        reported=position,
        velocity_ned=nothing,
        age_s=np.zeros((ticks, count)),
        attitude_rpy=nothing,
        battery=np.ones((ticks, count)),
        armed=np.ones((ticks, count), bool),
        custom_mode=np.zeros((ticks, count), np.int64),
        asked_ned=nothing,
        sent_ned=nothing,
        verdict=np.zeros((ticks, count), np.int64),
        trust=trust,
        weights=weights,
        virtual_ne=virtual,
        virtual_velocity_ne=np.zeros((ticks, 2)),
        ratings=tuple(Rating(*one) for one in said),
        parts=parts,
        faults=(FaultSpan(failed + 1, "motor_degradation", onset_s, np.inf, f"robot {failed + 1} at 40% speed"),),
        happenings=(),
        links=None,
        track=Track(mission_s, position, trust, virtual, measured=False, parts=parts),
    )


def _on_the_way(path, at_s):
    segment = path.segment_at(at_s)
    return segment.start_ne + segment.velocity_ne * (min(at_s, segment.ends_s) - segment.begins_s)
