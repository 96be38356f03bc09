"""Runs pytest again and again, each time in a fork of a process that has its libraries already.

A JSON object {"tests", "within_s"} comes in on each line, one {"fate"} goes out: "passed", "failed"
or "timed out". What is tested is imported after the fork alone, so each fork sees the files as they
are then; what no change reaches, the libraries of others, is paid for once.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import select
import signal
import sys
from typing import Any

import pytest

LIBRARIES = (
    "hypothesis.strategies", "msgspec", "numba", "numpy", "pyarrow.parquet", "pyproj", "rich.table",
    "scipy.ndimage", "shapely", "typer", "zenoh",
)  # fmt: skip
OURS = ("foretwin", "tests")


def main() -> None:
    """Serve until nothing more is asked."""
    for name in LIBRARIES:
        importlib.import_module(name)
    for line in sys.stdin:
        ours = sorted(name for name in sys.modules if name.split(".")[0] in OURS)
        if ours:
            raise RuntimeError(f"imported before the fork: {ours}")
        print(json.dumps({"fate": _fate(**json.loads(line))}), flush=True)


def _fate(tests: list[str], within_s: float | None) -> str:
    child = os.fork()
    if child == 0:
        _run(tests)
    told = os.pidfd_open(child)
    try:
        ended, _, _ = select.select([told], [], [], within_s)
    finally:
        os.close(told)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)  # it, and what it has started and left
        _, status = os.waitpid(child, 0)
    if not ended:
        return "timed out"
    # A file of judge tests alone has none for every day, and notices nothing.
    unmoved = (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED)
    return "passed" if os.waitstatus_to_exitcode(status) in unmoved else "failed"


def _run(tests: list[str]) -> None:
    code: Any = 70
    try:
        os.setsid()
        nowhere = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(nowhere, stream)
        # Of hypothesis, which is here already, pytest would rewrite the assertions otherwise.
        calm = ["-W", "ignore::pytest.PytestAssertRewriteWarning"]
        code = pytest.main(["-x", "-q", "-p", "no:cacheprovider", *calm, *tests])
    finally:
        os._exit(int(code))


if __name__ == "__main__":
    main()
