"""Gymnasium is an extra: whoever does not learn needs none of it."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[3]
ROOMS = ("contracts", "telemetry", "world_gen", "sim_worker", "orchestrator", "viewer")


def test_gymnasium_is_imported_by_the_environments_alone() -> None:
    importing = re.compile(r"^\s*(?:import|from) (?:gymnasium|sim_worker\.gym)\b", re.MULTILINE)
    files = [file for room in ROOMS for file in (ROOT / room).rglob("*.py")]

    found = {file.parent for file in files if importing.search(file.read_text(encoding="utf-8"))}

    assert found == {ROOT / "sim_worker" / "gym"}


def test_the_command_line_and_the_worker_do_without_it() -> None:
    code = (
        "import sys; sys.modules['gymnasium'] = None;"
        "import foretwin.__main__, foretwin.sim_worker.worker, foretwin.sim_worker.futures.run_job"
    )

    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)
