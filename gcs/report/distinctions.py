"""What tells flights apart that stand side by side: their names, and the keys of their scenarios that differ."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from gcs.recording.history import History
from gcs.report.told import Told
from gcs.report.verdicts import Cell, Row, Table
from gcs.words import controller_name

MOST = 12
"""Keys that are listed."""


def names(histories: Sequence[History]) -> list[str]:
    """How flights are called: by their controller, and by as much more as makes each name the only one."""
    called = [controller_name(history.scenario) for history in histories]
    scenarios = [Path(history.metadata.get("scenario", "")).stem for history in histories]
    if len(set(scenarios)) > 1:
        called = [f"{scenario}: {name}" for scenario, name in zip(scenarios, called, strict=True)]
    seeds = [history.metadata.get("seed", "") for history in histories]
    more = (
        [f"seed {seed}" if seed else "" for seed in seeds],
        [history.path.resolve().parent.name for history in histories],
        [f"flight {number}" for number in range(1, len(histories) + 1)],
    )
    for said in more:
        for name in {name for name in called if called.count(name) > 1}:
            alike = [place for place, other in enumerate(called) if other == name]
            tells = {said[place] for place in alike}
            if "" not in tells and len(tells) > 1:
                for place in alike:
                    called[place] = f"{name}, {said[place]}"
    return called


def differences(flights: Sequence[Told]) -> Table | None:
    """Keys of the scenarios that are not the same in all flights; None where there are none."""
    flat = [dict(_flat(told.history.scenario.model_dump(mode="json"))) for told in flights]
    every = dict.fromkeys(key for one in flat for key in one)
    keys = [key for key in every if len({repr(one.get(key)) for one in flat}) > 1]
    if not keys:
        return None
    rows = tuple(Row(key, tuple(Cell(_said(one.get(key))) for one in flat)) for key in keys[:MOST])
    if len(keys) > MOST:
        rows += (Row(f"and {len(keys) - MOST} more keys", tuple(Cell("") for _ in flat)),)
    return Table(("key", *(told.name for told in flights)), rows)


def _flat(values: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """section.key → value, as `--set` names them."""
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{above}{key}.")
        elif isinstance(value, list) and value and all(isinstance(one, Mapping) for one in value):
            for index, one in enumerate(value):
                yield from _flat(one, f"{above}{key}.{index}.")
        else:
            yield f"{above}{key}", value


def _said(value: Any) -> str:
    return "–" if value is None else str(value)
