"""Autopilots: how each is brought into the air, under our control, and down again.

One step at a time: each function looks at what telemetry says of one vehicle and names the one thing to ask of it
next, or nothing when it is there. Whoever calls asks again until it is.
"""

from gcs.autopilots.fleet import Fleet

__all__ = ["Fleet"]
