"""Asking vehicles for what they still lack, again and again where it is not seen to be done."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gcs.commands import Command, Kill
from gcs.flight_state import Asked, Commands, FlightState
from gcs.telemetry import Swarm
from scenarios import Scenario

RETRY_S = 1.0
"""Between two askings for the same thing."""


class Asking:
    """Knows how long to wait."""

    def __init__(self, scenario: Scenario) -> None:
        self._patience = scenario.time.ticks(RETRY_S)

    def __call__(
        self, state: FlightState, swarm: Swarm, what: Callable[[int], tuple[Command, ...]]
    ) -> tuple[FlightState, Commands]:
        """Ask every vehicle (row) of ours for it; for the same, or less of it, only after RETRY_S.

        Who is silent is asked all the same, for it may hear; who is mute is not, for it may be a pilot's.
        """
        commands: Commands = []
        asked = list(state.asked)
        spared = state.released | state.hands.mute
        for row, system in enumerate(swarm.ids):
            wanted = () if spared[row] else what(row)
            repeated = set(wanted) <= set(asked[row].commands) and state.tick - asked[row].tick < self._patience
            if wanted and not repeated:
                asked[row] = Asked(wanted, state.tick)
                commands += [(system, command) for command in wanted]
        return replace(state, asked=tuple(asked)), commands

    def kill(self, state: FlightState, swarm: Swarm) -> tuple[FlightState, Commands]:
        """Stop the rotors of those whom the operator said it of, again and again until they are seen to stand."""
        killing = state.hands.killing
        if not killing.any():
            return state, []
        again = (state.tick - state.hands.killed_tick) % self._patience == 0
        commands: Commands = [(swarm.ids[row], Kill()) for row in np.flatnonzero(killing & again)]
        return replace(state, hands=replace(state.hands, killing=killing & swarm.armed)), commands


def some(command: Command | None) -> tuple[Command, ...]:
    """As many as there are."""
    return () if command is None else (command,)
