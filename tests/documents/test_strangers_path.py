"""A stranger's path: the wheel in an empty folder, and the tutorial word by word.

Nothing is prepared but the wheel: the environment is the one that the tutorial makes.
"""

from __future__ import annotations

import json
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from tests.documents.running import play_page
from tests.documents.stage import Installed

pytestmark = [pytest.mark.judge, pytest.mark.timeout(3600)]


def test_the_tutorial_leads_from_the_wheel_to_a_sweep(tmp_path: Path, installed: Installed) -> None:
    assert play_page("docs/tutorial.md", tmp_path, installed) >= 11

    libraries = next((tmp_path / ".venv").glob("lib/python*/site-packages/foretwin"))
    assert (libraries / "orchestrator").is_dir(), "the wheel's own files, in the tutorial's folder"
    first = json.loads(next((tmp_path / "runs").glob("*/run.json")).read_text(encoding="utf-8"))
    assert first["exit"] == "completed"
    assert first["intersections"]
    report = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert len(report) < 3_000_000
    assert "foretwin repeat" in report
    assert (tmp_path / "crossing.png").stat().st_size > 10_000
    assert (tmp_path / "crossing.png.report.md").read_text(encoding="utf-8").count("default") > 0
    assert "[speed]" in (tmp_path / "trip.csv.toml").read_text(encoding="utf-8")
    again = json.loads(next((tmp_path / "replayed").glob("*/run.json")).read_text(encoding="utf-8"))
    assert again["route_source"] != first["route_source"]
    rows = pq.read_table(tmp_path / "sweeps" / "sweep" / "rows")
    assert set(rows["planner"].to_pylist()) == {"pure_pursuit_idm", "constant_speed"}
