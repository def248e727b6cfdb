"""`gcs experiment`: flown once and kept, the same on any workers, broken off and gone on with, judged in pairs."""

import csv
import fcntl
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from io import StringIO
from itertools import pairwise
from math import isnan
from pathlib import Path

import matplotlib.pyplot as plt
import orjson
import pytest
from flights import GCS
from rich.console import Console

from gcs.experiment import meter, run, workers
from gcs.experiment.cells import cells, suites
from gcs.experiment.conduct import Conducted, Timing
from gcs.experiment.journal import BEGINNING, Journal, UnusableJournal
from gcs.experiment.plot import MOST_ROWS, draw
from gcs.experiment.results import Asked, Results
from gcs.experiment.run import RunResult, fly_run, tasks
from gcs.experiment.terminal import show
from gcs.flight import Flight
from gcs.lockstep import Lockstep
from gcs.loop import fly
from gcs.scoring import score
from gcs.track import Tracker
from gcs.trial import attempt
from gcs.truth import Truth
from scenarios import load
from scenarios.experiment import experiment_names, load_experiment, parse_experiment

SHORT = """
title = "Short"
seeds = 2
reference = "truth"
scenarios = ["transit"]
set = [
    "mission.leg.0.length_m=3", "mission.leg.1.length_m=4.5", "mission.run_up_s=1", "swarm.altitude_m=4",
    "time.physics_hz=100",
]

[[suite]]
name = "base"
severities = [0.4]

[[suite]]
name = "fault-free"
no_fault = true

[[arm]]
name = "average"
controller = "average"

[[arm]]
name = "truth"
controller = "trust-r"
trust = "truth"
"""
RUNS = 8
FILES = {"runs.jsonl", "runs.csv", "cells.csv", "table.md", "experiment.json", "pass_rate.png", "errors.png"}


@pytest.fixture
def short(tmp_path):
    path = tmp_path / "short.toml"
    path.write_text(SHORT, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """The short experiment, flown once by `gcs` on two processes: (file, folder, what it said, stderr)."""
    folder = tmp_path_factory.mktemp("flown")
    path = folder / "short.toml"
    path.write_text(SHORT, encoding="utf-8")
    done = command(path, "--jobs", 2, "--out", folder / "out", "--json")
    assert done.returncode == 0, done.stderr
    return path, folder / "out", orjson.loads(done.stdout), done.stderr


@pytest.fixture
def gcs(gcs):
    """Run `gcs experiment` with these words."""
    return partial(gcs, "experiment")


def command(*words):
    words = [str(word) for word in (GCS, "experiment", *words)]
    return subprocess.run(words, capture_output=True, text=True, check=False, timeout=120)


def one_sentence(words):
    return words.count("\n") == 1 and words.startswith("gcs: ")


def results(said):
    """Of an object of JSON, what must not depend on who flew it."""
    return {key: said[key] for key in ("title", "seeds", "reference", "cells", "suites", "incomplete")}


def lines(folder):
    path = folder / "runs.jsonl"
    return path.read_bytes().splitlines() if path.exists() else []


# What is flown


def test_a_trial_scores_what_a_whole_flight_scores():
    scenario = load("emergency")
    flight = Flight(scenario)
    truth = Truth(flight.ids)
    tracker = Tracker(flight, truth)
    world = Lockstep.of(scenario, seed=3)
    state = fly(world, world, flight, (truth, tracker), period_ns=scenario.time.period_ns)
    assert state.problem is None
    assert attempt(scenario, seed=3).score == score(tracker.track, scenario)


def test_every_arm_flies_every_condition_with_the_same_seeds_all_arms_of_a_seed_before_the_next():
    every = tasks(load_experiment("base"), seeds=3)
    assert len(every) == 6 * 9 * 3
    assert [task.seed for task in every] == sorted(task.seed for task in every)
    for arm in {task.arm for task in every}:
        mine = [(task.suite, task.condition, task.seed) for task in every if task.arm == arm]
        assert len(mine) == len(set(mine)) == 6 * 3


def test_a_key_is_the_flights_and_not_its_names():
    def keys(text):
        return [task.key for task in tasks(parse_experiment(text, source="x"), seeds=2)]

    renamed = SHORT.replace('"base"', '"first"').replace('name = "average"', 'name = "eq. 1"')
    assert keys(SHORT) == keys(renamed)
    assert len(set(keys(SHORT))) == RUNS
    assert not set(keys(SHORT)) & set(keys(SHORT.replace("m=3", "m=3.1")))
    fused = SHORT.replace('trust = "truth"', 'trust = "fused"\nratings = "realistic"')
    assert not set(keys(fused)[1::2]) & set(keys(fused.replace("realistic", "lazy"))[1::2])


def test_an_unknown_model_of_raters_is_refused_with_those_there_are(gcs, short):
    short.write_text(SHORT.replace('trust = "truth"', 'trust = "fused"') + 'ratings = "psychic"\n', encoding="utf-8")
    code, _, err = gcs(short)
    assert code == 2
    assert "arm truth: ratings = 'psychic': allowed are " in err
    assert "realistic" in err


# What comes out


def test_all_that_an_experiment_leaves_says_the_same(flown):
    _, folder, said, err = flown
    assert {path.name for path in folder.iterdir()} == FILES
    assert said == orjson.loads((folder / "experiment.json").read_bytes())
    assert len(lines(folder)) == RUNS
    with (folder / "runs.csv").open(encoding="utf-8") as stream:
        runs = list(csv.DictReader(stream))
    assert {(r["suite"], r["arm"], r["seed"]) for r in runs} == {
        (suite, arm, seed) for suite in ("base", "fault-free") for arm in ("average", "truth") for seed in "12"
    }
    with (folder / "cells.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row["passed_rate"]) for row in rows] == [cell["passed"]["rate"] for cell in said["cells"]]
    table = (folder / "table.md").read_text(encoding="utf-8")
    for cell in said["cells"]:
        assert f"{cell['heading_error_deg']['mean']:.2f} ± {cell['heading_error_deg']['ci95']:.2f}°" in table
    assert "nan" not in table
    assert said["timing"]["flown"] == RUNS
    assert said["timing"]["workers"] == 2
    assert f"{said['timing']['runs_per_hour']:.0f} runs/h, workers: 2" in err
    assert f"{RUNS} of {RUNS} runs" in err


def test_a_run_is_what_the_flight_scores(flown):
    _, folder, *_ = flown
    task = tasks(parse_experiment(SHORT, source="x"), seeds=1)[1]
    expected = attempt(task.scenario, seed=1).score
    kept = next(run for run in map(RunResult.of_line, lines(folder)) if run.key == task.key)
    assert (kept.heading_error_deg, kept.distance_to_target_m) == (
        expected.heading_error_deg,
        expected.distance_to_target_m,
    )
    assert (kept.passed, kept.detected, kept.faulty) == (expected.passed, {5: 0.0}, 1)


def test_pictures_are_pictures(flown):
    for name in ("pass_rate.png", "errors.png"):
        assert plt.imread(flown[1] / name).shape[0] > 200


def test_without_json_a_table_is_shown_and_the_files_are_named(gcs, flown):
    path, folder, *_ = flown
    code, out, err = gcs(path, "--out", folder)
    assert code == 0
    assert "Short" in out
    assert "fault-free" in out
    assert all(str(folder / name) in err.replace("\n", "") for name in FILES - {"runs.jsonl"})


# Flown once


def test_the_same_command_again_flies_nothing_and_says_the_same(flown):
    path, folder, said, _ = flown
    before = (folder / "runs.jsonl").read_bytes()
    again = command(path, "--out", folder, "--json")
    assert results(orjson.loads(again.stdout)) == results(said)
    assert orjson.loads(again.stdout)["timing"] | {"wall_s": 0} == {
        "flown": 0, "kept": RUNS, "workers": 0, "wall_s": 0, "runs_per_hour": None,
    }  # fmt: skip
    assert (folder / "runs.jsonl").read_bytes() == before


@contextmanager
def copy_of(flown, tmp_path, *, runs):
    """A folder with the first of the runs."""
    folder = tmp_path / "copy"
    folder.mkdir()
    (folder / "runs.jsonl").write_bytes(b"".join(line + b"\n" for line in lines(flown[1])[:runs]))
    yield folder


def test_what_a_killed_process_left_half_written_is_flown_again(gcs, flown, tmp_path):
    path, original, said, _ = flown
    with copy_of(flown, tmp_path, runs=RUNS - 1) as folder:
        with (folder / "runs.jsonl").open("ab") as stream:
            stream.write(lines(original)[-1][:40])
        code, out, _ = gcs(path, "--jobs", 1, "--out", folder, "--json")
        assert code == 0
        assert orjson.loads(out)["timing"]["flown"] == 1
        assert results(orjson.loads(out)) == results(said)
        assert len(lines(folder)) == RUNS


def test_more_seeds_fly_only_what_is_new(gcs, flown, tmp_path):
    with copy_of(flown, tmp_path, runs=RUNS) as folder:
        code, out, _ = gcs(flown[0], "--seeds", 3, "--only", "fault-free", "--jobs", 1, "--out", folder, "--json")
        assert code == 0
        assert orjson.loads(out)["timing"] | {"wall_s": 0, "runs_per_hour": 0} == {
            "flown": 2, "kept": 4, "workers": 1, "wall_s": 0, "runs_per_hour": 0,
        }  # fmt: skip
        assert {cell["suite"] for cell in orjson.loads(out)["cells"]} == {"fault-free"}


def test_a_part_of_an_experiment_says_so_and_that_there_are_more_runs(gcs, flown, tmp_path):
    with copy_of(flown, tmp_path, runs=RUNS) as folder:
        code, out, err = gcs(flown[0], "--seeds", 1, "--only", "fault-*", "--out", folder, "--json")
        assert code == 0
        assert orjson.loads(out)["asked"] == {
            "command": f"gcs experiment {flown[0]} --seeds 1 --only 'fault-*'",
            "only": ["fault-*"], "seeds": 1, "seeds_of_file": 2,
        }  # fmt: skip
        assert "runs.jsonl holds 6 runs more, which were not asked for" in err
        head = (folder / "table.md").read_text(encoding="utf-8").partition("##")[0]
        assert "A part of the experiment: only fault-*; seeds 1 to 1 of 2." in head
        gcs(flown[0], "--out", folder)
        assert "A part" not in (folder / "table.md").read_text(encoding="utf-8")


def test_flights_that_are_the_same_under_two_names_are_flown_once(gcs, flown, tmp_path):
    path = tmp_path / "twice.toml"
    path.write_text(SHORT + '[[suite]]\nname = "again"\nno_fault = true\n', encoding="utf-8")
    with copy_of(flown, tmp_path, runs=RUNS) as folder:
        code, out, _ = gcs(path, "--out", folder, "--json")
        assert code == 0
        said = orjson.loads(out)
        assert said["timing"]["flown"] == 0
        free, again = ([c | {"suite": ""} for c in said["suites"] if c["suite"] == s] for s in ("fault-free", "again"))
        assert free == again


OWN_RULE = """
from trustr.consensus import average

def mine(heard, settings):
    return average(heard, settings)
"""


def test_a_rule_of_ones_own_is_flown_again_when_its_source_has_changed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "own.toml"
    fault_free = SHORT.replace('[[suite]]\nname = "base"\nseverities = [0.4]\n', "")
    path.write_text(fault_free.replace('controller = "average"', 'controller = "own_rule:mine"'), encoding="utf-8")
    words = (path, "--seeds", 1, "--jobs", 1, "--out", "out", "--json")
    (tmp_path / "own_rule.py").write_text(OWN_RULE, encoding="utf-8")
    first = command(*words)
    assert first.returncode == 0, first.stderr
    assert [orjson.loads(done.stdout)["timing"]["flown"] for done in (first, command(*words))] == [2, 0]
    (tmp_path / "own_rule.py").write_text(OWN_RULE + "# better\n", encoding="utf-8")
    assert orjson.loads(command(*words).stdout)["timing"]["flown"] == 1


def own(rule):
    """Tasks of one arm with this rule."""
    return tasks(parse_experiment(SHORT.replace('"average"\n\n', f'"{rule}"\n\n'), source="x"), seeds=1)


def test_a_worker_that_holds_an_older_version_of_a_rule_says_so_and_its_run_is_no_result(tmp_path, monkeypatch):
    (tmp_path / "aged_rule.py").write_text(OWN_RULE, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    task = own("aged_rule:mine")[0]
    found = fly_run(replace(task, key="of another version"))
    assert found.crashed
    assert "this worker holds another version of it" in found.problem


@pytest.mark.parametrize(
    ("rule", "said"),
    [
        ("no_such_module:mine", "there is no module no_such_module"),
        ("broken_rule:mine", "it raised ZeroDivisionError"),
        ("broken_rule:other", "has no function other"),
    ],
)
def test_a_rule_that_cannot_be_flown_is_told_before_anything_flies(rule, said, gcs, short, tmp_path, monkeypatch):
    (tmp_path / "broken_rule.py").write_text("def mine(heard, settings):\n    return 1 / 0\n", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    short.write_text(SHORT.replace('controller = "average"', f'controller = "{rule}"'), encoding="utf-8")
    code, out, err = gcs(short, "--jobs", 1, "--out", tmp_path / "out")
    assert (code, out) == (2, "")
    assert one_sentence(err)
    assert f"control.rule = {rule!r}: " in err
    assert said in err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "file",
    ["gcs/flight.py", "gcs/experiment/run.py", "gcs/recording/writer.py", "aircraft/quad/quad.xml",
     "aircraft/quad/Systems/rotors.xml"],
)  # fmt: skip
def test_the_digest_is_of_all_sources_and_of_the_aircraft(file, tmp_path):
    root = Path(run.__file__).parents[2]
    for room in ("aircraft", "fdm", "gcs", "scenarios", "trustr", "wire"):
        shutil.copytree(root / room, tmp_path / "a" / room, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(tmp_path / "a", tmp_path / "b")
    assert run.code_digest(tmp_path / "a") == run.code_digest(tmp_path / "b")
    run.code_digest.cache_clear()
    with (tmp_path / "b" / file).open("a", encoding="utf-8") as stream:
        stream.write("\n")
    assert run.code_digest(tmp_path / "a") != run.code_digest(tmp_path / "b")


def test_the_digest_is_of_what_calculates_too(monkeypatch):
    of = run.code_digest.__wrapped__
    here = of()
    monkeypatch.setattr(run, "version", lambda package: "0.0" if package == "jsbsim" else version(package))
    assert of() != here


def test_a_run_names_the_sources_of_the_process_that_flew_it(monkeypatch):
    monkeypatch.setattr(run, "code_digest", lambda: "of the worker")
    (task, *_) = tasks(parse_experiment(SHORT, source="x"), seeds=1)
    assert orjson.loads(fly_run(task).line())["code"] == "of the worker"


def test_the_keys_of_rules_that_ship_stay_what_they_were(monkeypatch):
    """As since scenarios have a fence; a change of the scenario's keys or defaults changes them, and must be meant."""
    monkeypatch.setattr(run, "version", lambda _: "0.1.0")
    assert tasks(load_experiment("base"), seeds=1)[0].key == "c9bc8c264104534f7a08"


def test_runs_of_other_sources_under_the_same_version_count_but_are_told(gcs, flown, tmp_path):
    with copy_of(flown, tmp_path, runs=RUNS) as folder:
        journal = folder / "runs.jsonl"
        digest = run.code_digest().encode()
        journal.write_bytes(journal.read_bytes().replace(digest, b"0" * len(digest)))
        code, _, err = gcs(flown[0], "--out", folder, "--json")
        assert code == 0
        assert f"{RUNS} runs were flown by other sources than these" in err


def test_results_name_the_version_the_command_and_the_sources_that_flew(flown):
    path, folder, said, _ = flown
    (digest,) = {orjson.loads(line)["code"] for line in lines(folder)}
    assert (said["version"], said["sources"]) == (version("trustr"), {digest: RUNS})
    assert said["asked"]["command"] == f"gcs experiment {path}"
    head = (folder / "table.md").read_text(encoding="utf-8").partition("##")[0]
    assert f"`gcs experiment {path}`, trustr {version('trustr')}: 8 runs, flown by sources {digest}.\n" in head


def test_results_of_several_sources_say_how_many_runs_are_whose(tmp_path):
    runs = [*made("a", [1, 1, 1], code="new"), *made("b", [1], code="old")]
    results_of(runs).save(tmp_path)
    table = (tmp_path / "table.md").read_text(encoding="utf-8")
    assert "3 runs flown by sources new; 1 runs by others: old (1)." in table
    assert orjson.loads((tmp_path / "experiment.json").read_bytes())["sources"] == {"new": 3, "old": 1}


def test_a_journal_that_holds_something_else_is_refused(gcs, short, tmp_path):
    (tmp_path / "runs.jsonl").write_text('{"my": "notes"}\n', encoding="utf-8")
    code, out, err = gcs(short, "--out", tmp_path)
    assert (code, out) == (2, "")
    assert one_sentence(err)
    assert "runs.jsonl, line 1" in err
    assert (tmp_path / "runs.jsonl").read_text(encoding="utf-8") == '{"my": "notes"}\n'


@pytest.mark.parametrize("notes", [b"my notes, without an end", b'{"my": "notes"}\n{"ke', b'{"key":"n'])
def test_only_half_a_run_is_cut_off_a_journal(notes, tmp_path):
    path = tmp_path / "runs.jsonl"
    path.write_bytes(notes)
    if notes.startswith(BEGINNING):
        with Journal(tmp_path) as journal:
            assert journal.runs == {}
        assert path.read_bytes() == b""
        return
    with pytest.raises(UnusableJournal, match="is no run of this version"), Journal(tmp_path):
        pass
    assert path.read_bytes() == notes


def test_two_experiments_do_not_write_into_one_folder(gcs, short, tmp_path):
    with (tmp_path / "runs.jsonl").open("ab") as stream:
        fcntl.flock(stream, fcntl.LOCK_EX)
        code, _, err = gcs(short, "--out", tmp_path)
    assert code == 2
    assert one_sentence(err)
    assert "another experiment is writing there" in err


@pytest.mark.parametrize("jobs", [1, 2])
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_broken_off_it_keeps_what_is_flown_and_goes_on_from_there(flown, tmp_path, jobs, how):
    path, _, said, _ = flown
    words = [str(GCS), "experiment", str(path), "--out", str(tmp_path), "--jobs", str(jobs), "--json"]
    with (tmp_path / "stderr").open("wb") as stderr:
        started = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=stderr, start_new_session=True)
        while len(lines(tmp_path)) < 2 and started.poll() is None:
            time.sleep(0.02)
        os.killpg(started.pid, how)
        code = started.wait(timeout=30)
    left = len(lines(tmp_path))
    assert 2 <= left < RUNS
    if how == signal.SIGINT:
        assert code == 130
        assert "the same command goes on from there" in (tmp_path / "stderr").read_text()
    again = subprocess.run(words, capture_output=True, check=True)
    assert orjson.loads(again.stdout)["timing"]["kept"] >= left - (how == signal.SIGKILL)
    assert results(orjson.loads(again.stdout)) == results(said)


# Whoever flies


def test_one_process_flies_what_two_fly(gcs, flown, tmp_path):
    code, out, _ = gcs(flown[0], "--jobs", 1, "--out", tmp_path / "out", "--json")
    assert code == 0
    assert results(orjson.loads(out)) == results(flown[2])


CLUSTER = """
import sys
from distributed import LocalCluster
with LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None) as cluster:
    print(cluster.scheduler_address, flush=True)
    sys.stdin.read()
"""


@contextmanager
def cluster():
    started = subprocess.Popen(
        [sys.executable, "-c", CLUSTER],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    try:
        yield started.stdout.readline().strip()
    finally:
        started.communicate(timeout=60)


def test_a_dask_cluster_flies_what_this_machine_flies(flown, tmp_path):
    with cluster() as address:
        done = command(flown[0], "--dask", address, "--out", tmp_path / "out", "--json")
    assert done.returncode == 0, done.stderr
    said = orjson.loads(done.stdout)
    assert results(said) == results(flown[2])
    assert (said["timing"]["workers"], said["timing"]["flown"]) == (2, RUNS)


@contextmanager
def server_of_another_kind():
    """Answers everything as the web does, and closes."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve():
            while True:
                try:
                    client, _ = server.accept()
                except OSError:
                    return
                with client:
                    client.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")

        threading.Thread(target=serve, daemon=True).start()
        yield f"tcp://127.0.0.1:{server.getsockname()[1]}"
        server.shutdown(socket.SHUT_RDWR)


def test_no_cluster_is_told_in_one_sentence_without_a_long_wait(gcs, short, tmp_path):
    with server_of_another_kind() as other:
        for address in ("tcp://127.0.0.1:1", "tcp://127.0.0.1", "nonsense", "ftp://127.0.0.1:1", other):
            began = time.monotonic()
            code, _, err = gcs(short, "--dask", address, "--out", tmp_path / "out")
            assert code == 2
            assert one_sentence(err), err
            assert f"--dask {address}: no scheduler answers there" in err
            assert time.monotonic() - began < 15


class Answering:
    """A Dask client whose workers answer what they are told to."""

    def __init__(self, *answers):
        self._answers = {f"worker {number}": answer for number, answer in enumerate(answers)}
        self.closed = False

    def nthreads(self):
        return dict.fromkeys(self._answers, 2)

    def run(self, *_, **__):
        return self._answers

    def close(self, **_):
        self.closed = True


@pytest.mark.parametrize(
    ("answers", "said"),
    [
        ((), "no worker has joined this scheduler"),
        ((version("trustr"), "0.0.1"), "worker worker 1 has trustr 0.0.1, this machine has"),
        ((PackageNotFoundError("trustr"),), "worker worker 0 has no trustr, this machine has"),
    ],
)
def test_workers_must_have_what_flies_here(answers, said, monkeypatch):
    import distributed

    async def reached(_):
        pass

    client = Answering(*answers)
    monkeypatch.setattr(workers, "_reach", reached)
    monkeypatch.setattr(distributed, "Client", lambda *_, **__: client)
    with pytest.raises(workers.NoCluster, match=said):
        workers.Cluster("tcp://there:1")
    assert client.closed


def test_without_dask_installed_the_sentence_says_how_to_get_it(gcs, short, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    code, _, err = gcs(short, "--dask", "tcp://127.0.0.1:1", "--out", tmp_path)
    assert code == 2
    assert one_sentence(err)
    assert "pip install 'trustr[dask]'" in err


def test_a_cluster_that_is_not_there_leaves_no_folder(gcs, short, tmp_path):
    code, _, err = gcs(short, "--dask", "nonsense", "--out", tmp_path / "out")
    assert code == 2
    assert one_sentence(err)
    assert not (tmp_path / "out").exists()


# What goes wrong


def test_a_flight_that_cannot_be_completed_has_not_passed_is_listed_and_stops_nothing(gcs, short, tmp_path):
    short.write_text(SHORT.replace("set = [", 'set = ["time.timeout_s=3", '), encoding="utf-8")
    code, out, err = gcs(short, "--seeds", 1, "--jobs", 1, "--out", tmp_path, "--json")
    assert code == 0
    said = orjson.loads(out)
    assert len(said["incomplete"]) == len(said["cells"]) == 4
    assert "took longer than time.timeout_s" in said["incomplete"][0]["problem"]
    cell = said["cells"][0]
    assert (cell["passed"]["count"], cell["passed"]["n"], cell["incomplete"], cell["heading_error_deg"]) == (
        0,
        1,
        1,
        None,
    )
    assert "not completed: base, transit 40 %, average, seed 1: the flight took longer" in err
    table = (tmp_path / "table.md").read_text(encoding="utf-8")
    assert table.count("took longer than time.timeout_s") == 4
    assert gcs(short, "--seeds", 1, "--out", tmp_path, "--json")[0] == 0


def test_an_error_of_the_program_is_no_result_and_is_flown_again(gcs, short, tmp_path, monkeypatch):
    real = run.attempt

    def attempt_with_a_defect(scenario, *, seed, ratings):
        if scenario.control.rule == "average":
            raise ZeroDivisionError("by\n  nothing")
        return real(scenario, seed=seed, ratings=ratings)

    monkeypatch.setattr(run, "attempt", attempt_with_a_defect)
    code, out, err = gcs(short, "--seeds", 1, "--jobs", 1, "--out", tmp_path, "--json")
    assert code == 3
    assert "ZeroDivisionError: by nothing (test_experiment.py:" in orjson.loads(out)["incomplete"][0]["problem"]
    assert "2 runs ended in an error of this program; they are in no figure" in err
    assert [(cell["crashed"], cell["passed"]["n"]) for cell in orjson.loads(out)["suites"]] == [(1, 0), (0, 1)] * 2
    assert "seed 1: ZeroDivisionError: by nothing (test_experiment.py:" in (table := said_in(tmp_path / "table.md"))
    assert "; an error of the program, in no figure" in table
    assert "nan" not in table
    assert len(lines(tmp_path)) == 2
    monkeypatch.undo()
    code, out, _ = gcs(short, "--seeds", 1, "--jobs", 1, "--out", tmp_path, "--json")
    assert code == 0
    assert (orjson.loads(out)["timing"]["flown"], orjson.loads(out)["incomplete"]) == (2, [])


def test_ctrl_c_inside_jsbsim_is_still_ctrl_c(monkeypatch):
    def interrupted(*_, **__):
        raise SystemError("returned a result with an exception set") from KeyboardInterrupt()

    monkeypatch.setattr(run, "attempt", interrupted)
    with pytest.raises(KeyboardInterrupt):
        fly_run(tasks(parse_experiment(SHORT, source="x"), seeds=1)[0])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("nope",), "no experiment 'nope'"),
        (("base", "--seeds", "0"), "--seeds 0: must be at least 1"),
        (("base", "--jobs", "0"), "--jobs 0: must be a number of processes"),
        (("base", "--only", "bse"), "--only bse: there is no such suite or condition; there are base/transit 40 %"),
        (("base", "--out", "/dev/null/x"), "--out /dev/null/x: cannot be written"),
        (("base", "--jobs", "2", "--dask", "tcp://there:1"), "--jobs 2: with --dask, the cluster's workers fly"),
    ],
)
def test_a_wrong_word_is_one_sentence(gcs, words, said):
    code, out, err = gcs(*words)
    assert (code, out) == (2, "")
    assert said in err
    assert one_sentence(err)


# What the runs amount to


def made(arm, passes, *, suite="s", condition="c", **changes):
    """Runs with seeds from 1."""
    one = RunResult(
        key="", suite=suite, condition=condition, arm=arm, seed=0, passed=False, heading_error_deg=1.0,
        distance_to_target_m=2.0, min_separation_m=1.5, faulty=0, detected={}, false_alarms=0, problem=None,
        crashed=False, wall_s=1.0, cpu_s=1.0, code="c0de",
    )  # fmt: skip
    return [replace(one, seed=seed, passed=bool(passed), **changes) for seed, passed in enumerate(passes, start=1)]


def results_of(runs, *, title="Many", reference=None, seeds=3):
    asked = Asked("gcs experiment many", (), seeds, seeds)
    return Results.of(Conducted(runs, Timing(1, 0, 1, 1.0, 1.0)), title=title, reference=reference, asked=asked)


def said_in(path):
    return path.read_text(encoding="utf-8")


def by_arm(found):
    return {cell.arm: cell for cell in found}


def test_pairs_are_of_one_condition_and_seed():
    """Both pass half of the time: never together in condition c, always together in d."""
    runs = [
        *made("truth", [1, 1, 0, 0]), *made("auto", [0, 0, 1, 1]),
        *made("truth", [1, 0, 1, 0], condition="d"), *made("auto", [1, 0, 1, 0], condition="d"),
    ]  # fmt: skip
    apart, together = (cell.against_reference for cell in cells(runs, reference="truth") if cell.arm == "auto")
    assert (apart.won, apart.lost, apart.pairs) == (2, 2, 4)
    assert (together.won, together.lost, together.pairs) == (0, 0, 4)
    (pooled,) = (cell for cell in suites(runs, reference="truth") if cell.arm == "auto")
    assert (pooled.condition, pooled.passed.count, pooled.passed.n) == (None, 4, 8)
    assert (pooled.against_reference.won, pooled.against_reference.lost, pooled.against_reference.pairs) == (2, 2, 8)
    where = pooled.passed_where_reference_did
    assert (where.count, where.n) == (2, 4)


def test_below_the_reference_is_a_whole_interval_below_it_by_more_than_five_points():
    truth = made("truth", [1] * 30)
    few, many = made("few", [0] * 6 + [1] * 24), made("many", [0] * 9 + [1] * 21)
    found = by_arm(cells([*truth, *few, *many], reference="truth"))
    assert found["few"].against_reference.high > -0.05
    assert not found["few"].below_reference
    assert found["many"].against_reference.high < -0.05
    assert found["many"].below_reference
    assert found["truth"].against_reference is None
    assert not found["truth"].below_reference
    assert found["truth"].passed_where_reference_did.rate == 1


def test_without_the_reference_there_is_nothing_to_compare():
    runs = [*made("truth", [1], suite="a"), *made("auto", [1], suite="a"), *made("auto", [1], suite="b")]
    first, second = (cell for cell in suites(runs, reference="truth") if cell.arm == "auto")
    assert first.against_reference is not None
    assert second.against_reference is None
    assert second.passed_where_reference_did is None
    assert all(cell.against_reference is None for cell in suites(runs, reference=None))


def test_the_median_detection_counts_who_was_never_found():
    found = made("a", [1] * 3, faulty=1, detected={5: 2.0}) + made("a", [0] * 2, faulty=1)
    (cell,) = cells(found, reference=None)
    assert (cell.detection_s, cell.detected.count, cell.detected.n) == (2.0, 3, 5)
    assert cell.slowest_s == 2.0
    (cell,) = cells(found + made("a", [0] * 2, faulty=1), reference=None)
    assert (cell.detection_s, cell.detected.count, cell.detected.n) == (None, 3, 7)
    (cell,) = cells(made("a", [1]), reference=None)
    assert (cell.detection_s, cell.detected) == (None, None)


def test_means_are_over_the_flights_that_came_to_their_read_out_and_passes_over_all():
    lost = made("a", [0], heading_error_deg=None, distance_to_target_m=None, min_separation_m=None, problem="lost")
    (cell,) = cells([*made("a", [1, 1]), *lost], reference=None)
    assert (cell.passed.count, cell.passed.n, cell.incomplete) == (2, 3, 1)
    assert (cell.heading_error_deg.mean, cell.heading_error_deg.ci95, cell.min_separation_m) == (1.0, 0.0, 1.5)
    (cell,) = cells(lost, reference=None)
    assert (cell.heading_error_deg, cell.min_separation_m) == (None, None)


def test_errors_of_the_program_are_in_no_figure_and_nor_are_their_pairs():
    broken = {"problem": "ZeroDivisionError", "crashed": True, "heading_error_deg": None, "distance_to_target_m": None}
    truth = [*made("truth", [1, 1, 1]), *(replace(run, seed=4) for run in made("truth", [0], **broken))]
    auto = [replace(run, **broken) if run.seed == 1 else run for run in made("auto", [0, 0, 1, 1], faulty=1)]
    found = by_arm(cells([*truth, *auto], reference="truth"))
    assert (found["truth"].passed.n, found["truth"].passed.rate, found["truth"].crashed) == (3, 1.0, 1)
    assert (found["auto"].passed.n, found["auto"].crashed, found["auto"].incomplete) == (3, 1, 0)
    assert found["auto"].detected.n == 3
    assert (found["auto"].against_reference.pairs, found["auto"].against_reference.lost) == (2, 1)
    assert found["auto"].passed_where_reference_did.n == 2


def test_where_nothing_but_errors_came_of_it_there_is_no_rate(tmp_path):
    runs = [*made("truth", [1, 1]), *made("auto", [0, 0], problem="ZeroDivisionError", crashed=True)]
    found = results_of(runs, reference="truth")
    found.save(tmp_path)
    draw(found, tmp_path)
    assert orjson.loads(found.json())["cells"][1]["passed"]["rate"] is None
    assert "| c | auto | 0 | – |" in said_in(tmp_path / "table.md")


def test_the_table_shows_the_closest_approach_and_who_did_not_arrive(tmp_path):
    runs = made("a", [0, 1], min_separation_m=0.914) + made("b", [0], problem="lost") + made("b", [1, 1])
    runs += made("c", [0], problem="a defect", crashed=True) + made("c", [1])
    results_of(runs).save(tmp_path)
    rows = [[cell.strip() for cell in row.split("|")[1:-1]] for row in said_in(tmp_path / "table.md").splitlines()]
    head, _, *arms = (row for row in rows if len(row) > 5)
    shown = {row[1]: (row[head.index("closest")], row[head.index("not completed")]) for row in arms}
    assert shown == {"a": ("0.91 m", "0"), "b": ("1.50 m", "1"), "c": ("1.50 m", "0, and 1 crashed")}


@pytest.mark.parametrize(("found", "said"), [(1, "most not found, at most 3.2 s (1/3)"), (0, "not found (0/3)")])
def test_where_most_are_not_found_the_table_says_most(found, said, tmp_path):
    runs = made("a", [1] * found, faulty=1, detected={5: 3.2}) + made("a", [0] * (3 - found), faulty=1)
    results_of(runs).save(tmp_path)
    assert f"| {said} |" in said_in(tmp_path / "table.md")


def test_rules_that_use_no_trust_find_nobody_and_alarm_nobody():
    every = tasks(parse_experiment(SHORT, source="x"), seeds=1)
    averaged = fly_run(every[0])
    assert averaged.arm == "average"
    assert (averaged.faulty, averaged.detected, averaged.false_alarms) == (0, {}, 0)


def test_a_line_of_the_journal_reads_back_as_the_run_it_was():
    (one,) = made("a", [1], detected={5: 0.1 + 0.2, 12: 3.0}, problem="a\nb")
    assert RunResult.of_line(one.line()) == one
    assert one.line().count(b"\n") == 1


# Terminal, pictures and progress


def shown(results, width):
    console = Console(file=StringIO(), width=width)
    show(results, console)
    return console.file.getvalue()


@pytest.mark.parametrize("width", [100, 110])
@pytest.mark.parametrize("name", experiment_names())
def test_a_terminal_shows_every_name_and_figure_of_what_ships(name, width):
    experiment = load_experiment(name)
    runs = [
        one
        for condition in experiment.conditions
        for arm in experiment.arms_of(condition)
        for one in made(
            arm.name, [arm.name == experiment.reference] * 30, suite=condition.suite, condition=condition.name,
            heading_error_deg=123.456, distance_to_target_m=123.456, faulty=2, detected={4: 15.0, 5: 15.0},
        )
    ]  # fmt: skip
    said = shown(results_of(runs, title=experiment.title, reference=experiment.reference), width)
    assert "…" not in said
    assert all(len(line) <= width for line in said.splitlines())
    for suite in experiment.suite:
        assert f"\n{suite.name} " in said or f"\n{suite.name}\n" in said
    for arm in experiment.arm:
        assert all(word in said.split() for word in arm.name.split())
    rows = [line for line in said.splitlines() if " %" in line]
    assert len(rows) == len({(run.suite, run.arm) for run in runs})
    for row in rows:
        assert re.search(r"(0|100) % \[\d+, \d+\] +123.46° +123.46 m +1.50 m +\d+/\d+ +15.0 s", row)
    if experiment.reference is not None:
        assert "−100 [−100, " in said


def test_names_are_shown_as_they_are_whatever_they_hold(tmp_path):
    runs = [*made("x [/z]", [1], suite="[bold]"), *made("[red]", [0], suite="[bold]")]
    said = shown(results_of(runs, title="[/b] $x$", reference="x [/z]"), 120)
    for words in ("x [/z]", "[bold]", "[red]", "[/b] $x$", "against x [/z]"):
        assert words in said
    draw(results_of(runs, title="[/b] $x$", reference="x [/z]"), tmp_path)


def test_a_narrow_terminal_wraps_and_loses_nothing():
    said = shown(results_of(made("ratings, heterogeneous", [1] * 3) + made("b", [1] * 3), reference="b"), 50)
    assert "…" not in said
    assert all(len(line) <= 50 for line in said.splitlines())


def large(count):
    arms = ("average", "confidence-decay", "truth", "fused")
    runs = [
        done
        for number in range(count)
        for condition in ("transit 40 %", "emergency 40 %")
        for arm in arms
        for done in made(arm, [1, 0, arm == "truth"], suite=f"a suite of many words {number}", condition=condition)
    ]
    return results_of(runs, reference="truth")


@pytest.mark.parametrize("count", [1, MOST_ROWS // 2, 25])
def test_no_two_names_of_a_picture_overlap(count, tmp_path, monkeypatch):
    figures = []
    monkeypatch.setattr(plt, "close", figures.append)
    draw(large(count), tmp_path)
    monkeypatch.undo()
    for figure in figures:
        renderer = figure.canvas.get_renderer()
        for axes in figure.axes:
            labels = [text for text in axes.get_yticklabels() if text.get_text() and text.get_visible()]
            low, high = axes.get_xlim()
            ticks = [text for text in axes.get_xticklabels() if low <= text.get_position()[0] <= high]
            assert len(ticks) >= 2
            for sort in (labels, ticks):
                boxes = [text.get_window_extent(renderer) for text in sort]
                assert not any(a.overlaps(b) for a, b in pairwise(boxes))
            assert all(text.get_window_extent(renderer).x0 >= 0 for text in labels)
        titles = [axes.title.get_window_extent(renderer) for axes in figure.axes]
        assert not any(a.overlaps(b) for n, a in enumerate(titles) for b in titles[n + 1 :])
        plt.close(figure)


def test_elsewhere_than_on_a_terminal_progress_is_a_line_every_so_often(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(meter.time, "monotonic", lambda: now[0])
    console = Console(file=StringIO(), width=100)
    with meter.Meter(console, total=110, kept=10) as shown:
        for _ in range(100):
            now[0] += 1.0
            shown.advance()
    said = console.file.getvalue().splitlines()
    assert said[0] == "40 of 110 runs, 3600 runs/h, 0:01:10 left"
    assert len(said) == 4
    assert said[-1] == "110 of 110 runs, 3600 runs/h, 0:00:00 left"


def test_a_single_seed_has_no_interval_and_nothing_says_nan(tmp_path):
    found = results_of(made("a", [1]), title="One", seeds=1)
    assert isnan(found.cells[0].heading_error_deg.ci95)
    found.save(tmp_path)
    draw(found, tmp_path)
    assert orjson.loads(found.json())["cells"][0]["heading_error_deg"]["ci95"] is None
    assert "nan" not in (tmp_path / "table.md").read_text(encoding="utf-8")
