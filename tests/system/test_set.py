"""`foretwin set` on a drive that runs: processes of their own, over the real bus."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from foretwin.contracts.errors import UserError
from foretwin.contracts.joining import newest_running
from foretwin.orchestrator.commands.cli import EXIT_USER, run
from tests.system.foretwin_command import Finished, run_folder, started, wait_for

HELD_AT_JOIN = """
import time
from pathlib import Path
from foretwin.orchestrator.drive.conductor import Conductor

join, folder = Conductor.join, Path.cwd()

def held(conductor):
    (folder / "held").touch()
    while not (folder / "go").exists():
        time.sleep(0.01)
    join(conductor)

Conductor.join = held
"""
"""Makes a drive listen to nobody before a file named `go` is there."""

SMALL = ("--speed", "max", "--futures", "6", "--rate", "0.5", "--end", "10")


def test_roles_and_correction_of_a_running_drive_are_set(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "runs"
    with started(out, *SMALL) as process:
        wait_for(lambda: bool(list(out.glob("*/run.json"))), "the run's record")
        told = []
        for assignment in ("role.ego=twin", "correction=follow", "role.ego=shadow"):
            assert run(["set", assignment, "--out", str(out)]) == 0
            told.append(capsys.readouterr().out)
        assert run(["set", "role.ego=wheel", "--out", str(out)]) == EXIT_USER
        assert "role.ego=wheel: must be all, twin, shadow, ghost" in capsys.readouterr().err
        screen, _ = process.communicate(timeout=240.0)
    folder = run_folder(out)
    assert folder is not None
    done = Finished(process.returncode, screen, folder)
    assert done.code == 0, screen
    assert "role.ego: all -> twin, from " in told[0]
    assert "correction: free -> follow, from " in told[1]
    assert run(["set", "role.ego=twin", "--run", str(folder)]) == EXIT_USER
    assert "the run has ended (completed)" in capsys.readouterr().err

    changes = done.record()["changes"]
    assert [(change["key"], change["value"]) for change in changes] == [
        ("role.ego", "twin"), ("correction", "follow"), ("role.ego", "shadow"),
    ]  # fmt: skip
    assert [row["key"] for row in done.rows("changes")] == ["role.ego", "correction", "role.ego"]
    _, follow_ns, shadow_ns = (change["stamp_ns"] for change in changes)
    for row in done.rows("mirror"):
        at_ns = row["stamp_ns"]
        assert (row["role"] == "shadow") == (at_ns >= shadow_ns)
        drawn = row["correction_along_mps2"] is not None
        assert drawn == (follow_ns <= at_ns < shadow_ns)
        # The gap is the free twin's, whatever is shown.
        free = "free" if row["free_x_m"] is not None else "twin"
        gap_m = math.hypot(
            row[f"{free}_x_m"] - row["real_x_m"], row[f"{free}_y_m"] - row["real_y_m"]
        )
        assert row["gap_m"] == pytest.approx(gap_m, abs=1e-6)
    assert {row["role"] for row in done.rows("mirror")} >= {"twin", "shadow"}
    assert json.loads((folder / "run.json").read_text())["config"]["role"] == "all"


def test_a_run_is_listed_no_sooner_than_it_can_be_spoken_to(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "runs"

    def is_listed() -> bool:
        try:
            newest_running(out)
        except UserError:
            return False
        return True

    with started(out, *SMALL, changed_by=HELD_AT_JOIN) as process:
        wait_for((tmp_path / "held").exists, "the drive to stand before it joins the bus")
        assert not is_listed()
        assert run(["set", "correction=follow", "--out", str(out)]) == EXIT_USER
        assert "no drive is running there" in capsys.readouterr().err
        (tmp_path / "go").touch()
        wait_for(is_listed, "the run to be listed")
        assert run(["set", "correction=follow", "--out", str(out)]) == 0
        assert process.poll() is None
