"""A recording from afar: from when to when, who spoke, who was silent, and where a place lies that somebody names."""

import numpy as np
import pytest
from excerpts import OTHER_STATION, frames_alone, said_by_another_station
from flights import SHORT, messages, recorded, scratch

from gcs.choices import BadUsageError
from gcs.recording.mcap_file import McapFile
from gcs.recording.reader import UnreadableRecording
from gcs.replay import timeline
from gcs.replay.index import Silence, silences

SECOND = 1_000_000_000


@pytest.fixture(scope="module")
def flight():
    return timeline.load(recorded("emergency").path)


@pytest.fixture(scope="module")
def imported():
    path = recorded("demo", *SHORT).path
    return timeline.load(frames_alone(path, more=said_by_another_station(1.0)))


def test_it_spans_from_the_first_message_to_behind_the_last(flight):
    times = [time_ns for _, time_ns, _ in messages(recorded("emergency").path)]
    assert (flight.start_ns, flight.end_ns) == (min(times), max(times) + 1)


def test_seconds_are_counted_from_mission_start(flight):
    row = int(np.flatnonzero(flight.flight.mission_s == 0.0)[0])
    assert flight.seconds(int(flight.flight.time_ns[row])) == 0.0
    assert flight.since == "since mission start"
    assert flight.seconds(flight.start_ns) < -5.0


def test_its_vehicles_and_its_ground_station_are_known_by_what_they_said_of_themselves(flight):
    assert flight.senders.vehicles == (1, 2, 3, 4, 5, 6)
    assert flight.senders.stations == {(255, 190)}


def test_a_folder_stands_for_the_recording_in_it(flight):
    assert timeline.load(recorded("emergency").folder).path == flight.path


@pytest.mark.parametrize(
    ("asked", "seconds"), [("12.5", 12.5), ("0:12.5", 12.5), ("0", 0.0), ("-2", -2.0), (" 7 ", 7.0), ("0:07", 7.0)]
)
def test_a_place_is_named_in_seconds_or_minutes(flight, asked, seconds):
    assert flight.place(asked) == flight.origin_ns + round(seconds * SECOND)


def test_a_place_is_named_by_words_of_what_happened_there(flight):
    (distrusted,) = (one for one in flight.happenings if one.words == "robot 5 is distrusted")
    assert flight.place("Distrust") == distrusted.time_ns + 1
    landing = next(one for one in flight.happenings if one.words == "landing")
    assert flight.place("landing") == landing.time_ns + 1


@pytest.mark.parametrize("asked", ["100", "-60", "9:00", "5000000"])
def test_beyond_the_ends_there_is_no_place(flight, asked):
    with pytest.raises(BadUsageError, match=r"^--from -?[\d:]+: the recording goes from -\d+\.\d s to \d+\.\d s$"):
        flight.place(asked, "--from")


@pytest.mark.parametrize("asked", ["lunch", "", "1:75", "nan", "1e3"])
def test_what_did_not_happen_is_refused_with_all_that_did(flight, asked):
    with pytest.raises(BadUsageError, match=r"words of an event; there are: joining; taking off; .*robot 5 is distrus"):
        flight.place(asked)


def test_both_ends_as_they_are_shown_are_places(flight):
    for end_ns in (flight.start_ns, flight.end_ns):
        assert abs(flight.place(f"{flight.seconds(end_ns):.1f}") - end_ns) <= 0.05 * SECOND


def test_of_another_ground_stations_log_there_are_vehicles_and_times_and_no_more(imported):
    assert imported.flight is None
    assert imported.happenings == imported.events == ()
    assert imported.senders.vehicles == (1, 2, 3, 4, 5, 6)
    assert imported.senders.stations == {(255, 190), OTHER_STATION}
    assert imported.since == "since the first message"
    assert imported.seconds(imported.start_ns) == 0.0
    assert imported.ticks[1] - imported.ticks[0] == SECOND // 10
    with pytest.raises(BadUsageError, match="there are: none"):
        imported.place("landing")


def test_where_nobody_or_a_vehicle_was_silent_is_known():
    def keep(name, seconds):
        return not 4.0 <= seconds < 7.0 and not (name[0] == 3 and seconds >= 8.0)

    path = frames_alone(recorded("demo", *SHORT).path, keep=keep)
    found = timeline.load(path)
    silent = [(gap.vehicle, found.seconds(gap.begin_ns), found.seconds(gap.end_ns)) for gap in found.silences]
    everybody = [(begin, end) for vehicle, begin, end in silent if vehicle is None]
    assert everybody == [(pytest.approx(4.0, abs=0.2), pytest.approx(7.0, abs=0.2))]
    assert {vehicle for vehicle, begin, _ in silent if begin < 6.0} == {None, 1, 2, 3, 4, 5, 6}
    last = found.seconds(found.end_ns)
    assert [row for row in silent if row[1] > 7.0] == [(3, pytest.approx(8.0, abs=0.2), pytest.approx(last, abs=0.5))]


def test_a_flight_without_silence_has_no_gaps(flight):
    assert flight.silences == ()


def test_gaps_are_longer_than_the_time_between_two_beats():
    beats = np.array([0, 1, 2, 5, 6], np.int64) * SECOND
    assert silences({}) == ()
    assert silences({7: beats}) == (Silence(2 * SECOND, 5 * SECOND, None), Silence(2 * SECOND, 5 * SECOND, 7))
    always = np.arange(7, dtype=np.int64) * SECOND
    assert silences({1: always, 2: always[3:]}) == (Silence(0, 3 * SECOND, 2),)


def test_a_torn_recording_is_refused_with_what_rebuilds_it():
    torn = scratch() / "torn.mcap"
    torn.write_bytes(recorded("demo", *SHORT).path.read_bytes()[:-5000])
    with pytest.raises(UnreadableRecording, match="gcs log recover"):
        timeline.load(torn)


def test_an_empty_recording_cannot_be_played():
    path = scratch() / "empty.mcap"
    McapFile(path).finish()
    with pytest.raises(UnreadableRecording, match="holds no message"):
        timeline.load(path)


def test_a_log_of_frames_is_told_what_makes_a_recording_of_it(tmp_path):
    with pytest.raises(UnreadableRecording, match="gcs log import makes a recording of it"):
        timeline.load(tmp_path / "flight.tlog")


def test_a_file_that_is_not_there_is_told_in_a_sentence(tmp_path):
    with pytest.raises(UnreadableRecording, match="No such file"):
        timeline.load(tmp_path / "nothing.mcap")
