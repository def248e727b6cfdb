"""The `gcs` command: parse, build, call. What is heavy is imported by the command that needs it."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import App, CycloptsError, Parameter

from gcs import console
from gcs.choices import (
    AS_IT_IS,
    BadUsageError,
    Choices,
    Overrides,
    check_many,
    check_seed,
    check_speed,
    checked_ids,
)
from gcs.cli_recordings import compare, log, replay, report, video
from gcs.guard import BAD_INPUT, DONE, INTERRUPTED, NOT_DONE, guarded
from gcs.options import AsJson, Decodes, LinkTexts, Out, ScenarioName, SigningKey, Vehicles
from gcs.supervision import NOBODY, Supervision
from gcs.unblocked import unblocked


def _version() -> str:
    from importlib.metadata import version

    return version("trustr")


app = App(
    name="gcs",
    help="Ground station for swarms that know whom to trust.",
    version=_version,
)


@app.command
def run(
    scenario: Annotated[
        str, Parameter(help="A scenario's name or TOML file; or a run.mcap, or its folder, to be flown again.")
    ],
    /,
    choices: Choices = AS_IT_IS,
    supervision: Supervision = NOBODY,
    *,
    seed: Annotated[
        int | None, Parameter(help="Of noise, gusts and turbulence; 1, or the recording's, if absent.")
    ] = None,
    out: Out = None,
    record_decoded: Decodes = False,
    json: AsJson = False,
) -> int:
    """Fly a scenario in simulation, as fast as it goes, and record it; or a recorded flight once more."""

    def command() -> int:
        try:
            from gcs.lockstep import Lockstep
        except ModuleNotFoundError as error:
            raise BadUsageError(f"run simulates, and needs {error.name}, which is not installed") from None
        from gcs.flying import Request, Way, flight
        from gcs.to_fly import to_fly

        check_seed(seed)
        ours = to_fly(scenario, choices, supervision, seed=seed, say=console.say)
        world = Lockstep.of(ours.scenario, seed=ours.seed)
        request = Request(ours.name, supervision, seed=ours.seed, out=out, json=json, decodes=record_decoded)
        return flight(ours.scenario, request, world, world, ours.ratings, Way(said=ours.said))

    return guarded(command)


@app.command
def fly(
    scenario: ScenarioName,
    /,
    choices: Choices = AS_IT_IS,
    supervision: Supervision = NOBODY,
    *,
    link: LinkTexts,
    arm: Annotated[
        bool, Parameter(negative=(), show_default=False, help="Arm and fly; without it, only listen.")
    ] = False,
    yes: Annotated[bool, Parameter(negative=(), show_default=False, help="Do not ask before arming.")] = False,
    degrade: Annotated[
        int | None,
        Parameter(help="Bend the set-points of this vehicle as the paper's fault does; its autopilot knows nothing."),
    ] = None,
    signing_key: SigningKey = None,
    speed: Annotated[float, Parameter(help="The vehicles' seconds a second, as `fdm serve --speed`.")] = 1.0,
    seed: Annotated[int | None, Parameter(help="Of `fdm serve`, for the record.")] = None,
    out: Out = None,
    record_decoded: Decodes = False,
    json: AsJson = False,
) -> int:
    """Fly a scenario with vehicles behind real links: `fdm serve`, PX4 or ArduPilot."""

    def command() -> int:
        from gcs.flying import Hardware, Request, live

        check_seed(seed)
        check_speed(speed)
        hardware = Hardware(link, arm, yes, degrade, signing_key, speed)
        request = Request(scenario, supervision, seed=seed, out=out, json=json, decodes=record_decoded)
        return live(choices.scenario(scenario), request, hardware)

    return guarded(command)


@app.command
def vehicles(
    *,
    link: LinkTexts,
    seconds: Annotated[float, Parameter(help="How long to listen; Ctrl-C ends it sooner.")] = 5.0,
    signing_key: SigningKey = None,
    json: AsJson = False,
) -> int:
    """List every vehicle and ground station that is heard on a link; sends nothing."""

    def command() -> int:
        from gcs.links import LISTENS, opened, understood
        from gcs.vehicles import list_heard

        if not 0.0 < seconds < math.inf:
            raise BadUsageError(f"--seconds {seconds}: must be a number above 0")
        with opened(understood(link), None, purpose=LISTENS, signing_key=signing_key) as live:
            return list_heard(live, seconds=seconds, as_json=json, console=console.stdout(), write=console.write)

    return guarded(command)


@app.command
def land(*, link: LinkTexts, vehicle: Vehicles = (), signing_key: SigningKey = None) -> int:
    """Land every vehicle heard on a link, or these: at once, whether or not a flight is under way."""

    def command() -> int:
        from gcs import operating

        return operating.land(operating.Links.of(link, signing_key), checked_ids(vehicle))

    return guarded(command)


@app.command
def hold(*, link: LinkTexts, vehicle: Vehicles = (), signing_key: SigningKey = None) -> int:
    """Have every vehicle heard on a link, or these, stop and stay where they are."""

    def command() -> int:
        from gcs import operating

        return operating.hold(operating.Links.of(link, signing_key), checked_ids(vehicle))

    return guarded(command)


@app.command
def kill(
    *,
    link: LinkTexts,
    vehicle: Vehicles = (),
    yes: Annotated[bool, Parameter(negative=(), show_default=False, help="With --vehicle: do not ask.")] = False,
    signing_key: SigningKey = None,
) -> int:
    """Stop rotors at once, in the air too: who flies falls. Asks twice."""

    def command() -> int:
        from gcs import operating

        return operating.kill_vehicles(operating.Links.of(link, signing_key), checked_ids(vehicle), yes=yes)

    return guarded(command)


@app.command
def take_back(
    *,
    link: LinkTexts,
    vehicle: Annotated[int, Parameter(negative=(), help="System id of a vehicle that a pilot took from the flight.")],
) -> int:
    """Give a vehicle that a pilot, or its autopilot, took over back to the flight that is under way."""

    def command() -> int:
        from gcs import operating

        (system,) = checked_ids((vehicle,))
        return operating.back_to_the_flight(operating.Links.of(link, None), system)

    return guarded(command)


@app.command
def scenarios(*, json: AsJson = False) -> int:
    """List the scenarios that ship."""
    from gcs.listing import listing

    return listing(as_json=json, console=console.stdout())


@app.command
def reproduce(
    *,
    seeds: Annotated[int, Parameter(help="Flights a condition: seeds 1 to this.")] = 30,
    jobs: Annotated[int, Parameter(help="Processes; −1 is one a core.")] = -1,
    out: Annotated[Path | None, Parameter(help="Folder for reproduce.json and reproduce.md.")] = None,
    json: AsJson = False,
) -> int:
    """Fly the paper's eight conditions over many seeds, and the recommended profile beside them."""

    def command() -> int:
        from gcs.output import output_folder
        from gcs.reproduce import FlightNotCompleted, conditions
        from gcs.reproduce import reproduce as fly_all

        check_many(seeds, jobs)
        folder = output_folder(out, "reproduce")
        try:
            result = fly_all(conditions(), seeds=seeds, jobs=jobs, console=console.stderr())
        except FlightNotCompleted as error:
            console.say(f"gcs: {error}")
            return NOT_DONE
        result.save(folder)
        if json:
            console.write(result.json())
        else:
            result.show(console.stdout())
            console.say(f"written: {folder}/reproduce.json, {folder}/reproduce.md")
        return DONE

    return guarded(command)


@app.command
def experiment(
    file: Annotated[
        str, Parameter(help="base, false-alarms, faults, further, supervisors, or the path of a TOML file.")
    ],
    /,
    *,
    seeds: Annotated[int | None, Parameter(help="Flights a condition and arm: seeds 1 to this.")] = None,
    jobs: Annotated[int, Parameter(help="Processes; −1 is one a core.")] = -1,
    dask: Annotated[str | None, Parameter(help="Fly on the Dask cluster of this scheduler: tcp://HOST:PORT.")] = None,
    only: Annotated[
        tuple[str, ...],
        Parameter(negative=(), help="Suites and conditions: NAME or SUITE/CONDITION, * for anything. Repeatable."),
    ] = (),
    out: Annotated[Path | None, Parameter(help="Folder, gone on with; runs/experiment-FILE if absent.")] = None,
    json: AsJson = False,
) -> int:
    """Fly suites of conditions with several arms over the same seeds; called again, it goes on where it stopped."""

    def command() -> int:
        from gcs.experiment.command import experiment as conduct

        check_many(seeds, jobs)
        shown = None if json else console.stdout()
        return conduct(
            file, seeds=seeds, jobs=jobs, dask=dask, only=only, out=out, stdout=shown, stderr=console.stderr()
        )

    return guarded(command)


@app.command
def identify(
    fleet: Annotated[str, Parameter(help="A scenario, or the run.mcap (or its folder) of a flight without a fault.")],
    /,
    *,
    seeds: Annotated[int, Parameter(help="Flights of the scenario, without its faults.")] = 5,
    set_: Overrides = (),
    json: AsJson = False,
) -> int:
    """Find how healthy vehicles answer and how far they stray, as keys for a scenario."""

    def command() -> int:
        from gcs.identify import as_json, as_toml, of_fleet

        check_many(seeds, 1)
        found = of_fleet(fleet, overrides=set_, seeds=seeds, console=console.stderr())
        if json:
            console.write(as_json(found))
        else:
            sys.stdout.write(as_toml(found) + "\n")
        return DONE

    return guarded(command)


for command in (compare, replay, log, report, video):
    app.command(command)


def main(words: Sequence[str] | None = None) -> None:
    """Entry point. words: of the command line, if not the process's own."""
    with unblocked("stderr"):
        try:
            code = app(
                sys.argv[1:] if words is None else words,
                exit_on_error=False,
                print_error=False,
                result_action="return_value",
            )
        except CycloptsError as error:
            console.say(f"gcs: {error}")
            code = BAD_INPUT
        except KeyboardInterrupt:
            console.say("gcs: interrupted")
            code = INTERRUPTED
        except BrokenPipeError:  # the reader of our stdout has gone
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            code = 1
    sys.exit(code)
