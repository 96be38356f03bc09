"""The probe plays what rounds play, to the same bits each time."""

from __future__ import annotations

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest

from foretwin.contracts.frames import local_pose
from foretwin.contracts.runner import JobRequest
from foretwin.orchestrator.rounds.probe import probe_task
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.result_digest import result_digest
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.orchestrator.trip import town, town_plan, town_world
from tests.sim_worker.places import crossroads

CAR = load_vehicle()


@pytest.mark.parametrize("which", [1, 2])
def test_a_probe_holds_faults_scenarios_and_road_users(tmp_path: Path, which: int) -> None:
    config = town_plan(tmp_path, futures=24, futures_per_job=12).config
    world = town_world(town().junctions[which].summary.id)
    task, again = (probe_task(config, world, CAR, 0) for _ in range(2))
    assert task == again
    assert task is not None
    assert isinstance(task.question, JobRequest)
    job = task.question.decoded()
    assert len(job.futures) == 12
    assert job.accidents
    results = [run_job(job, BatchSimulation(world, CAR, nsim=12)) for _ in range(2)]
    assert result_digest(results[0]) == result_digest(results[1])
    assert results[0].outcome.valid.all()
    assert results[0].outcome.progress_m.max() > 40.0
    happens = {future.scenario_id for future in job.futures} - {""}
    assert len(happens) >= 3
    assert results[0].road_users.kinds.size


def test_a_probe_begins_forty_metres_before_its_junction(tmp_path: Path) -> None:
    config, world = town_plan(tmp_path).config, crossroads()
    task = probe_task(config, world, CAR, 3)
    assert task is not None
    assert isinstance(task.question, JobRequest)
    job = task.question.decoded()
    at, xy_m = job.state, job.path.xy_m
    here = local_pose(world.frame, at.position, at.yaw_rad)
    (across,) = {
        one.id: one for one in world.connections
        if np.hypot(*(xy_m - one.centerline[0]).T).min() < 0.6
        and np.hypot(*(xy_m - one.centerline[-1]).T).min() < 0.6
    }.values()  # fmt: skip

    assert (at.speed_mps, at.stamp_ns, job.vehicle_version) == (8.0, 0, 3)
    assert job.round_id == 2_147_483_647, "that of no round"
    assert (job.cruise_speed_mps, set(job.speed_ahead_mps)) == (8.0, {8.0})
    assert math.dist(here[:2], xy_m[0]) == pytest.approx(5.0, abs=0.2)
    assert math.dist(here[:2], across.centerline[0]) == pytest.approx(40.0, abs=1.1)
    ahead = xy_m[6] - xy_m[5]
    assert here.yaw_rad == pytest.approx(math.atan2(ahead[1], ahead[0]), abs=0.02)


def test_where_nothing_can_be_driven_there_is_none(tmp_path: Path) -> None:
    bare = msgspec.structs.replace(crossroads(), connections=())
    assert probe_task(town_plan(tmp_path).config, bare, CAR, 0) is None


def test_a_way_that_leads_out_of_the_world_is_none(tmp_path: Path) -> None:
    config, world = town_plan(tmp_path).config, crossroads()
    cut = tuple(lane for lane in world.lanes if lane.id.startswith("from_"))
    assert probe_task(config, world, CAR, 0) is not None
    assert probe_task(config, msgspec.structs.replace(world, lanes=cut), CAR, 0) is None
