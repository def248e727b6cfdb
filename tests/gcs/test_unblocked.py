"""Terminals and pipes that nobody reads: whoever speaks goes on, and a flight is flown, landed and told of."""

import fcntl
import io
import os
import pty
import re
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager, suppress

import orjson
import pytest
from flights import GCS, SHORT, recorded
from rich.console import Console

from gcs import progress
from gcs.flight import Flight
from gcs.loop import fly
from gcs.progress import Display
from gcs.recording.reader import ticks
from gcs.replay.again import Recorded
from gcs.replay.verify import decide_again
from gcs.unblocked import MOST, PATIENCE_S, Unblocked, unblocked

ROOM = 4096
"""Bytes that a pipe of ours holds."""


@contextmanager
def small_pipe():
    """(reading end, writing end as a text stream)"""
    reading, writing = os.pipe()
    fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, ROOM)
    with os.fdopen(reading, "rb", buffering=0) as reader, os.fdopen(writing, "w") as stream:
        yield reader, stream


def all_of(reader):
    """What can be read until the pipe stays empty; its writer waits to write more."""
    os.set_blocking(reader.fileno(), False)
    found, empty = b"", 0
    while empty < 20:
        data = reader.read(ROOM)
        found, empty = found + (data or b""), 0 if data else empty + 1
        threading.Event().wait(0.0 if data else 0.01)
    return found.decode()


def test_what_is_said_is_written_in_its_order_and_the_last_word_before_the_end():
    lines = [f"{number} – word {'x' * 200}\n" for number in range(MOST)]
    with small_pipe() as (reader, stream):
        heard = []
        listener = threading.Thread(target=lambda: heard.extend(iter(lambda: reader.read(100), b"")))
        listener.start()
        speaker = Unblocked(stream)
        for line in lines:
            assert speaker.write(line) == len(line)
        speaker.end()
        assert not speaker.behind
        stream.close()
        listener.join()
    assert b"".join(heard).decode() == "".join(lines)


def test_what_nobody_reads_holds_up_nobody_and_what_is_lost_is_counted():
    with small_pipe() as (reader, stream):
        speaker = Unblocked(stream)
        began = time.monotonic()
        for number in range(2000):
            speaker.write(f"{number:0100}\n")
        assert time.monotonic() - began < PATIENCE_S
        assert speaker.behind
        speaker.end()
        assert time.monotonic() - began < 4 * PATIENCE_S
        *lines, last = all_of(reader).splitlines()
    lost = int(re.fullmatch(r"\((\d+) messages were not shown: nobody read them\)", last)[1])
    assert [int(line) for line in lines] == list(range(2000 - lost))
    assert lost > 2000 - MOST - 2 * ROOM / 100


def test_whoever_hangs_up_is_spoken_to_without_an_error():
    with small_pipe() as (reader, stream):
        reader.close()
        speaker = Unblocked(stream)
        print("word", file=speaker, flush=True)
        speaker.end()
        assert not speaker.behind
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


@pytest.mark.parametrize("file", ["file", "memory"])
def test_a_file_is_written_to_as_ever(file, tmp_path, monkeypatch):
    stream = (tmp_path / "log").open("w") if file == "file" else io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    with stream, unblocked("stderr"):
        assert sys.stderr is stream


def test_over_a_picture_that_nobody_has_taken_no_other_is_drawn(monkeypatch):
    monkeypatch.setattr(progress, "REFRESH_S", 0.0)
    recording = recorded("emergency")
    pages, flight = Recorded(list(ticks(recording.path))), Flight(recording.scenario)
    with small_pipe() as (reader, stream):
        stream.write("x" * ROOM)
        stream.flush()
        speaker = Unblocked(stream)
        screen = Console(file=speaker, force_terminal=True, width=110)
        with Display(flight, screen, title="A TITLE") as display:
            fly(pages, pages, flight, (display,), period_ns=recording.scenario.time.period_ns, events=pages.events)
        speaker.end()
        assert all_of(reader).count("A TITLE") <= 2


def filled(stream):
    """This end, with no room left."""
    os.set_blocking(stream, False)
    with suppress(BlockingIOError):
        while True:
            os.write(stream, b"\n")
    os.set_blocking(stream, True)
    return stream


def flown(tmp_path, *words, **streams):
    options = [word for override in SHORT for word in ("--set", override)]
    return subprocess.Popen([GCS, "run", "demo", *options, *words, "--out", tmp_path], **streams)


def test_a_flight_whose_words_go_into_a_full_pipe_is_flown_to_its_end(tmp_path):
    with small_pipe() as (_, stream):
        process = flown(tmp_path, "--json", stdout=subprocess.PIPE, stderr=filled(stream.fileno()))
        out, _ = process.communicate(timeout=60)
        assert process.returncode == 0
        assert orjson.loads(out)["problem"] is None
        assert decide_again(tmp_path / "run.mcap").difference is None
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def test_ctrl_c_lands_a_flight_on_a_terminal_that_nobody_reads_and_it_ends(tmp_path):
    master, slave = pty.openpty()
    endless = ("--set", "mission.leg.1.length_m=3000", "--set", "time.timeout_s=3000")
    process = flown(tmp_path, *endless, stdin=slave, stdout=slave, stderr=slave)
    recording = tmp_path / "run.mcap"
    deadline = time.monotonic() + 30
    while not recording.exists() or recording.stat().st_size < 1_000_000:  # far more pictures than the terminal holds
        assert time.monotonic() < deadline
        assert process.poll() is None
        threading.Event().wait(0.05)
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=60) == 130
    assert decide_again(recording).difference is None
    assert orjson.loads((tmp_path / "summary.json").read_bytes())["problem"] is None
    for end in (master, slave):
        os.close(end)
