"""What happened, in a dozen sentences or little more, as somebody would tell it who was there."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gcs.flight_state import Phase
from gcs.recording.reader import CUT_SHORT
from gcs.report.meanwhile import meanwhile
from gcs.report.series import heeded
from gcs.report.telling import FEW, MOST, fitted
from gcs.report.told import Told
from gcs.scoring import AIRBORNE
from gcs.words import controller_name, robots

NUMBERS = ["No", "One", "Two", "Three", "Four", "Five", "Six", "Seven", "Eight", "Nine", "Ten", "Eleven", "Twelve"]
WHENCE = {
    "truth": "it was told by the simulation who fails",
    "auto": "whom to trust, the swarm had to find out from behaviour alone",
    "ratings": "it trusted whom people trust",
    "fused": "it trusted by behaviour and by what people said",
}


def story(told: Told) -> tuple[str, ...]:
    """Paragraphs: how it began, what happened, how it ended; those that have nothing to tell are left out."""
    begun, ended = list(_beginning(told)), list(_end(told))
    flown = [sentence.said for sentence in fitted(meanwhile(told), MOST - len(begun) - len(ended))]
    return tuple(" ".join(part) for part in (begun, flown, ended) if part)


def _beginning(told: Told) -> Iterator[str]:
    history = told.history
    many = _many(told.count)
    climbs = _first(told, Phase.CLIMB)
    if climbs is None and not told.mission.size:
        yield f"{many} {'was' if told.count == 1 else 'were'} waited for, and never took off."
        return
    yield f"{many} took off{'' if climbs is None else _climbed(told, climbs)}."
    whence = f": {WHENCE[told.trust_source]}" if told.trust_source else ", which asks for no trust"
    if told.trust_source == "ratings" and not history.ratings and not history.metadata.get("ratings"):
        whence = ": it trusted as people did on average in the user study"
    yield f"The controller was {_lower(controller_name(history.scenario))}{whence}."


def _climbed(told: Told, climbs: int) -> str:
    """When all were up, if they ever were. climbs: the row in which it began."""
    phases = (Phase.TAKE_CONTROL, Phase.RUN_UP, Phase.MISSION)
    up = next((row for row in (_first(told, phase) for phase in phases) if row is not None), None)
    if up is None:
        return ""
    height, took_s = f"{told.history.scenario.swarm.altitude_m:g} m up", told.since_s[up] - told.since_s[climbs]
    return f" and was {height} {took_s:.1f} s later" if told.count == 1 else f"; {took_s:.1f} s later all were {height}"


def _end(told: Told) -> Iterator[str]:
    history = told.history
    yield from _heeded(told)
    if told.score is not None:
        yield _judged(told)
    lasted_s = told.since_s[-1] - told.since_s[0]
    phase = history.phase[-1]
    if history.problem == CUT_SHORT:
        yield f"The recording breaks off {lasted_s:.1f} s after its start, in the phase “{phase}”."
    elif history.problem is not None:
        yield f"It did not end as planned: {history.problem}."
    if phase == Phase.DONE.value:
        yield f"All was over after {lasted_s:.1f} s{_down(told)}."
    elif history.problem is None:
        yield f"The recording ends after {lasted_s:.1f} s, in the phase “{phase}”."
    yield from _rebuilt(told)


def _rebuilt(told: Told) -> Iterator[str]:
    """What is missing in a recording that `gcs log recover` made."""
    recovered = told.history.recovered
    if recovered is None:
        return
    lost_s, frames = float(recovered.get("seconds_lost", "nan")), recovered.get("frames_added", "0")
    lost = f": {lost_s:.1f} s of it are lost" if lost_s > 0.0 else ""
    added = f"; {frames} frames are from its journal alone" if frames != "0" else ""
    yield f"This recording was rebuilt from a damaged one{lost}{added}."


def _down(told: Told) -> str:
    """Who was back on the ground, as far as that is known."""
    flew = told.mission.size or _first(told, Phase.CLIMB) is not None
    if not flew or not np.isfinite(told.history.position[-1]).all():
        return ""
    ids, height = told.history.ids, told.history.position[-1, :, 2]
    mute = told.silent[-1] if told.history.measured else np.zeros(told.count, bool)
    up = [ids[row] for row in np.flatnonzero(~mute & (height >= AIRBORNE))]
    said = f"; {robots(up)} still in the air" if up else "" if mute.any() else ", everyone back on the ground"
    for row in np.flatnonzero(mute)[:FEW]:
        said += f"; robot {ids[row]} was last heard {told.history.age_s[-1, row]:.0f} s before, {height[row]:.1f} m up"
    return said


def _heeded(told: Told) -> Iterator[str]:
    """What became of the failed robots' say: it tells why it ended well or badly."""
    failed = [row for row, look in enumerate(told.looks) if look == "failed"]
    if not failed or not told.mission.size or told.count < 2:
        return
    history = told.history
    ruled = told.mission[np.isfinite(history.weights[told.mission]).all(axis=(1, 2))]
    last_leg = ruled[history.mission_s[ruled] >= told.plan.hand_over_s]
    if not last_leg.size:
        return
    share = heeded(history.weights[last_leg], told.scored).mean(axis=0)[failed]
    few, alone = len(failed) <= FEW, len(failed) == 1
    whom = robots([history.ids[row] for row in failed]) if few else f"the {len(failed)} failed robots"
    equal, together = len(failed) / told.count, float(share.sum())
    in_all = "" if alone else " together"
    if share.min() >= 0.8 / told.count:
        yield f"On the last leg {whom} counted for as much as anybody: {together:.1%} of what is heeded{in_all}."
    else:
        counted = "next to nothing" if together < 0.001 else f"{together:.1%} of what is heeded"
        yield f"On the last leg {whom} counted for {counted}{in_all}, where an equal share is {equal:.1%}."


def _judged(told: Told) -> str:
    score, expect = told.score, told.history.scenario.expect
    assert score is not None
    close = score.min_separation_m
    apart = (
        ""
        if close >= expect.min_separation_m
        else f", and robots had come within {close:.2f} m of each other (allowed {expect.min_separation_m:g} m)"
    )
    return (
        f"As results were read, {told.plan.read_out_s:.1f} s into the mission, {told.mean} had gone "
        f"{score.heading_error_deg:.1f}° off its heading (allowed {expect.heading_error_deg:g}°) and was "
        f"{score.distance_to_target_m:.1f} m from its target (allowed {expect.distance_to_target_m:g} m){apart}: "
        f"the mission {'passed' if told.passed else 'failed'}."
    )


def _first(told: Told, phase: Phase) -> int | None:
    return told.history.phase.index(phase.value) if phase.value in told.history.phase else None


def _many(count: int) -> str:
    number = NUMBERS[count] if count < len(NUMBERS) else str(count)
    return f"{number} {'robot' if count == 1 else 'robots'}"


def _lower(name: str) -> str:
    """In the middle of a sentence: names of people and of rules keep their capitals."""
    return "the " + name[0].lower() + name[1:] if name.startswith(("Averaged", "Coordinate")) else name
