"""What happened between take-off and landing, a strand for each kind of thing; what matters most comes first."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from gcs.recording.history import Kind
from gcs.report.distrust import Distrust, distrusts
from gcs.report.rated import in_words
from gcs.report.telling import FEW, Sentence, Strand, capital, counted, crowd, listed, some
from gcs.report.told import Told
from gcs.words import faults, robots


def meanwhile(told: Told) -> list[Strand]:
    """Before the mission too; of a flight that never began its mission, only who said what and who was silent."""
    people = [*_operator(told), *_hands(told), *_silences(told)]
    if not told.mission.size:
        return people
    return [*_calls(told), *people, *_faults(told), *_distrust(told), *_left(told), *in_words(told), *_legs(told)]


def when(told: Told, at_s: float) -> str:
    """As a sentence begins. at_s: since mission start."""
    if not told.mission.size:
        return f"{at_s:.1f} s into the recording"
    return f"At {at_s:.1f} s" if at_s >= 0.0 else f"{-at_s:.1f} s before the mission"


def _from(told: Told, at_s: float) -> str:
    return f"From {at_s:.1f} s on" if told.mission.size and at_s >= 0.0 else f"{when(told, at_s)} and later"


def _span(times_s: Sequence[float]) -> str:
    """As a sentence on several things in the mission begins."""
    first, last = f"{min(times_s):.1f} s", f"{max(times_s):.1f} s"
    return f"At {first}" if first == last else f"From {first} to {last}"


def _seconds(lasting_s: Sequence[float]) -> str:
    least, most = f"{min(lasting_s):.1f} s", f"{max(lasting_s):.1f} s"
    return least if least == most else f"{least} to {most}"


def _operator(told: Told) -> Iterator[Strand]:
    said = [one for one in told.history.happenings if one.kind is Kind.WORD and one.vehicle is None]
    if not said:
        return
    times_s = [float(told.since_s[one.tick]) for one in said]
    sentences = [Sentence(at_s, f"{when(told, at_s)} {one.words}.") for at_s, one in zip(times_s, said, strict=True)]
    words = [f"“{one.words.split(': ', 1)[-1]}”" for one in said]
    most = " and ".join(words) if len(words) < FEW else f"{', '.join(words[: FEW - 1])}, …, at last {words[-1]}"
    in_sum = f"{_from(told, times_s[0])} the operator spoke {len(said)} times: {most}."
    yield Strand(tuple(sentences), Sentence(times_s[0], in_sum))


def _hands(told: Told) -> Iterator[Strand]:
    """Who was not ours any more, and who was again."""
    changed = [one for one in told.history.happenings if one.kind is Kind.HANDS]
    if not changed:
        return
    times_s = [float(told.since_s[one.tick]) for one in changed]
    sentences = [Sentence(at_s, f"{when(told, at_s)} {one.words}.") for at_s, one in zip(times_s, changed, strict=True)]
    whom = sorted({one.vehicle for one in changed if one.vehicle is not None})
    often = f"{crowd(whom)} changed hands, {len(changed)} times in all"
    in_sum = f"{_from(told, times_s[0])} {often}; at last {changed[-1].words}."
    yield Strand(tuple(sentences), Sentence(times_s[0], in_sum))


def _silences(told: Told) -> Iterator[Strand]:
    """Who was not heard any more, and who came back."""
    ever = told.silent.any(axis=0)
    if not ever.any():
        return
    whom = [told.history.ids[row] for row in np.flatnonzero(ever)]
    back = [told.history.ids[row] for row in np.flatnonzero(ever & ~told.silent[-1])]
    at_s = float(told.since_s[int(told.silent.any(axis=1).argmax())])
    begins = when(told, at_s) if len(whom) == 1 else _from(told, at_s)
    heard = "" if not back else ", for a while" if back == whom else f"; {robots(back)} came back"
    yield Strand.one(at_s, f"{begins} {crowd(whom)} fell silent{heard}.")


def _calls(told: Told) -> Iterator[Strand]:
    """How the mission began, and the emergency calls."""
    scenario, segments, reached_s = told.history.scenario, told.plan.segments, told.since_s[told.mission[-1]]
    yield Strand.one(0.0, f"The mission began: “{segments[0].task}”.")
    calls = [event.at_length_m / scenario.mission.cruise_m_s for event in scenario.event]
    begun = [
        (segment.begins_s, before.task, segment.task)
        for before, segment in pairwise(segments)
        if segment.begins_s <= reached_s + 1e-9 and any(math.isclose(segment.begins_s, call) for call in calls)
    ]
    if begun:
        sentences = (
            Sentence(at_s, f"At {at_s:.1f} s an emergency call broke off “{before}”: on to “{now}”.")
            for at_s, before, now in begun
        )
        times = listed([f"{at_s:.1f} s" for at_s, *_ in begun])
        in_sum = f"Emergency calls broke off what was being flown at {times}, the last for “{begun[-1][2]}”."
        yield Strand(tuple(sentences), Sentence(begun[0][0], in_sum))


def _legs(told: Told) -> Iterator[Strand]:
    """Legs that were begun as planned."""
    scenario, reached_s = told.history.scenario, told.since_s[told.mission[-1]]
    calls = [event.at_length_m / scenario.mission.cruise_m_s for event in scenario.event]
    begun = [
        segment
        for segment in told.plan.segments[1:]
        if segment.begins_s <= reached_s + 1e-9 and not any(math.isclose(segment.begins_s, call) for call in calls)
    ]
    if begun:
        sentences = (Sentence(leg.begins_s, f"At {leg.begins_s:.1f} s it was time for “{leg.task}”.") for leg in begun)
        span = _span([leg.begins_s for leg in begun])
        in_sum = Sentence(begun[0].begins_s, f"{span} {len(begun)} more legs began, the last “{begun[-1].task}”.")
        yield Strand(tuple(sentences), in_sum, spared=f"{counted(len(begun), 'leg')} begun as planned")


def _faults(told: Told) -> Iterator[Strand]:
    """The truth, once a fault, however often it comes and goes; what was planned where nobody knows it."""
    if not told.faults_known:
        planned = faults(told.history.scenario)
        if planned:
            yield Strand.one(0.0, f"The scenario has {some(planned)}; whether it was so, nobody told.")
        return
    by = "by the scenario" if told.planned else ""
    firsts = {span.words: span.from_s for span in reversed(told.history.acted)}
    from_the_start = [said for said, at_s in firsts.items() if at_s <= 0.0]
    later = sorted((at_s, said) for said, at_s in firsts.items() if at_s > 0.0)
    if from_the_start:
        untold = "" if told.trust_source == "truth" or told.planned else ", and no controller was told"
        begins = capital(f"{by} something was wrong".strip())
        tells = "; whether the vehicles flew so, they do not tell" if told.planned else ""
        yield Strand.one(0.0, f"{begins} from the start{untold}: {some(from_the_start)}{tells}.")
    if later:
        by = f", {by}," if by else ""
        sentences = (Sentence(at_s, f"At {at_s:.1f} s{by} something went wrong: {said}.") for at_s, said in later)
        number = f"{len(later)}{' more' if from_the_start else ''} things"
        what = some([said for _, said in later])
        in_sum = f"{_span([at_s for at_s, _ in later])}{by} {number} went wrong: {what}."
        yield Strand(tuple(sentences), Sentence(later[0][0], in_sum))
    if not firsts:
        said = capital(f"{by} nothing was wrong with anybody.".strip())
        yield Strand.one(0.0, said, spared="that nothing was wrong")


def _distrust(told: Told) -> Iterator[Strand]:
    """When trust fell, how soon after the onset, and whether rightly."""
    about = distrusts(told)
    found, wronged = [one for one in about if one.found], [one for one in about if one.wronged]
    if found:
        times_s, delays_s = [one.rightly_s for one in found], [one.delay_s for one in found]
        in_sum = (
            f"{_span(times_s)} {crowd([one.system for one in found])} were rightly distrusted, "
            f"{_seconds(delays_s)} after their faults began."
        )
        yield Strand(tuple(_found(one) for one in found), Sentence(min(times_s), in_sum))
    if wronged:
        times_s = [one.wrongly_s for one in wronged]
        though = " though nothing was wrong with them" if told.faults_known else ""
        in_sum = f"{_span(times_s)} {crowd([one.system for one in wronged])} were distrusted{though}."
        sentences = tuple(_wronged(one, known=told.faults_known) for one in wronged)
        yield Strand(sentences, Sentence(min(times_s), in_sum))
    missed = [one.system for one in about if one.missed]
    if missed:
        after = " since its fault began" if len(missed) == 1 and any(one.system in missed for one in wronged) else ""
        said = f"Trust in {crowd(missed)} never fell below one half{after}."
        yield Strand.one(float(told.since_s[told.mission[-1]]), said)


def _found(one: Distrust) -> Sentence:
    again = "; it was trusted again later" if one.trusted_again else ""
    if one.delay_s > 1e-6:
        after = f", {one.delay_s:.1f} s after its fault began" if one.onset_s > 0.0 else ""
        said = f"At {one.rightly_s:.1f} s{after}, trust in robot {one.system} fell below one half{again}."
    elif one.wronged:
        said = f"At {one.onset_s:.1f} s its fault began, and robot {one.system} was distrusted{again}."
    else:
        said = f"Robot {one.system} was distrusted at once{again}."
    return Sentence(one.rightly_s, said)


def _wronged(one: Distrust, *, known: bool) -> Sentence:
    yet = " yet" if math.isfinite(one.onset_s) else ""
    again = " and trusted again later" if one.trusted_again else ""
    though = f" though nothing was wrong with it{yet}" if known else ""
    return Sentence(one.wrongly_s, f"At {one.wrongly_s:.1f} s robot {one.system} was distrusted{though}{again}.")


def _left(told: Told) -> Iterator[Strand]:
    """Who was left behind and taken back, and who took the lead."""
    left, back, led = [], [], []
    for before, now in pairwise(told.history.parts):
        at_s = now.time_s
        if gone := sorted(set(now.left_behind) - set(before.left_behind)):
            left.append(Sentence(at_s, f"At {at_s:.1f} s the swarm left {robots(gone)} behind."))
        if come := sorted(set(before.left_behind) - set(now.left_behind)):
            back.append(Sentence(at_s, f"At {at_s:.1f} s it took {robots(come)} back."))
        led += [
            Sentence(at_s, f"At {at_s:.1f} s robot {new} took the lead from robot {old}.")
            for old, new in zip(before.leaders, now.leaders, strict=True)
            if old != new
        ]
    parts = told.parts_at_the_end()
    if left:
        gone_now = f"at last {crowd(parts.left_behind)}" if parts.left_behind else "at last nobody"
        said = f"From {left[0].at_s:.1f} s on the swarm left robots behind {len(left)} times, {gone_now}."
        yield Strand(tuple(left), Sentence(left[0].at_s, said))
    if back:
        said = f"From {back[0].at_s:.1f} s on it took robots back {len(back)} times."
        yield Strand(tuple(back), Sentence(back[0].at_s, said))
    if led:
        said = f"From {led[0].at_s:.1f} s on the lead changed {len(led)} times: at last {crowd(parts.leaders)} led."
        yield Strand(tuple(led), Sentence(led[0].at_s, said), spared=f"{counted(len(led), 'change')} of the lead")
