"""What happened, in a dozen sentences at most, as somebody would tell it who was there."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise

import numpy as np

from gcs.events import Rating
from gcs.flight_state import Phase
from gcs.gate import LOST_NS
from gcs.recording.happenings import Kind
from gcs.report.series import heeded
from gcs.report.told import Told
from gcs.scoring import AIRBORNE, DISTRUSTED
from gcs.words import controller_name, robots

MOST = 12
"""Sentences."""
ALWAYS, OFTEN, SELDOM = 0, 1, 2
"""How soon a sentence goes when there are too many: SELDOM ones first."""
FEW = 4
"""Things of a kind that are told one by one."""
NUMBERS = ["No", "One", "Two", "Three", "Four", "Five", "Six", "Seven", "Eight", "Nine", "Ten", "Eleven", "Twelve"]
WHENCE = {
    "truth": "it was told by the simulation who fails",
    "auto": "whom to trust, the swarm had to find out from behaviour alone",
    "ratings": "it trusted whom people trust",
    "fused": "it trusted by behaviour and by what people said",
}


@dataclass(frozen=True, slots=True)
class Sentence:
    """One thing that happened."""

    at_s: float
    """Since mission start, as are all."""
    rank: int
    said: str


def story(told: Told) -> tuple[str, ...]:
    """Paragraphs: how it began, the mission, how it ended; those that have nothing to tell are left out."""
    begun, flown, ended = list(_beginning(told)), sorted(_mission(told), key=lambda s: s.at_s), list(_end(told))
    while len(begun) + len(flown) + len(ended) > MOST and any(sentence.rank > ALWAYS for sentence in flown):
        flown.remove(max(reversed(flown), key=lambda sentence: sentence.rank))
    flown = flown[: max(MOST - len(begun) - len(ended), 0)]
    return tuple(" ".join(sentence.said for sentence in part) for part in (begun, flown, ended) if part)


def _beginning(told: Told) -> Iterator[Sentence]:
    history = told.history
    many = _many(told.count)
    climbs = _first(told, Phase.CLIMB)
    if climbs is None:
        yield Sentence(
            -math.inf, ALWAYS, f"{many} {'was' if told.count == 1 else 'were'} waited for, and never took off."
        )
        return
    up = next(filter(None, (_first(told, phase) for phase in (Phase.TAKE_CONTROL, Phase.RUN_UP, Phase.MISSION))), None)
    height = f"{history.scenario.swarm.altitude_m:g} m up"
    climbed = f"; {told.since_s[up] - told.since_s[climbs]:.1f} s later all were {height}" if up else ""
    if told.count == 1 and up:
        climbed = f" and was {height} {told.since_s[up] - told.since_s[climbs]:.1f} s later"
    yield Sentence(-math.inf, ALWAYS, f"{many} took off{climbed}.")
    whence = f": {WHENCE[told.trust_source]}" if told.trust_source else ", which asks for no trust"
    if told.trust_source == "ratings" and not history.ratings and not history.metadata.get("ratings"):
        whence = ": it trusted as people did on average in the user study"
    yield Sentence(-math.inf, ALWAYS, f"The controller was {_lower(controller_name(history.scenario))}{whence}.")


def _mission(told: Told) -> Iterator[Sentence]:
    if not told.mission.size:
        return
    yield from _tasks(told)
    yield from _faults(told)
    if told.trust_source is not None:
        yield from _distrust(told)
        yield from _missed(told)
    yield from _roles(told)
    yield from _ratings(told)
    yield from _silences(told)
    yield from _operator(told)


def _tasks(told: Told) -> Iterator[Sentence]:
    segments, scenario = told.plan.segments, told.history.scenario
    reached_s = told.since_s[told.mission[-1]]
    yield Sentence(0.0, ALWAYS, f"The mission began: “{segments[0].task}”.")
    calls = [event.at_length_m / scenario.mission.cruise_m_s for event in scenario.event]
    for before, segment in pairwise(segments):
        at_s = segment.begins_s
        if at_s > reached_s + 1e-9:
            return
        if any(math.isclose(at_s, call) for call in calls):
            yield Sentence(
                at_s, ALWAYS, f"At {at_s:.1f} s an emergency call broke off “{before.task}”: on to “{segment.task}”."
            )
        else:
            yield Sentence(at_s, OFTEN, f"At {at_s:.1f} s it was time for “{segment.task}”.")


def _faults(told: Told) -> Iterator[Sentence]:
    """The truth, once a fault, however often it comes and goes."""
    firsts = {span.words: span.from_s for span in reversed(told.history.faults)}
    from_the_start = [said for said, at_s in firsts.items() if at_s <= 0.0]
    if from_the_start:
        said = " and ".join(from_the_start[:FEW])
        more = f", and {len(from_the_start) - FEW} more" if len(from_the_start) > FEW else ""
        yield Sentence(0.0, ALWAYS, f"Something was wrong from the start, and no controller was told: {said}{more}.")
    for said, at_s in firsts.items():
        if at_s > 0.0:
            yield Sentence(at_s, OFTEN, f"At {at_s:.1f} s something went wrong: {said}.")
    if not firsts and not told.history.measured:
        yield Sentence(0.0, SELDOM, "Nothing was wrong with anybody.")


def _distrust(told: Told) -> Iterator[Sentence]:
    """When trust fell, and how soon after the onset."""
    trust, rows = told.history.trust[told.mission], told.mission
    for column, (system, look) in enumerate(zip(told.history.ids, told.looks, strict=True)):
        low = np.flatnonzero(trust[:, column] < DISTRUSTED)
        if not low.size:
            continue
        at_s = float(told.since_s[rows[low[0]]])
        spans = [span.from_s for span in told.history.faults if span.vehicle == system]
        onset_s = min(spans, default=math.inf)
        if look == "doubted" or at_s < onset_s - 1e-9:
            again = " and trusted again later" if trust[-1, column] >= DISTRUSTED else ""
            yield Sentence(
                at_s, OFTEN, f"At {at_s:.1f} s robot {system} was distrusted though nothing was wrong with it{again}."
            )
        elif at_s - onset_s < 1e-6:
            yield Sentence(at_s, ALWAYS, f"Robot {system} was distrusted at once.")
        else:
            after = f", {at_s - onset_s:.1f} s after its fault began" if onset_s > 0.0 else ""
            yield Sentence(at_s, ALWAYS, f"At {at_s:.1f} s{after}, trust in robot {system} fell below one half.")


def _missed(told: Told) -> Iterator[Sentence]:
    """Who failed and was trusted to the end."""
    trust = told.history.trust[told.mission]
    missed = [
        system
        for column, (system, look) in enumerate(zip(told.history.ids, told.looks, strict=True))
        if look == "failed"
        and any(span.vehicle == system for span in told.history.faults)
        and not (trust[:, column] < DISTRUSTED).any()
    ]
    if missed:
        yield Sentence(told.since_s[told.mission[-1]], OFTEN, f"Trust in {robots(missed)} never fell below one half.")


def _roles(told: Told) -> Iterator[Sentence]:
    for before, now in pairwise(told.history.parts):
        led = [(new, old) for old, new in zip(before.leaders, now.leaders, strict=True) if old != new]
        for new, old in led:
            yield Sentence(now.time_s, OFTEN, f"At {now.time_s:.1f} s robot {new} took the lead from robot {old}.")
        left = sorted(set(now.left_behind) - set(before.left_behind))
        back = sorted(set(before.left_behind) - set(now.left_behind))
        if left:
            yield Sentence(now.time_s, ALWAYS, f"At {now.time_s:.1f} s the swarm left {robots(left)} behind.")
        if back:
            yield Sentence(now.time_s, OFTEN, f"At {now.time_s:.1f} s it took {robots(back)} back.")


def _ratings(told: Told) -> Iterator[Sentence]:
    """Who said what, one by one if it is little."""
    said = [rating for rating in told.history.ratings if rating.time_s is not None]
    if not said:
        return
    first_s = min(rating.time_s for rating in said if rating.time_s is not None)
    raters = sorted({rating.rater for rating in said})
    if len(said) <= FEW:
        for rater, of_one in groupby(sorted(said, key=lambda rating: rating.rater), key=lambda rating: rating.rater):
            given = list(of_one)
            yield Sentence(
                given[0].time_s or 0.0, OFTEN, f"{rater} gave {_listed([_given(rating) for rating in given])}."
            )
        return
    who = raters[0] if len(raters) == 1 else f"{len(raters)} people"
    means = {
        system: float(np.mean([rating.rating for rating in said if rating.vehicle == system]))
        for system in sorted({rating.vehicle for rating in said if rating.vehicle is not None})
    }
    worst = (
        f"; robot {min(means, key=means.__getitem__)} came off worst, {min(means.values()):.1f} of 5 on average"
        if means
        else ""
    )
    yield Sentence(first_s, OFTEN, f"From {first_s:.1f} s on {who} gave {len(said)} ratings{worst}.")


def _given(rating: Rating) -> str:
    whom = "the swarm" if rating.vehicle is None else f"robot {rating.vehicle}"
    return f"{rating.rating} of 5 to {whom} at {rating.time_s:.1f} s"


def _silences(told: Told) -> Iterator[Sentence]:
    """Who was not heard any more, and who came back."""
    about = [one for one in told.history.happenings if one.kind is Kind.LINK and one.vehicle is not None]
    if not about:
        return
    whom = sorted({one.vehicle for one in about if one.vehicle is not None})
    mute = told.history.age_s[-1] > LOST_NS / 1e9
    back = [system for system, silent in zip(told.history.ids, mute, strict=True) if system in whom and not silent]
    at_s = float(told.since_s[about[0].tick])
    first = f"At {at_s:.1f} s" if len(about) <= 2 else f"From {at_s:.1f} s on"
    heard = "" if not back else ", for a while" if back == whom else f"; {robots(back)} came back"
    yield Sentence(at_s, ALWAYS, f"{first} {robots(whom)} fell silent{heard}.")


def _operator(told: Told) -> Iterator[Sentence]:
    for one in told.history.happenings:
        if one.kind is Kind.WORD and one.vehicle is None:
            at_s = float(told.since_s[one.tick])
            yield Sentence(at_s, ALWAYS, f"At {at_s:.1f} s {one.words}.")


def _end(told: Told) -> Iterator[Sentence]:
    history = told.history
    yield from _heeded(told)
    if told.score is not None:
        yield _judged(told)
    if history.problem is not None:
        yield Sentence(math.inf, ALWAYS, f"It did not end as planned: {history.problem}.")
    if not told.since_s.size:
        return
    lasted_s = told.since_s[-1] - told.since_s[0]
    if history.phase[-1] == Phase.DONE.value:
        yield Sentence(math.inf, ALWAYS, f"All was over after {lasted_s:.1f} s{_down(told)}.")
    elif history.problem is None:
        yield Sentence(math.inf, ALWAYS, f"The recording ends after {lasted_s:.1f} s, {history.phase[-1]}.")


def _down(told: Told) -> str:
    """Who was back on the ground, where that is known."""
    up = [
        system
        for system, height in zip(told.history.ids, told.history.position[-1, :, 2], strict=True)
        if height >= AIRBORNE
    ]
    if _first(told, Phase.CLIMB) is None or not np.isfinite(told.history.position[-1]).all():
        return ""
    return f"; {robots(up)} still in the air" if up else ", everyone back on the ground"


def _heeded(told: Told) -> Iterator[Sentence]:
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
    whom = robots([history.ids[row] for row in failed]) if len(failed) <= FEW else f"the {len(failed)} failed robots"
    equal = 1.0 / told.count
    most = float(share.max())
    if most >= 0.8 * equal:
        said = f"On the last leg {whom} counted for as much as anybody: {most:.1%} of what is heeded."
    else:
        counted = "next to nothing" if most < 0.001 else f"{most:.1%} of what is heeded"
        said = f"On the last leg {whom} counted for {counted}, where an equal share is {equal:.1%}."
    yield Sentence(told.plan.read_out_s, ALWAYS, said)


def _judged(told: Told) -> Sentence:
    score, expect = told.score, told.history.scenario.expect
    assert score is not None
    close = score.min_separation_m
    apart = (
        ""
        if close >= expect.min_separation_m
        else f", and robots had come within {close:.2f} m of each other (allowed {expect.min_separation_m:g} m)"
    )
    return Sentence(
        told.plan.read_out_s,
        ALWAYS,
        f"As results were read, {told.plan.read_out_s:.1f} s into the mission, the healthy robots' mean had gone "
        f"{score.heading_error_deg:.1f}° off its heading (allowed {expect.heading_error_deg:g}°) and was "
        f"{score.distance_to_target_m:.1f} m from its target (allowed {expect.distance_to_target_m:g} m){apart}: "
        f"the mission {'passed' if told.passed else 'failed'}.",
    )


def _first(told: Told, phase: Phase) -> int | None:
    return told.history.phase.index(phase.value) if phase.value in told.history.phase else None


def _many(count: int) -> str:
    number = NUMBERS[count] if count < len(NUMBERS) else str(count)
    return f"{number} {'robot' if count == 1 else 'robots'}"


def _listed(things: Sequence[str]) -> str:
    return things[0] if len(things) == 1 else f"{', '.join(things[:-1])} and {things[-1]}"


def _lower(name: str) -> str:
    """In the middle of a sentence: names of people and of rules keep their capitals."""
    return "the " + name[0].lower() + name[1:] if name.startswith(("Averaged", "Coordinate")) else name
