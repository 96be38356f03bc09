"""The template package that a user copies: found by its entry points, and it drives."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from foretwin.contracts.futures import Future
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.planners.hosted import HostedPlanner
from foretwin.sim_worker.planners.registry import load_planner, planner_names
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.places import crossroads, happening, job
from tests.system.foretwin_command import REPOSITORY

PACKAGE = REPOSITORY / "examples" / "planner_package"
ENTRIES = tomllib.loads((PACKAGE / "pyproject.toml").read_text())["project"]["entry-points"]


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The package as pip leaves it: its modules, and a folder that names its entry points."""
    info = tmp_path / "foretwin_planners_template-0.1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: foretwin-planners-template\nVersion: 0.1.0\n"
    )
    lines = [f"{name} = {value}" for name, value in ENTRIES["foretwin.planners"].items()]
    (info / "entry_points.txt").write_text("\n".join(["[foretwin.planners]", *lines]))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.syspath_prepend(PACKAGE)
    yield
    for name in ENTRIES["foretwin.planners"]:
        planner = load_planner(name)
        assert isinstance(planner, HostedPlanner)
        planner.close()
    load_planner.cache_clear()


@pytest.mark.usefixtures("installed")
def test_both_planners_are_found_and_drive_and_stop() -> None:
    assert {"calm", "calm_one"} <= set(planner_names())
    lead = {"lead__speed_mps": 0.0, "lead__gap_m": 30.0}
    futures = (
        Future(index=0, name="alone", planner="calm"),
        Future(index=1, name="alone", planner="calm_one"),
        happening(2, "lead_stopping", planner="calm", **lead),
        happening(3, "lead_stopping", planner="calm_one", **lead),
    )
    outcome = run_job(
        job(futures, horizon_s=8.0), BatchSimulation(crossroads(), load_vehicle(), nsim=4)
    )
    outcome = outcome.outcome
    assert outcome.valid.all(), outcome.failures
    assert not outcome.collided.any()
    assert (outcome.progress_m[:2] > 50.0).all()
    assert (outcome.progress_m[2:] < 30.0).all()


def pip_installed(folder: Path) -> Path:
    """Install a copy of the package as the documentation says; return where it is."""
    copy, target = folder / "planner_package", folder / "target"
    shutil.copytree(PACKAGE, copy)
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", target]
    subprocess.run([*command, str(copy)], check=True)
    return target


@pytest.mark.judge
def test_pip_installs_it(tmp_path: Path) -> None:
    target = pip_installed(tmp_path)
    code = (
        "from foretwin.sim_worker.planners.registry import check_planner, planner_names;"
        "check_planner('calm'); check_planner('calm_one'); print(*planner_names())"
    )
    said = subprocess.run(
        [sys.executable, "-c", code], cwd=REPOSITORY, capture_output=True, text=True, check=True,
        env={"PYTHONPATH": f"{target}:{REPOSITORY}", "PATH": ""},
    ).stdout.split()  # fmt: skip
    assert {"calm", "calm_one"} <= set(said)


@pytest.mark.judge
def test_a_drive_takes_it_by_name(tmp_path: Path) -> None:
    target = pip_installed(tmp_path)
    drive = [sys.executable, "-P", "-m", "foretwin", "drive", "--view", "none", "--end", "9"]
    drive += ["--speed", "max", "--futures", "12", "--rate", "0.5", "--out", str(tmp_path / "runs")]
    done = subprocess.run(
        [*drive, "--planner", "calm"], cwd=tmp_path, capture_output=True, text=True, timeout=240.0,
        env=os.environ
        | {"PYTHONPATH": f"{target}{os.pathsep}{REPOSITORY}", "XDG_CACHE_HOME": str(tmp_path)},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    (table,) = tmp_path.glob("runs/*/results/futures.parquet")
    rows = pq.read_table(table).to_pylist()
    calm = [row["valid"] for row in rows if row["planner"] == "calm"]
    assert len(calm) > 10
    assert all(calm)
