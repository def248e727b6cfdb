"""A flight whose own code fails: other code tells its vehicles to land; who only watches takes nothing with it."""

from collections import Counter
from types import SimpleNamespace

import numpy as np
import orjson
import pytest
from flights import SHORT, Beside, Saying, failing, scratch
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs import session
from gcs.emergency import PAUSE_S, ROUNDS, LastResort
from gcs.flight import Flight
from gcs.lockstep import Lockstep
from gcs.loop import fly
from gcs.recording.mcap_file import McapFile
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
            "demo", scenario, link(world), world, seed=1, out=folder, operator=Saying(events),
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

    monkeypatch.setattr(session, "_summary", unsound)
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


def test_the_operators_second_ctrl_c_lands_nothing_as_it_was_told():
    scenario = load("demo", overrides=SHORT)
    world = Lockstep.of(scenario, seed=1)
    with pytest.raises(KeyboardInterrupt):
        flown(
            "demo", scenario, world, world, seed=1, out=scratch(), watching=lambda _flight: (),
            operator=Saying(failing(MISSION_TICK, KeyboardInterrupt())),
        )  # fmt: skip
    assert "land" not in modes(seen(world))


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


@pytest.mark.parametrize("method", ["channel", "extend", "flush", "finish"])
def test_a_defect_in_the_recording_is_said_at_once_and_does_not_end_the_flight(method, monkeypatch):
    calls, sound = iter(range(10**9)), getattr(McapFile, method)

    def unsound(*words, **options):
        if next(calls) >= 10 or method == "finish":
            raise IndexError("a defect")
        return sound(*words, **options)

    monkeypatch.setattr(McapFile, method, unsound)
    said = []
    _, summary = in_lockstep(said=said)
    assert summary.heading_error_deg is not None
    assert "the recording stopped: IndexError: a defect" in summary.problem
    assert sum("the recording stopped" in words for words in said) == 1


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
