"""What came of a sweep: counts by scenario and planner, and why cases were not placed."""

from __future__ import annotations

from pathlib import Path

from foretwin.orchestrator.sweep.spec import load_spec
from foretwin.orchestrator.sweep.summary import Summary
from tests.orchestrator.sweeps import small_sweep


def test_cases_that_cannot_be_played_are_counted_by_reason(tmp_path: Path) -> None:
    summary = Summary(load_spec(small_sweep(tmp_path)).spec)
    row = {"scenario": "scp", "planner": "constant_speed", "failure": "", "trajectory_sha256": None}
    for reason in ("too short", "too short", "built over"):
        summary.add({**row, "left_out": reason})
    (entry,) = summary.table()
    assert entry["not_placed"] == {"too short": 2, "built over": 1}
    assert (entry["cases"], entry["placed"]) == (3, 0)
