"""Flights side by side: the table says which one passed, the picture shows both."""

from dataclasses import replace
from io import StringIO

import matplotlib.image as mpimg
import numpy as np
import pytest
from flights import SHORT, fly_and_record, recorded
from rich.console import Console

from gcs.compare import UnwritablePicture, compare
from gcs.output import PICTURE
from gcs.picture import FAILED, FAULT, HEALTHY, draw
from gcs.recording.reader import UnreadableRecording
from scenarios import load

AVERAGE = ("emergency", 'control.rule="average"')


def compared(*paths, picture):
    console = Console(file=StringIO(), width=110)
    compare(paths, picture=picture, console=console)
    return console.file.getvalue()


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """What is printed, and the picture, of the averaged update and Trust-R."""
    picture = tmp_path_factory.mktemp("compare") / "comparison.png"
    return compared(recorded(*AVERAGE).folder, recorded("emergency").path, picture=picture), picture


def test_the_table_has_a_column_for_each_flight_and_says_which_passed(both):
    words, _ = both
    (head,) = (line for line in words.splitlines() if "Averaged update" in line)
    assert head.index("Averaged update (eq. 1)") < head.index("Trust-R, trust from truth")
    (mission,) = (line for line in words.splitlines() if line.strip().startswith("mission"))
    assert mission.split() == ["mission", "failed", "passed"]


def test_the_table_has_the_figures_of_both_summaries(both):
    words, _ = both
    for flight in (recorded(*AVERAGE), recorded("emergency")):
        assert f"{flight.summary.heading_error_deg:.1f}°" in words
        assert f"{flight.summary.distance_to_target_m:.1f} m" in words
    assert "at most 4°" in words
    assert "at most 3.2 m" in words


def test_every_path_is_told_whole_on_a_line_of_its_own(both):
    words, picture = both
    lines = words.splitlines()
    assert f"picture    {picture.resolve()}" in lines
    for flight in (recorded(*AVERAGE), recorded("emergency")):
        assert f"recording  {flight.path.resolve()}" in lines


def pixels(path):
    assert path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    return mpimg.imread(path)


def shade(image, colour):
    """How many pixels have this colour, or nearly: lines let a little of the paper through."""
    wanted = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    return int((abs(image[..., :3] - wanted).max(axis=2) < 0.1).sum())


def test_the_picture_is_wide_enough_to_read_and_shows_the_failed_robot_twice(both):
    _, picture = both
    image = pixels(picture)
    height, width = image.shape[:2]
    assert 1200 <= width <= 2400
    assert 700 <= height <= 1600
    left, right = image[:, : width // 2], image[:, width // 2 :]
    for half in (left, right):
        assert shade(half, FAILED) > 300
        assert all(shade(half, colour) > 50 for colour in (HEALTHY[0], HEALTHY[1], HEALTHY[2]))


def test_every_run_leaves_a_picture_of_its_own():
    failing, healthy = (fly_and_record(name, *SHORT, pictured=True).folder / PICTURE for name in ("transit", "demo"))
    image = pixels(failing)
    assert image.shape[0] > 700
    assert shade(image, FAILED) > 300
    assert shade(pixels(healthy), FAILED) == 0


LEFT = ("emergency", 'trust.source="auto"', 'control.profile="recommended"', 'trust.beyond_repair="hold"')
BOTH = 'fault=[{vehicle=1, kind="motor_degradation"}, {vehicle=3, kind="motor_degradation", onset_s=6}]'


def row(words, name):
    (found,) = (line for line in words.splitlines() if line.strip().startswith(name))
    return found.split(name)[1].split()


def test_the_table_says_who_was_distrusted_how_soon_and_who_was_left_behind(tmp_path):
    flight = recorded(*LEFT, "fault.0.vehicle=1")
    paths = recorded(*AVERAGE).path, recorded("emergency").path, flight.path
    words = compared(*paths, picture=tmp_path / "c.png")
    found = f"{flight.summary.detected['1']:.1f}"
    assert " ".join(row(words, "distrusted after")) == f"– robot 5: 0.0 s robot 1: {found} s"
    assert " ".join(row(words, "left behind")) == "nobody nobody robot 1"


def test_where_nobody_was_left_behind_the_table_does_not_ask(both):
    assert "left behind" not in both[0]


def drawn(track, scenario, path):
    draw(track, scenario, path)
    return pixels(path)


def test_the_picture_tells_two_faulty_robots_left_behind_from_the_others(tmp_path):
    flown = recorded(*LEFT, BOTH).read()
    assert flown.track.parts[-1].left_behind == (1, 3)
    image = drawn(flown.track, flown.scenario, tmp_path / "left.png")
    untold = drawn(replace(flown.track, parts=()), flown.scenario, tmp_path / "untold.png")
    assert image.shape[1] == untold.shape[1]
    legend, legend_untold = image[-100:], untold[-100:]
    assert shade(legend, FAILED) > shade(legend_untold, FAILED) > 50
    assert shade(image, FAULT) > 5000


def test_a_robot_that_telemetry_has_lost_is_drawn_as_far_as_it_was_heard(tmp_path):
    flight = recorded("demo", *SHORT).read()
    position = flight.track.position.copy()
    position[20:, 1], position[:, 2] = np.nan, np.nan
    draw(replace(flight.track, position=position, measured=True), flight.scenario, tmp_path / "lost.png")
    shown = pixels(tmp_path / "lost.png")
    for row, there in ((0, True), (1, True), (2, False)):
        colour = [int(HEALTHY[row][at : at + 2], 16) / 255 for at in (1, 3, 5)]
        assert (np.abs(shown[: len(shown) // 2, :, :3] - colour) < 0.01).all(axis=2).any() == there


def test_a_wind_on_everyone_shades_its_time_and_blames_nobody(tmp_path):
    wind = 'fault=[{vehicle=1, kind="wind", speed_m_s=6, from_deg=90, everyone=true, onset_s=5}]'
    flown = recorded("emergency", 'trust.source="auto"', wind).read()
    image = drawn(flown.track, flown.scenario, tmp_path / "wind.png")
    assert shade(image, FAILED) == 0


@pytest.mark.filterwarnings("error")
def test_a_flight_in_which_everybody_fails_is_drawn_too(tmp_path):
    flown = recorded("demo").read()
    everybody = ", ".join(f'{{vehicle={system}, kind="frozen_telemetry"}}' for system in range(1, 7))
    image = drawn(flown.track, load("demo", overrides=[f"fault=[{everybody}]"]), tmp_path / "all.png")
    assert shade(image, HEALTHY[0]) == 0


def test_one_recording_alone_is_a_table_with_one_column(tmp_path):
    words = compared(recorded("demo").folder, picture=tmp_path / "one.png")
    assert "recommended" in words
    assert "passed" in words
    assert "failed" not in words


@pytest.mark.parametrize("suffix", [".pdf", ".svg"])
def test_the_picture_comes_in_vectors_too(suffix, tmp_path):
    picture = tmp_path / f"one{suffix}"
    compared(recorded("demo").path, picture=picture)
    assert picture.stat().st_size > 10_000


def test_a_flight_that_never_got_to_its_mission_has_no_score_and_does_not_hide_the_other(tmp_path):
    ended = fly_and_record("demo", "time.timeout_s=2")
    words = compared(ended.folder, recorded("demo").folder, picture=tmp_path / "c.png")
    (mission,) = (line for line in words.splitlines() if line.strip().startswith("mission"))
    assert mission.split()[:3] == ["mission", "not", "completed:"]
    assert mission.split()[-1] == "passed"
    with pytest.raises(UnreadableRecording, match="no recording has a mission"):
        compared(ended.folder, picture=tmp_path / "none.png")


def test_a_picture_that_cannot_be_written_is_refused_in_a_sentence(tmp_path):
    (tmp_path / "file").touch()
    for picture in (tmp_path / "nowhere" / "c.png", tmp_path / "file" / "c.png"):
        with pytest.raises(UnwritablePicture, match="cannot be written: N"):
            compared(recorded("demo").path, picture=picture)
    with pytest.raises(UnwritablePicture, match=r"must end in \.png"):
        compared(recorded("demo").path, picture=tmp_path / "c.txt")


def test_nothing_to_compare_is_refused(tmp_path):
    with pytest.raises(UnreadableRecording, match="at least one"):
        compared(picture=tmp_path / "c.png")
    with pytest.raises(UnreadableRecording, match="nowhere"):
        compared(tmp_path / "nowhere", picture=tmp_path / "c.png")
