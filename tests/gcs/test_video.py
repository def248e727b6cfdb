"""Films of flights: what everyone sees, what a blind film keeps to itself, and a file that any player shows."""

import math
import re
import subprocess
import sys
from contextlib import closing
from dataclasses import replace
from functools import cache

import imageio_ffmpeg
import numpy as np
import pytest
from flights import SHORT, recorded, scratch

from gcs.events import Rating
from gcs.mission import plan
from gcs.output import whole
from gcs.recording.history import FaultSpan, load
from gcs.trust_colour import trust_colour
from gcs.video.encoder import Encoder, ffmpeg
from gcs.video.film import explained, unexplained
from gcs.video.flock import Flock
from gcs.video.insight import Insight
from gcs.video.motion import AFTER_S, BEFORE_S, Motion
from gcs.video.trust_bars import TrustBars
from gcs.video.view import HEIGHT, RATE, WIDTH, Box, View
from scenarios import load as load_scenario

FILM_S = BEFORE_S + AFTER_S


@cache
def history():
    return load(recorded("demo", *SHORT).path)


def failing(flight, row=1):
    """The same flight, with one robot that fails and that nobody trusts."""
    trust = flight.trust.copy()
    trust[:, row] = 0.0
    return replace(flight, trust=trust, faults=(FaultSpan(flight.ids[row], "rotor", 0.0, math.inf, "it drags"),))


def without_mission(flight):
    nothing = np.full(len(flight.mission_s), np.nan)
    return replace(
        flight, mission_s=nothing, track=None, problem="it never began", virtual_ne=nothing[:, None] + [0, 0]
    )


def pictures(drawn):
    """(H, W, 3) each, kept."""
    return [np.asarray(picture)[..., :3].astype(int) for picture in drawn]


def times(motion, count=3):
    return np.linspace(motion.begins_s, motion.ends_s - 0.01, count)


def shown(flight, count=3):
    motion = Motion.of(flight)
    return pictures(explained(flight, motion, times(motion, count)))


def shown_blind(flight, count=3):
    motion = Motion.of(flight)
    return pictures(unexplained(motion, times(motion, count)))


def reddest(picture):
    """How far red is above the other colours, at most."""
    return (picture[..., 0] - picture[..., 1:].max(axis=-1)).max()


@pytest.fixture(scope="module", params=["explained", "blind"])
def film(request):
    """A film as a person gets it, ten times as fast as the flight."""
    from gcs import cli

    path = scratch() / "some-name.mp4"
    blind = ["--blind"] if request.param == "blind" else []
    with pytest.raises(SystemExit) as ended:
        cli.main(["video", str(recorded("demo", *SHORT).folder), "--out", str(path), "--speed", "10", *blind])
    assert not ended.value.code
    return path


class TestTheFile:
    def test_has_the_size_rate_and_length_that_were_promised(self, film):
        with closing(imageio_ffmpeg.read_frames(str(film))) as stream:
            head = next(stream)
        assert (head["size"], head["fps"], head["codec"]) == ((1280, 720), 30.0, "h264")
        assert head["pix_fmt"].startswith("yuv420p")
        mission_s = plan(history().scenario).read_out_s
        frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(film))
        assert seconds == pytest.approx((mission_s + FILM_S) / 10, abs=0.05)
        assert frames == round(seconds * RATE)

    def test_shows_something_from_first_to_last(self, film):
        raw = subprocess.run(
            [ffmpeg(), "-v", "error", "-i", film, "-f", "rawvideo", "-pix_fmt", "gray", "-"],
            capture_output=True,
            check=True,
        )
        pictures = np.frombuffer(raw.stdout, np.uint8).reshape(-1, HEIGHT, WIDTH)
        assert (pictures.mean(axis=(1, 2)) > 200).all()  # paper
        assert (pictures.min(axis=(1, 2)) < 90).all()  # and ink

    def test_says_nothing_of_where_it_came_from(self, film):
        written = film.read_bytes()
        for tag in (b"\xa9nam", b"\xa9cmt", b"\xa9too", b"\xa9day", b"demo", b"Trust", b"trustr", b"run.mcap"):
            assert tag not in written


class TestABlindFilm:
    def test_is_the_same_whoever_was_trusted_and_whatever_flew_it(self):
        flight = history()
        scenario = load_scenario("demo", overrides=(*SHORT, 'control.rule="average"', 'title="another"'))
        rng = np.random.default_rng(1)
        other = replace(
            failing(flight),
            scenario=scenario,
            metadata={"scenario": "another", "seed": "7"},
            problem="robot 2 was lost",
            weights=rng.random(flight.weights.shape),
            virtual_ne=flight.virtual_ne + 5.0,
            ratings=(Rating("op1", 2, 1),),
            happenings=(),
            parts=(),
            asked_ned=flight.asked_ned * 2.0,
            battery=flight.battery * 0.5,
        )
        assert all(np.array_equal(a, b) for a, b in zip(shown_blind(flight), shown_blind(other), strict=True))
        assert not any(np.array_equal(a, b) for a, b in zip(shown(flight), shown(other), strict=True))

    def test_has_no_red_where_the_explained_one_shows_who_failed(self):
        flight = failing(history())
        red = (255 * trust_colour(0.0)).round()
        for picture in shown(flight)[1:]:
            assert (np.abs(picture - red).max(axis=-1) <= 2).sum() > 50
        assert max(map(reddest, shown_blind(flight))) < 10

    def test_shows_motion(self):
        first, *_, last = shown_blind(history())
        assert (np.abs(first - last).max(axis=-1) > 60).sum() > 100

    def test_is_named_after_nothing(self, gcs, tmp_path):
        path = tmp_path / "run.mcap"
        path.write_bytes(recorded("demo", *SHORT).path.read_bytes())
        code, out, _ = gcs("video", tmp_path, "--blind", "--speed", 100)
        assert code == 0
        assert out.split() == ["video", str(tmp_path / "blind.mp4")]


def test_the_same_recording_gives_the_same_pictures():
    assert all(np.array_equal(a, b) for a, b in zip(shown(history()), shown(history()), strict=True))


class TestMotion:
    def test_goes_straight_between_two_ticks_and_turns_the_shorter_way(self):
        flight = history()
        yaw = np.where(np.arange(len(flight.time_ns)) % 2 == 0, 3.1, -3.1)
        attitude = np.zeros_like(flight.attitude_rpy)
        attitude[..., 2] = yaw[:, None]
        motion = Motion.of(replace(flight, attitude_rpy=attitude))
        halfway = 0.5 * (motion.time_s[150] + motion.time_s[151])
        place, turned = motion.at(halfway)
        np.testing.assert_allclose(place, 0.5 * (motion.place_ne[150] + motion.place_ne[151]))
        np.testing.assert_allclose(np.cos(turned), -1.0)  # between 3.1 and −3.1 is south, not north

    def test_shows_a_flight_without_a_mission_whole(self):
        motion = Motion.of(without_mission(history()))
        assert (motion.begins_s, motion.ends_s) == (0.0, motion.time_s[-1])

    @pytest.mark.parametrize(("speed", "frames"), [(1.0, 300), (10.0, 30), (0.5, 600), (100.0, 3)])
    def test_has_so_many_pictures(self, speed, frames):
        motion = replace(Motion.of(history()), begins_s=2.0, ends_s=12.0)
        at = motion.frames(speed=speed, rate=RATE)
        assert len(at) == frames
        np.testing.assert_allclose(np.diff(at), speed / RATE)


class TestView:
    def test_has_one_scale_north_upwards_and_everything_in_it(self):
        motion, box = Motion.of(history()), Box(100, 50, 900, 650)
        view = View.of(motion, box)
        origin, north, east = view.pixels([(0, 0), (1, 0), (0, 1)])
        np.testing.assert_allclose([north - origin, east - origin], [(0, view.scale), (view.scale, 0)], atol=1e-9)
        flown = view.pixels(motion.place_ne[motion.ticks(motion.begins_s, motion.ends_s)]).reshape(-1, 2)
        assert (flown > (box.left + 50, box.bottom + 50)).all()
        assert (flown < (box.right - 50, box.top - 50)).all()

    def test_of_robots_that_never_told_where_they_are(self):
        motion = Motion.of(without_mission(history()))
        view = View.of(replace(motion, place_ne=np.full_like(motion.place_ne, np.nan)), Box(0, 0, WIDTH, HEIGHT))
        assert math.isfinite(view.scale)


def test_a_flight_that_never_got_anywhere_is_shown_with_its_reason():
    assert len(shown(without_mission(history()))) == 3


@pytest.mark.parametrize("count", [1, 12, 13, 30, 100])
def test_bars_of_however_many_robots_stay_beside_each_other(count):
    flight = history()
    rows = np.arange(count) % len(flight.ids)
    many = replace(flight, ids=tuple(range(1, count + 1)), trust=flight.trust[:, rows])
    motion = Motion.of(flight)
    view = View.of(motion, Box(0, 0, 930, HEIGHT))
    box = Box(950, 0, 1260, 560)
    bars = TrustBars(many, Insight(many, Flock(motion, view), view), box)
    *_, empty = bars.ground()
    corners = np.array([path.vertices for path in empty.get_paths()])
    low, high = corners.min(axis=1), corners.max(axis=1)
    assert len(low) == min(count, 48)
    assert (low >= (box.left, bars.bottom)).all()
    assert (high <= (box.right, box.top)).all()
    apart = (low[:, None] >= high[None]) | (high[:, None] <= low[None])
    assert (apart.any(axis=-1) | np.eye(len(low), dtype=bool)).all()


class TestWhatCannotBe:
    @pytest.mark.parametrize(
        ("words", "sentence"),
        [
            (["--speed", "0"], "--speed 0: must be 0.1 to 100"),
            (["--speed", "nan"], "--speed nan: must be 0.1 to 100"),
            (["--out", "film.avi"], "--out film.avi: must end in .mp4"),
            (["--out", "/proc/nowhere/film.mp4"], "--out /proc/nowhere/film.mp4: cannot be written"),
        ],
    )
    def test_is_one_sentence(self, gcs, words, sentence):
        code, out, err = gcs("video", recorded("demo", *SHORT).folder, *words)
        assert (code, out) == (2, "")
        assert err.startswith(f"gcs: {sentence}")

    def test_without_the_encoder_it_says_what_to_install(self, gcs, monkeypatch):
        monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
        code, _, err = gcs("video", recorded("demo", *SHORT).folder)
        assert code == 2
        assert "pip install 'trustr[video]'" in err

    def test_a_full_disk_is_a_sentence_and_leaves_nothing(self, gcs, tmp_path):
        (tmp_path / ".unfinished-film.mp4").symlink_to("/dev/full")
        out = tmp_path / "film.mp4"
        code, _, err = gcs("video", recorded("demo", *SHORT).folder, "--speed", 50, "--out", out)
        assert code == 2
        assert re.search(r"cannot be written: No space left on device$", err.strip())
        assert list(tmp_path.iterdir()) == []

    def test_whoever_interrupts_it_finds_no_torn_file(self, tmp_path):
        def interrupted():
            with whole(tmp_path / "film.mp4") as path, Encoder(path, ffmpeg()) as encoder:
                encoder.add(memoryview(bytes(WIDTH * HEIGHT * 4)))
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            interrupted()
        assert list(tmp_path.iterdir()) == []


def around(picture, view, place_ne, pixels=10):
    """The part of a picture about a place."""
    right, up = np.round(view.pixels(place_ne)).astype(int)
    return picture[HEIGHT - up - pixels : HEIGHT - up + pixels, right - pixels : right + pixels]


def test_nobody_sees_where_an_emergency_calls_before_it_does():
    motion = Motion.of(load(recorded("emergency").path))
    call_s = motion.starts_s + motion.plan.hand_over_s
    before, after = pictures(unexplained(motion, np.array([call_s - 0.05, call_s + 0.05])))
    view, (known, called) = View.planned(motion, Box(0, 0, WIDTH, HEIGHT)), motion.plan.segments
    first, second = known.planned_end_ne, called.planned_end_ne
    assert around(before, view, first).min() == around(after, view, first).min() < 120
    assert around(before, view, second).min() > 200
    assert around(after, view, second).min() < 120


def test_a_blind_film_looks_at_the_same_ground_however_the_flight_went():
    view, other = (
        View.planned(Motion.of(load(recorded(*name).path)), Box(0, 0, WIDTH, HEIGHT))
        for name in (("emergency",), ("emergency", 'control.rule="average"'))
    )
    assert (view.scale, view.centre_ne) == (other.scale, other.centre_ne)
