"""Exit codes, and what speaks to a person: bad input is one sentence, anything else keeps its traceback."""

from __future__ import annotations

from collections.abc import Callable

from gcs.choices import BadUsageError
from gcs.console import say

DONE, BAD_INPUT, NOT_DONE, INTERRUPTED = 0, 2, 3, 130
"""Exit codes."""


def guarded(command: Callable[[], int]) -> int:
    """What speaks to a person is one sentence and an exit code; anything else is a defect and keeps its traceback."""
    try:
        return command()
    except Exception as error:
        code = _exit_code(error)
        if code is None:
            raise
        say(f"gcs: {error}")
        return code


def _exit_code(error: Exception) -> int | None:
    """None of a defect."""
    from gcs.compare import UnwritablePicture
    from gcs.output import Unwritable
    from gcs.rates import LinkTooSlow
    from gcs.ratings import RatingsError
    from gcs.reach import Refused, Unanswered
    from gcs.recording.files import RecordingError
    from gcs.recording.reader import UnreadableRecording
    from gcs.rules import RuleError
    from scenarios import ScenarioError
    from wire.connection import ConnectionRefused
    from wire.signing import SigningKeyError

    refusals = (
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
        Unwritable,
    )
    if isinstance(error, refusals):
        return BAD_INPUT
    return NOT_DONE if isinstance(error, Unanswered) else None
