"""Land, hold or kill whoever is heard, at once and on a path of its own: no flight, no scenario, no recording."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field

from gcs.autopilots import Fleet
from gcs.commands import Beat, Command, Kill, Land, RequestStream
from gcs.live import BEAT_NS, EVERYBODY
from gcs.loop import Clock, Link
from gcs.messages import LOCAL_POSITION_NED, Encoder
from gcs.roster import Roster, listed
from gcs.routes import id_of, name_of
from gcs.telemetry import NEVER, Swarm
from gcs.vehicles import autopilot_name, height_of
from wire.modes import ARDUPILOT, PX4, mode_name

STEP_NS = 100_000_000
ASK_NS = 1_000_000_000
"""Between two askings of one vehicle: its answer is its next heartbeat."""
TELL_NS = 5_000_000_000
"""Between two words on how far they are."""
HEAR_S = 3.0
"""Heartbeats come once a second: whoever is there has been heard by then."""
SILENT_S = 6.0
"""Who was not heard by then is not there."""

_FLEET = Fleet(height_m=0.0, position_s=0.5)


@dataclass(frozen=True, slots=True)
class Order:
    """What is wanted of a vehicle, whatever it is doing."""

    word: str
    next: Callable[[Swarm], Command | None]
    """The one thing to ask of a swarm's only vehicle; None where it is under way, or there."""
    done: Callable[[Swarm], bool]
    said: Callable[[Swarm], str]
    """Of a vehicle that is there."""
    patience_s: float


def _known(swarm: Swarm) -> bool:
    return int(swarm.autopilot[0]) in (PX4, ARDUPILOT)


def _next_to_land(swarm: Swarm) -> Command | None:
    """NAV_LAND for kinds that we do not know: the protocol's own word for it."""
    if not swarm.armed[0]:
        return None
    return _FLEET.next_to_land(swarm, 0) if _known(swarm) else Land()


LANDING = Order(
    word="land",
    next=_next_to_land,
    done=lambda swarm: not swarm.armed[0],
    said=lambda _swarm: "on the ground, rotors off",
    patience_s=90.0,
)
HOLDING = Order(
    word="hold",
    next=lambda swarm: _FLEET.next_to_hold(swarm, 0),
    done=lambda swarm: not swarm.armed[0] or (_known(swarm) and _FLEET.next_to_hold(swarm, 0) is None),
    said=lambda swarm: "holds" if swarm.armed[0] else "is not in the air, rotors off",
    patience_s=10.0,
)
KILLING = Order(
    word="kill",
    next=lambda swarm: Kill() if swarm.armed[0] else None,
    done=lambda swarm: not swarm.armed[0],
    said=lambda _swarm: "rotors off",
    patience_s=10.0,
)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of it, by number: a vehicle's system id, or more where several have the same (gcs.routes)."""

    done: tuple[int, ...]
    not_done: dict[int, str]
    """And why not."""

    @property
    def all_done(self) -> bool:
        """Somebody was there, and everybody did it."""
        return bool(self.done) and not self.not_done


@dataclass(slots=True)
class _Case:
    """One vehicle while we step in."""

    encoder: Encoder
    asked_ns: int = NEVER
    obeyed: bool = False
    """Has been seen doing it."""
    taken: bool = False
    """Somebody else then had it do another thing: it is theirs."""
    told: str = ""


@dataclass(slots=True)
class Intervention:
    """One order to a fleet, until telemetry shows that it is obeyed. Whoever is heard is asked at once.

    Vehicles that share a system id are vehicles of their own, where the link tells them apart.
    """

    order: Order
    link: Link
    clock: Clock
    say: Callable[[str], None]
    only: Collection[int] = ()
    """System ids; empty is everybody who is heard."""
    roster: Roster = field(default_factory=Roster)
    _cases: dict[int, _Case] = field(default_factory=dict)
    _everybody: Encoder = field(default_factory=lambda: Encoder(EVERYBODY))

    def carry_out(self) -> Outcome:
        """Ask, and ask again, until all have obeyed or patience is at its end."""
        start_ns = self.clock.now()
        beat_ns = told_ns = start_ns
        while True:
            now_ns = self.clock.now()
            self.roster.take(self.link.receive())
            for system in self._wanted():
                self._see_to(system, now_ns)
            if now_ns >= beat_ns:
                beat_ns += BEAT_NS
                self._beat()
            if now_ns - told_ns >= TELL_NS:
                told_ns = now_ns
                self._tell()
            if self._over((now_ns - start_ns) / 1e9, now_ns):
                return self._outcome(now_ns)
            self.clock.sleep_until(now_ns + STEP_NS)

    def _wanted(self) -> list[int]:
        return [number for number in self.roster.swarms if not self.only or id_of(number) in self.only]

    def _missing(self) -> set[int]:
        return set(self.only) - self.roster.swarms.keys()

    def _see_to(self, system: int, now_ns: int) -> None:
        swarm = self.roster.swarms[system]
        case = self._cases.get(system)
        if case is None:
            case = self._cases[system] = _Case(Encoder(id_of(system)))
            self.say(f"vehicle {name_of(system)} is heard: {described(swarm)}")
            self._send(system, RequestStream(LOCAL_POSITION_NED, 0.5))
        done, wanted = self.order.done(swarm), self.order.next(swarm)
        if done and case.told != (told := self.order.said(swarm)):
            case.told = told
            self.say(f"vehicle {name_of(system)}: {told}")
        if wanted is None:
            case.obeyed |= bool(swarm.armed[0])
        elif case.obeyed and not case.taken:
            case.taken = True
            self.say(f"vehicle {name_of(system)} was taken over by another ({_mode(swarm)}): it is asked no more")
        if wanted is not None and not case.taken and now_ns - case.asked_ns >= ASK_NS:
            case.asked_ns = now_ns
            self._send(system, wanted)

    def _send(self, system: int, command: Command) -> None:
        self.link.send(system, self._cases[system].encoder.encode(command, 0))

    def _beat(self) -> None:
        """An autopilot obeys, and some speak, only where a ground station is alive."""
        for system in self._cases:
            self._send(system, Beat())
        if not self._cases or self._missing():
            self.link.send(EVERYBODY, self._everybody.encode(Beat(), 0))

    def _tell(self) -> None:
        waiting = [
            f"{name_of(system)} ({_mode(swarm)}, {_metres(height_of(swarm))})"
            for system in self._wanted()
            if not self.order.done(swarm := self.roster.swarms[system])
        ]
        if waiting:
            self.say(f"{self.order.word}: waiting for {listed(waiting)}")

    def _over(self, passed_s: float, now_ns: int) -> bool:
        if passed_s >= self.order.patience_s:
            return True
        if passed_s < HEAR_S:
            return False
        heard = self._wanted()
        waits = (not heard or self._missing()) and passed_s < SILENT_S
        return not waits and all(self._settled(system, now_ns) for system in heard)

    def _settled(self, system: int, now_ns: int) -> bool:
        return self._cases[system].taken or self._done(system, now_ns)

    def _done(self, system: int, now_ns: int) -> bool:
        return self.roster.alive(system, now_ns) and self.order.done(self.roster.swarms[system])

    def _outcome(self, now_ns: int) -> Outcome:
        done, not_done = list[int](), dict[int, str]()
        for system in sorted({*self._wanted(), *self._missing()}):
            if system not in self.roster.swarms:
                not_done[system] = "is not heard"
            elif self._done(system, now_ns):
                done.append(system)
            elif not self.roster.alive(system, now_ns):
                not_done[system] = "fell silent"
            elif self._cases[system].taken:
                not_done[system] = "was taken over by another"
            else:
                not_done[system] = f"is still {'armed, in ' if self.order.word != 'hold' else 'in '}" + _mode(
                    self.roster.swarms[system]
                )
        return Outcome(tuple(done), not_done)


def described(swarm: Swarm) -> str:
    """A swarm's only vehicle in a few words."""
    armed = "armed" if swarm.armed[0] else "not armed"
    height = height_of(swarm)
    place = () if height is None else (_metres(height),)
    return ", ".join((autopilot_name(int(swarm.autopilot[0])), _mode(swarm), armed, *place))


def _mode(swarm: Swarm) -> str:
    return mode_name(int(swarm.autopilot[0]), int(swarm.custom_mode[0]))


def _metres(height: float | None) -> str:
    return "height unknown" if height is None else f"{height:.1f} m up"
