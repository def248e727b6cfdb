"""What healthy vehicles are like, from flights of a scenario and from a recording; and as lines of a scenario."""

import shutil
import tomllib
from functools import partial

import numpy as np
import orjson
import pytest
from flights import SHORT, failing, fly_and_record, recorded, rewritten, scratch, told

from gcs.recording.reader import steered
from scenarios import load
from scenarios.models import Control, Trust

RESPONSE = {"response_delay_s": (0.147, 0.03), "response_lag_s": (0.298, 0.04)}
"""As `scenarios/models.py` has them: found from five hundred flights in ordinary air."""


@pytest.fixture
def gcs(gcs):
    """Run `gcs identify` with these words."""
    return partial(gcs, "identify")


def check(found):
    for key, (value, within) in RESPONSE.items():
        assert found["trust"][key] == pytest.approx(value, abs=within)
    assert found["control"]["response_time_s"] == pytest.approx(Control().response_time_s, abs=0.06)
    assert 0.0 < found["trust"]["tolerance_m_s"] <= Trust().tolerance_m_s
    assert 0.0 < found["trust"]["place_tolerance_m"] <= Trust().place_tolerance_m


def test_a_scenarios_vehicles_are_what_trust_takes_them_for(gcs):
    code, out, _ = gcs("emergency", "--seeds", 2, "--json")
    assert code == 0
    found = orjson.loads(out)
    assert found.keys() == {"control", "trust", "unexplained_m_s", "moved_m_s"}
    check(found)
    assert found["unexplained_m_s"] == pytest.approx(load("emergency").noise.velocity_m_s, abs=0.01)
    assert found["moved_m_s"] > 0.3


def test_a_recording_of_a_healthy_flight_tells_the_same(gcs):
    for path in (recorded("demo").path, recorded("demo").folder):
        code, out, err = gcs(path, "--json")
        assert (code, err) == (0, "")
        check(orjson.loads(out))


def test_slower_vehicles_are_found_to_be_slower(gcs):
    code, out, _ = gcs("demo", "--seeds", 1, "--set", "vehicle.lag_s=0.8", "--json")
    assert code == 0
    assert orjson.loads(out)["control"]["response_time_s"] == pytest.approx(1.27, abs=0.15)


def test_its_lines_are_lines_of_a_scenario(gcs, tmp_path):
    code, out, _ = gcs(recorded("demo").path)
    assert code == 0
    check(tomllib.loads(out))
    mission = 'title = "mine"\nmission.leg = [{task = "there", heading_deg = 0, length_m = 30}]\n'
    (tmp_path / "mine.toml").write_text(mission + out)
    scenario = load(tmp_path / "mine.toml")
    assert scenario.trust.response_delay_s == tomllib.loads(out)["trust"]["response_delay_s"]
    assert scenario.control.response_time_s == tomllib.loads(out)["control"]["response_time_s"]


# --- what it cannot take


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "FLEET"),
        (("nowhere",), "no scenario"),
        (("nowhere.mcap",), "nowhere.mcap: cannot be read"),
        (("demo", "--seeds", "0"), "--seeds 0"),
        (("demo", "--set", "trust.tolerance=1"), "did you mean tolerance_m_s?"),
        (("demo", "--set", "nonsense"), "section.key=value"),
    ],
    ids=lambda word: " ".join(word) if isinstance(word, tuple) else "",
)
def test_what_it_cannot_take_is_refused_in_a_sentence(gcs, tmp_path, monkeypatch, words, said):
    monkeypatch.chdir(tmp_path)
    refused(gcs(*words), said)


def refused(result, said):
    code, out, err = result
    assert (code, out) == (2, "")
    assert err.startswith("gcs: ")
    assert err.count("\n") == 1
    assert said in err


def test_nothing_of_a_recording_can_be_changed(gcs):
    refused(gcs(recorded("demo").path, "--set", "vehicle.lag_s=1"), "--set vehicle.lag_s=1: a recording has been flown")


def test_of_telemetry_older_than_three_ticks_nothing_is_learnt():
    stale = {40: 0.31, 41: 0.3}

    def age(_place, topic, _time_ns, data):
        content = orjson.loads(data) if topic == "/swarm/state" else {}
        if content.get("tick") in ticks:
            content["age_s"][4] = ticks[content["tick"]]
            return orjson.dumps(content)
        return data

    flight = recorded("demo")
    begins = told(flight, "/mission")[0]["tick"]
    ticks = {begins + after: age_s for after, age_s in stale.items()}
    steered_ticks = steered(rewritten(flight.path, age))
    known = {tick: np.isfinite(velocity).all(1).tolist() for tick, _, velocity, _ in steered_ticks}
    assert known[begins + 40] == [True] * 4 + [False, True]
    assert known[begins + 41] == [True] * 6


def test_a_recording_in_which_something_fails_is_refused(gcs):
    """Its tolerances would let every fault pass."""
    refused(gcs(recorded("emergency").path), "robot 5")


def test_a_wind_on_everyone_is_nobodys_failure(gcs):
    wind = 'fault=[{vehicle=1, kind="wind", speed_m_s=2, everyone=true}]'
    assert gcs(recorded("demo", wind).path, "--json")[0] == 0


def test_a_file_that_is_no_recording_or_a_torn_one_is_refused(gcs, tmp_path):
    data = recorded("demo").path.read_bytes()
    for content, why in ((b"", "not an MCAP"), (b"hello\n" * 100, "not an MCAP"), (data[: len(data) // 2], "torn")):
        (tmp_path / "run.mcap").write_bytes(content)
        refused(gcs(tmp_path / "run.mcap"), why)


def cut_short(after_s):
    folder = scratch()
    with pytest.raises(ZeroDivisionError):
        fly_and_record("demo", out=folder, events=failing(after_s * 10 + 1, ZeroDivisionError()))
    return folder / "run.mcap"


def test_a_flight_cut_short_tells_what_it_can(gcs):
    code, out, _ = gcs(cut_short(30), "--json")
    assert code == 0
    check(orjson.loads(out))
    refused(gcs(cut_short(10)), "holds no 6 s of set-points to every vehicle with all of them heard")


def test_a_folder_called_as_a_scenario_does_not_hide_it(gcs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(recorded("demo", *SHORT).folder, tmp_path / "transit")
    code, _, err = gcs("transit", "--seeds", 1, "--set", "mission.leg.1.length_m=10", "--json")
    assert (code, err) == (0, "")
