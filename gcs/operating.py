"""`gcs land`, `hold`, `kill` and `take-back`: through the flights that have the links, or by themselves."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from gcs.cards import Card, under_way
from gcs.choices import BadUsageError
from gcs.commands import RequestStream
from gcs.console import asked, say
from gcs.events import HOLD, LAND, kill, take_back
from gcs.flight_state import Phase
from gcs.guard import BAD_INPUT, DONE, NOT_DONE
from gcs.interventions import (
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
from gcs.reach import Call, Ended, Refused, Unanswered
from gcs.roster import Roster, listed
from gcs.routes import id_of, name_of
from gcs.standing import Standing
from wire.connection import Connection, ConnectionRefused
from wire.signing import SigningKeyError

RETURN_S = 8.0
"""A vehicle that was taken back flies our set-points within this, or stays whose it is."""
_STILL, _STEERED = ("hold", "brake"), ("offboard", "guided")
_COMING_DOWN = (Phase.LAND.value, Phase.DONE.value)
_FAILURES = (Unanswered, Refused, ConnectionRefused, SigningKeyError)
"""Of one link: they keep no other from being landed."""


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
    def flights(self) -> tuple[Card, ...]:
        """Flights of this user's that have any of them."""
        return under_way(self.connections)

    def only_flight(self, word: str) -> Card | None:
        """The flight that has them all; None where no flight has any. Raises BadUsageError."""
        flights = self.flights
        if len(flights) > 1 or (flights and self.without(flights).connections):
            processes = " and ".join(str(flight.process) for flight in flights)
            raise BadUsageError(f"--link: not all of them are one flight's (process {processes}): {word} one at a time")
        return flights[0] if flights else None

    def of_flight(self, flight: Card) -> Links:
        """Those that it has."""
        return replace(self, connections=tuple(link for link in self.connections if flight.has(link)))

    def without(self, flights: Iterable[Card]) -> Links:
        """Those that none of these has."""
        taken = [link for flight in flights for link in self.of_flight(flight).connections]
        return replace(self, connections=tuple(link for link in self.connections if link not in taken))


def land(links: Links, only: tuple[int, ...]) -> int:
    """Land everybody who is heard, or these. Exit code."""
    return _order(links, LANDING, only, LAND, lambda standing: standing.phase in _COMING_DOWN and not standing.ours)


def hold(links: Links, only: tuple[int, ...]) -> int:
    """Have everybody who is heard, or these, stay where they are. Exit code."""
    return _order(
        links,
        HOLDING,
        only,
        HOLD,
        lambda standing: (
            standing.phase == Phase.HOLD.value and all(one.mode in _STILL for one in standing.ours.values())
        ),
    )


def kill_vehicles(links: Links, only: tuple[int, ...], *, yes: bool) -> int:
    """Stop rotors at once, after two questions, or with --vehicle and --yes. Exit code."""
    asks = not (only and yes)
    if asks and not sys.stdin.isatty():
        raise BadUsageError("kill without a terminal needs --vehicle and --yes: whoever is in the air falls")
    flight = links.only_flight("kill")
    if flight is not None:
        return _kill_in_flight(flight, only, asks=asks)
    with opened(links.connections, None, purpose=STEPS_IN, signing_key=links.signing_key) as live:
        roster = _survey(live)
        missing = [system for system in only if system not in roster.swarms]
        doomed = {
            number: described(swarm)
            for number, swarm in sorted(roster.swarms.items())
            if swarm.armed[0] and (not only or id_of(number) in only)
        }
        if missing or not roster.swarms:
            say(f"gcs: not heard: {listed(missing) or 'anybody'}{_refused(live)}")
        if not doomed:
            say("nobody is heard there whose rotors run")
            return NOT_DONE if missing or not roster.swarms else DONE
        if asks and not _twice_confirmed(doomed):
            return BAD_INPUT
        named = {id_of(number) for number in doomed}
        outcome = Intervention(KILLING, live, live, say, only=named, roster=roster).carry_out()
        return max(_told(KILLING, outcome, live), NOT_DONE if missing else DONE)


def back_to_the_flight(links: Links, system: int) -> int:
    """Give a vehicle that a pilot, or its autopilot, took from a running flight back to it. Exit code."""
    flight = links.only_flight("take-back")
    if flight is None:
        raise BadUsageError("no flight of yours has this link: take-back is for a flight that is under way")

    def back(standing: Standing) -> bool:
        one = standing.vehicles.get(system)
        return one is not None and not one.released and one.mode in _STEERED

    try:
        with Call(flight) as call:
            call.tell(take_back(system))
            found = call.watch(back, patience_s=RETURN_S)
    except Ended:
        found = False
    if found:
        say(f"vehicle {system} flies with the others again")
        return DONE
    say(f"gcs: vehicle {system} did not come back to the flight")
    return NOT_DONE


def _order(links: Links, order: Order, only: tuple[int, ...], word: str, done: Callable[[Standing], bool]) -> int:
    """Through each flight that has a link; by ourselves where none has, or where it ends before all is done.

    All are told before any is watched, and one that cannot be told keeps no other from it. Exit code, the worst.
    """
    flights = links.flights
    if flights and only:
        raise BadUsageError(
            f"--vehicle: the flight of process {flights[0].process} has this link, and {order.word}s as a whole, "
            "without --vehicle. One alone: take it by its remote control, or have all land and then give this again"
        )
    codes, ended, calls = [DONE], list[Card](), list[Call]()
    with ExitStack() as stack:
        for flight in flights:
            try:
                call = stack.enter_context(Call(flight))
                call.tell(word)
            except _FAILURES as error:
                codes.append(_said(error))
            except Ended:
                ended.append(flight)
            else:
                calls.append(call)
        alone = links.without({*flights} - {*ended})
        if alone.connections:
            codes.append(_by_ourselves(alone, order, only))
        for call in calls:
            try:
                codes.append(_watched(call, order, done))
            except _FAILURES as error:
                codes.append(_said(error))
            except Ended:
                say("the flight has ended before that; going on without it")
                codes.append(_by_ourselves(links.of_flight(call.flight), order, only))
    return max(codes)


def _said(error: Exception) -> int:
    say(f"gcs: {error}")
    return NOT_DONE if isinstance(error, Unanswered) else BAD_INPUT


def _watched(call: Call, order: Order, done: Callable[[Standing], bool]) -> int:
    """Exit code. Raises Unanswered, Refused and Ended."""
    others = set[int]()

    def settled(standing: Standing) -> bool:
        others.update(standing.armed.keys() - standing.ours.keys())
        return done(standing)

    found = call.watch(settled, patience_s=order.patience_s)
    theirs = f" (left in other hands: {listed(sorted(others))})" if others else ""
    say(f"{order.word}: done{theirs}" if found else f"gcs: {order.word}: not everybody has{theirs}")
    return DONE if found and not others else NOT_DONE


def _by_ourselves(links: Links, order: Order, only: tuple[int, ...]) -> int:
    try:
        with opened(links.connections, None, purpose=STEPS_IN, signing_key=links.signing_key) as live:
            outcome = Intervention(order, live, live, say, only=only).carry_out()
            if not outcome.done:
                say(f"gcs: nobody {'has' if outcome.not_done else 'is heard'}{_refused(live)}")
            code = _told(order, outcome, live)
    except _FAILURES as error:
        return _said(error)
    if code == DONE and order is HOLDING:
        say("from now on they hear no ground station: what they do then, and how soon, their failsafe parameters say")
    return code


def _told(order: Order, outcome: Outcome, live: Live) -> int:
    for number, why in outcome.not_done.items():
        say(f"gcs: {order.word}: vehicle {name_of(number)} {why}")
    for system in (crowded := live.duplicates):
        say(f"gcs: {order.word}: more vehicles call themselves {system} than can be told apart: not all were told")
    if outcome.all_done:
        say(f"{order.word}: done by {listed(map(name_of, outcome.done))}")
    return DONE if outcome.all_done and not crowded else NOT_DONE


def _kill_in_flight(flight: Card, only: tuple[int, ...], *, asks: bool) -> int:
    try:
        with Call(flight) as call:
            vehicles = call.standing().vehicles
        missing = [system for system in only if system not in vehicles]
        if missing:
            raise BadUsageError(f"--vehicle {listed(missing)}: the flight has {listed(vehicles)}")
        doomed = {system: str(one) for system, one in vehicles.items() if one.armed and (not only or system in only)}
        if not doomed:
            say("nobody is there whose rotors run")
            return DONE
        if asks and not _twice_confirmed(doomed):
            return BAD_INPUT
        with Call(flight) as call:
            for system in doomed:
                call.tell(kill(system))
            found = call.watch(
                lambda standing: not standing.armed.keys() & doomed.keys(), patience_s=KILLING.patience_s
            )
    except Ended:
        say("gcs: the flight has ended; give this command again")
        return NOT_DONE
    say(f"kill: done, {listed(doomed)}" if found else "gcs: kill: not every rotor is seen to stand")
    return DONE if found else NOT_DONE


def _survey(live: Live) -> Roster:
    """Hear who is there, and ask how high."""
    roster, asked_of = Roster(), set[int]()
    for frames in live.hear(HEAR_S, step_ns=STEP_NS):
        roster.take(frames)
        for number in roster.swarms.keys() - asked_of:
            asked_of.add(number)
            live.send(number, Encoder(id_of(number)).encode(RequestStream(LOCAL_POSITION_NED, 0.5), 0))
    return roster


def _twice_confirmed(doomed: Mapping[int, str]) -> bool:
    """Whoever is in the air falls: a word, and then the numbers of those who will."""
    for number, words in doomed.items():
        say(f"vehicle {name_of(number)}: {words}")
    if asked("Their rotors will stop, and who is in the air falls. Type KILL to go on: ") != "KILL":
        say("gcs: nothing was stopped")
        return False
    systems = " ".join(dict.fromkeys(str(id_of(number)) for number in doomed))
    if (asked(f"Type the numbers of those that will fall, {systems}: ") or "").split() != systems.split():
        say("gcs: nothing was stopped")
        return False
    return True


def _refused(live: Live) -> str:
    words = refused(live.rejections)
    return "" if words is None else f" ({words})"
