"""Exit codes, and what speaks to a person: bad input is one sentence, anything else keeps its traceback."""

from __future__ import annotations

from collections.abc import Callable

from gcs.choices import BadUsageError
from gcs.console import say

FLOWN, BAD_INPUT, NOT_COMPLETED, INTERRUPTED = 0, 2, 3, 130
"""Exit codes."""


def guarded(command: Callable[[], int]) -> int:
    """Bad input is one sentence and exit code 2."""
    try:
        return command()
    except Exception as error:
        if _hangs(error):
            say(f"gcs: {error}")
            return NOT_COMPLETED
        if not isinstance(error, _refusals()):
            raise
        say(f"gcs: {error}")
        return BAD_INPUT


def _hangs(error: Exception) -> bool:
    """Whether it is a flight that does not answer."""
    from gcs.reach import Unanswered

    return isinstance(error, Unanswered)


def _refusals() -> tuple[type[Exception], ...]:
    """What speaks to a person; anything else is a defect and keeps its traceback."""
    from gcs.compare import UnwritablePicture
    from gcs.rates import LinkTooSlow
    from gcs.ratings import RatingsError
    from gcs.reach import Refused
    from gcs.recording.reader import UnreadableRecording
    from gcs.recording.writer import RecordingError
    from gcs.rules import RuleError
    from scenarios import ScenarioError
    from wire.connection import ConnectionRefused
    from wire.signing import SigningKeyError

    return (
        BadUsageError,
        ScenarioError,
        RuleError,
        ConnectionRefused,
        SigningKeyError,
        LinkTooSlow,
        Refused,
        RecordingError,
        RatingsError,
        UnreadableRecording,
        UnwritablePicture,
    )
