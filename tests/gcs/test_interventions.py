"""Stepping in without a flight: vehicles in the air are landed, held or killed by whoever hears them."""

import math
from itertools import pairwise

import pytest
from flights import SHORT, failing
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcs.commands import ChangeMode
from gcs.flight import Flight
from gcs.interventions import HOLDING, KILLING, LANDING, Intervention
from gcs.lockstep import Lockstep
from gcs.loop import fly
from gcs.messages import Encoder
from gcs.routes import Routes
from gcs.telemetry import Swarm, observe
from scenarios import load
from wire.frames import Framer, Sender, decode
from wire.hub import Peer
from wire.modes import PX4_MODES, mode_name

TWO = (*SHORT, "swarm.rows=1", "swarm.columns=2", "swarm.leaders=[1]")
BOTH = pytest.mark.parametrize("autopilot", ["px4", "ardupilot"])


def in_the_air(autopilot="px4"):
    """Two vehicles on a mission whose ground station has just gone."""
    scenario = load("demo", overrides=TWO)
    world = Lockstep.of(scenario, seed=1, autopilot=autopilot)
    with pytest.raises(ZeroDivisionError):
        fly(world, world, Flight(scenario), (), period_ns=10**8, events=failing(140, ZeroDivisionError()))
    world.receive()
    return world


def on_the_ground():
    return Lockstep.of(load("demo", overrides=TWO), seed=1)


def seen(world, *, after_s=1.2):
    world.receive()
    world.sleep_until(world.now() + round(after_s * 1e9))
    return observe(Swarm.of((1, 2)), world.receive())


def modes(swarm):
    return [mode_name(*pair) for pair in zip(swarm.autopilot.tolist(), swarm.custom_mode.tolist(), strict=True)]


class Overheard:
    """A link that keeps what is sent through it, and lets things happen at their time."""

    def __init__(self, world, *, then=None, after_s=0.0):
        self._world, self._then = world, then
        self._at_ns = world.now() + round(after_s * 1e9)
        self.sent = []

    def receive(self):
        if self._then is not None and self._world.now() >= self._at_ns:
            self._then(self._world)
            self._then = None
        return self._world.receive()

    def send(self, system, frame):
        self.sent.append((self._world.now(), system, decode(*Framer().frames(0, frame))))
        self._world.send(system, frame)

    def commands(self, number, system):
        """When this vehicle was asked for this."""
        return [at for at, to, one in self.sent if to == system and getattr(one, "command", None) == number]


@BOTH
def test_land_brings_everybody_down_and_is_done_when_rotors_stand(autopilot):
    world, said = in_the_air(autopilot), []
    outcome = Intervention(LANDING, world, world, said.append).carry_out()
    assert outcome.all_done
    assert outcome.done == (1, 2)
    swarm = seen(world)
    assert not swarm.armed.any()
    assert modes(swarm) == ["land", "land"]
    assert "vehicle 1: on the ground, rotors off" in said


@BOTH
def test_hold_stops_everybody_at_their_height_and_lets_nobody_descend(autopilot):
    world = in_the_air(autopilot)
    outcome = Intervention(HOLDING, world, world, say=str).carry_out()
    assert outcome.done == (1, 2)
    swarm = seen(world)
    assert modes(swarm) == [{"px4": "hold", "ardupilot": "brake"}[autopilot]] * 2
    assert swarm.armed.all()
    assert (-swarm.position_ned[:, 2] > 9.0).all()


@BOTH
def test_kill_stops_rotors_in_the_air_and_of_nobody_else(autopilot):
    world = in_the_air(autopilot)
    outcome = Intervention(KILLING, world, world, say=str, only=(2,)).carry_out()
    assert outcome == type(outcome)((2,), {})
    assert seen(world).armed.tolist() == [True, False]


class Namesakes:
    """Several worlds whose vehicles call themselves alike, each behind an address of its own."""

    def __init__(self, *worlds):
        self._worlds = {Peer(None, ("127.0.0.1", port)): world for port, world in enumerate(worlds)}
        self._routes = Routes(None)

    def now(self):
        return max(world.now() for world in self._worlds.values())

    def sleep_until(self, time_ns):
        for world in self._worlds.values():
            world.sleep_until(time_ns)

    def receive(self):
        arrived = [(peer, frame) for peer, world in self._worlds.items() for frame in world.receive()]
        numbered = [(peer, self._routes.numbered(frame, peer)) for peer, frame in arrived]
        return [frame for peer, frame in numbered if self._routes.refusal(frame, peer) is None]

    def send(self, number, frame):
        if self._routes.peer(number) is not None:
            self._worlds[self._routes.peer(number)].send(number % 256, frame)


@pytest.mark.parametrize("only", [(), (1, 2)], ids=["everybody", "named"])
def test_vehicles_of_one_id_are_all_landed_though_one_of_them_stands_on_the_ground(only):
    above, said = in_the_air(), []
    below = on_the_ground()
    below.sleep_until(above.now())
    link = Namesakes(below, above)
    outcome = Intervention(LANDING, link, link, said.append, only=only).carry_out()
    assert outcome.done == (1, 2, 257, 258)
    assert not seen(above).armed.any()
    assert "vehicle 1 (no. 2 of that id): on the ground, rotors off" in said


def test_of_two_with_one_id_neither_is_taken_for_the_other():
    above, stubborn = in_the_air(), Stubborn(system=2)
    stubborn.sleep_until(above.now())
    link = Namesakes(above, stubborn)
    outcome = Intervention(LANDING, link, link, say=str).carry_out()
    assert outcome.done == (1, 258)
    assert outcome.not_done == {2: "is still armed, in mode 0"}


def test_hold_says_of_those_on_the_ground_that_they_are_there():
    world, said = on_the_ground(), []
    assert Intervention(HOLDING, world, world, said.append).carry_out().all_done
    assert "vehicle 1: is not in the air, rotors off" in said
    assert not any("holds" in words for words in said)


def test_whoever_is_heard_is_told_at_once_and_no_more_than_once_a_second():
    world = in_the_air()
    link = Overheard(world)
    start_ns = world.now()
    Intervention(LANDING, link, world, say=str).carry_out()
    asked = link.commands(dialect.MAV_CMD_NAV_LAND, 1)
    assert asked[0] - start_ns <= 1_100_000_000  # a heartbeat is a second apart
    assert 1 <= len(asked) <= 3
    assert all(later - earlier >= 10**9 for earlier, later in pairwise(asked))


def test_a_ground_station_is_heard_as_long_as_it_steps_in():
    world = in_the_air()
    link = Overheard(world)
    Intervention(LANDING, link, world, say=str).carry_out()
    beats = [at for at, to, one in link.sent if to == 1 and one.get_type() == "HEARTBEAT"]
    assert all(later - earlier <= 1_100_000_000 for earlier, later in pairwise(beats))
    assert len(beats) > 5


def test_one_that_somebody_else_takes_meanwhile_is_left_to_them_and_that_is_said():
    world, said = in_the_air(), []
    hold = PX4_MODES["hold"]

    def pilot(world):
        world.send(1, Encoder(1).encode(ChangeMode(hold.main, hold.sub), 0))

    link = Overheard(world, then=pilot, after_s=4.0)
    outcome = Intervention(LANDING, link, world, said.append).carry_out()
    assert outcome.done == (2,)
    assert outcome.not_done == {1: "was taken over by another"}
    assert not outcome.all_done
    assert "vehicle 1 was taken over by another (hold): it is asked no more" in said
    assert len(link.commands(dialect.MAV_CMD_NAV_LAND, 1)) <= 3


def test_one_that_is_named_and_not_there_is_not_done():
    world = on_the_ground()
    outcome = Intervention(LANDING, world, world, say=str, only=(1, 9)).carry_out()
    assert outcome.done == (1,)
    assert outcome.not_done == {9: "is not heard"}


def test_where_nobody_is_nothing_is_done():
    class Silence:
        def __init__(self):
            self.time_ns = 0

        def now(self):
            return self.time_ns

        def sleep_until(self, time_ns):
            self.time_ns = time_ns

        def receive(self):
            return []

        def send(self, system, frame):
            """Nobody is there."""

    outcome = Intervention(LANDING, silence := Silence(), silence, say=str).carry_out()
    assert (outcome.done, outcome.not_done, outcome.all_done) == ((), {}, False)
    assert silence.time_ns == pytest.approx(6e9, abs=2e8)


class Stubborn:
    """A vehicle of an unknown kind that never obeys; and a clock."""

    def __init__(self, *, until_s=math.inf, system=7):
        self.time_ns, self.sent, self._beat_ns = 0, [], 0
        self._until_ns, self._sender = until_s * 1e9, Sender(system, 1)

    def now(self):
        return self.time_ns

    def sleep_until(self, time_ns):
        self.time_ns = time_ns

    def receive(self):
        if not self._beat_ns <= self.time_ns <= self._until_ns:
            return []
        self._beat_ns = self.time_ns + 10**9
        beat = dialect.MAVLink_heartbeat_message(2, 0, dialect.MAV_MODE_FLAG_SAFETY_ARMED, 0, 4, 3)
        return Framer().frames(self.time_ns, self._sender.pack(beat))

    def send(self, system, frame):
        self.sent.append((system, decode(*Framer().frames(0, frame))))


@pytest.mark.parametrize(
    ("order", "after_s", "why"),
    [
        (LANDING, 90, "is still armed, in mode 0"),
        (HOLDING, 10, "is still in mode 0"),
        (KILLING, 10, "is still armed, in mode 0"),
    ],
    ids=["land", "hold", "kill"],
)
def test_one_that_never_obeys_is_given_up_after_a_while_and_named(order, after_s, why):
    vehicle = Stubborn()
    outcome = Intervention(order, vehicle, vehicle, say=str).carry_out()
    assert outcome.not_done == {7: why}
    assert vehicle.time_ns == pytest.approx(after_s * 1e9, abs=2e8)


def test_an_autopilot_of_an_unknown_kind_is_told_to_land_in_the_protocols_own_word():
    vehicle = Stubborn()
    Intervention(LANDING, vehicle, vehicle, say=str).carry_out()
    asked = [one for system, one in vehicle.sent if getattr(one, "command", None) == dialect.MAV_CMD_NAV_LAND]
    assert 80 <= len(asked) <= 91


def test_one_that_falls_silent_is_not_counted_as_done():
    vehicle = Stubborn(until_s=5)
    outcome = Intervention(LANDING, vehicle, vehicle, say=str).carry_out()
    assert outcome.not_done == {7: "fell silent"}
