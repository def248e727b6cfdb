"""Messages between two times: each once, whatever the slices, and backwards the same in reverse order."""

from itertools import pairwise

import pytest
from flights import SHORT, messages, recorded, rewritten, scratch
from hypothesis import given, settings
from hypothesis import strategies as st

from gcs.recording.reader import UnreadableRecording
from gcs.replay import timeline
from gcs.replay.player import Player, Span
from gcs.replay.reel import Reel

FLIGHT = ("demo", *SHORT)


@pytest.fixture(scope="module")
def known():
    """What the recording holds, by another reader, in the order of time and of the file."""
    return sorted(messages(recorded(*FLIGHT).path), key=lambda message: message[1])


@pytest.fixture(scope="module")
def ends():
    whole = timeline.load(recorded(*FLIGHT).path)
    return whole.start_ns, whole.end_ns


def played(reel, *spans):
    return [(message.topic, message.time_ns, message.data) for span in spans for message in reel.play(Span(*span))]


def test_all_of_it_is_all_there_is_in_either_direction(known, ends):
    with Reel(recorded(*FLIGHT).path) as reel:
        assert played(reel, ends) == known
        assert played(reel, ends[::-1]) == known[::-1]


@settings(max_examples=10)
@given(cuts=st.lists(st.floats(0, 1), max_size=6).map(sorted), backwards=st.booleans())
def test_nothing_is_put_out_twice_or_left_out_in_any_slicing(known, ends, cuts, backwards):
    start, end = ends
    places = [start, *(start + round(cut * (end - start)) for cut in cuts), end]
    places = places[::-1] if backwards else places
    with Reel(recorded(*FLIGHT).path) as reel:
        whole = played(reel, *pairwise(places))
    assert whole == (known[::-1] if backwards else known)


@settings(max_examples=10)
@given(moves=st.lists(st.tuples(st.floats(0, 1), st.floats(0, 1)), max_size=5))
def test_wherever_it_came_from_a_span_holds_what_lies_in_it(known, ends, moves):
    start, end = ends
    with Reel(recorded(*FLIGHT).path) as reel:
        for one, other in moves:
            begin, stop = (start + round(at * (end - start)) for at in (one, other))
            low, high = sorted((begin, stop))
            within = [message for message in known if low <= message[1] < high]
            assert played(reel, (begin, stop)) == (within if begin <= stop else within[::-1])


def test_a_player_at_any_speed_puts_out_the_whole_flight_once(known, ends):
    player, seen = Player(*ends, ends[0]).faster(), []
    with Reel(recorded(*FLIGHT).path) as reel:
        while not player.paused:
            player, span = player.advance(333_333_333)
            seen += played(reel, span)
    assert seen == known


def test_a_message_comes_with_what_a_reader_needs_to_understand_it(ends):
    with Reel(recorded(*FLIGHT).path) as reel:
        kinds = {message.topic: message for message in reel.play(Span(*ends))}
    tick, raw = kinds["/tick"], kinds["/mavlink/1_1/raw"]
    assert (tick.encoding, tick.schema_name, tick.schema_encoding) == ("json", "trustr.Tick", "jsonschema")
    assert b'"lateness_ns"' in tick.schema_data
    assert (raw.encoding, raw.schema_name, raw.schema_encoding, raw.schema_data) == ("mavlink", "", "", b"")


def test_damage_is_met_where_it_lies_and_told_in_a_sentence(ends):
    path = scratch() / "flipped.mcap"
    data = bytearray(rewritten(recorded(*FLIGHT).path, lambda *told: told[-1]).read_bytes())
    data[len(data) // 2] ^= 0x40
    path.write_bytes(data)
    with Reel(path) as reel, pytest.raises(UnreadableRecording, match=r"^/.*flipped\.mcap: .*gcs log recover"):
        reel.play(Span(*ends))


def test_what_is_no_recording_is_refused_and_closed():
    path = scratch() / "words.mcap"
    path.write_text("no MCAP file\n")
    with pytest.raises(UnreadableRecording, match="not an MCAP file"):
        Reel(path)
