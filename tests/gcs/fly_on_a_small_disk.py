"""Flies the demo with its recording and its journal on a disk that fills up, and on which there is room again later.

Words: the folder that the disk is mounted on, and one elsewhere for copies. Says in JSON what was said, and when.
"""

import json
import shutil
import sys
from pathlib import Path

from flights import SHORT, Arriving, fly_and_record

from gcs.recording.journal import Journal
from gcs.session import Recording

LEFT = 700_000
"""Bytes that are free at first: ten seconds of a flight."""
FULL_TICKS = 50
"""How long the disk stays full after that is told."""


class Disk:
    """A `Record` that gives space back some time after somebody said that there is none."""

    def __init__(self, folder, copies):
        self._folder, self._copies = folder, copies
        self._ballast = folder / "ballast"
        self._ballast.write_bytes(bytes(shutil.disk_usage(folder).free - LEFT))
        self._tick = 0
        self.said = []

    def say(self, words):
        self.said.append((self._tick, words))

    def tick(self, tick):
        self._tick = tick.number + 1
        if self.said and self._ballast.exists() and tick.number == self.said[0][0] + FULL_TICKS:
            for name in ("run.mcap", "run.tlog"):
                shutil.copy(self._folder / name, self._copies / f"full-{name}")
            self._ballast.unlink()


def main(folder, copies):
    disk = Disk(folder, copies)
    with Journal(folder / "run.tlog", disk.say) as journal:
        flight = fly_and_record(
            "demo",
            *SHORT,
            out=folder,
            through=lambda world, _clock: Arriving(world, journal.arrived),
            watching=lambda _flight: (disk,),
            recording=Recording(journal=journal),
            say=disk.say,
        )
        missing = journal.missing
    for path in folder.iterdir():
        shutil.copy(path, copies)
    told = {"said": disk.said, "missing": missing, "problem": flight.summary.problem}
    json.dump(told | {"heading_error_deg": flight.summary.heading_error_deg}, sys.stdout)


main(*map(Path, sys.argv[1:]))
