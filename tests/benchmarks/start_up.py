"""How long `gcs --help` takes: what a person waits for before anything happens."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time


def main() -> None:
    """Print one line."""
    took = []
    for _ in range(7):
        start = time.perf_counter()
        command = [sys.executable, "-c", "import sys; sys.argv = ['gcs', '--help']; from gcs.cli import main; main()"]
        subprocess.run(command, check=True, capture_output=True)
        took.append(time.perf_counter() - start)
    print(f"gcs --help: {statistics.median(took):.2f} s (median of {len(took)})")


if __name__ == "__main__":
    main()
