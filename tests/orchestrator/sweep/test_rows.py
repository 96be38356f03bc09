"""What comes back of a job is its finished part, or is refused in words."""

from __future__ import annotations

import functools

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from msgspec.structs import replace

from foretwin.contracts.futures import Job
from foretwin.contracts.job_identity import job_bytes
from foretwin.contracts.parts import FinishedPart
from foretwin.orchestrator.sweep.rows import Due, fault_in
from foretwin.sim_worker.futures.finished_part import finished_part, parquet_bytes
from foretwin.sim_worker.futures.future_mix import plan_futures
from tests.sim_worker.futures.cells import cells_for
from tests.sim_worker.places import job


@functools.cache
def planned(count: int = 4) -> Job:
    return job(plan_futures(count=count, seed=0, planners=["pure_pursuit_idm"]), horizon_s=1.0)


def part_of(question: Job, *, first: int = 100) -> FinishedPart:
    cells = cells_for(question, first=first)
    return finished_part(question, job_bytes(question), None, cells, failure="not played")


def fault(part: FinishedPart | None) -> str:
    question = planned()
    return fault_in(
        part,
        Due(
            number=0,
            job_sha256=job_bytes(question).sha256,
            planner="pure_pursuit_idm",
            road_users=0,
            cells=cells_for(question),
        ),
    )


def with_table(name: str, data: bytes) -> FinishedPart:
    part = part_of(planned())
    return replace(part, tables={**part.tables, name: data})


def futures(part: FinishedPart) -> pa.Table:
    return pq.read_table(pa.BufferReader(part.tables["futures"]))


def test_the_part_of_a_job_has_no_fault() -> None:
    assert fault(part_of(planned())) == ""


@pytest.mark.parametrize("table", ["futures", "jobs", "road_users"])
def test_what_is_no_whole_file_of_parquet_is_refused(table: str) -> None:
    whole = part_of(planned()).tables[table]
    for data in (b"", b"garbage", whole[:-1], whole[: len(whole) // 2], b"PAR1" + whole[4:-8]):
        assert fault(with_table(table, data)).startswith("no Parquet: ")


def test_the_part_of_another_job_or_of_other_cells_is_refused() -> None:
    whole, other = part_of(planned()), part_of(planned(3))
    assert fault(None) == fault(other) == "no part of this job"
    assert fault(replace(other, job_sha256=whole.job_sha256)) == "3 rows of futures; 4 are due"
    elsewhere = part_of(planned(), first=0)
    assert fault(elsewhere) == "futures of another cell"
    named = futures(whole)
    place = named.schema.get_field_index("job_sha256")
    renamed = named.set_column(place, named.schema[place], pa.array(4 * ["0" * 64]))
    assert fault(with_table("futures", parquet_bytes(renamed))) == "futures of another job_sha256"


def test_other_tables_columns_counts_and_hashes_are_refused() -> None:
    whole = part_of(planned())
    assert fault(replace(whole, tables={})) == "holds tables none"
    fewer = futures(whole).drop_columns(["metric_ttc"])
    assert fault(with_table("futures", parquet_bytes(fewer))) == "futures have other columns"
    (count,) = whole.counts
    for wrong in ((), (replace(count, cases=3),), (replace(count, planner="x"),)):
        assert fault(replace(whole, counts=wrong)) == "counts other rows than it holds"
    assert fault(replace(whole, rows_sha256="0")) == "no hash of its rows"
