"""What tests of the ground station share besides flights."""

import pytest

from gcs import cli


@pytest.fixture
def gcs(capfd):
    """Run `gcs` with these words in this process: (exit code, stdout, stderr)."""

    def run(*words):
        with pytest.raises(SystemExit) as ended:
            cli.main([str(word) for word in words])
        return ended.value.code or 0, *capfd.readouterr()

    return run
