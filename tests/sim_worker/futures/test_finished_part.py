"""A finished part: whole files that say everything of a job's cells, and what they come to."""

from __future__ import annotations

import functools
import hashlib

import msgspec
import pyarrow as pa
import pyarrow.parquet as pq

from foretwin.contracts.futures import Future, Job
from foretwin.contracts.job_identity import job_bytes
from foretwin.contracts.parts import CaseCount, FinishedPart
from foretwin.contracts.runner import job_task
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.finished_part import count_cases, finished_part
from foretwin.sim_worker.futures.future_mix import plan_futures
from foretwin.sim_worker.futures.job_tables import JOB_TABLES
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.scenarios.drawing import draw_cases
from foretwin.sim_worker.scenarios.reading import catalogue
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.sim_worker.futures.cells import cells_for
from tests.sim_worker.places import crossroads, job

FOUR = job(plan_futures(count=4, seed=0, planners=["pure_pursuit_idm"]), horizon_s=1.0)


@functools.cache
def part_of(question: Job = FOUR) -> FinishedPart:
    result = run_job(question, BatchSimulation(crossroads(), load_vehicle(), nsim=4))
    return finished_part(question, job_bytes(question), result, cells_for(question))


def read(part: FinishedPart, table: str) -> pa.Table:
    return pq.read_table(pa.BufferReader(part.tables[table]))


def test_rows_say_of_which_cells_they_are_and_not_who_played_them() -> None:
    rows = read(part_of(), "futures").to_pylist()
    assert [row["cell"] for row in rows] == [100, 101, 102, 103]
    assert [row["case"] for row in rows] == [0, 1, 2, 3]
    assert rows[2]["place"] == "place 2"
    assert {(row["junction_id"], row["vehicle"], row["worker_id"]) for row in rows} == {
        ("n1", "named", None)
    }
    assert all(row["trajectory_sha256"] for row in rows)


def test_every_table_is_a_whole_file_with_its_columns_and_whose_map_it_is() -> None:
    part = part_of()
    assert list(part.tables) == ["road_users", "jobs", "futures"]
    for name in part.tables:
        table = read(part, name)
        assert table.schema.equals(JOB_TABLES[name])
        assert table.schema.metadata[b"attribution"].decode() == "© somebody"
        assert {b"versions", b"processor"} <= table.schema.metadata.keys()
    assert read(part, "jobs")["job"].to_pylist() == [job_bytes(FOUR).data]
    assert part.job_sha256 == job_bytes(FOUR).sha256


def test_the_hash_is_of_the_rows_as_they_are_read() -> None:
    digest = hashlib.sha256()
    for row in read(part_of(), "futures").to_pylist():
        digest.update(msgspec.msgpack.encode(row))
    assert part_of().rows_sha256 == digest.hexdigest()


def test_without_a_result_every_row_says_why() -> None:
    part = finished_part(FOUR, job_bytes(FOUR), None, cells_for(FOUR), failure="no answer in 1 s")
    rows = read(part, "futures").to_pylist()
    assert [row["failure"] for row in rows] == 4 * ["no answer in 1 s"]
    assert part.given_up == 4
    assert part_of().given_up == 0
    (count,) = part.counts
    assert (count.cases, count.placed, count.played, count.failed) == (4, 0, 0, 4)
    assert count.reasons == {"no answer in 1 s": 4}


def test_values_stand_in_the_order_of_the_scenario_though_jobs_sort_them() -> None:
    scenario = catalogue()["scp"]
    values = draw_cases(scenario)[0]
    one = Future(index=0, name="scp 0", scenario_id="scp", values=values)
    staged = msgspec.structs.replace(FOUR, futures=(one,), scenarios=(scenario,))
    named = job_bytes(staged)
    sent = job_task(staged, named).question.decoded()  # type: ignore[attr-defined]
    assert list(sent.futures[0].values) == sorted(values) != list(values)
    part = finished_part(sent, named, None, cells_for(sent), failure="not played")
    assert [name for name, _ in read(part, "futures")["values"][0].as_py()] == list(values)


def test_cases_are_counted_by_scenario_and_planner() -> None:
    played = {"scenario": "scp", "planner": "a", "failure": "", "left_out": "", "valid": True,
              "trajectory_sha256": "0", "collided": False, "min_clearance_m": 2.0}  # fmt: skip
    rows = [
        played,
        {**played, "collided": True, "min_clearance_m": None, "metric_driving_score": 0.5},
        {**played, "failure": "its planner failed", "valid": False, "min_clearance_m": None},
        {**played, "left_out": "too short", "trajectory_sha256": None, "valid": None},
        {**played, "planner": "b"},
    ]
    first, second = count_cases(rows)
    assert first == CaseCount(
        scenario="scp", planner="a", cases=4, placed=3, played=2, collided=1, failed=1,
        clearance_m=(2.0,), scores=(0.5,),
        reasons={"its planner failed": 1}, not_placed={"too short": 1},
    )  # fmt: skip
    assert (second.planner, second.cases, second.scores) == ("b", 1, ())
