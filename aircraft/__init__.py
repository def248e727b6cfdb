"""JSBSim models as package data: a folder each, with a README that says where every number came from."""

from pathlib import Path


def folder() -> Path:
    """The directory that holds the models; `folder() / "quad" / "quad.xml"` is the quadrotor."""
    return Path(__file__).resolve().parent
