"""Of one flight its story, the table, the caption under trust and what was logged in flight tell the same."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from pages import AUTO, AVERAGE, believing, dragged, flown, live, unreached

from gcs.recording.history import Kind
from gcs.report.believed import trust
from gcs.report.distrust import distrusts
from gcs.report.story import story
from gcs.report.told import Told
from gcs.report.verdicts import verdicts


def early():
    """Rated down seven seconds before its fault begins."""
    return dragged(2, 3, "fault.0.onset_s=9")


def slandered():
    """Two that nothing is wrong with are distrusted for a second, beside the one that failed."""
    history = dragged(2, 3)
    doubts = history.trust.copy()
    doubts[50:60, [0, 3]] = 0.3
    return believing(history, doubts)


def blind():
    """The failed one is trusted all the way."""
    history = dragged(2, 3)
    return believing(history, np.ones_like(history.trust))


def cut_short():
    """Broken off before its read-out: there is no score."""
    history = dragged(2, 3)
    rows = {name: getattr(history.track, name)[:100] for name in ("time_s", "position", "trust", "virtual_ne")}
    mission_s = np.where(np.arange(len(history.mission_s)) < 100, history.mission_s, np.nan)
    return replace(history, mission_s=mission_s, track=replace(history.track, **rows))


FLIGHTS = {
    "auto": lambda: flown(AUTO),
    "average": lambda: flown(AVERAGE),
    "truth": lambda: flown(),
    "early": early,
    "late": lambda: dragged(2, 3, "fault.0.onset_s=100"),
    "slandered": slandered,
    "blind": blind,
    "cut short": cut_short,
    "planned": lambda: replace(blind(), faults_by="planned"),
    "live": lambda: live(dragged(2, 3)),
    "unreached": unreached,
}


@pytest.fixture(params=FLIGHTS)
def told(request):
    return Told("a flight", FLIGHTS[request.param]())


def named(words, pattern):
    """Robots in the parts of a text that match, whose first group is their numbers."""
    return {int(number) for match in re.finditer(pattern, words) for number in re.findall(r"\d+", match[1])}


def test_story_table_and_caption_distrust_the_same_robots(told):
    said, caption = " ".join(story(told)), trust([told]).charts[0].words
    cell = dict(zip(verdicts([told]).headings[1:], verdicts([told]).rows[0].cells, strict=True))["distrusted after"]
    about = distrusts(told)
    if told.trust_source is None:
        assert (cell.note, caption) == ("asks for no trust", "This rule asks for no trust.")
        assert "distrusted" not in said
        return
    found, wronged = {one.system for one in about if one.found}, {one.system for one in about if one.wronged}
    if not told.faults_known:
        assert wronged == named(caption, r"in robot (\d+) at") == named(cell.said, r"robot (\d+): at")
        assert wronged == named(said, r"robot (\d+) was distrusted\.")
        return
    assert found == named(caption, r"obot (\d+) was distrusted [\d.]+ s after") == named(cell.said, r"robot (\d+):")
    assert (
        wronged == named(caption, r"obot (\d+) was distrusted at") == named(said, r"robot (\d+) was distrusted though")
    )
    assert ("false alarm" in cell.note and "no false" not in cell.note) is bool(wronged)
    missed = {one.system for one in about if one.missed}
    assert missed == named(said, r"Trust in robots? ([\d, ]+) never") == named(cell.note, r"never: robots? ([\d, ]+)")
    assert missed == named(caption, r"obot (\d+) failed and was trusted")
    for one in about:
        for at_s in (one.wrongly_s, one.rightly_s):
            assert math.isnan(at_s) or at_s == one.onset_s or f"At {at_s:.1f} s" in said


def test_what_the_score_found_is_what_they_tell(told):
    if told.score is None or told.trust_source is None or not told.faults_known:
        return
    about = distrusts(told)
    assert told.score.detected == pytest.approx({one.system: one.delay_s for one in about if one.found})
    assert told.score.false_alarms == sum(one.wronged for one in about)


@pytest.mark.parametrize("overrides", [(AUTO,), (), (AVERAGE,)])
def test_who_is_distrusted_at_first_is_who_was_logged_in_flight(overrides):
    history = flown(*overrides)
    logged = [one for one in history.happenings if one.kind is Kind.DISTRUST and one.words.endswith("is distrusted")]
    first = {one.vehicle: one.mission_s for one in reversed(logged)}
    about = distrusts(Told("a flight", history))
    assert first == {
        one.system: min(at_s for at_s in (one.wrongly_s, one.rightly_s) if not math.isnan(at_s))
        for one in about
        if not one.missed
    }


def test_what_is_called_wrong_is_the_same_in_the_story_and_the_table(told):
    said = " ".join(story(told))
    cell = dict(zip(verdicts([told]).headings[1:], verdicts([told]).rows[0].cells, strict=True))["what went wrong"]
    if cell.said == "unknown":
        assert "whether it was so, nobody told" in said
    elif told.mission.size:
        assert ("Nothing was wrong with anybody." in said) is (cell.said == "nothing")
        assert cell.said == "nothing" or cell.said in said
    else:
        assert cell.said == "nothing"


def test_a_fault_that_is_the_scenarios_word_alone_condemns_nobody():
    told = Told("a flight", replace(blind(), faults_by="planned"))
    cell = dict(zip(verdicts([told]).headings[1:], verdicts([told]).rows[0].cells, strict=True))["distrusted after"]
    assert (cell.note, cell.mark) == ("never: robot 5, no false alarm, by the scenario", "")
    drawn = trust([told])
    assert drawn.charts[0].words == "By the scenario robot 5 failed and was trusted; nobody was distrusted."
    assert "truth" not in f"{drawn.look_for} {drawn.legend}"
