"""`gcs replay`: a recorded flight played by its time, on the screen and to other tools."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from time import sleep
from typing import Protocol

import orjson

from gcs import console
from gcs.choices import BadUsageError
from gcs.guard import DONE
from gcs.recording.reader import located
from gcs.replay import timeline as timelines
from gcs.replay.controls import Controls, pressed
from gcs.replay.outputs import Output
from gcs.replay.player import FASTEST, SLOWEST, Player, Span
from gcs.replay.reel import Reel
from gcs.replay.timeline import Timeline
from gcs.replay.to_udp import UdpOutput, checked
from wire.clock import WallClock

TURN_NS = 10_000_000
"""Real time between two looks at what is due."""
LONGEST_TURN_NS = 200_000_000
"""Of real time, a turn counts no more: a replay that was stopped goes on where it was, and sends nothing in a burst."""
IDLE_NS = 100_000_000
"""The same while it is paused; a key ends it at once."""
WORD_NS = 1_000_000_000
"""Real time between two words where there is no terminal."""
LARGE = 20 << 20
"""Bytes of a recording that takes a while to be read."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Playing:
    """How a recording is to be played."""

    speed: float = 1.0
    """Recorded seconds a second, SLOWEST to FASTEST."""
    reverse: bool = False
    begin: str | None = None
    """Seconds since mission start, or words of an event; None is the beginning, or the end backwards."""
    to: str | None = None
    """Connection string of a ground control station; None sends nothing."""
    to_network: bool = False
    """Whether that may be another machine."""
    foxglove_port: int | None = None
    """On loopback; None serves nobody."""
    as_json: bool = False
    """What was played, as one object on stdout instead of a line."""


class Seat(Protocol):
    """Where somebody sits, or nobody: real time, and what is pressed in it."""

    def now(self) -> int:
        """Ns, on a clock of its own."""
        ...

    def wait(self, until_ns: int) -> Sequence[str]:
        """Until then, or until keys are pressed: which."""
        ...


class Show(Protocol):
    """Shows where the replay is."""

    def __call__(self, controls: Controls, now_ns: int, *, at_once: bool = False) -> None:
        """now_ns: on the seat's clock;  at_once: whether a key was pressed."""
        ...


class Unattended:
    """Nobody presses anything."""

    def __init__(self, clock: WallClock) -> None:
        self.now = clock.now
        self._clock = clock

    def wait(self, until_ns: int) -> Sequence[str]:
        """Until then."""
        sleep(self._clock.seconds_until(until_ns))
        return ()


def play(recording: Path, playing: Playing) -> int:
    """Play it: with keys on a terminal, else to its end. Raises BadUsageError and UnreadableRecording."""
    speed = _speed(playing.speed)
    connection = None if playing.to is None else checked(playing.to, network=playing.to_network)
    _announce(located(recording))
    timeline = timelines.load(recording)
    player = _player(timeline, playing, speed)
    with ExitStack() as stack:
        reel = stack.enter_context(Reel(timeline.path))
        udp = None if connection is None else stack.enter_context(closing(UdpOutput(connection, timeline.senders)))
        outputs: list[Output] = [] if udp is None else [udp]
        if playing.foxglove_port is not None:
            from gcs.replay.foxglove import FoxgloveOutput

            outputs.append(stack.enter_context(closing(FoxgloveOutput(playing.foxglove_port))))
        playback = Playback(timeline, reel, outputs)
        try:
            (_attended if _on_a_terminal() else _unattended)(playback, player)
        except KeyboardInterrupt:
            _tell(playing, playback, player, udp)
            raise
    _tell(playing, playback, player, udp)
    return DONE


def _announce(path: Path) -> None:
    """That a large recording is being read, for whoever waits."""
    with suppress(OSError):
        size = path.stat().st_size
        if size >= LARGE:
            console.say(f"reading {path}, {size / 1e6:.0f} MB")


def _speed(speed: float) -> Fraction:
    if not SLOWEST <= speed <= FASTEST:
        raise BadUsageError(f"--speed {speed:g}: must be {float(SLOWEST):g} to {float(FASTEST):g} × recorded time")
    return Fraction(str(speed))


def _player(timeline: Timeline, playing: Playing, speed: Fraction) -> Player:
    first = timeline.end_ns if playing.reverse else timeline.start_ns
    player = Player(timeline.start_ns, timeline.end_ns, first, speed, playing.reverse)
    return player if playing.begin is None else player.at(timeline.place(playing.begin, "--from"))


class Words:
    """Says where the replay is, now and then."""

    def __init__(self, timeline: Timeline) -> None:
        self._timeline = timeline
        self._said_ns = 0

    def __call__(self, controls: Controls, now_ns: int, *, at_once: bool = False) -> None:
        """On stderr, if it is time."""
        if at_once or now_ns - self._said_ns >= WORD_NS:
            self._said_ns = now_ns
            console.say(f"{self._timeline.seconds(controls.player.position_ns):.1f} s")


class Playback:
    """The messages of a recording on their way to whoever is to see them."""

    def __init__(self, timeline: Timeline, reel: Reel, outputs: Sequence[Output]) -> None:
        self.timeline = timeline
        self.messages = 0
        """Put out."""
        self.reached: Player | None = None
        """How far it is played; None before it begins."""
        self._reel = reel
        self._outputs = outputs

    def run(self, player: Player, seat: Seat, show: Show, *, stay: bool) -> Player:
        """Until it is quit, or, unless somebody is to stay, until the end in this direction."""
        controls, now_ns, self.reached = Controls(player), seat.now(), player
        while not controls.done and (stay or not controls.player.paused):
            turn_ns = IDLE_NS if controls.player.paused else TURN_NS
            typed, before_ns = seat.wait(now_ns + turn_ns), now_ns
            now_ns = seat.now()
            moved, span = controls.player.advance(min(now_ns - before_ns, LONGEST_TURN_NS))
            self._put(span)
            controls = replace(controls, player=moved)
            for key in typed:
                controls = self._press(controls, key)
            self.reached = controls.player
            show(controls, now_ns, at_once=bool(typed))
        return controls.player

    def _press(self, controls: Controls, key: str) -> Controls:
        done = pressed(controls, key, self.timeline)
        if done.played is not None:
            self._put(done.played)
        if done.jumped:
            for output in self._outputs:
                output.jumped(done.controls.player.position_ns)
        return done.controls

    def _put(self, span: Span) -> None:
        messages = self._reel.play(span)
        if messages:
            self.messages += len(messages)
            for output in self._outputs:
                output.put(messages)


def _on_a_terminal() -> bool:
    """Whether somebody sits there: keys are read from stdin, and the screen is on stderr."""
    return sys.stdin.isatty() and sys.stderr.isatty() and not console.stderr().is_dumb_terminal


def _attended(playback: Playback, player: Player) -> None:
    from gcs.replay.screen import Screen
    from gcs.replay.terminal import Keyboard
    from gcs.replay.view import seer

    timeline = playback.timeline
    with Reel(timeline.path) as reel:
        screen = Screen(console.stderr(), timeline, seer(timeline, reel), title=_title(timeline))
        with Keyboard(WallClock(), leave=screen.leave, enter=screen.enter) as keyboard:
            playback.run(player, keyboard, screen.show, stay=True)


def _title(timeline: Timeline) -> str:
    if timeline.flight is None:
        return timeline.path.name
    from gcs.words import controller_name

    return (
        f"{timeline.flight.metadata.get('scenario', timeline.path.name)}   {controller_name(timeline.flight.scenario)}"
    )


def _unattended(playback: Playback, player: Player) -> None:
    playback.run(player, Unattended(WallClock()), Words(playback.timeline), stay=False)


def _tell(playing: Playing, playback: Playback, begun: Player, udp: UdpOutput | None) -> None:
    """What was played, on stdout."""
    timeline, ended = playback.timeline, playback.reached or begun
    from_s, to_s = (round(timeline.seconds(player.position_ns), 3) for player in (begun, ended))
    if playing.as_json:
        console.write(
            orjson.dumps(
                {
                    "recording": str(timeline.path.resolve()),
                    "from_s": from_s,
                    "to_s": to_s,
                    "speed": playing.speed,
                    "reverse": playing.reverse,
                    "messages": playback.messages,
                    "frames_sent": None if udp is None else udp.sent,
                    "frames_held_back": None if udp is None else dict(udp.held_back),
                }
            )
        )
        return
    to = "" if udp is None else f", {udp.sent} frames to {playing.to}{_of_frames(udp)}"
    console.report(f"{timeline.path} from {from_s:.1f} s to {to_s:.1f} s: {playback.messages} messages{to}")


def _of_frames(udp: UdpOutput) -> str:
    """What else is to be said of them."""
    said = ", where nobody listened at times" if udp.refused else ""
    if udp.held_back:
        said += f"; {udp.held_back.total()} frames of vehicles held back ({', '.join(sorted(udp.held_back))})"
    return said
