"""The `gcs` command as a person or a script meets it: words, exit codes, files, JSON."""

import os
import pty
import re
import resource
import signal
import socket
import subprocess
import sys
from collections import Counter
from contextlib import closing
from pathlib import Path

import orjson
import pytest
from disks import Limited
from flights import GCS, SHORT, messages, recorded, start

from gcs import flying
from gcs.output import PICTURE, claimed, make_room, output_folder, room
from gcs.recording.export import NAMES
from gcs.recording.files import RecordingError
from gcs.replay.verify import decide_again
from gcs.report.command import PAGE

CONTRACT = {
    "scenario", "controller", "trust", "severity", "seed", "heading_error_deg", "distance_to_target_m",
    "min_separation_m", "passed", "detected", "false_alarms", "simulated_s", "real_time_factor", "recording",
}  # fmt: skip
BESIDES = {
    "profile", "scored_on", "problem", "faults", "swarm_heading_error_deg", "rejected_frames", "rejections", "loss",
    "left_behind",
}  # fmt: skip
"""Keys that the contract does not have yet."""
BRIEFLY = [word for override in SHORT for word in ("--set", override)]


def one_sentence(words):
    """Whether it is a single line to a person."""
    return words.count("\n") == 1 and words.startswith("gcs: ") and "Traceback" not in words


def test_json_is_one_object_with_the_contracts_keys_and_the_same_as_the_file(gcs, tmp_path):
    code, out, err = gcs("run", "demo", *BRIEFLY, "--seed", "7", "--out", tmp_path, "--json")
    assert code == 0
    assert out.count("\n") == 1
    result = orjson.loads(out)
    assert result.keys() == CONTRACT | BESIDES
    assert (result["scenario"], result["controller"], result["trust"], result["seed"]) == (
        "demo",
        "trust-r",
        "truth",
        7,
    )
    assert (result["severity"], result["detected"], result["false_alarms"]) == (None, {}, 0)
    assert result["recording"] == str((tmp_path / "run.mcap").resolve())
    assert result == orjson.loads((tmp_path / "summary.json").read_bytes())
    assert {path.name for path in tmp_path.iterdir()} == {"run.mcap", "summary.json", "trajectory.png"}
    assert "mission" in err


def test_a_run_in_words_says_what_was_flown_how_it_ended_and_where_it_is(gcs, tmp_path):
    code, out, _ = gcs("run", "demo", *BRIEFLY, "--out", tmp_path)
    assert code == 0
    assert out.startswith("demo: trust-r, trust from truth, no fault\n")
    assert re.search(r"^(passed|failed): heading off by \d+\.\d°, \d+\.\d m from the target", out, re.MULTILINE)
    assert f"recording  {(tmp_path / 'run.mcap').resolve()}\n" in out
    assert f"picture    {(tmp_path / 'trajectory.png').resolve()}\n" in out


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ("--controller average --severity 0.7", {"controller": "average", "trust": None, "severity": 0.7}),
        (
            "--trust ratings --set control.profile=recommended",
            {"controller": "trust-r", "trust": "ratings", "severity": 0.4, "profile": "recommended"},
        ),
        ("--no-fault", {"severity": None, "detected": {}, "faults": []}),
    ],
    ids=["average", "ratings", "no-fault"],
)
def test_every_choice_reaches_the_flight(gcs, tmp_path, options, expected):
    short = ("--set", "mission.leg.0.length_m=3", "--set", "event.0.at_length_m=1", "--set", "event.0.length_m=2")
    code, out, _ = gcs(
        "run", "emergency", *short, "--set", "mission.run_up_s=1", *options.split(), "--out", tmp_path, "--json"
    )
    assert code == 0
    assert orjson.loads(out).items() >= expected.items()


def test_a_failed_mission_is_a_flight_all_the_same():
    summary = recorded("emergency", 'control.rule="average"').summary
    assert not summary.passed
    assert summary.completed


def test_trust_from_the_studys_ratings_flies_too():
    flight = recorded("emergency", 'trust.source="ratings"')
    assert flight.summary.passed
    assert flight.summary.detected == {"5": 0.0}
    assert flight.summary.false_alarms == 0


def test_the_demo_passes():
    assert recorded("demo").summary.passed


def test_a_flight_that_takes_too_long_is_not_completed(gcs, tmp_path):
    code, out, err = gcs("run", "demo", "--set", "time.timeout_s=3", "--out", tmp_path, "--json")
    result = orjson.loads(out)
    assert code == 3
    assert "time.timeout_s = 3 s" in result["problem"]
    assert result["problem"] in err
    assert result["heading_error_deg"] is result["distance_to_target_m"] is result["min_separation_m"] is None
    assert result["passed"] is False
    assert (tmp_path / "run.mcap").stat().st_size > 10_000


def test_robots_that_touch_end_in_a_problem(gcs, tmp_path):
    crowded = ("--set", "swarm.spacing_m=0.7", "--set", "control.separation_gain=0")
    code, out, err = gcs("run", "demo", *BRIEFLY, *crowded, "--out", tmp_path)
    assert code == 3
    assert "their rotors would have touched" in err
    assert out.splitlines()[1].startswith("not completed")


REFUSED = [
    (["run", "emergency", "--bogus"], "--bogus"),
    (["run"], "SCENARIO"),
    (["nosuch"], "nosuch"),
    (["run", "nosuch"], "demo, emergency, transit"),
    (["run", "emergency", "trust-r"], "trust-r"),
    (["run", "emergency", "--controller", "guess"], "rule = 'guess': allowed are average, trust-r, median"),
    (["run", "emergency", "--severity", "1.5"], "--severity 1.5: must be 0 to 1"),
    (["run", "emergency", "--severity", "nan"], "--severity nan"),
    (["run", "emergency", "--severity", "half"], '"half"'),
    (["run", "emergency", "--seed", "-1"], "--seed -1"),
    (["run", "emergency", "--set", "network.best_range_m=28"], "best_range_m = 28.0 must be below range_m = 28.0"),
    (["run", "emergency", "--set", "network.range_m=5"], "best_range_m = 6.0 must be below range_m = 5.0"),
    (["run", "emergency", "--set", "fault.0.vehicle=7"], "fault.0.vehicle = 7: there is no such vehicle"),
    (["run", "emergency", "--set", "fault.0.max_speed_fraction=1.5"], "max_speed_fraction = 1.5"),
    (["run", "emergency", "--set", "mission.cruise=2"], "did you mean cruise_m_s?"),
    (["run", "emergency", "--set", "control.c1=nan"], "control.c1"),
    (["run", "emergency", "--set", "nonsense"], "section.key=value"),
    (["fly", "emergency"], "--link"),
    (["fly", "emergency", "--link", "hello"], "'hello'"),
    (["fly", "emergency", "--link", "ftp:127.0.0.1:1"], "ftp is not a kind of link; allowed are udpin"),
    (["fly", "emergency", "--link", "udpin:127.0.0.1:14999", "--link", "udp://127.0.0.1:14999"], "named twice"),
    (["fly", "emergency", "--link", "serial:/dev/ttyNone:57600", "--arm", "--yes"], "6 vehicles at 10 Hz need 6 × "),
    (["fly", "emergency", "--link", "udpin:127.0.0.1:14999", "--degrade", "7"], "--degrade 7: vehicle 7 cannot be"),
    (["fly", "emergency", "--link", "udpin:127.0.0.1:14999", "--signing-key", "nowhere"], "signing key nowhere: "),
    (["fly", "emergency", "--link", "udpin:127.0.0.1:70000"], "65535"),
    (["fly", "emergency", "--link", "udpin:127.0.0.1:14999", "--arm"], "--yes"),
    (["fly", "emergency", "--link", "udpin:127.0.0.1:14999", "--speed", "0"], "--speed 0"),
    (["fly", "emergency", "--link", "udpin:127.0.0.1:14999", "--speed", "nan"], "--speed nan"),
    (["fly", "emergency", "--link", "udpin:127.0.0.1:14999", "--speed", "inf"], "--speed inf"),
    (["vehicles"], "--link"),
    (["vehicles", "--link", "hello"], "'hello'"),
    (["vehicles", "--link", "udpin:127.0.0.1:14999", "--seconds", "0"], "--seconds 0"),
    (["vehicles", "--link", "udpin:127.0.0.1:14999", "--seconds", "nan"], "--seconds nan"),
    (["vehicles", "--link", "udpin:127.0.0.1:14999", "--signing-key", "nowhere"], "signing key nowhere: "),
    (["land"], "--link"),
    (["land", "--link", "hello"], "'hello'"),
    (["land", "--link", "udpin:127.0.0.1:14999", "--vehicle", "0"], "--vehicle 0: must be a system id, 1 to 255"),
    (["hold", "--link", "udpin:127.0.0.1:14999", "--vehicle", "256"], "--vehicle 256"),
    (["hold", "--link", "udpin:127.0.0.1:14999", "--vehicle", "one"], '"one"'),
    (["kill", "--link", "udpin:127.0.0.1:14999"], "needs --vehicle and --yes"),
    (["kill", "--link", "udpin:127.0.0.1:14999", "--vehicle", "1"], "needs --vehicle and --yes"),
    (["kill", "--link", "udpin:127.0.0.1:14999", "--yes"], "needs --vehicle and --yes"),
    (["take-back", "--link", "udpin:127.0.0.1:14999"], "--vehicle"),
    (["take-back", "--link", "udpin:127.0.0.1:14999", "--vehicle", "4"], "no flight of yours has this link"),
    (["reproduce", "--seeds", "0"], "--seeds 0"),
    (["reproduce", "--jobs", "0"], "--jobs 0"),
    (["compare"], "at least one"),
    (["compare", "nowhere"], "nowhere"),
    (["replay", "--verify", "nowhere"], "nowhere"),
    (["replay", "nowhere"], "nowhere"),
    (["run", "demo", "--severity", "0.4"], "no degraded motor"),
    (["run", "emergency", "--severity", "0.4", "--no-fault"], "no degraded motor"),
    (["run", "x" * 300], "no scenario"),
]


@pytest.mark.parametrize(("words", "said"), REFUSED, ids=[" ".join(words) for words, _ in REFUSED])
def test_bad_input_is_one_sentence_that_names_it_and_exit_code_2(gcs, tmp_path, monkeypatch, words, said):
    monkeypatch.chdir(tmp_path)
    code, out, err = gcs(*words)
    assert code == 2
    assert out == ""
    assert one_sentence(err), err
    assert said in err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "words", ["run demo", "reproduce --seeds 1", "fly demo --link udpout:127.0.0.1:9 --arm --yes --speed 50"]
)
def test_a_folder_that_cannot_be_made_is_refused_before_anything_flies(gcs, tmp_path, words):
    (tmp_path / "file").write_text("in the way")
    for out in (tmp_path / "file", tmp_path / "file" / "below"):
        code, _, err = gcs(*words.split(), "--out", out)
        assert code == 2
        assert one_sentence(err)
        assert f"--out {out}: cannot be written" in err
    assert (tmp_path / "file").read_text() == "in the way"


def test_a_recording_that_cannot_be_opened_is_refused(gcs, tmp_path):
    (tmp_path / "run.mcap").mkdir()
    code, _, err = gcs("run", "demo", "--out", tmp_path)
    assert code == 2
    assert one_sentence(err)
    assert "run.mcap" in err


def test_a_busy_port_is_refused(gcs, tmp_path):
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as taken:
        taken.bind(("127.0.0.1", 0))
        link = f"udpin:127.0.0.1:{taken.getsockname()[1]}"
        code, _, err = gcs("fly", "demo", "--link", link, "--arm", "--yes", "--out", tmp_path)
    assert code == 2
    assert one_sentence(err)
    assert link in err
    assert "in use" in err


def test_a_torn_or_foreign_recording_is_refused_by_every_command_that_reads(gcs, tmp_path):
    data = recorded("demo", *SHORT).path.read_bytes()
    for name, content in (("torn", data[: len(data) // 2]), ("empty", b""), ("text", b"hello\n" * 100)):
        path = tmp_path / f"{name}.mcap"
        path.write_bytes(content)
        for words in (["compare", path, "--out", tmp_path / "c.png"], ["replay", "--verify", path]):
            code, out, err = gcs(*words)
            assert (code, out) == (2, "")
            assert one_sentence(err)
            assert str(path) in err


def test_replay_and_compare_speak_on_stdout(gcs, tmp_path):
    path = recorded("demo", *SHORT).path
    code, out, err = gcs("replay", "--verify", path)
    assert (code, err) == (0, "")
    assert "identical to the bit" in out
    code, out, err = gcs("compare", path, path.parent, "--out", tmp_path / "c.png")
    assert (code, err) == (0, "")
    assert len(re.findall("passed|failed", out)) == 2


def test_scenarios_are_listed_for_people_and_for_programs(gcs):
    code, out, err = gcs("scenarios")
    assert (code, err) == (0, "")
    assert all(name in out for name in ("demo", "emergency", "transit"))
    _, out, _ = gcs("scenarios", "--json")
    listed = {row["name"]: row for row in orjson.loads(out)["scenarios"]}
    assert listed.keys() == {"demo", "emergency", "transit"}
    assert listed["demo"]["faults"] == []
    assert listed["emergency"]["vehicles"] == 6
    assert listed["transit"]["duration_s"] == pytest.approx(38 / 1.5 + 2, abs=1e-3)


def test_a_scenario_can_be_a_file(gcs, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('title = "mine"\nmission.leg = [{task = "there", heading_deg = 0, length_m = 3}]\n')
    code, out, _ = gcs(
        "run", path, "--set", "swarm.columns=1", "--set", "swarm.leaders=[1]", "--out", tmp_path, "--json"
    )
    assert code == 0
    assert orjson.loads(out)["scenario"] == str(path)


def test_without_out_a_run_is_put_in_a_folder_of_its_own(gcs, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, _ = gcs("run", "demo", "--set", "time.timeout_s=2", "--json")
    assert code == 3
    (folder,) = (tmp_path / "runs").iterdir()
    assert re.fullmatch(r"\d{8}T\d{6}-demo", folder.name)
    assert orjson.loads(out)["recording"] == str(folder / "run.mcap")


def test_two_runs_of_one_second_do_not_share_a_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folders = [output_folder(None, "demo") for _ in range(20)]
    assert len(set(folders)) == 20
    assert all(folder.is_dir() for folder in folders)


@pytest.mark.parametrize(
    ("typed", "said"), [("ARM\n", "in use"), ("arm\n", "not armed"), ("\n", "not armed"), ("\x04", "not armed")]
)
def test_on_a_terminal_arming_needs_the_word(tmp_path, typed, said):
    """The port is taken, so that nothing flies even then."""
    keyboard, terminal = pty.openpty()
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as taken:
        taken.bind(("127.0.0.1", 0))
        link = f"udpin:127.0.0.1:{taken.getsockname()[1]}"
        process = start(GCS, "fly", "demo", "--link", link, "--arm", "--json", "--out", tmp_path, stdin=terminal)
        os.write(keyboard, typed.encode())
        out, err = process.communicate(timeout=20)
    os.close(keyboard)
    os.close(terminal)
    assert process.returncode == 2
    assert out == ""
    assert "Type ARM" in err
    assert said in err
    assert "Traceback" not in err


def helped(*python):
    """`gcs --help` in a process of its own: what it prints, and the CPU seconds it took."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    words = [
        sys.executable,
        *python,
        "-c",
        "import sys; sys.argv = ['gcs', '--help']; from gcs.cli import main; main()",
    ]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return done, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def test_help_names_every_command_and_imports_nothing_heavy():
    done, _ = helped("-X", "importtime")
    commands = ("run", "fly", "vehicles", "land", "hold", "kill", "take-back", "reproduce", "scenarios", "compare")
    assert all(name in done.stdout for name in (*commands, "experiment", "identify", "replay"))
    imported = {line.split("|")[-1].strip() for line in done.stderr.splitlines()}
    assert "gcs.cli" in imported
    for heavy in ("matplotlib", "jsbsim", "scipy", "numpy", "pydantic", "pymavlink", "joblib"):
        assert heavy not in imported


def test_help_comes_within_a_second():
    assert min(helped()[1] for _ in range(3)) < 1.0


def until_said(process, words):
    """Read stderr until it says this."""
    for line in process.stderr:
        if words in line:
            return
    raise AssertionError(f"it ended without saying {words!r}")


def test_ctrl_c_in_lockstep_lands_closes_the_recording_and_ends_with_130(tmp_path):
    process = start(GCS, "run", "emergency", "--set", "event.0.length_m=300", "--out", tmp_path, "--json")
    until_said(process, "mission")
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in err
    assert "landing" in err
    result = orjson.loads(out)
    assert result["problem"] is None
    assert result["passed"] is False
    assert result["simulated_s"] < 200
    assert decide_again(tmp_path / "run.mcap").difference is None


def test_a_second_ctrl_c_ends_at_once_and_the_recording_is_whole(tmp_path):
    process = start(
        GCS, "run", "emergency", "--set", "event.0.length_m=3000", "--set", "time.timeout_s=3000", "--out", tmp_path
    )
    until_said(process, "mission")
    process.send_signal(signal.SIGINT)
    until_said(process, "once more")
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in err
    assert decide_again(tmp_path / "run.mcap").difference is None
    problem = orjson.loads((tmp_path / "summary.json").read_bytes())["problem"]
    assert problem == "ended at once by Ctrl-C: its vehicles were not told to land"


def test_a_polite_kill_lands_the_swarm_too(tmp_path):
    process = start(GCS, "run", "emergency", "--set", "event.0.length_m=300", "--out", tmp_path, "--json")
    until_said(process, "mission")
    process.send_signal(signal.SIGTERM)
    out, _ = process.communicate(timeout=60)
    assert process.returncode == 130
    assert orjson.loads(out)["passed"] is False
    assert decide_again(tmp_path / "run.mcap").difference is None


def test_a_disk_that_is_full_before_take_off_is_refused(gcs, tmp_path):
    with Limited(600):
        code, out, err = gcs("run", "demo", *BRIEFLY, "--out", tmp_path, "--json")
    assert (code, out) == (2, "")
    assert err == f"gcs: {tmp_path}/run.mcap: the recording cannot be written: File too large\n"
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_fills_up_in_flight_is_told_and_counts_as_a_problem_of_the_flight(gcs, tmp_path):
    with Limited(150_000):
        code, out, err = gcs("run", "demo", *BRIEFLY, "--out", tmp_path, "--json")
    assert code == 3
    result = orjson.loads(out)
    assert "run.mcap: the recording stopped: File too large" in result["problem"]
    assert result["heading_error_deg"] is not None
    assert result["passed"] is False
    assert "Traceback" not in err
    assert err.index("run.mcap: the recording stopped") < err.index("run.part2.mcap: the recording goes on")


@pytest.mark.parametrize("file", ["summary.json", "trajectory.png"])
def test_results_that_cannot_be_written_are_a_problem_and_are_told_all_the_same(gcs, tmp_path, monkeypatch, file):
    monkeypatch.setattr(flying, "make_room", lambda _folder: (tmp_path / file).symlink_to("/dev/full"))
    code, out, err = gcs("run", "demo", *BRIEFLY, "--out", tmp_path, "--json")
    assert code == 3
    result = orjson.loads(out)
    assert result["problem"] == f"{tmp_path}: the results cannot be written: No space left on device"
    assert result["heading_error_deg"] is not None
    assert result["passed"] is False
    assert err.endswith(f"gcs: {result['problem']}\n")
    if file == "trajectory.png":
        assert result == orjson.loads((tmp_path / "summary.json").read_bytes())
        assert not (tmp_path / "trajectory.png").exists()


def test_a_folder_without_room_for_a_whole_flight_is_refused(gcs, tmp_path):
    code, out, err = gcs("run", "demo", "--set", "time.timeout_s=1e15", "--out", tmp_path)
    assert (code, out) == (2, "")
    assert one_sentence(err)
    assert "MB are free, and a flight as long as time.timeout_s allows may leave" in err
    assert list(tmp_path.iterdir()) == []


def test_a_flight_leaves_less_than_the_room_it_asks_for():
    for flight in (recorded("emergency"), recorded("demo")):
        share = flight.summary.simulated_s / flight.scenario.time.timeout_s
        left = sum(path.stat().st_size for path in flight.folder.iterdir())
        assert 0.1 * room(flight.scenario) * share < left < room(flight.scenario)


def test_an_earlier_recording_in_the_same_folder_is_kept(gcs, tmp_path):
    gcs("run", "demo", *BRIEFLY, "--out", tmp_path)
    first = (tmp_path / "run.mcap").read_bytes()
    _, _, err = gcs("run", "demo", *BRIEFLY, "--seed", "2", "--out", tmp_path)
    (kept,) = tmp_path.glob("run-*.mcap")
    assert kept.read_bytes() == first
    assert str(kept) in err


def test_its_journal_and_its_further_parts_are_kept_with_it(tmp_path):
    left = {"run.mcap": b"1", "run.tlog": b"journal", "run.part2.mcap": b"2", "run.part10.mcap": b"10"}
    for name, data in left.items():
        (tmp_path / name).write_bytes(data)
    for _ in range(2):
        kept = make_room(tmp_path)
        found = {path.name.replace(kept.stem, "run"): path.read_bytes() for path in tmp_path.glob(f"{kept.stem}.*")}
        assert found == left
        assert not [name for name in left if (tmp_path / name).exists()]
        for name, data in left.items():
            (tmp_path / name).write_bytes(data)


def test_all_that_was_made_of_it_is_kept_with_it(tmp_path):
    """What somebody else put there, and what is kept already, stays where it is."""
    made = [f"run{behind}" for behind in (*NAMES.values(), "-recovered.mcap", "-recovered-csv", ".part2-frames.tlog")]
    beside = [PICTURE, PAGE, "summary.json", "video.mp4", "blind.mp4"]
    others = ["run.toml", "run-20260101T000000.mcap", "comparison.png", "run-of-mine.mcap"]
    for name in ("run.mcap", *made, *beside, *others):
        (tmp_path / name).write_bytes(name.encode())
    (tmp_path / "run-csv").unlink()
    (tmp_path / "run-csv").mkdir()
    stem = make_room(tmp_path).stem
    kept = {name: f"{stem}{name.removeprefix('run')}" for name in ("run.mcap", *made)}
    kept |= {name: f"{stem}-{name}" for name in beside} | {name: name for name in others}
    assert {path.name for path in tmp_path.iterdir()} == set(kept.values())
    assert (tmp_path / f"{stem}-csv").is_dir()
    assert all((tmp_path / now).read_bytes() == was.encode() for was, now in kept.items() if was != "run-csv")


@pytest.mark.parametrize("name", ["run.mcap", "run.part2.mcap", "run.tlog", "summary.json", "trajectory.png"])
@pytest.mark.parametrize("make", [Path.mkdir, os.mkfifo, lambda path: path.symlink_to("nowhere")], ids="dpl")
def test_what_would_be_in_the_way_is_refused_in_a_sentence_and_nothing_is_moved(tmp_path, name, make):
    (tmp_path / "run-csv").mkdir()
    make(tmp_path / name)
    with pytest.raises(RecordingError, match=rf"{name}: is no file, and in the way: name another folder$"):
        make_room(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"run-csv", name}


def test_a_folder_in_which_another_flight_is_being_recorded_is_refused(gcs, tmp_path):
    """And left as it is: what it holds is that flight's."""
    (tmp_path / "run.mcap").write_bytes(b"being written")
    with claimed(tmp_path):
        code, out, err = gcs("run", "demo", *BRIEFLY, "--out", tmp_path)
    assert (code, out) == (2, "")
    assert err == f"gcs: --out {tmp_path}: another flight is being recorded there: name another folder\n"
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"being written"]
    with claimed(tmp_path):
        pass


def test_a_journal_whose_recording_is_gone_is_kept_too(tmp_path):
    (tmp_path / "run.tlog").write_bytes(b"journal")
    kept = make_room(tmp_path)
    assert (kept.suffix, kept.read_bytes()) == (".tlog", b"journal")


def test_messages_are_recorded_as_json_where_that_is_asked_for(gcs, tmp_path):
    code, _, _ = gcs("run", "demo", *BRIEFLY, "--record-decoded", "--out", tmp_path)
    assert code == 0
    topics = Counter(topic for topic, _, _ in messages(tmp_path / "run.mcap"))
    assert topics["/mavlink/1_1/LOCAL_POSITION_NED"] == topics["/mavlink/6_1/LOCAL_POSITION_NED"] > 100
    assert topics["/mavlink/255_190/SET_POSITION_TARGET_LOCAL_NED"] > 100
    assert decide_again(tmp_path / "run.mcap").difference is None


def test_what_people_write_is_not_taken_for_markup(gcs, tmp_path):
    text = BRACKETS.replace("TITLE", "[/b] costs $5 or $\\\\frac$").replace("TASK", "[red]$x_")
    (tmp_path / "odd.toml").write_text(text)
    code, _, _ = gcs("run", tmp_path / "odd.toml", "--out", tmp_path / "[/a]")
    assert code == 0
    code, out, _ = gcs("compare", tmp_path / "[/a]", "--out", tmp_path / "c.png")
    assert code == 0
    assert "[/b] costs $5" in out


BRACKETS = """
title = "TITLE"
mission.leg = [{task = "TASK", heading_deg = 0, length_m = 3}]
"""
