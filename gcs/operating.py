"""`gcs land`, `hold`, `kill` and `take-back`: through the flight that has the link, or by themselves."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gcs.choices import BadUsageError
from gcs.commands import Beat, RequestStream
from gcs.console import asked, say
from gcs.events import HOLD, LAND, kill, take_back
from gcs.flight_state import Phase
from gcs.interventions import (
    EVERYBODY,
    HEAR_S,
    HOLDING,
    KILLING,
    LANDING,
    STEP_NS,
    Intervention,
    Order,
    Outcome,
    described,
)
from gcs.links import STEPS_IN, opened, refused, understood
from gcs.live import Live
from gcs.messages import LOCAL_POSITION_NED, Encoder
from gcs.reach import STATUS, Call, Ended, Flying, flying
from gcs.roster import Roster
from wire.connection import Connection

DONE, BAD_INPUT, NOT_DONE = 0, 2, 3
"""Exit codes."""
POLL_S = 0.2
TELL_S = 5.0
RETURN_S = 8.0
"""A vehicle that was taken back flies our set-points within this, or stays whose it is."""
GIVES_BACK_S = 10.0
"""A flight that has ended draws its picture, and then gives the link back."""
_STILL, _STEERED = ("hold", "brake"), ("offboard", "guided")

Status = Mapping[str, Any]
"""What a flight says of itself (gcs.reach)."""


@dataclass(frozen=True, slots=True)
class Links:
    """Where to step in."""

    connections: tuple[Connection, ...]
    signing_key: Path | None

    @staticmethod
    def of(texts: Iterable[str], signing_key: Path | None) -> Links:
        """Raises ConnectionRefused."""
        return Links(tuple(understood(texts)), signing_key)

    @property
    def flight(self) -> Flying | None:
        """The flight of this user's that has one of them."""
        return flying(self.connections)


def land(links: Links, only: tuple[int, ...]) -> int:
    """Land everybody who is heard, or these. Exit code."""
    over = (Phase.LAND.value, Phase.DONE.value)
    return _order(links, LANDING, only, LAND, lambda status: status["phase"] in over and not _ours(status))


def hold(links: Links, only: tuple[int, ...]) -> int:
    """Have everybody who is heard, or these, stay where they are. Exit code."""

    def still(status: Status) -> bool:
        return status["phase"] == Phase.HOLD.value and all(one["mode"] in _STILL for one in _ours(status).values())

    code = _order(links, HOLDING, only, HOLD, still)
    if code == DONE and links.flight is None:
        say("from now on they hear no ground station: what they do then, and how soon, their failsafe parameters say")
    return code


def kill_vehicles(links: Links, only: tuple[int, ...], *, yes: bool) -> int:
    """Stop rotors at once, after two questions, or with --vehicle and --yes. Exit code."""
    asks = not (only and yes)
    if asks and not sys.stdin.isatty():
        raise BadUsageError("kill without a terminal needs --vehicle and --yes: whoever is in the air falls")
    flight = links.flight
    if flight is not None:
        return _kill_in_flight(flight, only, asks=asks)
    with opened(links.connections, None, purpose=STEPS_IN, signing_key=links.signing_key) as live:
        roster = _survey(live)
        missing = [system for system in only if system not in roster.swarms]
        doomed = {
            system: described(swarm)
            for system, swarm in sorted(roster.swarms.items())
            if swarm.armed[0] and (not only or system in only)
        }
        if missing or not roster.swarms:
            say(f"gcs: not heard: {_listed(missing) or 'anybody'}{_refused(live)}")
        if not doomed:
            say("nobody is heard there whose rotors run")
            return NOT_DONE if missing or not roster.swarms else DONE
        if asks and not _twice_confirmed(doomed):
            return BAD_INPUT
        outcome = Intervention(KILLING, live, live, say, only=tuple(doomed), roster=roster).carry_out()
    return max(_told(KILLING, outcome), NOT_DONE if missing else DONE)


def back_to_the_flight(links: Links, system: int) -> int:
    """Give a vehicle that a pilot, or its autopilot, took from a running flight back to it. Exit code."""
    flight = links.flight
    if flight is None:
        raise BadUsageError("no flight of yours has this link: take-back is for a flight that is under way")

    def back(status: Status) -> bool:
        one = status["vehicles"].get(str(system), {})
        return not one.get("released", True) and one.get("mode") in _STEERED

    found = _through(flight, (take_back(system),), back, patience_s=RETURN_S)
    if found:
        say(f"vehicle {system} flies with the others again")
        return DONE
    say(f"gcs: vehicle {system} did not come back to the flight")
    return NOT_DONE


def _order(links: Links, order: Order, only: tuple[int, ...], word: str, done: Callable[[Status], bool]) -> int:
    """Through the flight that has the link; by ourselves where there is none, or where it ends before all is done."""
    flight = links.flight
    if flight is not None:
        if only:
            raise BadUsageError(
                f"--vehicle: the flight of process {flight.process} has this link, and {order.word}s as a whole"
            )
        others = set[str]()

        def settled(status: Status) -> bool:
            others.update(_armed(status).keys() - _ours(status).keys())
            return done(status)

        found = _through(flight, (word,), settled, patience_s=order.patience_s)
        if found is not None:
            theirs = f" (left in other hands: {_listed(sorted(map(int, others)))})" if others else ""
            say(f"{order.word}: done{theirs}" if found else f"gcs: {order.word}: not everybody has{theirs}")
            return DONE if found and not others else NOT_DONE
        say("the flight has ended before that; going on without it")
    patience_s = 0.0 if flight is None else GIVES_BACK_S
    with opened(
        links.connections, None, purpose=STEPS_IN, signing_key=links.signing_key, patience_s=patience_s
    ) as live:
        outcome = Intervention(order, live, live, say, only=only).carry_out()
        if not outcome.done:
            say(f"gcs: nobody has{_refused(live)}" if outcome.not_done else f"gcs: nobody is heard{_refused(live)}")
    return _told(order, outcome)


def _told(order: Order, outcome: Outcome) -> int:
    for system, why in outcome.not_done.items():
        say(f"gcs: {order.word}: vehicle {system} {why}")
    if outcome.all_done:
        say(f"{order.word}: done by {_listed(outcome.done)}")
    return DONE if outcome.all_done else NOT_DONE


def _kill_in_flight(flight: Flying, only: tuple[int, ...], *, asks: bool) -> int:
    with Call(flight) as call:
        vehicles = call.ask(STATUS)["vehicles"]
    missing = [system for system in only if str(system) not in vehicles]
    if missing:
        raise BadUsageError(f"--vehicle {_listed(missing)}: the flight has {_listed(map(int, vehicles))}")
    doomed = {
        int(system): _described(one)
        for system, one in vehicles.items()
        if one["armed"] and (not only or int(system) in only)
    }
    if not doomed:
        say("nobody is there whose rotors run")
        return DONE
    if asks and not _twice_confirmed(doomed):
        return BAD_INPUT

    def fallen(status: Status) -> bool:
        return not any(status["vehicles"][str(system)]["armed"] for system in doomed)

    found = _through(flight, tuple(kill(system) for system in doomed), fallen, patience_s=KILLING.patience_s)
    say(f"kill: done, {_listed(doomed)}" if found else "gcs: kill: not every rotor is seen to stand")
    return DONE if found else NOT_DONE


def _through(
    flight: Flying, words: tuple[str, ...], done: Callable[[Status], bool], *, patience_s: float
) -> bool | None:
    """Hand words to a flight and watch until it is done; None where it ends before that. Raises Unanswered, Refused."""
    with Call(flight) as call:
        try:
            for word in words:
                tick = call.ask(word)["tick"]
                say(f"the flight of process {flight.process} takes {word!r} at tick {tick}")
            return _watched(call, done, patience_s=patience_s)
        except Ended:
            return None


def _watched(call: Call, done: Callable[[Status], bool], *, patience_s: float) -> bool | None:
    began = told = time.monotonic()
    while (now := time.monotonic()) - began < patience_s:
        time.sleep(POLL_S)
        status = call.ask(STATUS)
        if done(status):
            return True
        if status.get("over"):
            return None
        if now - told >= TELL_S:
            told = now
            flying_still = ", ".join(f"{system} ({_described(one)})" for system, one in _armed(status).items())
            say(f"{status['phase']}: {flying_still}")
    return False


def _armed(status: Status) -> dict[str, Mapping[str, Any]]:
    return {system: one for system, one in status["vehicles"].items() if one["armed"]}


def _ours(status: Status) -> dict[str, Mapping[str, Any]]:
    """Who has its rotors running, and is the flight's."""
    return {system: one for system, one in _armed(status).items() if not one["released"]}


def _described(one: Mapping[str, Any]) -> str:
    """A vehicle of a flight's status in a few words."""
    place = "height unknown" if one["height_m"] is None else f"{one['height_m']:.1f} m up"
    return f"{one['mode']}, {place}{', in other hands' if one['released'] else ''}"


def _survey(live: Live) -> Roster:
    """Hear who is there, and ask how high."""
    roster = Roster()
    until_ns = live.now() + round(HEAR_S * 1e9)
    asked_of = dict[int, Encoder]()
    everybody = Encoder(EVERYBODY)
    while live.now() < until_ns:
        if not roster.swarms and live.speaks_first:
            live.send(EVERYBODY, everybody.encode(Beat(), 0))
        live.sleep_until(min(until_ns, live.now() + STEP_NS))
        roster.take(live.receive())
        for system in roster.swarms.keys() - asked_of.keys():
            asked_of[system] = Encoder(system)
            live.send(system, asked_of[system].encode(RequestStream(LOCAL_POSITION_NED, 0.5), 0))
    return roster


def _twice_confirmed(doomed: Mapping[int, str]) -> bool:
    """Whoever is in the air falls: a word, and then the numbers of those who will."""
    for system, words in doomed.items():
        say(f"vehicle {system}: {words}")
    if asked("Their rotors will stop, and who is in the air falls. Type KILL to go on: ") != "KILL":
        say("gcs: nothing was stopped")
        return False
    numbers = " ".join(map(str, doomed))
    if (asked(f"Type the numbers of those that will fall, {numbers}: ") or "").split() != numbers.split():
        say("gcs: nothing was stopped")
        return False
    return True


def _refused(live: Live) -> str:
    words = refused(live.rejections)
    return "" if words is None else f" ({words})"


def _listed(systems: Iterable[int]) -> str:
    return ", ".join(map(str, systems))
