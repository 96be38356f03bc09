"""Where tests of exports find the judges' interpreter, with libraries that foretwin lacks."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import pytest

JUDGES_VENV = "JUDGES_VENV"


def judges_python() -> Path:
    """Return the judges' interpreter, or skip the test where there is none."""
    venv = os.environ.get(JUDGES_VENV)
    if not venv:
        pytest.skip(f"{JUDGES_VENV} names no virtual environment with the judges of exports")
    python = Path(venv) / "bin" / "python"
    if not python.exists():
        pytest.skip(f"{JUDGES_VENV}={venv}: no interpreter at {python}")
    return python


def ask_judge(script: str, tasks: list[Any], *, timeout_s: float = 600.0) -> Any:
    """Run a script of this folder in the judges' interpreter; return what it says of the tasks."""
    path = Path(__file__).with_name(script)
    run = subprocess.run(
        [judges_python(), path],
        input=json.dumps(tasks),
        capture_output=True,
        text=True,
        timeout=timeout_s,
        check=False,
    )
    assert run.returncode == 0, run.stderr[-2000:]
    return json.loads(run.stdout)
