"""Pictures become an MP4: H.264, as every player and browser shows it, with nothing written into its metadata."""

from __future__ import annotations

import errno
import os
import subprocess
import tempfile
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from gcs.choices import BadUsageError
from gcs.output import Unwritable
from gcs.video.view import HEIGHT, RATE, WIDTH

COLOURS = ("-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709", "-color_range", "tv")
"""As players take high definition to be; without the tags some show it paler."""
BARE = ("-map_metadata", "-1", "-fflags", "+bitexact", "-flags:v", "+bitexact")
"""No titles, no times, no names in the file."""


def ffmpeg() -> str:
    """The program that encodes. Raises BadUsageError where it is not installed."""
    try:
        from imageio_ffmpeg import get_ffmpeg_exe
    except ImportError:
        raise BadUsageError("a film needs imageio-ffmpeg: pip install 'trustr[video]'") from None
    try:
        return str(get_ffmpeg_exe())
    except RuntimeError as error:
        raise BadUsageError(f"a film needs ffmpeg: {error}") from None


class Encoder:
    """A film that is written picture by picture. What cannot be written raises OSError."""

    def __init__(self, path: Path, program: str) -> None:
        path.open("wb").close()  # says at once, and in the system's words, what cannot be written
        self._path = path
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 -- closed with the film
        # in a session of its own: Ctrl-C is for us, who then end it
        self._process = subprocess.Popen(
            _command(program, path), stdin=subprocess.PIPE, stdout=self._said, stderr=self._said, start_new_session=True
        )

    def __enter__(self) -> Encoder:
        return self

    def add(self, picture: memoryview) -> None:
        """The next one: HEIGHT × WIDTH × 4 bytes of red, green, blue and nothing, from the upper left corner."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(picture)
        except BrokenPipeError:
            self._process.wait()
            self._fail()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """The file is whole, or the program has ended all the same."""
        assert self._process.stdin is not None
        if kind is not None:
            self._process.kill()
        try:
            with suppress(BrokenPipeError):  # then its exit code tells
                self._process.stdin.close()
            if self._process.wait() != 0 and kind is None:
                self._fail()
        finally:
            self._said.close()

    def _fail(self) -> None:
        """Say why, in the system's words where they are among ffmpeg's."""
        self._said.seek(0)
        said = self._said.read().decode(errors="replace").strip()
        for number in (errno.ENOSPC, errno.EIO, errno.EDQUOT, errno.EFBIG):
            if os.strerror(number) in said:
                raise OSError(number, os.strerror(number), str(self._path))
        raise Unwritable(f"the film cannot be encoded: {said.splitlines()[-1] if said else 'ffmpeg ended'}")


def _command(program: str, path: Path) -> list[str]:
    taken = ("-f", "rawvideo", "-pix_fmt", "rgba", "-s", f"{WIDTH}x{HEIGHT}", "-r", str(RATE), "-i", "-")
    made = ("-c:v", "libx264", "-preset", "veryfast", "-crf", "20", "-vf", "scale=out_color_matrix=bt709:out_range=tv")
    shown = ("-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4")
    return [program, "-v", "error", "-nostdin", "-y", *taken, *made, *COLOURS, *BARE, *shown, str(path)]
