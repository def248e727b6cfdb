"""In whose hands each vehicle is: ours, or those of a pilot, or of its own autopilot, who took it from us.

A heartbeat comes once a second, so a vehicle shows what it was asked for some time after it was asked. Therefore nobody
is suspected for not yet doing something; only for doing it no longer, for leaving the modes that we use at all, for
stopping its rotors and for booting again. Who is heard without its heartbeat, or after a silence before it, is mute:
its mode is what it was, nothing follows from it, and nothing is sent to it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from gcs.autopilots import Fleet
from gcs.gate import LOST_NS
from gcs.telemetry import NEVER, Flags, Integers, Swarm
from wire.modes import mode_name

Kind = TypeVar("Kind", bound=np.generic)

FAR = 1.0
"""m under its height: a vehicle that stops climbing there was stopped."""
RETURNS_S = 5.0
"""So long a vehicle that was taken back is asked to come; then whoever flies it keeps it."""

MUTE_NS = 6_000_000_000
"""Age of a heartbeat from which it tells no mode: six in a row are not lost by chance where every fifth is."""


class Duty(IntEnum):
    """What we want of a vehicle."""

    NOTHING = 0
    TAKE_OFF = 1
    OBEY = 2
    HOLD = 3
    LAND = 4


@dataclass(frozen=True, slots=True, eq=False)
class Hands:
    """What is remembered of each vehicle from tick to tick, (N,)."""

    released: Flags
    """Taken from us: never commanded again but to stop its rotors, unless the operator takes it back."""
    held: Flags
    """Has been seen armed in a mode of ours since it became ours."""
    duty: Integers
    """Of the last tick."""
    mode: Integers
    """The mode in which it did its duty; −1 until it was seen to."""
    armed: Flags
    boot_ms: Integers
    """As last seen."""
    returning: Integers
    """Ticks left to come back after the operator took it back; 0 where it need not."""
    killing: Flags
    """Told to stop its rotors at once, and not seen to have."""
    killed_tick: Integers
    """When it was told."""
    silent_ns: Integers
    """When it was last silent, after it had been heard."""
    mute: Flags
    """Is heard, but has not told its mode for MUTE_NS, or not since it was silent."""

    @staticmethod
    def of(n: int) -> Hands:
        """Before anything was seen."""
        nobody, zero = np.zeros(n, bool), np.zeros(n, np.int64)
        return Hands(nobody, nobody, zero, zero - 1, nobody, zero - 1, zero, nobody, zero, zero + NEVER, nobody)

    @property
    def coming(self) -> Flags:
        """(N,) taken back by the operator, and not yet seen to do its duty."""
        return np.asarray(self.returning > 0)


def watched(
    hands: Hands, swarm: Swarm, now_ns: int, duty: Integers, fleet: Fleet, *, height_m: float
) -> tuple[Hands, dict[int, str]]:
    """Hands after a tick's telemetry, and what became of each vehicle (row) that was taken from us in it."""
    silent = ~swarm.fresh(now_ns, within_ns=LOST_NS)
    silent_ns = np.where(silent & (swarm.position_ns != NEVER), now_ns, hands.silent_ns)
    mute = ~silent & ((now_ns - swarm.heartbeat_ns > MUTE_NS) | (swarm.heartbeat_ns <= silent_ns))
    ours, landing = fleet.ours(swarm), fleet.landing(swarm)
    doing = _doing(swarm, duty, fleet, ours, landing)
    mode = np.where(hands.duty == duty, hands.mode, -1)
    done, another = mode >= 0, swarm.custom_mode != mode
    came = ~mute & (doing | ~hands.coming)
    held = hands.held | (swarm.armed & ours & (duty != Duty.NOTHING) & came)
    stopped = hands.armed & ~swarm.armed
    booted = swarm.boot_ms < hands.boot_ms
    low = -swarm.position_ned[:, 2] < height_m - FAR
    taken = (held | (duty == Duty.TAKE_OFF)) & swarm.armed & ~ours
    taken |= (duty == Duty.TAKE_OFF) & (stopped | (done & another & (landing | (~doing & low))))
    taken |= (duty == Duty.OBEY) & (held | hands.coming) & stopped
    taken |= (duty == Duty.OBEY) & held & (landing | (done & another & ~doing))
    taken |= (duty == Duty.HOLD) & swarm.armed & done & another & ~doing & ~landing
    taken |= (duty == Duty.LAND) & swarm.armed & done & ~doing
    taken |= booted & (duty != Duty.NOTHING)
    kept = (hands.returning == 1) & ~held
    taken = (taken | kept) & ~hands.released
    words = {
        int(row): "was not given back" if kept[row] else _how(swarm, int(row), bool(booted[row]), bool(ours[row]))
        for row in np.flatnonzero(taken)
    }
    after = Hands(
        released=hands.released | taken,
        held=held,
        duty=duty,
        mode=np.where(doing, swarm.custom_mode, mode),
        armed=swarm.armed,
        boot_ms=swarm.boot_ms,
        returning=np.where(held, 0, np.maximum(hands.returning - 1, 0)),
        killing=hands.killing,
        killed_tick=hands.killed_tick,
        silent_ns=silent_ns,
        mute=mute,
    )
    return after, words


def fallen_back(hands: Hands, swarm: Swarm, duty: Integers, fleet: Fleet) -> Flags:
    """(N,) who flew our set-points and now holds or lands: by a pilot's hand, or for want of set-points."""
    flew = hands.held & ~hands.released & (duty == Duty.OBEY) & (hands.duty == duty) & (hands.mode >= 0)
    return np.asarray(flew & swarm.armed & fleet.ours(swarm) & ~fleet.obeying(swarm))


def taken_back(hands: Hands, row: int, *, ticks: int) -> Hands:
    """Hands after the operator took a vehicle back, which has so many ticks to come."""
    return replace(
        hands,
        released=_changed(hands.released, row, to=False),
        held=_changed(hands.held, row, to=False),
        mode=_changed(hands.mode, row, to=-1),
        returning=_changed(hands.returning, row, to=ticks),
    )


def killed(hands: Hands, row: int, tick: int) -> Hands:
    """Hands after the operator stopped a vehicle's rotors: it is nobody's any more."""
    return replace(
        hands,
        released=_changed(hands.released, row, to=True),
        killing=_changed(hands.killing, row, to=True),
        killed_tick=_changed(hands.killed_tick, row, to=tick),
    )


def _doing(swarm: Swarm, duty: Integers, fleet: Fleet, ours: Flags, landing: Flags) -> Flags:
    """(N,) who does its duty, as far as heartbeats show."""
    does: dict[Duty, Callable[[], Flags]] = {
        Duty.TAKE_OFF: lambda: ours & fleet.climbing(swarm),
        Duty.OBEY: lambda: fleet.obeying(swarm),
        Duty.HOLD: lambda: ours & _holding(swarm, fleet),
        Duty.LAND: lambda: landing,
    }
    doing = np.zeros(len(swarm.ids), bool)
    for kind, flags in does.items():
        if (duty == kind).any():
            doing |= (duty == kind) & flags()
    return doing


def _holding(swarm: Swarm, fleet: Fleet) -> Flags:
    """(N,) of whom nothing is left to ask."""
    return np.array([fleet.next_to_hold(swarm, row) is None for row in range(len(swarm.ids))]) & swarm.armed


def _how(swarm: Swarm, row: int, booted: bool, ours: bool) -> str:
    """How a vehicle was lost to somebody else."""
    if booted:
        return "booted again"
    if not swarm.armed[row]:
        return "stopped its rotors"
    mode = mode_name(int(swarm.autopilot[row]), int(swarm.custom_mode[row]))
    return f"left the ground station's control ({mode})" if ours else f"was taken over by another ({mode})"


def _changed(values: npt.NDArray[Kind], row: int, *, to: float) -> npt.NDArray[Kind]:
    """The same with one entry another."""
    changed = values.copy()
    changed[row] = to
    return changed
