"""The list of scenarios that ship."""

from __future__ import annotations

import sys
from typing import Any

import orjson

from gcs.mission import plan
from gcs.words import faults
from scenarios import find, load, names


def listing(*, as_json: bool, console: Any) -> int:
    """Print name, title and plan of each."""
    rows: list[dict[str, Any]] = []
    for name in names():
        scenario = load(name)
        rows.append(
            {
                "name": name,
                "title": scenario.title,
                "vehicles": scenario.swarm.count,
                "duration_s": round(plan(scenario).read_out_s, 3),
                "faults": faults(scenario),
                "path": str(find(name)),
            }
        )
    if as_json:
        sys.stdout.write(orjson.dumps({"scenarios": rows}).decode() + "\n")
        return 0
    from rich.table import Table

    table = Table(box=None, padding=(0, 2), header_style="dim")
    for column in ("name", "what is flown", "UAVs", "mission", "fault"):
        table.add_column(column)
    for row in rows:
        wrong = ", ".join(row["faults"]) or "none"
        table.add_row(row["name"], row["title"], str(row["vehicles"]), f"{row['duration_s']:.0f} s", wrong)
    console.print(table)
    return 0
