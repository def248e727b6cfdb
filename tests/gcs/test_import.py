"""Other ground stations' logs as recordings of ours."""

import hashlib
import io
import subprocess
import sys
from pathlib import Path

import pytest
from flights import SHORT, messages, recorded
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from pymavlink.dialects.v20 import ardupilotmega as dialect
from rich.console import Console

from gcs.recording.contents import frames
from gcs.recording.decoded import decoded
from gcs.recording.importing import Clock, import_tlog
from gcs.recording.tlog import Entries, packed
from wire.frames import Framer, Sender

MAVLOGDUMP = Path(sys.executable).with_name("mavlogdump.py")
START_US = 1_700_000_000_000_000


@pytest.fixture(scope="module")
def flight():
    return recorded("demo", *SHORT)


@pytest.fixture
def exported(flight, gcs, tmp_path):
    """All frames of a flight, as a .tlog."""
    path = tmp_path / "flight.tlog"
    assert gcs("log", "export", flight.path, "--to", "tlog", "--out", path)[0] == 0
    return path


def test_what_is_exported_and_imported_is_the_same_frames_at_the_same_microseconds(flight, exported, gcs):
    code, out, said = gcs("log", "import", exported)
    recording = exported.with_suffix(".mcap")
    raw = [(topic, time_ns, data) for topic, time_ns, data in messages(flight.path) if topic.endswith("/raw")]
    in_time = sorted(raw, key=lambda message: message[1])
    assert (code, said) == (0, "")
    assert out == f"{recording}: {len(raw)} frames of {len({topic for topic, _, _ in raw})} senders\n"
    read = [message for message in messages(recording) if message[0].endswith("/raw")]
    assert read == [(topic, time_ns // 1000 * 1000, data) for topic, time_ns, data in in_time]


def test_a_log_that_pymavlink_wrote_is_imported_with_its_messages_decoded(exported, gcs, tmp_path):
    foreign = tmp_path / "mav.tlog"
    dump = [sys.executable, MAVLOGDUMP, "--types=LOCAL_POSITION_NED,HEARTBEAT", "-o", foreign, exported]
    subprocess.run(dump, stdout=subprocess.DEVNULL, check=True)
    assert gcs("log", "import", foreign, "--out", tmp_path / "mav.mcap")[0] == 0
    with (tmp_path / "mav.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        (told,) = reader.iter_metadata()
        read = [(c.topic, m.log_time, m.data) for _, c, m in reader.iter_messages(log_time_order=False)]
    log = list(Entries(foreign.read_bytes()))
    assert told.name == "imported"
    assert told.metadata == {
        "file": "mav.tlog",
        "bytes": str(foreign.stat().st_size),
        "sha256": hashlib.sha256(foreign.read_bytes()).hexdigest(),
        "frames": str(len(log)),
        "skipped_bytes": "0",
    }
    expected = []
    for entry in log:
        (frame,) = Framer().frames(entry.time_us * 1000, entry.raw)
        name, data = decoded(frame)
        sender = f"/mavlink/{frame.system}_{frame.component}"
        expected += [(f"{sender}/raw", frame.time_ns, entry.raw), (f"{sender}/{name}", frame.time_ns, data)]
    assert read == expected
    assert {topic.rpartition("/")[2] for topic, _, _ in read} == {"raw", "LOCAL_POSITION_NED", "HEARTBEAT"}


def test_an_imported_log_is_exported_as_tables_of_its_messages(exported, gcs, tmp_path):
    gcs("log", "import", exported)
    code, out, _ = gcs("log", "export", exported.with_suffix(".mcap"), "--to", "csv", "--out", tmp_path / "tables")
    assert code == 0
    assert {path.stem.partition("_")[0] for path in (tmp_path / "tables").iterdir()} == {"mavlink", "columns"}
    assert "vehicles" not in out


def log_of(*times_us):
    """A log with a heartbeat at each of these times."""
    sender = Sender(1, 1)
    beat = dialect.MAVLink_heartbeat_message(2, 3, 81, 4, 3, 3)
    return b"".join(packed(time_us * 1000, sender.pack(beat)) for time_us in times_us)


@given(st.lists(st.integers(-450_000, 450_000), min_size=1, max_size=20))
def test_frames_keep_the_order_of_the_file(tmp_path_factory, steps):
    folder = tmp_path_factory.getbasetemp()
    (folder / "mav.mcap").unlink(missing_ok=True)
    times_us = [START_US + step for step in steps]
    (folder / "mav.tlog").write_bytes(log_of(*times_us))
    assert import_tlog(folder / "mav.tlog", out=None, console=Console(file=io.StringIO())) == 0
    read = [time_ns for topic, time_ns, _ in messages(folder / "mav.mcap") if topic.endswith("/raw")]
    assert read == [time_us * 1000 for time_us in times_us]
    assert [time_ns for time_ns, _ in frames(folder / "mav.mcap")] == sorted(read)


def test_damage_is_stepped_over_and_told(exported, gcs):
    whole = exported.read_bytes()
    exported.write_bytes(b"not a frame" + whole + whole[:9])
    _, out, said = gcs("log", "import", exported)
    assert out.endswith(f"; 20 of {len(whole) + 20} bytes were none\n")
    assert said == ""


@pytest.mark.parametrize(
    ("times_us", "problems"),
    [
        ((START_US, START_US + 5, START_US + 3), []),
        ((START_US, START_US + 1800 * 10**6), []),
        ((7, 8), ["its clock begins before 1980: it was not set"]),
        (
            (START_US, START_US - 5 * 10**6, START_US, START_US - 60 * 10**6),
            ["its clock goes back 2 times, by up to 60 s: frames keep their order"],
        ),
        (
            (START_US, START_US + 7200 * 10**6),
            ["its clock jumps ahead once, by up to 7200 s: frames keep their order"],
        ),
    ],
)
def test_what_is_strange_about_a_clock_is_said(times_us, problems):
    clock = Clock()
    for time_us in times_us:
        clock.take(time_us)
    assert clock.problems() == problems


def test_a_strange_clock_is_no_reason_to_refuse_a_log(gcs, tmp_path):
    (tmp_path / "mav.tlog").write_bytes(log_of(7, 8, START_US, START_US + 1))
    code, _, said = gcs("log", "import", tmp_path / "mav.tlog")
    assert code == 0
    assert said.splitlines() == [
        f"gcs: {tmp_path / 'mav.tlog'}: its clock begins before 1980: it was not set",
        f"gcs: {tmp_path / 'mav.tlog'}: its clock jumps ahead once, by up to {START_US / 1e6:.0f} s: "
        "frames keep their order",
    ]


def test_what_is_no_log_is_refused_in_a_sentence(gcs, tmp_path):
    (tmp_path / "notes.tlog").write_text("no frames here")
    code, out, said = gcs("log", "import", tmp_path / "notes.tlog")
    sentence = f"gcs: {tmp_path / 'notes.tlog'}: no .tlog: there is no MAVLink frame behind a time in it\n"
    assert (code, out, said) == (2, "", sentence)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.tlog"]
    code, _, said = gcs("log", "import", tmp_path / "absent.tlog")
    assert (code, said) == (2, f"gcs: {tmp_path / 'absent.tlog'}: cannot be read: No such file or directory\n")


def test_a_recording_needs_no_import(flight, gcs, tmp_path):
    code, _, said = gcs("log", "import", flight.path, "--out", tmp_path / "out.mcap")
    assert (code, said) == (2, f"gcs: {flight.path}: an MCAP file already: there is nothing to import\n")
    assert not list(tmp_path.iterdir())


def test_what_is_mostly_something_else_is_told(gcs, tmp_path):
    (tmp_path / "mav.tlog").write_bytes(log_of(START_US) + bytes(1000))
    code, _, said = gcs("log", "import", tmp_path / "mav.tlog")
    assert (code, said) == (0, f"gcs: {tmp_path / 'mav.tlog'}: most of it is no frame behind a time: is it a .tlog?\n")


def test_a_recording_is_not_replaced_by_its_journal(exported, gcs, tmp_path):
    (tmp_path / "run.mcap").write_bytes(b"a recording")
    exported.rename(tmp_path / "run.tlog")
    code, _, said = gcs("log", "import", tmp_path / "run.tlog")
    assert code == 2
    assert "is there already" in said
    assert (tmp_path / "run.mcap").read_bytes() == b"a recording"
