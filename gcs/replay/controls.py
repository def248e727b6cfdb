"""What the keys of a replay do: a state machine round the player, with a line in which a place is typed."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gcs.replay.player import REACTION_NS, Player, Span
from gcs.replay.timeline import NoSuchPlace, Timeline

HELP = (
    ("space", "pause"),
    ("q", "quit"),
    ("←→", "step"),
    ("+−", "speed"),
    ("r", "reverse"),
    ("n p", "event"),
    ("g", "go to"),
    ("Home End", "first, last"),
)
"""For the bottom of the screen, the most needed first: from the first that does not fit there, all are left out."""


@dataclass(frozen=True, slots=True)
class Controls:
    """A player in somebody's hands."""

    player: Player
    typed: str | None = None
    """Where to go to, as far as it is typed; None while nobody types."""
    note: str = ""
    """What to say about the last key."""
    done: bool = False
    """Whether it is to end."""


@dataclass(frozen=True, slots=True)
class Pressed:
    """What a key did."""

    controls: Controls
    played: Span | None = None
    """Passed through; None where nothing was."""
    jumped: bool = False
    """To another place, and what lies between was left out."""


def pressed(controls: Controls, key: str, timeline: Timeline) -> Pressed:
    """After a key; those that mean nothing change nothing."""
    controls = replace(controls, note="")
    if controls.typed is not None:
        return _typed(controls, controls.typed, key, timeline)
    player = controls.player
    match key:
        case "space":
            return _moved(controls, player.toggled())
        case "left" | ",":
            return _stepped(controls, player.back(timeline.ticks))
        case "right" | ".":
            return _stepped(controls, player.onward(timeline.ticks))
        case "+" | "=":
            return Pressed(replace(controls, player=player.faster()))
        case "-" | "_":
            return Pressed(replace(controls, player=player.slower()))
        case "r":
            return Pressed(replace(controls, player=player.turned()))
        case "n" | "p":
            there = (player.onward if key == "n" else player.back)(timeline.events, reaction_ns=REACTION_NS)
            none = f"there is no event {'after' if key == 'n' else 'before'} this"
            return _moved(replace(controls, note=none if there == player else ""), there)
        case "home":
            return _moved(controls, player.at(player.start_ns))
        case "end":
            return _moved(controls, player.at(player.end_ns))
        case "g":
            return Pressed(replace(controls, typed=""))
        case "q":
            return Pressed(replace(controls, done=True))
    return Pressed(controls)


def _typed(controls: Controls, typed: str, key: str, timeline: Timeline) -> Pressed:
    """One more letter of a place, or its end."""
    if key == "enter":
        controls = replace(controls, typed=None)
        try:
            return _moved(controls, controls.player.at(timeline.place(typed)))
        except NoSuchPlace as error:
            return Pressed(replace(controls, note=error.short))
    if key == "backspace":
        return Pressed(replace(controls, typed=typed[:-1]))
    if key == "escape":
        return Pressed(replace(controls, typed=None))
    letter = " " if key == "space" else key
    return Pressed(replace(controls, typed=typed + letter) if len(letter) == 1 else controls)


def _moved(controls: Controls, player: Player) -> Pressed:
    return Pressed(replace(controls, player=player), jumped=player.position_ns != controls.player.position_ns)


def _stepped(controls: Controls, player: Player) -> Pressed:
    """Whoever steps wants to look: it stays there."""
    there = replace(player, paused=True)
    return Pressed(replace(controls, player=there), played=Span(controls.player.position_ns, player.position_ns))
