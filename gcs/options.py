"""Options that several commands share, as types of their parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

ScenarioName = Annotated[str, Parameter(help="A scenario's name (see `gcs scenarios`), or the path of a TOML file.")]
Out = Annotated[
    Path | None,
    Parameter(help="Folder for run.mcap, summary.json and trajectory.png; runs/TIME-SCENARIO if absent."),
]
AsJson = Annotated[bool, Parameter(name="--json", negative=(), show_default=False, help="One JSON object on stdout.")]
Decodes = Annotated[
    bool,
    Parameter(
        name="--record-decoded",
        negative=(),
        show_default=False,
        help="Record MAVLink messages as JSON, too; `gcs log export --to mcap` does it afterwards.",
    ),
]
LinkTexts = Annotated[
    tuple[str, ...],
    Parameter(
        name="--link",
        negative=(),
        help="udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT, tcpin:HOST:PORT or serial:DEVICE:BAUD; repeatable, "
        "PORT may be a range 14550-14555.",
    ),
]
SigningKey = Annotated[
    Path | None,
    Parameter(help="File with the MAVLink 2 signing key, 64 hex digits or a passphrase; only what is signed is heard."),
]
Vehicles = Annotated[
    tuple[int, ...],
    Parameter(name="--vehicle", negative=(), help="System id; repeatable. Everybody who is heard, if absent."),
]
