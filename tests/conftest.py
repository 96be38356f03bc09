"""Fixtures shared by all tests: the folder of real data, and a warning-free start."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# A busy machine is no fault of the code: pytest-timeout alone says what takes too long. The same
# code meets the same examples, so that a change alone can break a test;
# `--hypothesis-profile explore` looks for others.
CALM = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("foretwin", CALM, derandomize=True)
settings.register_profile("explore", CALM)
settings.load_profile("foretwin")

# Tests are spread over the cores: threads of scikit-learn beside them wait for each other in loops
# (learning a small table took over 300 s on two busy cores, 56 s with one thread).
os.environ.setdefault("OMP_NUM_THREADS", "1")

# Under nohup and behind a shell's `&` they would be ignored by all that tests start, those that
# must end by them too.
signal.signal(signal.SIGHUP, signal.SIG_DFL)
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    if os.environ.get("FORETWIN_DATA"):
        return
    skip = pytest.mark.skip(reason="FORETWIN_DATA is not set: no real drives and maps here")
    for item in items:
        if "real_data" in item.keywords:
            item.add_marker(skip)


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of real drives and maps; tests that use it are marked real_data."""
    folder = Path(os.environ["FORETWIN_DATA"])
    if not folder.is_dir():
        raise FileNotFoundError(f"FORETWIN_DATA names {folder}, which is no folder")
    return folder
