"""How hard property tests try: TRUSTR_PROFILE=test (the same few examples every time) or soak (many, always new)."""

import gc
import os

from hypothesis import HealthCheck, settings

SOAK_EXAMPLES = 20_000

settings.register_profile(
    "test", max_examples=60, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.register_profile(
    "soak", max_examples=SOAK_EXAMPLES, deadline=None, print_blob=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile(os.environ.get("TRUSTR_PROFILE", "test"))


def pytest_collection_finish():
    """What was collected stays to the end: the garbage collector need not look at it again and again."""
    gc.freeze()


def pytest_sessionfinish(session):
    """A skipped test is a claim that nobody checked: it fails the run."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if reporter is not None and reporter.stats.get("skipped") and session.exitstatus == 0:
        session.exitstatus = 1
