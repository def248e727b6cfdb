"""The page: every flight's tables, story and charts, side by side, in HTML that needs nothing else."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from gcs.recording.history import History
from gcs.report.believed import trust, weights
from gcs.report.beneath import batteries, gate, lateness, links
from gcs.report.courses import courses
from gcs.report.distinctions import differences, names
from gcs.report.judged import closeness, distance, heading
from gcs.report.story import story
from gcs.report.svg import element
from gcs.report.told import Told
from gcs.report.verdicts import Table, robot_by_robot, verdicts

SECTIONS = (courses, heading, distance, trust, weights, closeness, links, batteries, lateness, gate)
"""In the order of the page."""


@dataclass(frozen=True, slots=True)
class Account:
    """One flight in words."""

    name: str
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
    flights = [Told(name, history) for name, history in zip(names(histories), histories, strict=True)]
    titles = list(dict.fromkeys(history.scenario.title for history in histories))
    surroundings = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    surroundings.filters["key"] = _key
    surroundings.filters["units"] = _with_units
    return surroundings.get_template("page.html.jinja").render(
        title=titles[0] if len(titles) == 1 else f"{len(histories)} flights of {len(titles)} scenarios",
        columns=len(flights) if len(flights) <= 3 else 2 if len(flights) == 4 else 3,
        verdicts=verdicts(flights),
        accounts=[_account(told) for told in flights],
        sections=[section(flights) for section in SECTIONS],
        differences=differences(flights),
    )


def _account(told: Told) -> Account:
    history = told.history
    facts = {"recording": str(history.path.resolve()), **history.metadata}
    facts |= {f"recovered, {name.replace('_', ' ')}": said for name, said in (history.recovered or {}).items()}
    return Account(
        name=told.name,
        paragraphs=story(told),
        robots=robot_by_robot(told),
        facts=tuple((name, value) for name, value in facts.items() if value),
        again=f"gcs run {shlex.quote(str(history.path.resolve()))}",
        scenario=history.scenario.model_dump_json(indent=1),
    )


def _with_units(said: str) -> str:
    """Numbers keep their units on their line."""
    return re.sub(r"(?<=\d) (?=(s|ms|m|of 5)\b)", "\u00a0", said)


def _key(class_: str) -> str:
    """A sample of how a thing is drawn."""
    if class_.endswith("bar"):
        drawn = element("rect", x=1, y=2, width=20, height=7, class_=class_)
    elif class_ == "rating swarm":
        drawn = element("rect", x=6, y=1, width=9, height=9, class_=class_)
    elif class_.startswith("rating"):
        drawn = element("circle", cx=11, cy=5.5, r=4.5, class_=class_)
    else:
        drawn = element("line", x1=1, x2=21, y1=5.5, y2=5.5, class_=class_)
    return element("svg", drawn, viewBox="0 0 22 11", class_="key", aria_hidden="true")
