"""A recorded flight decided again: the same to the bit, or the tick at which it is not."""

from io import StringIO

import numpy as np
import orjson
import pytest
from flights import SHORT, failing, fly_and_record, messages, recorded, rewritten
from rich.console import Console

from gcs.recording.reader import UnreadableRecording, ticks
from gcs.replay.verify import decide_again, verify
from wire.frames import Framer, Sender
from wire.payloads import LOCAL_POSITION_NED, pack_local_position, unpack_local_position

CONDITIONS = {
    "trust-r": ("emergency",),
    "average": ("emergency", 'control.rule="average"'),
    "recommended": ("demo",),
}
BRIEF = ("demo", *SHORT)


@pytest.mark.parametrize("condition", CONDITIONS)
def test_a_flight_decided_again_is_the_same_to_the_bit(condition):
    flight = recorded(*CONDITIONS[condition])
    result = decide_again(flight.path)
    assert result.difference is None
    assert result.ticks == round(flight.summary.simulated_s / 0.1)
    assert result.setpoints == sum(frame[7] == 84 for _, frame in flight.link.sent)


def test_the_pages_of_a_recording_are_the_frames_that_the_loop_took_and_sent():
    flight = recorded("emergency")
    pages = list(ticks(flight.path))
    assert [frame for page in pages for frame in page.received] == flight.link.received
    assert [frame for page in pages for frame in page.sent] == [frame for _, frame in flight.link.sent]


def telemetry(path, system, tick):
    """The place in the file of the last position of a vehicle that this tick consumed."""
    place = None
    for at, (topic, _, data) in enumerate(messages(path)):
        if topic == f"/mavlink/{system}_1/raw" and data[7] == LOCAL_POSITION_NED:
            place = at
        elif topic == "/tick" and orjson.loads(data)["number"] == tick:
            return place
    raise AssertionError("there is no such tick")


def moved(raw, metres):
    """The same frame, the vehicle further north."""
    (frame,) = Framer().frames(0, raw)
    position = unpack_local_position(frame.payload)
    there = position._replace(x=position.x + metres)
    return Sender(frame.system, 1).frame(LOCAL_POSITION_NED, pack_local_position(there))


def tampered(path, *, system, tick, metres):
    """A copy of a recording in which a vehicle says once that it is somewhere else."""
    place = telemetry(path, system, tick)
    return rewritten(path, lambda at, _topic, _time, data: moved(data, metres) if at == place else data)


@pytest.mark.parametrize(("tick", "metres"), [(121, 0.5), (150, 0.001)])
def test_one_position_tampered_with_is_found_at_the_tick_that_saw_it(tick, metres):
    result = decide_again(tampered(recorded(*BRIEF).path, system=3, tick=tick, metres=metres))
    assert result.difference.tick == tick
    assert result.difference.recorded != result.difference.decided


def test_a_copy_with_nothing_changed_is_no_different():
    flight = recorded(*BRIEF)
    assert decide_again(rewritten(flight.path, lambda _at, _t, _n, data: data)).difference is None


def test_a_set_point_taken_out_is_found():
    flight = recorded(*BRIEF)
    held = messages(flight.path)
    sent = [at for at, (topic, _, data) in enumerate(held) if topic == "/mavlink/255_190/raw" and data[7] == 84]
    gone = sent[len(sent) // 2]
    tick = sum(topic == "/tick" for topic, _, _ in held[:gone])
    changed = rewritten(flight.path, lambda at, _t, _n, data: None if at == gone else data)
    assert decide_again(changed).difference.tick == tick


def said(path):
    console = Console(file=StringIO(), width=200)
    return verify(path, console=console), console.file.getvalue()


def test_it_is_said_in_words_and_in_the_exit_code():
    flight = recorded(*BRIEF)
    code, words = said(flight.path)
    assert code == 0
    assert f"{decide_again(flight.path).ticks} ticks decided again" in words
    code, words = said(tampered(flight.path, system=1, tick=140, metres=0.5))
    assert code == 3
    assert "tick 140" in words


def test_a_flight_cut_short_is_decided_again_as_far_as_it_went(tmp_path):
    with pytest.raises(ZeroDivisionError):
        fly_and_record("demo", out=tmp_path, events=failing(201, ZeroDivisionError()))
    result = decide_again(tmp_path / "run.mcap")
    assert result.difference is None
    assert result.ticks == 201


def test_an_operators_word_is_decided_again_at_its_tick():
    asked = iter(["land" if tick == 150 else None for tick in range(10_000)])
    flight = fly_and_record(*BRIEF, events=lambda: tuple(filter(None, [next(asked)])))
    pages = list(ticks(flight.path))
    assert [number for number, page in enumerate(pages) if page.events] == [150]
    assert decide_again(flight.path).difference is None
    assert flight.summary.heading_error_deg is None
    assert flight.summary.completed


def test_a_recording_that_holds_no_tick_has_nothing_to_decide():
    empty = rewritten(recorded(*BRIEF).path, lambda _at, topic, _n, data: None if topic == "/tick" else data)
    with pytest.raises(UnreadableRecording, match="no tick"):
        decide_again(empty)


def test_a_torn_recording_is_refused_in_a_sentence(tmp_path):
    data = recorded(*BRIEF).path.read_bytes()
    for part in np.linspace(0.05, 0.99, 7):
        (tmp_path / "torn.mcap").write_bytes(data[: int(len(data) * part)])
        with pytest.raises(UnreadableRecording, match=r"torn\.mcap: torn, damaged or not an MCAP file"):
            decide_again(tmp_path / "torn.mcap")
