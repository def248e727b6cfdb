"""Our recordings in other tools' formats, read by software that nobody here wrote."""

import io
import json
import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import orjson
import polars as pl
import pytest
from flights import SHORT, digest, messages, recorded, scratch
from mcap.reader import make_reader
from mcap.writer import Writer
from rich.console import Console

from gcs.recording.decoded import decoded
from gcs.recording.export import export
from gcs.recording.reader import read
from gcs.recording.tlog import Entries, Entry
from wire.frames import Framer, decode

MAVLOGDUMP = Path(sys.executable).with_name("mavlogdump.py")
OURS = ["faults", "links", "mission", "ratings", "rejected", "roles", "states", "ticks", "vehicles", "weights"]


@pytest.fixture(scope="module")
def flight():
    return recorded("demo", *SHORT)


@pytest.fixture(scope="module")
def exported(flight):
    """A form → where a flight was written in it, once."""

    folder, done = scratch(), {}

    def written(form):
        if form not in done:
            done[form] = folder / f"as-{form}"
            assert export(flight.path, to=form, out=done[form], console=Console(file=io.StringIO())) == 0
        return done[form]

    return written


@pytest.fixture(scope="module")
def frames(flight):
    """Every recorded frame, taken apart, in the order of the file."""
    framer = Framer()
    return [framer.frames(time_ns, data)[0] for topic, time_ns, data in messages(flight.path) if topic.endswith("/raw")]


def test_the_tlog_holds_every_frame_in_the_order_of_time(exported, frames):
    log = Entries(exported("tlog").read_bytes())
    in_time = sorted(frames, key=lambda frame: frame.time_ns)
    assert list(log) == [Entry(frame.time_ns // 1000, frame.raw) for frame in in_time]
    assert log.skipped == 0


def test_mavlogdump_reads_the_tlog(exported, frames):
    dump = subprocess.run(
        [sys.executable, MAVLOGDUMP, "--format=json", exported("tlog")], capture_output=True, text=True, check=True
    )
    told = [json.loads(line)["meta"] for line in dump.stdout.splitlines()]  # which takes its bare NaN
    assert Counter(meta["type"] for meta in told) == Counter(decoded(frame)[0] for frame in frames)
    assert [meta["timestamp"] for meta in told] == pytest.approx(sorted(frame.time_ns / 1e9 for frame in frames))


def tables(folder):
    """Name → table, of whichever format."""
    return {
        path.stem: pl.read_parquet(path) if path.suffix == ".parquet" else pl.read_csv(path, infer_schema_length=None)
        for path in folder.iterdir()
        if path.suffix != ".json"
    }


def test_csv_and_parquet_hold_the_same_tables(exported):
    csv, parquet = tables(exported("csv")), tables(exported("parquet"))
    assert csv.keys() == parquet.keys()
    for name, table in parquet.items():
        assert csv[name].columns == table.columns
        assert csv[name].cast(dict(table.schema)).equals(table), name


def test_tables_are_typed(exported):
    parquet = tables(exported("parquet"))
    vehicles = parquet["vehicles"].schema
    assert [vehicles[name] for name in ("tick", "time_ns", "vehicle", "verdict")] == [pl.Int64] * 4
    assert vehicles["commanded"] == parquet["states"].schema["armed"] == pl.Boolean
    assert vehicles["mission_s"] == vehicles["trust"] == vehicles["sent_north_m_s"] == pl.Float64
    position = parquet["mavlink_LOCAL_POSITION_NED"].schema
    assert dict(position) == {
        "time_ns": pl.Int64,
        "system": pl.UInt8,
        "component": pl.UInt8,
        "time_boot_ms": pl.UInt32,
        **dict.fromkeys(("x", "y", "z", "vx", "vy", "vz"), pl.Float32),
    }


def test_every_table_says_what_its_columns_mean(exported):
    for form in ("csv", "parquet"):
        meanings = orjson.loads((exported(form) / "columns.json").read_bytes())
        for name, table in tables(exported(form)).items():
            assert [column["name"] for column in meanings[name]["columns"]] == table.columns
            assert meanings[name]["rows"] == len(table)
            sentences = [column["sentence"] for column in meanings[name]["columns"]]
            assert all(sentences)
            assert name not in OURS or len(set(sentences)) == len(sentences), name
        columns = {column["name"]: column for column in meanings["vehicles"]["columns"]}
        assert columns["truth_velocity_east_m_s"]["unit"] == "m/s"
        assert columns["truth_velocity_east_m_s"]["axis"] == "east"
        assert "down from the vehicle's own origin" in columns["down_m"]["sentence"]
        assert "telemetry, to the north" in columns["velocity_north_m_s"]["sentence"]
        lat = next(c for c in meanings["mavlink_GLOBAL_POSITION_INT"]["columns"] if c["name"] == "lat")
        assert lat["unit"] == "degE7"


def test_frames_are_a_row_each_in_the_table_of_their_message(exported, frames):
    parquet = tables(exported("parquet"))
    rows = {name: len(table) for name, table in parquet.items() if name.startswith("mavlink_")}
    assert rows == Counter(f"mavlink_{decoded(frame)[0]}" for frame in frames)
    setpoints = parquet["mavlink_SET_POSITION_TARGET_LOCAL_NED"]
    sent = [decode(frame) for frame in frames if frame.message == 84]
    assert setpoints["time_ns"].to_list() == [frame.time_ns for frame in frames if frame.message == 84]
    assert setpoints["target_system"].to_list() == [message.target_system for message in sent]
    assert setpoints["vx"].to_numpy() == pytest.approx([message.vx for message in sent], abs=0)
    assert set(setpoints["system"]) == {255}


def test_a_row_of_vehicles_is_what_was_told_of_one_vehicle_at_one_tick(exported, flight):
    vehicles = tables(exported("parquet"))["vehicles"]
    told = {
        (topic, orjson.loads(data)["tick"]): orjson.loads(data)
        for topic, _, data in messages(flight.path)
        if topic in ("/swarm/state", "/truth/pose", "/trust", "/setpoint", "/mission")
    }
    ticks = sorted({tick for _, tick in told})
    assert len(vehicles) == len(ticks) * flight.scenario.swarm.count
    for tick in ticks[:: len(ticks) // 20]:
        fleet, pose, trust, setpoint, mission = (
            told.get((topic, tick)) for topic in ("/swarm/state", "/truth/pose", "/trust", "/setpoint", "/mission")
        )
        for row in vehicles.filter(pl.col("tick") == tick).iter_rows(named=True):
            at = row["vehicle"] - 1
            assert [row["north_m"], row["east_m"], row["down_m"]] == fleet["position_m"][at]
            assert row["age_s"] == fleet["age_s"][at]
            assert row["mission_s"] == (None if mission is None else mission["mission_s"])
            assert row["trust"] == (None if trust is None else trust["trust"][at])
            assert row["truth_height_m"] == (None if pose is None else pose["position_m"][at][2])
            assert row["sent_east_m_s"] == (None if setpoint is None else setpoint["sent"][at][1])
            assert row["commanded"] == (None if setpoint is None else setpoint["commanded"][at])


def test_weights_of_a_robot_sum_to_one(exported):
    parquet = tables(exported("parquet"))
    sums = parquet["weights"].group_by("tick", "robot").agg(pl.col("weight").sum())["weight"].to_numpy()
    assert len(sums) > 0
    assert np.abs(sums - 1.0).max() < 1e-9
    assert parquet["weights"]["weight"].min() > 0.0
    assert set(parquet) >= set(OURS)


def test_decoded_messages_are_added_and_nothing_else_is_changed(exported, flight, frames):
    copy = exported("mcap")
    added = [message for message in messages(copy) if is_decoded(message[0])]
    assert [message for message in messages(copy) if not is_decoded(message[0])] == messages(flight.path)
    assert [(time_ns, data) for _, time_ns, data in added] == [(f.time_ns, decoded(f)[1]) for f in frames]
    before, after = read(flight.path), read(copy)
    assert (after.scenario, after.rated, after.problem) == (before.scenario, before.rated, before.problem)
    with flight.path.open("rb") as one, copy.open("rb") as other:
        theirs, ours = make_reader(one), make_reader(other, validate_crcs=True)
        assert list(ours.iter_attachments()) == list(theirs.iter_attachments())
        assert list(ours.iter_metadata()) == list(theirs.iter_metadata())
        summary = ours.get_summary()
    by_topic = {channel.topic: summary.schemas.get(channel.schema_id) for channel in summary.channels.values()}
    assert by_topic["/mavlink/1_1/LOCAL_POSITION_NED"].name == "mavlink.LOCAL_POSITION_NED"
    assert by_topic["/mavlink/255_190/SET_POSITION_TARGET_LOCAL_NED"].encoding == "jsonschema"
    assert summary.statistics.message_count == len(messages(copy))


def is_decoded(topic):
    return topic.startswith("/mavlink/") and not topic.endswith("/raw")


def test_what_is_decoded_already_is_not_doubled(exported, gcs):
    again = scratch() / "again.mcap"
    assert gcs("log", "export", exported("mcap"), "--to", "mcap", "--out", again)[0] == 0
    assert digest(again) == digest(exported("mcap"))


def test_the_export_is_decided_again_as_the_flight_was(exported, gcs):
    code, out, _ = gcs("replay", "--verify", exported("mcap"))
    assert code == 0
    assert "identical to the bit" in out


def test_the_command_says_what_it_wrote_and_where(gcs, flight, tmp_path):
    code, out, _ = gcs("log", "export", flight.folder, "--to", "csv", "--out", tmp_path / "tables")
    assert code == 0
    assert out.startswith(f"{tmp_path / 'tables'}: ")
    rows = len(tables(tmp_path / "tables")["vehicles"])
    assert f"vehicles {rows}" in " ".join(out.split())


def test_what_is_there_already_is_left_alone(gcs, flight, tmp_path):
    (tmp_path / "mine").write_text("precious")
    code, _, said = gcs("log", "export", flight.path, "--to", "tlog", "--out", tmp_path / "mine")
    assert (code, said) == (2, f"gcs: --out {tmp_path / 'mine'}: is there already: name another, or take it away\n")
    code, _, said = gcs("log", "export", flight.path, "--to", "csv", "--out", tmp_path)
    assert (code, said) == (2, f"gcs: --out {tmp_path}: is there already: name another, or take it away\n")
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


@pytest.mark.parametrize("form", ["tlog", "csv", "parquet", "mcap"])
def test_of_a_torn_recording_nothing_is_written(gcs, flight, tmp_path, form):
    torn = tmp_path / "run.mcap"
    torn.write_bytes(flight.path.read_bytes()[: flight.path.stat().st_size // 2])
    code, out, said = gcs("log", "export", torn, "--to", form)
    assert (code, out) == (2, "")
    assert said == f"gcs: {torn}: torn or damaged; gcs log recover {torn} rebuilds it\n"
    assert list(tmp_path.iterdir()) == [torn]


def test_a_tlog_is_imported_not_exported(gcs, exported, tmp_path):
    (tmp_path / "mav.tlog").write_bytes(exported("tlog").read_bytes())
    code, _, said = gcs("log", "export", tmp_path / "mav.tlog", "--to", "csv")
    assert (code, said) == (
        2,
        f"gcs: {tmp_path / 'mav.tlog'}: a log of frames; gcs log import makes a recording of it\n",
    )


def written_elsewhere(path, *, schema="another.Tick"):
    """Another program's file, with topics called like ours."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(library="another")
        channel = writer.register_channel("/tick", "json", writer.register_schema(schema, "jsonschema", b"{}"))
        writer.add_message(channel, 5, b'{"of": "a clock"}', 5)
        writer.finish()
    return path


@pytest.mark.parametrize(
    ("form", "why"),
    [
        ("tlog", "holds no MAVLink frame: there is nothing to write to a .tlog"),
        ("csv", "holds neither frames nor topics of ours: there is no table to write"),
    ],
)
def test_of_a_file_with_nothing_of_ours_nothing_is_written(gcs, tmp_path, form, why):
    path = written_elsewhere(tmp_path / "other.mcap")
    code, out, said = gcs("log", "export", path, "--to", form)
    assert (code, out, said) == (2, "", f"gcs: {path}: {why}\n")
    assert list(tmp_path.iterdir()) == [path]


def test_a_topic_of_another_version_is_refused_in_a_sentence(gcs, tmp_path):
    path = written_elsewhere(tmp_path / "other.mcap", schema="trustr.Tick")
    code, _, said = gcs("log", "export", path, "--to", "csv")
    assert (code, said) == (2, f"gcs: {path}: /tick is not as this version writes it\n")


@pytest.mark.parametrize("command", [("log", "export", "--to", "tlog"), ("report",)])
def test_of_a_recording_in_several_files_it_is_said_that_one_of_them_is_shown(gcs, flight, tmp_path, command):
    for name in ("run.mcap", "run.part2.mcap"):
        (tmp_path / name).write_bytes(flight.path.read_bytes())
    code, _, said = gcs(*command, tmp_path)
    assert code == 0
    assert said == (
        f"gcs: {tmp_path / 'run.mcap'}: goes on in run.part2.mcap, of which nothing is shown; "
        f"gcs log recover {tmp_path / 'run.mcap'} joins all\n"
    )
    (tmp_path / "run-frames.tlog").unlink(missing_ok=True)
    _, _, said = gcs("log", "export", "--to", "tlog", tmp_path / "run.part2.mcap")
    assert "run.part2.mcap: a part of run.mcap, and nothing else is shown; gcs log recover" in said


def test_without_pyarrow_there_is_csv(gcs, flight, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    code, _, said = gcs("log", "export", flight.path, "--to", "parquet", "--out", tmp_path / "parquet")
    assert (code, said) == (2, "gcs: --to parquet needs pyarrow: pip install 'trustr[parquet]'\n")
    assert gcs("log", "export", flight.path, "--to", "csv", "--out", tmp_path / "csv")[0] == 0
    assert [path.name for path in tmp_path.iterdir()] == ["csv"]
