"""Pictures of an experiment."""

from __future__ import annotations

from pathlib import Path

from gcs.experiment.results import Results


def draw(results: Results, folder: Path) -> tuple[str, ...]:  # noqa: ARG001
    """Names of the files."""
    return ()
