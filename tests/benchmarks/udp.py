"""How far flights over UDP in real time end from the lockstep flight with their seed: `python -m tests.benchmarks.udp`.

Not part of `make bench`: five repetitions take five minutes of wall time.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from gcs.recording.reader import RECORDING, read

REPETITIONS = 5
LINK = "127.0.0.1:14690"


def main() -> None:
    """Print a line a repetition."""
    with tempfile.TemporaryDirectory() as folder:
        lockstep = _places(_gcs("run", "emergency", "--out", f"{folder}/lockstep"), Path(folder) / "lockstep")
        print("distance of each vehicle from its lockstep place at the read-out [m], `emergency`, seed 1")
        for repetition in range(1, REPETITIONS + 1):
            out = Path(folder) / str(repetition)
            server = subprocess.Popen(
                [sys.executable, "-m", "fdm", "serve", "emergency", "--to", f"udpout:{LINK}"], stderr=subprocess.DEVNULL
            )
            try:
                code = _gcs("fly", "emergency", "--link", f"udpin:{LINK}", "--arm", "--yes", "--out", str(out))
            finally:
                server.terminate()
                server.wait()
            apart = np.linalg.norm(_places(code, out) - lockstep, axis=1)
            print(repetition, " ".join(f"{metres:.2f}" for metres in apart), f"  worst {apart.max():.2f}", flush=True)


def _gcs(*words: str) -> int:
    return subprocess.run([sys.executable, "-m", "gcs", *words], capture_output=True, check=False).returncode


def _places(code: int, out: Path) -> np.ndarray:
    """(N, 3) true places at the read-out."""
    track = read(out / RECORDING).track
    if code or track is None:
        raise SystemExit(f"a flight ended with exit code {code}")
    return track.position[-1]


if __name__ == "__main__":
    main()
