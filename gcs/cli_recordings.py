"""Commands on recordings: parse and call. What is heavy is imported by the command that needs it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import App, Parameter

from gcs import console
from gcs.choices import AS_IT_IS, BadUsageError, Choices
from gcs.guard import DONE, guarded
from gcs.options import AsJson

Recording = Annotated[Path, Parameter(help="A run.mcap, or the folder it is in.")]
Recordings = Annotated[Path, Parameter(name="RECORDING", help="run.mcap files, or the folders they are in.")]


def compare(
    *recordings: Recordings,
    out: Annotated[Path, Parameter(help="The picture.")] = Path("comparison.png"),
) -> int:
    """Put flights side by side: a table, and one picture on one scale."""

    def command() -> int:
        from gcs.compare import compare as side_by_side

        side_by_side(recordings, picture=out, console=console.stdout())
        return DONE

    return guarded(command)


def replay(
    recording: Recording,
    /,
    choices: Choices = AS_IT_IS,
    *,
    verify: Annotated[
        bool,
        Parameter(negative=(), show_default=False, help="Decide again and compare, instead of playing it."),
    ] = False,
    speed: Annotated[float, Parameter(help="0.25 to 10 × recorded time.")] = 1.0,
    reverse: Annotated[bool, Parameter(negative=(), show_default=False, help="Backwards.")] = False,
    from_: Annotated[
        str | None,
        Parameter(name="--from", help="Where to begin: seconds since mission start (12.5), or words of an event."),
    ] = None,
    to: Annotated[
        str | None,
        Parameter(help="udpout:HOST:PORT: send a ground control station what the vehicles sent."),
    ] = None,
    to_network: Annotated[
        bool, Parameter(negative=(), show_default=False, help="--to may name another machine.")
    ] = False,
    foxglove: Annotated[bool, Parameter(negative=(), show_default=False, help="Serve Foxglove live.")] = False,
    foxglove_port: Annotated[int | None, Parameter(help="On loopback; 8765 if absent.")] = None,
    json: AsJson = False,
) -> int:
    """Play a recorded flight by its time, on the screen and to other tools; or decide it again and compare.

    With --controller, --trust, --severity, --no-fault or --set: what would have been commanded.
    """

    def command() -> int:
        playing_alone = {
            "--speed": speed != 1.0,
            "--reverse": reverse,
            "--from": from_ is not None,
            "--to": to is not None,
            "--to-network": to_network,
            "--foxglove": foxglove,
            "--foxglove-port": foxglove_port is not None,
        }
        if verify or choices != AS_IT_IS:
            _refuse(playing_alone, "nothing is played where a flight is decided again")
        if verify:
            from gcs.replay.verify import verify as decide_again

            return decide_again(recording, choices=choices, as_json=json, console=console.stdout())
        if choices != AS_IT_IS:
            from gcs.replay.what_if import what_if

            return what_if(recording, choices, as_json=json, console=console.stdout())
        from gcs.replay.command import Playing, play

        if to is None:
            _refuse({"--to-network": to_network}, "nothing is sent without --to")
        if not foxglove:
            _refuse({"--foxglove-port": foxglove_port is not None}, "nothing is served without --foxglove")
        playing = Playing(
            speed=speed,
            reverse=reverse,
            begin=from_,
            to=to,
            to_network=to_network,
            foxglove_port=(FOXGLOVE_PORT if foxglove_port is None else foxglove_port) if foxglove else None,
            as_json=json,
        )
        return play(recording, playing)

    return guarded(command)


FOXGLOVE_PORT = 8765
"""Where Foxglove looks for a server."""


def _refuse(options: Mapping[str, bool], why: str) -> None:
    """Options that would do nothing. options: → whether it was given. Raises BadUsageError."""
    given = ", ".join(option for option, there in options.items() if there)
    if given:
        raise BadUsageError(f"{given}: {why}")


log = App(name="log", help="What is in a recording; recover, export and import recordings.")


@log.command
def info(
    file: Annotated[Path, Parameter(help="A recording, torn or whole, a .tlog, or the folder of a run.")],
    /,
    *,
    json: AsJson = False,
) -> int:
    """Say what is in a recording, and whether it is whole."""

    def command() -> int:
        from gcs.recording.info import show

        return show(file, as_json=json, console=console.stdout())

    return guarded(command)


@log.command
def recover(
    file: Annotated[Path, Parameter(help="A torn or damaged run.mcap, or the folder it is in.")],
    /,
    *,
    journal: Annotated[Path | None, Parameter(help="Its .tlog; the one beside it, if absent.")] = None,
    out: Annotated[Path | None, Parameter(help="FILE-recovered.mcap if absent.")] = None,
    json: AsJson = False,
) -> int:
    """Rebuild a clean recording from a torn one, its further parts and its journal."""

    def command() -> int:
        from gcs.recording.recover import recover as rebuild

        return rebuild(file, journal=journal, out=out, as_json=json, console=console.stdout())

    return guarded(command)


@log.command
def export(
    file: Recording,
    /,
    *,
    to: Annotated[
        Literal["tlog", "csv", "parquet", "mcap"],
        Parameter(help="tlog: frames; csv, parquet: a folder of tables; mcap: the recording with decoded messages."),
    ],
    out: Annotated[Path | None, Parameter(help="Beside the recording, if absent.")] = None,
) -> int:
    """Write a recording for other tools."""

    def command() -> int:
        from gcs.recording.export import export as write

        return write(file, to=to, out=out, console=console.stdout())

    return guarded(command)


@log.command(name="import")
def import_(
    file: Annotated[Path, Parameter(help="A .tlog of MAVProxy, QGroundControl or Mission Planner.")],
    /,
    *,
    out: Annotated[Path | None, Parameter(help="The same name with .mcap, if absent.")] = None,
) -> int:
    """Turn another ground station's .tlog into MCAP."""

    def command() -> int:
        from gcs.recording.importing import import_tlog

        return import_tlog(file, out=out, console=console.stdout())

    return guarded(command)


def report(
    *recordings: Recordings,
    out: Annotated[Path | None, Parameter(help="The page; report.html beside the first recording, if absent.")] = None,
) -> int:
    """Write one page that explains flights, side by side: HTML that needs nothing else."""

    def command() -> int:
        from gcs.report.command import report as write

        return write(recordings, out=out, console=console.stdout())

    return guarded(command)


def video(
    recording: Recording,
    /,
    *,
    out: Annotated[Path | None, Parameter(help="The film; video.mp4 beside the recording, if absent.")] = None,
    blind: Annotated[
        bool,
        Parameter(negative=(), show_default=False, help="Without labels, names or trust: for people in a study."),
    ] = False,
    speed: Annotated[float, Parameter(help="Recorded seconds a second of film.")] = 1.0,
) -> int:
    """Render a flight as an MP4: 1280 × 720, 30 frames a second."""

    def command() -> int:
        from gcs.video.command import video as render

        return render(recording, out=out, blind=blind, speed=speed, console=console.stderr())

    return guarded(command)
