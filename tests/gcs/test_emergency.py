"""A flight whose own code fails: other code tells its vehicles to land; who only watches takes nothing with it."""

import re
from collections import Counter
from types import SimpleNamespace

import numpy as np
import orjson
import pytest
from flights import SHORT, Beside, Counting, Saying, failing, fly_and_record, messages, recorded, scratch
from mcap.reader import SeekingReader
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs import session
from gcs.emergency import PAUSE_S, ROUNDS, LastResort
from gcs.flight import Flight
from gcs.lockstep import Lockstep
from gcs.loop import fly
from gcs.recording import sources, writer
from gcs.recording.files import SUMMARY
from gcs.recording.mcap_chunk import Filling
from gcs.recording.mcap_file import McapFile
from gcs.recording.own_topics import OwnTopics
from gcs.recording.viewers import Viewers
from gcs.recording.writer import Tap
from gcs.session import flown
from gcs.telemetry import Swarm, observe
from scenarios import load
from wire.modes import ARDUCOPTER_MODES, PX4_MODES, mode_name

MISSION_TICK = 160
"""The demo is in its mission by then."""


def defect():
    return ZeroDivisionError("a defect")


def in_lockstep(events=tuple, *, link=lambda world: world, watching=(), said=None):
    """A demo as `gcs run` flies it, through a link of the test's own: the world, and how it ended."""
    scenario, folder = load("demo", overrides=SHORT), scratch()
    world = Lockstep.of(scenario, seed=1)
    words = [] if said is None else said
    try:
        summary = flown(
            "demo", scenario, link(world), world, seed=1, out=folder, operator=Saying(events), pictured=False,
            watching=lambda _flight: watching, say=words.append,
        )  # fmt: skip
    except Exception as error:
        return world, error
    return world, summary


def seen(world, *, after_s=1.2):
    """The fleet as its telemetry tells it a little later."""
    world.receive()
    world.sleep_until(world.now() + round(after_s * 1e9))
    return observe(Swarm.of(range(1, 7)), world.receive())


def modes(swarm):
    return {mode_name(*pair) for pair in zip(swarm.autopilot.tolist(), swarm.custom_mode.tolist(), strict=True)}


def test_an_error_in_the_air_lands_everybody_before_it_goes_on():
    said = []
    world, error = in_lockstep(failing(MISSION_TICK, defect()), said=said)
    assert isinstance(error, ZeroDivisionError)
    (words,) = said
    assert words.startswith("gcs: the flight failed (ZeroDivisionError: a defect (flights.py, line ")
    assert words.endswith("; telling its vehicles to land")
    swarm = seen(world)
    assert modes(swarm) == {"land"}
    assert swarm.armed.all()
    assert not seen(world, after_s=30).armed.any()


class Lands:
    """A link that counts how often each vehicle is told to land."""

    def __init__(self, link):
        self._link = link
        self.told = Counter()

    def receive(self):
        return self._link.receive()

    def send(self, system, frame):
        if dialect.MAVLink(None).decode(bytearray(frame)).to_dict().get("command") == dialect.MAV_CMD_NAV_LAND:
            self.told[system] += 1
        self._link.send(system, frame)

    @property
    def rejected(self):
        return self._link.rejected


def test_each_is_told_ten_times_and_no_more():
    links = []

    def counted(world):
        links.append(Lands(world))
        return links[0]

    in_lockstep(failing(MISSION_TICK, defect()), link=counted)
    assert links[0].told == dict.fromkeys(range(1, 7), ROUNDS)


def test_an_error_when_all_have_landed_commands_nothing(monkeypatch):
    def unsound(*_figures):
        raise defect()

    monkeypatch.setattr(session, "summary_of", unsound)
    said = []
    _, error = in_lockstep(said=said)
    assert isinstance(error, ZeroDivisionError)
    assert said == []


def test_without_the_last_resort_they_would_have_held_first():
    """The claim above can fail."""
    scenario = load("demo", overrides=SHORT)
    world = Lockstep.of(scenario, seed=1)
    with pytest.raises(ZeroDivisionError):
        fly(world, world, Flight(scenario), (), period_ns=10**8, events=failing(MISSION_TICK, defect()))
    assert "land" not in modes(seen(world))


def ended_by(error, folder):
    """A demo that an error ends in its mission: the link it was flown over, and the world."""
    links = []

    def through(world, _clock):
        links.extend((Counting(world), world))
        return links[0]

    with pytest.raises(type(error)):
        fly_and_record("demo", *SHORT, out=folder, through=through, events=failing(MISSION_TICK, error))
    return links


def problem_told(folder):
    """In the recording, and in summary.json, which are one."""
    with (folder / "run.mcap").open("rb") as stream:
        told = {record.name: record.metadata for record in SeekingReader(stream).iter_metadata()}[SUMMARY]["json"]
    assert orjson.loads(told) == orjson.loads((folder / "summary.json").read_bytes())
    return orjson.loads(told)["problem"]


def test_a_flight_that_failed_says_why_and_is_recorded_to_the_end_of_what_was_sent_and_heard(tmp_path):
    link, _ = ended_by(defect(), tmp_path)
    raw = [(topic, data) for topic, _, data in messages(tmp_path / "run.mcap") if topic.endswith("/raw")]
    ours = "/mavlink/255_190/raw"
    assert [data for topic, data in raw if topic == ours] == [frame for _, frame in link.sent]
    assert [data for topic, data in raw if topic != ours] == [frame.raw for frame in link.received]
    last_told = dialect.MAVLink(None).decode(bytearray(raw[-1][1]))
    assert last_told.param1 == 1  # DO_SET_MODE, to land
    failed_ns = [time_ns for topic, time_ns, _ in messages(tmp_path / "run.mcap") if topic == "/tick"][-1]
    assert link.received[-1].time_ns - failed_ns > 0.9 * ROUNDS * PAUSE_S * 1e9
    assert re.fullmatch(
        r"the flight failed: ZeroDivisionError: a defect \(flights.py, line \d+\); its vehicles were told to land",
        problem_told(tmp_path),
    )


def test_the_operators_second_ctrl_c_lands_nothing_as_it_was_told_and_is_the_flights_problem(tmp_path):
    _, world = ended_by(KeyboardInterrupt(), tmp_path)
    assert "land" not in modes(seen(world))
    assert problem_told(tmp_path) == "ended at once by Ctrl-C: its vehicles were not told to land"


def test_what_notes_the_landing_keeps_no_frame_of_it_from_leaving():
    class Broken:
        def __getattr__(self, name):
            raise defect()

    wire = Wire()
    LastResort(Tap(wire, wire, Broken()), wire, (1, 2), say=str).land()
    assert len(wire.sent) == 2 * ROUNDS


class Wire:
    """A link that keeps what is sent, and fails as it is told; and a clock that may."""

    def __init__(self, *, unreachable=(), clock_fails=False):
        self._unreachable, self._clock_fails = unreachable, clock_fails
        self.time_ns, self.sent = 0, []

    def send(self, system, frame):
        if system in self._unreachable:
            raise OSError("no route")
        self.sent.append((self.time_ns, system, dialect.MAVLink(None).decode(bytearray(frame))))

    def now(self):
        if self._clock_fails:
            raise RuntimeError("no clock")
        return self.time_ns

    def sleep_until(self, time_ns):
        if self._clock_fails:
            raise RuntimeError("no clock")
        self.time_ns = time_ns


def test_each_is_told_ten_times_over_two_seconds_in_words_that_every_autopilot_understands():
    wire = Wire()
    LastResort(wire, wire, (3, 9), say=str).land()
    lands = [(at, to) for at, to, command in wire.sent if command.command == dialect.MAV_CMD_NAV_LAND]
    assert lands == [(round(turn * PAUSE_S * 1e9), to) for turn in range(ROUNDS) for to in (3, 9)]
    assert all(command.target_system == to and command.target_component == 1 for _, to, command in wire.sent)


class Told:
    """A tick that tells who flies what."""

    def __init__(self, autopilots, released=()):
        self.swarm = Swarm.of(range(1, len(autopilots) + 1))
        self.swarm.autopilot[:] = autopilots
        self.state = SimpleNamespace(released=np.isin(self.swarm.ids, released))


def test_each_is_also_asked_for_the_landing_mode_of_its_own_autopilot():
    wire = Wire()
    resort = LastResort(wire, wire, (1, 2, 3), say=str)
    resort.tick(Told([12, 3, 0]))
    resort.land()
    asked = {
        (to, command.param1, command.param2, command.param3)
        for _, to, command in wire.sent
        if command.command == dialect.MAV_CMD_DO_SET_MODE
    }
    px4 = PX4_MODES["land"]
    assert asked == {(1, 1, px4.main, px4.sub), (2, 1, ARDUCOPTER_MODES["land"], 0)}


def test_one_that_a_pilot_has_is_left_to_the_pilot():
    wire = Wire()
    resort = LastResort(wire, wire, (1, 2, 3), say=str)
    resort.tick(Told([12, 12, 3], released=(2,)))
    resort.land()
    assert {to for _, to, _ in wire.sent} == {1, 3}


def test_one_that_cannot_be_reached_keeps_nobody_from_being_told():
    wire = Wire(unreachable=(1,))
    LastResort(wire, wire, (1, 2), say=str).land()
    assert sum(to == 2 for _, to, _ in wire.sent) == ROUNDS


def test_without_a_clock_they_are_told_all_the_same():
    wire = Wire(clock_fails=True)
    LastResort(wire, wire, (1, 2), say=str).land()
    assert len(wire.sent) == 2 * ROUNDS


class Deaf(Beside):
    """A link that fails to be read from one call on."""

    def __init__(self, link, after):
        super().__init__(link)
        self._left = after

    def receive(self):
        self._left -= 1
        if self._left < 0:
            raise defect()
        return super().receive()


def test_a_link_that_cannot_be_read_any_more_still_carries_the_landing():
    world, error = in_lockstep(link=lambda world: Deaf(world, MISSION_TICK))
    assert isinstance(error, ZeroDivisionError)
    assert modes(seen(world)) == {"land"}


class Fails:
    """A display that fails at one tick, after which it must not be asked again."""

    def __init__(self, tick, error):
        self._tick, self._error = tick, error
        self.ticks = 0

    def tick(self, tick):
        self.ticks += 1
        if tick.number == self._tick:
            raise self._error


@pytest.mark.parametrize("error", [defect(), SystemExit(1), MemoryError(), BrokenPipeError("gone")], ids=repr)
def test_a_display_that_fails_is_left_out_and_the_flight_goes_on_to_its_end(error):
    display, said = Fails(50, error), []
    _, summary = in_lockstep(watching=(display,), said=said)
    assert display.ticks == 51
    assert summary.heading_error_deg is not None
    assert summary.problem.startswith(f"the display failed and was left out: {type(error).__name__}")
    assert said == [f"gcs: {summary.problem}"]
    assert not summary.passed


def test_the_operators_second_ctrl_c_passes_a_display():
    scenario = load("demo", overrides=SHORT)
    world = Lockstep.of(scenario, seed=1)
    with pytest.raises(KeyboardInterrupt):
        flown(
            "demo", scenario, world, world, seed=1, out=scratch(), operator=Saying(tuple),
            watching=lambda _flight: (Fails(3, KeyboardInterrupt()),),
        )  # fmt: skip


def unsound(monkeypatch, whose, name, *, after):
    """From so many calls on this fails."""
    calls, sound = iter(range(10**9)), getattr(whose, name)

    def code(*words, **options):
        if next(calls) >= after:
            raise IndexError("a defect")
        return sound(*words, **options)

    monkeypatch.setattr(whose, name, code)


@pytest.mark.parametrize(
    ("method", "after", "word"), [("channel", 10, "raw frames"), ("extend", 10, "raw frames"),
    ("flush", 2, "recording stopped"), ("finish", 0, "recording stopped")],
)  # fmt: skip
def test_a_defect_in_the_recording_is_said_at_once_and_does_not_end_the_flight(method, after, word, monkeypatch):
    unsound(monkeypatch, McapFile, method, after=after)
    said = []
    _, summary = in_lockstep(said=said)
    assert summary.heading_error_deg is not None
    assert word in summary.problem
    assert "IndexError: a defect" in summary.problem
    assert sum(word in words for words in said) == 1
    assert len(said) <= 4  # raw frames, our topics, viewers', ticks


VIEWERS = ("/tf", "/swarm/scene", "/log", "/uav/1/fix")
STATES = ("/swarm/state", "/setpoint", "/mission", "/trust", "/uav/1/state")
FAILS_AT = 60


@pytest.mark.parametrize(
    ("whose", "name", "word", "missing"),
    [
        (Viewers, "of", "topics for viewers are", VIEWERS),
        (OwnTopics, "of", "our own topics are", (*STATES, "/truth/pose")),
        (writer, "pose_of", "true places are", ("/truth/pose",)),
        (sources, "tick_topic", "ticks are", ("/tick",)),
    ],
)
def test_a_defect_in_one_kind_of_topics_costs_them_and_nothing_else(monkeypatch, whose, name, word, missing, tmp_path):
    undisturbed = messages(recorded("demo", *SHORT).path)
    unsound(monkeypatch, whose, name, after=FAILS_AT)
    said = []
    flight = fly_and_record("demo", *SHORT, out=tmp_path, say=said.append)
    held = messages(flight.path)
    failed_ns = [time_ns for topic, time_ns, _ in undisturbed if topic == "/tick"][FAILS_AT]
    kept = set(held)
    lost = [message for message in undisturbed if message not in kept]
    assert {time_ns >= failed_ns for _, time_ns, _ in lost} == {True}
    assert {topic for topic, _, _ in lost} >= set(missing)
    assert [message for message in undisturbed if message in kept] == held
    assert not [topic for topic, time_ns, _ in held if topic in missing and time_ns >= failed_ns]
    assert [words.startswith(f"gcs: {flight.path}: {word} missing from here on: IndexError") for words in said] == [
        True
    ]
    assert flight.summary.problem == said[0].removeprefix("gcs: ")
    with flight.path.open("rb") as stream:
        assert SeekingReader(stream, validate_crcs=True).get_summary().statistics.message_count == len(held)


def test_a_recording_that_a_defect_stopped_has_an_end_and_says_why(monkeypatch, tmp_path):
    unsound(monkeypatch, Filling, "packed", after=5)
    flight = fly_and_record("demo", *SHORT, out=tmp_path)
    with flight.path.open("rb") as stream:
        reader = SeekingReader(stream, validate_crcs=True)
        told = {record.name: record.metadata for record in reader.iter_metadata()}
        assert reader.get_summary().statistics.chunk_count == 5
    assert "the recording stopped: IndexError: a defect" in orjson.loads(told[SUMMARY]["json"])["problem"]
    assert messages(flight.path) == messages(recorded("demo", *SHORT).path)[: len(messages(flight.path))]


def test_a_flight_with_a_failed_display_is_recorded_as_one_without():
    plain, spoilt = scratch(), scratch()
    for folder, watching in ((plain, ()), (spoilt, (Fails(9, defect()),))):
        scenario = load("demo", overrides=SHORT)
        world = Lockstep.of(scenario, seed=1)
        flown(
            "demo", scenario, world, world, seed=1, out=folder, operator=Saying(tuple),
            watching=lambda _flight, watching=watching: watching, say=str,
        )  # fmt: skip
    first, second = (orjson.loads((folder / "summary.json").read_bytes()) for folder in (plain, spoilt))
    differing = {key for key in first if first[key] != second[key]}
    assert differing <= {"problem", "passed", "recording", "real_time_factor"}
    assert "problem" in differing
    assert np.isfinite(first["heading_error_deg"])
