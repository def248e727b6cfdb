"""A recorded flight flown once more from its recording: the same to the byte, or with what is chosen otherwise."""

import shutil
from functools import cache

import orjson
import pytest
from flights import SHORT, digest, failing, fly_and_record, messages, recorded, rewritten, told, unended

from gcs.choices import Choices
from gcs.events import Rating
from gcs.recording.reader import ticks
from gcs.supervision import NOBODY, Supervision
from gcs.to_fly import to_fly
from gcs.versions import installed, others, sources

BRIEF = ("demo", *SHORT)
AVERAGE, FUSED = 'control.rule="average"', 'trust.source="fused"'
KNOWN = (Rating("op1", 5, 1, 3.0), Rating("op1", None, 4, 0.0), Rating("op2", 5, 2, 3.0))


def saying(said):
    """What people say at these ticks."""
    by_tick = iter([said.get(tick, ()) for tick in range(10_000)])
    return lambda: next(by_tick)


@cache
def supervised():
    """Rated before the mission and in it, beforehand and while it is flown, and after the operator has ended it."""
    said = {
        5: (Rating("live", 2, 1),),
        120: (Rating("live", 1, 5), Rating("live", 5, 1)),
        141: ("take back 3", Rating("live", None, 3)),
        150: ("land",),
        155: (Rating("live", 4, 1),),
    }
    return fly_and_record(*BRIEF, FUSED, ratings=KNOWN, events=saying(said))


def flown_again(gcs, path, out, *options):
    """The summary of `gcs run` with a recording, and what it said on stderr."""
    code, printed, err = gcs("run", path, "--out", out, "--json", *options)
    assert code == 0
    return orjson.loads(printed), err


def prepared(path, *, supervision=NOBODY, **chosen):
    """What would be flown, and what is said of it."""
    said = []
    return to_fly(str(path), Choices(**chosen), supervision, seed=None, say=said.append), said


@pytest.mark.parametrize("flight", [lambda: recorded(*BRIEF), supervised], ids=["as it is", "supervised"])
def test_a_flight_flown_again_is_the_same_to_the_byte(gcs, tmp_path, flight):
    flight = flight()
    summary, err = flown_again(gcs, flight.path, tmp_path)
    assert digest(tmp_path / "run.mcap") == digest(flight.path)
    known = orjson.loads(flight.summary.json())
    assert {key for key in known if known[key] != summary[key]} <= {"recording", "real_time_factor"}
    assert "may differ" not in err


def test_of_all_that_was_said_nothing_is_left_out():
    flight = supervised()
    spoken = [(page.number, event) for page in ticks(flight.path) for event in page.events]
    assert [event for _, event in spoken if isinstance(event, str)] == ["take back 3", "land"]
    counted = [event for _, event in spoken if isinstance(event, Rating)]
    assert len(counted) == len(KNOWN) + 5
    assert [rating.time_s is None for rating in counted] == [True, *[False] * 6, True]


def test_a_folder_may_be_named_and_is_not_written_over(gcs, tmp_path):
    shutil.copytree(recorded(*BRIEF).folder, tmp_path / "flight")
    flown_again(gcs, tmp_path / "flight", tmp_path / "flight")
    kept = [path for path in (tmp_path / "flight").glob("*.mcap") if path.name != "run.mcap"]
    assert [digest(path) for path in kept] == [digest(recorded(*BRIEF).path)]
    assert digest(tmp_path / "flight" / "run.mcap") == digest(kept[0])


def test_without_a_folder_it_goes_into_a_new_one_called_as_its_scenario(gcs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, _ = gcs("run", recorded(*BRIEF).path, "--json")
    assert code == 0
    (folder,) = (tmp_path / "runs").iterdir()
    assert folder.name.endswith("-demo")
    assert orjson.loads(out)["scenario"] == "demo"


def test_what_is_chosen_is_another_flight_of_the_same_vehicles_in_the_same_air(gcs, tmp_path):
    summary, _ = flown_again(gcs, recorded(*BRIEF).path, tmp_path, "--controller", "average")
    assert (summary["controller"], summary["seed"]) == ("average", 1)
    assert digest(tmp_path / "run.mcap") == digest(recorded(*BRIEF, AVERAGE).path)


def test_it_is_flown_with_its_own_seed_or_the_one_that_is_named():
    of_two = recorded(*BRIEF, seed=2).path
    assert prepared(of_two)[0].seed == 2
    assert to_fly(str(of_two), Choices(), NOBODY, seed=3, say=print).seed == 3


def test_ratings_keep_their_time_of_the_mission_where_it_begins_later(gcs, tmp_path):
    flown_again(gcs, supervised().path, tmp_path, "--set", "mission.run_up_s=1.5")
    was = [rating for rating in told(supervised(), "/ratings") if rating["time_s"] is not None]
    again = [orjson.loads(data) for topic, _, data in messages(tmp_path / "run.mcap") if topic == "/ratings"]
    now = [rating for rating in again if rating["time_s"] is not None]
    assert [rating["time_s"] for rating in now] == [rating["time_s"] for rating in was]
    assert {later["tick"] - earlier["tick"] for later, earlier in zip(now, was, strict=True)} == {5}


@pytest.mark.parametrize(
    ("chosen", "why"),
    [
        ({"trust": "auto"}, "trust from auto takes none"),
        ({"supervision": Supervision(ratings="realistic")}, "others are given"),
    ],
    ids=["another source of trust", "another supervisor"],
)
def test_ratings_that_do_not_count_are_said_to_be_left_out(chosen, why):
    flight, said = prepared(supervised().path, **chosen)
    assert said == [f"the 8 ratings of {supervised().path} are left out: {why}"]
    assert not {"op1", "op2", "live"} & {rating.rater for rating in flight.ratings or ()}
    words = [event for _ in range(200) for event in flight.said()]
    assert words == ["take back 3", "land"]


def test_a_flight_cut_short_is_flown_to_its_end(gcs, tmp_path):
    with pytest.raises(ZeroDivisionError):
        fly_and_record(*BRIEF, out=tmp_path / "cut", events=failing(101, ZeroDivisionError()))
    flown_again(gcs, tmp_path / "cut", tmp_path / "whole")
    assert digest(tmp_path / "whole" / "run.mcap") == digest(recorded(*BRIEF).path)


# --- what may make it another flight is said


def test_versions_that_differ_are_named():
    here = installed()
    assert list(others(here)) == []
    assert list(others(here | {"jsbsim": "0.1"})) == [f"jsbsim 0.1 (here {here['jsbsim']})"]
    assert list(others({"scenario": "demo"})) == []
    assert list(others(here | {"machine": "pdp11"})) == [f"machine pdp11 (here {here['machine']})"]
    assert list(others(here | {"sources": "0"})) == [f"sources 0 (here {here['sources']})"]
    assert {"lz4", "orjson", "protobuf"} < here.keys()
    assert "absent" not in here.values()


def test_our_own_version_is_another_when_any_file_of_ours_is(tmp_path):
    files = {"gcs/loop.py": b"1", "gcs/report/page.html": b"", "aircraft/quad.xml": b"<q/>"}
    fingerprint, fingerprints = sources.__wrapped__, set()
    for at, changed in enumerate((None, *files)):
        root = tmp_path / str(at)
        for name, content in files.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_bytes(content + b" " * (name == changed))
        fingerprints.add(fingerprint(root))
        (root / "gcs" / "__pycache__").mkdir()
        (root / "gcs" / "__pycache__" / "loop.pyc").write_bytes(b"2")
        assert fingerprint(root) in fingerprints
    assert len(fingerprints) == 4


def test_ticks_that_a_damaged_recording_lacks_are_said_to_be_silent():
    def without(_at, topic, _time, data):
        return None if topic == "/tick" and orjson.loads(data)["number"] == 50 else data

    _, (said,) = prepared(rewritten(recorded(*BRIEF).path, without))
    assert said.endswith("lacks 1 of its ticks; what was said in them is not said again")


def test_what_a_recording_does_not_hold_of_its_flight_is_said_not_to_be_said_again(tmp_path):
    for name in ("run.mcap", "run.part2.mcap"):
        shutil.copy(recorded(*BRIEF).path, tmp_path / name)
    path = tmp_path / "run.mcap"
    assert prepared(tmp_path)[1] == [
        f"{path}: goes on in run.part2.mcap, of which nothing is said again; gcs log recover {path} joins all"
    ]
    path = unended(recorded(*BRIEF).path)
    assert prepared(path)[1] == [f"{path}: ends before the flight did; what was said after that is not said again"]


# --- what cannot be flown


def refused(outcome, *said):
    code, out, err = outcome
    assert (code, out) == (2, "")
    assert all(words in err for words in said)
    assert err.startswith("gcs: ")
    assert err.count("\n") == 1


def test_what_is_no_recording_is_refused_in_a_sentence(gcs, tmp_path):
    data = recorded(*BRIEF).path.read_bytes()
    (tmp_path / "torn.mcap").write_bytes(data[: len(data) // 2])
    (tmp_path / "folder").mkdir()
    refused(gcs("run", tmp_path / "none.mcap"), "none.mcap: cannot be read")
    refused(gcs("run", tmp_path / "folder"), "run.mcap: cannot be read")
    refused(gcs("run", tmp_path / "torn.mcap"), "torn.mcap: torn", "gcs log recover")
    refused(
        gcs("run", recorded(*BRIEF).path, "--set", "control.c9=1"), "run.mcap: control.c9 = 1: there is no such key"
    )
    refused(gcs("run", recorded(*BRIEF).path, "--seed", "-1"), "--seed -1")


def test_a_folder_called_as_a_scenario_is_not_flown_instead(gcs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(recorded(*BRIEF).folder, tmp_path / "transit")
    refused(gcs("run", "transit", "--set", "control.c9=1"), "transit.toml: control.c9")
