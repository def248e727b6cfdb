"""`gcs run` and `gcs fly`: the one way a flight is flown from the command line, whatever it is flown with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from gcs import console
from gcs.choices import BadUsageError, confirmed
from gcs.control_socket import ControlSocket
from gcs.degrade import Degraded, degrading
from gcs.events import Event, Rating
from gcs.flight import Flight
from gcs.guard import BAD_INPUT, DONE, INTERRUPTED, NOT_DONE
from gcs.links import FLIES, LISTENS, opened, understood
from gcs.listen import before_arming, listen
from gcs.loop import Clock, Link
from gcs.operator import Operator
from gcs.output import PICTURE, claimed, make_room, output_folder, room
from gcs.progress import Display
from gcs.rates import positions_per_tick
from gcs.recording import files
from gcs.recording.journal import Journal
from gcs.recording.reader import RECORDING
from gcs.recording.writer import IN_LARGE_CHUNKS_NS, PROMPTLY_NS
from gcs.session import Recording, flown
from gcs.summary import Reception, Summary
from gcs.supervision import Supervision
from gcs.words import verdict
from scenarios import MotorDegradation, Scenario
from wire.connection import Connection
from wire.frames import Frame


@dataclass(frozen=True, slots=True)
class Request:
    """What was asked for, besides the scenario's own keys."""

    name: str
    """Of the scenario, as it was typed."""
    supervision: Supervision
    seed: int | None
    out: Path | None
    json: bool
    decodes: bool
    """Whether MAVLink messages are recorded as JSON, too."""


@dataclass(frozen=True, slots=True)
class Hardware:
    """Where the vehicles are, and what may be done with them."""

    link: tuple[str, ...]
    arm: bool
    yes: bool
    degrade: int | None
    """System id of the vehicle whose set-points are bent on their way out."""
    signing_key: Path | None
    speed: float


def live(scenario: Scenario, request: Request, hardware: Hardware) -> int:
    """Fly vehicles behind real links, or only listen to them. Exit code."""
    connections = understood(hardware.link)
    if hardware.degrade is not None:
        scenario = _with_one_degraded(scenario, hardware.degrade)
    signed = hardware.signing_key is not None
    scenario = scenario.asking(positions_per_tick(connections, scenario, signed=signed)).fenced()
    ratings = request.supervision.known(scenario, seed=request.seed)
    if hardware.arm and not confirmed(hardware.yes, say=console.say):
        return BAD_INPUT
    ids = range(1, scenario.swarm.count + 1)
    purpose = FLIES if hardware.arm else LISTENS
    with opened(connections, ids, purpose=purpose, speed=hardware.speed, signing_key=hardware.signing_key) as vehicles:
        if not hardware.arm:
            return listen(vehicles, scenario, as_json=request.json, say=console.say)
        refusals = before_arming(vehicles, scenario, say=console.say)
        if refusals:
            raise BadUsageError("; ".join(refusals))
        link: Link = vehicles
        if hardware.degrade is not None:
            link = Degraded(vehicles, vehicles, scenario, hardware.degrade)

        def reception() -> Reception:
            return Reception.of(vehicles.rejections, vehicles.quality)

        way = Way(
            connections,
            reception=reception,
            flush_ns=PROMPTLY_NS,
            listens=vehicles.tell,
            faults_made=hardware.degrade is not None,
        )
        return flight(scenario, request, link, vehicles, ratings, way)


@dataclass(frozen=True, slots=True)
class Way:
    """What differs between vehicles behind real links and those that we simulate, besides link and clock."""

    connections: Sequence[Connection] = ()
    """By which other commands may reach the flight."""
    said: Callable[[], tuple[Event, ...]] = tuple
    """Where none may, what is said instead, tick by tick."""
    reception: Callable[[], Reception] = Reception
    """Tells how the vehicles were heard."""
    flush_ns: int = IN_LARGE_CHUNKS_NS
    """How long anything may wait to be recorded."""
    listens: Callable[[Callable[[Frame], None]], None] | None = None
    """Hands a journal every frame as it arrives; None where the flight can be flown again, and needs none."""
    faults_made: bool = True
    """Whether the link makes the scenario's faults; otherwise they are left to the vehicles."""


IN_LOCKSTEP = Way()


def flight(
    scenario: Scenario,
    request: Request,
    link: Link,
    clock: Clock,
    ratings: tuple[Rating, ...] | None,
    way: Way = IN_LOCKSTEP,
) -> int:
    """Fly, record, show and report. Exit code."""
    with ExitStack() as stack:
        live_ratings = request.supervision.live(stack, scenario, console.say)
        folder = output_folder(request.out, request.name, needs=room(scenario))
        stack.enter_context(claimed(folder))
        earlier = make_room(folder)
        if earlier is not None:
            console.say(f"what an earlier run left is kept as {earlier}")
        journal = None
        if way.listens is not None:
            journal = stack.enter_context(Journal(files.journal(folder / RECORDING), console.say))
            way.listens(journal.arrived)
        screen = console.stderr()
        control = None
        if way.connections:
            ids = range(1, scenario.swarm.count + 1)
            control = stack.enter_context(ControlSocket(way.connections, ids, console.say))
        operator = stack.enter_context(
            Operator(
                lambda words: screen.print(words, highlight=False, markup=False),
                words=way.said if control is None else control.take,
                ratings=live_ratings,
            )
        )

        def watching(flight: Flight) -> tuple[Display | ControlSocket, ...]:
            display = stack.enter_context(Display(flight, screen, title=Path(request.name).stem))
            return (display,) if control is None else (display, control)

        summary = flown(
            request.name,
            scenario,
            link,
            clock,
            seed=request.seed,
            out=folder,
            operator=operator,
            watching=watching,
            ratings=ratings,
            recording=Recording(way.flush_ns, request.decodes, journal),
            reception=way.reception,
            faults_made=way.faults_made,
        )
    _report(summary, folder, json=request.json)
    if operator.interrupted:
        return INTERRUPTED
    return DONE if summary.completed else NOT_DONE


def _with_one_degraded(scenario: Scenario, system: int) -> Scenario:
    """The scenario with this vehicle's behavioural fault and no other: the vehicles bring none along."""
    try:
        scenario = degrading(scenario, system)
    except ValueError as error:
        raise BadUsageError(f"--degrade {system}: {error}") from None
    its = [fault for fault in scenario.fault if isinstance(fault, MotorDegradation) and fault.vehicle == system]
    return Scenario.model_validate(scenario.model_dump() | {"fault": [fault.model_dump() for fault in its]})


def _report(summary: Summary, folder: Path, *, json: bool) -> None:
    if summary.problem is not None:
        console.say(f"gcs: {summary.problem}")
    if json:
        console.report(summary.json().decode())
        return
    lines = [verdict(summary), f"recording  {summary.recording}"]
    if (folder / PICTURE).exists():
        lines.append(f"picture    {(folder / PICTURE).resolve()}")
    console.report("\n".join(lines))
