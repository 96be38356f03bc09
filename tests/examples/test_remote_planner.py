"""The example of a driving stack: a sweep starts it, and it drives as it says."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from foretwin.orchestrator.commands.cli import run
from tests.system.foretwin_command import REPOSITORY

SPEC = REPOSITORY / "examples" / "remote_planner.toml"


def test_it_serves_a_sweep_as_its_spec_has_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(REPOSITORY)
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    assert run(["sweep", str(SPEC), "--out", str(tmp_path / "out"), "--workers", "1"]) == 0
    summary = json.loads((tmp_path / "out" / "sweep.json").read_bytes())
    told = {"command": "python examples/remote_planner.py", "name": "example", "version": "1.0"}
    assert summary["planners"]["example_stack"] == told
    rows = pq.read_table(tmp_path / "out" / "rows").to_pylist()
    driven = [row for row in rows if row["planner"] == "example_stack" and row["valid"]]
    assert len(driven) >= 10
    assert not any(row["failure"] or row["remark"] for row in driven)
    assert max(row["progress_m"] for row in driven) > 30.0
    stopped = [row for row in driven if row["scenario"] == "cpta"]
    assert not any(row["collided"] for row in stopped), "it brakes for who walks ahead"
