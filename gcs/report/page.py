"""The page: every flight's tables, story and charts, side by side, in HTML that needs nothing else."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from gcs.recording.history import History
from gcs.report.believed import trust, weights
from gcs.report.beneath import batteries, gate, lateness, links
from gcs.report.courses import courses
from gcs.report.judged import closeness, distance, heading
from gcs.report.story import story
from gcs.report.svg import element
from gcs.report.told import Told
from gcs.report.verdicts import Cell, Row, Table, robot_by_robot, verdicts
from gcs.words import controller_name

SECTIONS = (courses, heading, distance, trust, weights, closeness, links, batteries, lateness, gate)
"""In the order of the page."""


@dataclass(frozen=True, slots=True)
class Account:
    """One flight in words."""

    name: str
    passed: bool
    paragraphs: tuple[str, ...]
    robots: Table
    facts: tuple[tuple[str, str], ...]
    """Versions, seed, when it was flown, and where its recording lies."""
    again: str
    """The command that flies it again."""
    scenario: str
    """As JSON."""


def page(histories: Sequence[History]) -> str:
    """HTML of at least one flight."""
    flights = [Told(name, history) for name, history in zip(_names(histories), histories, strict=True)]
    titles = list(dict.fromkeys(history.scenario.title for history in histories))
    surroundings = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    surroundings.filters["svg"] = Markup  # charts escape their own words
    surroundings.filters["key"] = _key
    surroundings.filters["units"] = _with_units
    return surroundings.get_template("page.html.jinja").render(
        title=titles[0] if len(titles) == 1 else f"{len(histories)} flights of {len(titles)} scenarios",
        columns=len(flights) if len(flights) <= 3 else 2 if len(flights) == 4 else 3,
        verdicts=verdicts(flights),
        accounts=[_account(told) for told in flights],
        sections=[section(flights) for section in SECTIONS],
        differences=_differences(flights),
    )


def _account(told: Told) -> Account:
    history = told.history
    facts = {"scenario": history.metadata.get("scenario", ""), "recording": str(history.path.resolve())} | dict(
        history.metadata
    )
    return Account(
        name=told.name,
        passed=told.passed,
        paragraphs=story(told),
        robots=robot_by_robot(told),
        facts=tuple((name, value) for name, value in facts.items() if value),
        again=f"gcs run {shlex.quote(str(history.path.resolve()))}",
        scenario=history.scenario.model_dump_json(indent=1),
    )


def _names(histories: Sequence[History]) -> list[str]:
    """How flights are called: by their controller, and by as much more as tells them apart."""
    number = {id(history): str(place) for place, history in enumerate(histories, start=1)}
    more: tuple[Callable[[History], str], ...] = (
        lambda history: f"seed {history.metadata['seed']}" if history.metadata.get("seed") else "",
        lambda history: history.path.resolve().parent.name,
        lambda history: f"flight {number[id(history)]}",
    )
    names = [controller_name(history.scenario) for history in histories]
    scenarios = [Path(history.metadata.get("scenario", "")).stem for history in histories]
    if len(set(scenarios)) > 1:
        names = [f"{scenario}: {name}" for scenario, name in zip(scenarios, names, strict=True)]
    for tell in more:
        twice = {name for name in names if names.count(name) > 1}
        for name in twice:
            alike = [place for place, other in enumerate(names) if other == name]
            said = {place: tell(histories[place]) for place in alike}
            if len(set(said.values())) > 1:
                for place in alike:
                    names[place] = f"{name}, {said[place]}" if said[place] else name
    return names


MOST_DIFFERENCES = 12


def _differences(flights: Sequence[Told]) -> Table | None:
    """Keys of the scenarios that are not the same in all flights; None where there are none."""
    flat = [dict(_flat(told.history.scenario.model_dump(mode="json"))) for told in flights]
    keys = [
        key
        for key in dict.fromkeys(key for one in flat for key in one)
        if len({repr(one.get(key)) for one in flat}) > 1
    ]
    if not keys:
        return None
    rows = tuple(Row(key, tuple(Cell(_said(one.get(key))) for one in flat)) for key in keys[:MOST_DIFFERENCES])
    if len(keys) > MOST_DIFFERENCES:
        rest = f"and {len(keys) - MOST_DIFFERENCES} more keys"
        rows += (Row(rest, tuple(Cell("") for _ in flat)),)
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


def _with_units(said: str) -> str:
    """Numbers keep their units on their line."""
    return re.sub(r"(?<=\d) (?=(s|ms|m|of 5)\b)", "\u00a0", said)


def _key(class_: str) -> Markup:
    """A sample of how a thing is drawn."""
    if class_.endswith("bar"):
        drawn = element("rect", x=1, y=2, width=20, height=7, class_=class_)
    elif class_ == "rating swarm":
        drawn = element("rect", x=6, y=1, width=9, height=9, class_=class_)
    elif class_.startswith("rating"):
        drawn = element("circle", cx=11, cy=5.5, r=4.5, class_=class_)
    else:
        drawn = element("line", x1=1, x2=21, y1=5.5, y2=5.5, class_=class_)
    return Markup(element("svg", drawn, viewBox="0 0 22 11", class_="key", aria_hidden="true"))
