"""Who drove, as a report tells it."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.orchestrator.report.blocks import Prose
from foretwin.orchestrator.report.conduct_parts import disagreement_part
from foretwin.orchestrator.report.material import RunMaterial
from tests.orchestrator.report.told_runs import run_of_nothing


def test_takeovers_by_the_human_and_by_the_software_are_told_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    segment = {
        "from_stamp_ns": 0, "to_stamp_ns": 1, "plans": 0, "lateral_m": None, "along_m": None,
        "speed_mps": None, "disagreements": 0,
    }  # fmt: skip
    modes = ["manual", "autonomous", "manual", "autonomous"]
    rows = [segment | {"number": n, "control_mode": mode} for n, mode in enumerate(modes)]
    run = RunMaterial(run_of_nothing(tmp_path / "run"))
    monkeypatch.setattr(run, "rows", lambda name: rows if name == "driven_segments" else [])

    said, *_ = disagreement_part(run, []).blocks

    assert said == Prose("1 takeover by the human, 2 by the software.")
