"""What tests of the ground station share besides flights."""

import tempfile
from pathlib import Path

import pytest

from gcs import cards as flights_cards
from gcs import cli


@pytest.fixture
def cards(monkeypatch):
    """A folder of the test's own where flights lay their cards; short, because the names of sockets must be."""
    with tempfile.TemporaryDirectory(prefix="rt-") as folder:
        monkeypatch.setattr(flights_cards, "FOLDER", Path(folder) / "cards")
        yield Path(folder) / "cards"


@pytest.fixture
def gcs(capfd):
    """Run `gcs` with these words in this process: (exit code, stdout, stderr)."""

    def run(*words):
        with pytest.raises(SystemExit) as ended:
            cli.main([str(word) for word in words])
        return ended.value.code or 0, *capfd.readouterr()

    return run
