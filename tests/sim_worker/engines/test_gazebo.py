"""Gazebo's own physics moves the car of a job; skips where ign-physics is not installed."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
import pytest

from foretwin.contracts.futures import Future
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.engines import gazebo
from foretwin.sim_worker.engines.gazebo import Gazebo, built_runner, trouble_with_gazebo
from foretwin.sim_worker.engines.registry import trouble_with_engine
from foretwin.sim_worker.futures.run_job import run_alone, stage_for
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.driving import drive, seed, states
from tests.sim_worker.places import crossroads, job

CAR = load_vehicle()


def test_where_it_is_absent_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gazebo, "plugin_path", lambda: None)
    trouble = trouble_with_engine("gazebo")
    assert trouble is not None
    assert "libignition-physics5-dartsim-plugin5" in trouble
    assert "\n" not in trouble
    with pytest.raises(ValueError, match="needs ign-physics 5 with DART"):
        built_runner()


def test_what_does_not_compile_is_said_in_one_line(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(gazebo, "trouble_with_gazebo", lambda: None)
    monkeypatch.setattr(gazebo, "_LIBRARIES", ())
    program = tmp_path / "g++"
    program.write_text("#!/bin/sh\necho no memory >&2\nexit 1\n")
    flags = tmp_path / "pkg-config"
    flags.write_text("#!/bin/sh\n")
    for file in (program, flags):
        file.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    with pytest.raises(ValueError, match="cannot be compiled: no memory"):
        built_runner(tmp_path)
    assert not list(tmp_path.glob("gazebo-*"))


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Iterator[BatchSimulation]:
    if (trouble := trouble_with_gazebo()) is not None:
        pytest.skip(trouble)
    made = stage_for("gazebo", None, CAR, nsim=3)
    yield made
    made.close()


@pytest.mark.judge
def test_it_goes_near_where_the_twin_goes(stage: BatchSimulation) -> None:
    ends = []
    for place in (stage, BatchSimulation(None, CAR, nsim=3)):
        seed(place, states(3, speed=np.array([5.0, 8.0, 10.0])), delay=0.1)
        accel, tire = np.array([0.0, -2.0, 1.0]), np.array([0.1, 0.05, -0.02])
        ends.append(drive(place, 40, accel=accel, tire=tire)[:, -1])
    assert np.hypot(*(ends[0] - ends[1])[:, :2].T).max() < 0.5
    assert ends[0][:, 3] == pytest.approx(ends[1][:, 3], abs=0.3)


@pytest.mark.judge
def test_it_stops_stands_and_begins_anew_the_same(stage: BatchSimulation) -> None:
    runs = []
    for _ in range(2):
        seed(stage, states(1, speed=4.0))
        runs.append(drive(stage, 40, accel=-4.0)[0])
    assert abs(runs[0][-1, 3]) < 0.02
    assert np.array_equal(runs[0], runs[1])


@pytest.mark.judge
def test_a_job_is_played_and_its_process_is_gone_afterwards() -> None:
    if (trouble := trouble_with_gazebo()) is not None:
        pytest.skip(trouble)
    nominal = job((Future(index=0, name="nominal"),), horizon_s=4.0)
    there = run_alone(msgspec.structs.replace(nominal, engine="gazebo"), crossroads(), CAR)
    here = run_alone(nominal, crossroads(), CAR)
    apart = here.trajectory.states[0, -1, :2] - there.trajectory.states[0, -1, :2]
    assert there.outcome.valid.all()
    assert np.hypot(*apart) < 0.5
    engine = Gazebo(CAR)
    assert Path(f"/proc/{engine.process_id}").exists()
    engine.close()
    assert not Path(f"/proc/{engine.process_id}").exists()
