"""The `gcs` command: parse, build, call. What is heavy is imported by the command that needs it."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, CycloptsError, Parameter

from gcs.choices import AS_IT_IS, BadUsageError, Choices, Overrides, check_many, check_seed, confirmed
from gcs.supervision import NOBODY, Supervision

if TYPE_CHECKING:
    from gcs.events import Rating
    from gcs.summary import Summary
    from scenarios import Scenario


def _version() -> str:
    from importlib.metadata import version

    return version("trustr")


app = App(
    name="gcs",
    help="Ground station for swarms that know whom to trust.",
    version=_version,
)

FLOWN, BAD_INPUT, NOT_COMPLETED, INTERRUPTED = 0, 2, 3, 130
"""Exit codes."""

LIVE_POSITIONS = 5
"""A tick: real links deliver at any moment of it; asked once, a flight ended 0.5 m from its lockstep twin."""

ScenarioName = Annotated[str, Parameter(help="A scenario's name (see `gcs scenarios`), or the path of a TOML file.")]
Out = Annotated[
    Path | None,
    Parameter(help="Folder for run.mcap, summary.json and trajectory.png; runs/TIME-SCENARIO if absent."),
]
AsJson = Annotated[bool, Parameter(name="--json", negative=(), show_default=False, help="One JSON object on stdout.")]
Yes = Annotated[bool, Parameter(negative=(), show_default=False, help="Do not ask before arming.")]


@app.command
def run(
    scenario: ScenarioName,
    /,
    choices: Choices = AS_IT_IS,
    supervision: Supervision = NOBODY,
    *,
    seed: Annotated[int, Parameter(help="Of noise, gusts and turbulence.")] = 1,
    out: Out = None,
    json: AsJson = False,
) -> int:
    """Fly a scenario in simulation, as fast as it goes, and record it."""

    def command() -> int:
        try:
            from gcs.lockstep import Lockstep
        except ModuleNotFoundError as error:
            raise BadUsageError(f"run simulates, and needs {error.name}, which is not installed") from None

        check_seed(seed)
        chosen = choices.scenario(scenario)
        ratings = supervision.known(chosen, seed=seed)
        world = Lockstep.of(chosen, seed=seed)
        return _fly(scenario, chosen, world, world, supervision, ratings, seed=seed, out=out, json=json)

    return _guarded(command)


@app.command
def fly(
    scenario: ScenarioName,
    /,
    choices: Choices = AS_IT_IS,
    supervision: Supervision = NOBODY,
    *,
    link: Annotated[
        tuple[str, ...],
        Parameter(
            negative=(), help="udpin:HOST:PORT or udpout:HOST:PORT; repeatable, PORT may be a range 14550-14555."
        ),
    ],
    arm: Annotated[
        bool, Parameter(negative=(), show_default=False, help="Arm and fly; without it, only listen.")
    ] = False,
    yes: Yes = False,
    speed: Annotated[float, Parameter(help="The vehicles' seconds a second, as `fdm serve --speed`.")] = 1.0,
    seed: Annotated[int | None, Parameter(help="Of `fdm serve`, for the record.")] = None,
    out: Out = None,
    json: AsJson = False,
) -> int:
    """Fly a scenario with vehicles behind real links: `fdm serve`, or PX4."""

    def command() -> int:
        from gcs.listen import listen
        from gcs.live import Live
        from wire.connection import parse

        check_seed(seed)
        if not 0.0 < speed < math.inf:
            raise BadUsageError(f"--speed {speed}: must be a number above 0")
        chosen = choices.scenario(scenario).asking(LIVE_POSITIONS)
        ratings = supervision.known(chosen, seed=seed)
        connections = [connection for text in link for connection in parse(text)]
        if arm and not confirmed(yes, say=_say):
            return BAD_INPUT
        live = Live(connections, range(1, chosen.swarm.count + 1), speed=speed)
        try:
            if not arm:
                return listen(live, chosen, as_json=json, say=_say)
            return _fly(scenario, chosen, live, live, supervision, ratings, seed=seed, out=out, json=json)
        finally:
            live.close()

    return _guarded(command)


@app.command
def scenarios(*, json: AsJson = False) -> int:
    """List the scenarios that ship."""
    from gcs.listing import listing

    return listing(as_json=json, console=_stdout())


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
        from gcs.reproduce import FlightNotCompleted, conditions
        from gcs.reproduce import reproduce as fly_all
        from gcs.session import output_folder

        check_many(seeds, jobs)
        folder = output_folder(out, "reproduce")
        try:
            result = fly_all(conditions(), seeds=seeds, jobs=jobs, console=_stderr())
        except FlightNotCompleted as error:
            _say(f"gcs: {error}")
            return NOT_COMPLETED
        result.save(folder)
        if json:
            _write(result.json())
        else:
            result.show(_stdout())
            _say(f"written: {folder}/reproduce.json, {folder}/reproduce.md")
        return FLOWN

    return _guarded(command)


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
        console = None if json else _stdout()
        return conduct(file, seeds=seeds, jobs=jobs, dask=dask, only=only, out=out, stdout=console, stderr=_stderr())

    return _guarded(command)


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
        found = of_fleet(fleet, overrides=set_, seeds=seeds, console=_stderr())
        if json:
            _write(as_json(found))
        else:
            sys.stdout.write(as_toml(found) + "\n")
        return FLOWN

    return _guarded(command)


@app.command
def compare(
    *recordings: Annotated[Path, Parameter(name="RECORDING", help="run.mcap files, or the folders they are in.")],
    out: Annotated[Path, Parameter(help="The picture.")] = Path("comparison.png"),
) -> int:
    """Put flights side by side: a table, and one picture on one scale."""

    def command() -> int:
        from gcs.compare import compare as side_by_side

        side_by_side(recordings, picture=out, console=_stdout())
        return FLOWN

    return _guarded(command)


@app.command
def replay(
    recording: Annotated[Path, Parameter(help="A run.mcap, or the folder it is in.")],
    /,
    *,
    verify: Annotated[
        bool, Parameter(negative=(), help="Decide again and compare; so far all that replay does.")
    ] = True,
) -> int:
    """Decide a recorded flight again from its frames, and compare every frame it would send."""

    def command() -> int:
        from gcs.replay import verify as decide_again

        return decide_again(recording, console=_stdout()) if verify else FLOWN

    return _guarded(command)


def _fly(
    name: str,
    scenario: Scenario,
    link: Any,
    clock: Any,
    supervision: Supervision,
    ratings: tuple[Rating, ...] | None,
    *,
    seed: int | None,
    out: Path | None,
    json: bool,
) -> int:
    """The one way a flight is flown, whatever it is flown with."""
    from contextlib import ExitStack

    from gcs.operator import Operator
    from gcs.progress import Display
    from gcs.session import flown, make_room, output_folder

    with ExitStack() as stack:
        live_ratings = supervision.live(stack, scenario, _say)
        folder = output_folder(out, name)
        earlier = make_room(folder)
        if earlier is not None:
            _say(f"an earlier recording is kept as {earlier}")
        console = _stderr()
        operator = stack.enter_context(
            Operator(lambda words: console.print(words, highlight=False, markup=False), ratings=live_ratings)
        )

        def watching(flight: Any) -> tuple[Display]:
            return (stack.enter_context(Display(flight, console, title=Path(name).stem)),)

        summary = flown(
            name,
            scenario,
            link,
            clock,
            seed=seed,
            out=folder,
            operator=operator,
            watching=watching,
            ratings=ratings,
        )
    _report(summary, folder, json=json)
    if operator.interrupted:
        return INTERRUPTED
    return FLOWN if summary.completed else NOT_COMPLETED


def _report(summary: Summary, folder: Path, *, json: bool) -> None:
    from gcs.session import PICTURE
    from gcs.words import verdict

    if summary.problem is not None:
        _say(f"gcs: {summary.problem}")
    if json:
        _write(summary.json())
        return
    lines = [verdict(summary), f"recording  {summary.recording}"]
    if (folder / PICTURE).exists():
        lines.append(f"picture    {(folder / PICTURE).resolve()}")
    sys.stdout.write("\n".join(lines) + "\n")


def _guarded(command: Callable[[], int]) -> int:
    """Bad input is one sentence and exit code 2."""
    try:
        return command()
    except Exception as error:
        if not isinstance(error, _refusals()):
            raise
        _say(f"gcs: {error}")
        return BAD_INPUT


def _refusals() -> tuple[type[Exception], ...]:
    """What speaks to a person; anything else is a defect and keeps its traceback."""
    from gcs.compare import UnwritablePicture
    from gcs.ratings import RatingsError
    from gcs.recording.reader import UnreadableRecording
    from gcs.recording.writer import RecordingError
    from gcs.rules import RuleError
    from scenarios import ScenarioError
    from wire.connection import ConnectionRefused

    return (
        BadUsageError,
        ScenarioError,
        RuleError,
        ConnectionRefused,
        RecordingError,
        RatingsError,
        UnreadableRecording,
        UnwritablePicture,
    )


def _write(line: bytes) -> None:
    sys.stdout.write(line.decode() + "\n")


def _say(words: str) -> None:
    """On stderr, where progress and words go."""
    sys.stderr.write(words + "\n")
    sys.stderr.flush()


def _stdout() -> Any:
    from rich.console import Console

    return Console(width=None if sys.stdout.isatty() else 110)


def _stderr() -> Any:
    from rich.console import Console

    return Console(stderr=True)


def main(words: Sequence[str] | None = None) -> None:
    """Entry point. words: of the command line, if not the process's own."""
    try:
        code = app(
            sys.argv[1:] if words is None else words,
            exit_on_error=False,
            print_error=False,
            result_action="return_value",
        )
    except CycloptsError as error:
        sys.stderr.write(f"gcs: {error}\n")
        code = BAD_INPUT
    except KeyboardInterrupt:
        sys.stderr.write("gcs: interrupted\n")
        code = INTERRUPTED
    except BrokenPipeError:  # the reader of our stdout has gone
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 1
    sys.exit(code)
