"""From a job and its result to the finished part of a sweep: by who played it, wherever that is."""

from __future__ import annotations

import collections
import hashlib
from collections.abc import Iterable

import msgspec
import pyarrow as pa

from foretwin.contracts.futures import FuturesResult, Job
from foretwin.contracts.job_identity import JobBytes
from foretwin.contracts.parts import CaseCount, FinishedPart, JobCells
from foretwin.sim_worker.futures.checked_parquet import parquet_writer
from foretwin.sim_worker.futures.future_rows import Row, future_rows
from foretwin.sim_worker.futures.job_tables import as_table, job_row, played_with, road_user_rows
from foretwin.sim_worker.scenarios.reading import numbers

_SCORE = "metric_driving_score"


def finished_part(
    job: Job,
    recorded: JobBytes,
    result: FuturesResult | None,
    cells: JobCells,
    *,
    failure: str = "",
) -> FinishedPart:
    """Return the part of a job; without a result, all its rows say in `failure` why."""
    rows = future_rows(job, result, job_sha256=recorded.sha256)
    order = {scenario.id: [n.name for n in numbers(scenario)] for scenario in job.scenarios}
    of_cells = zip(cells.scenarios, cells.cases, cells.places, strict=True)
    for number, (row, future, (scenario, case, place)) in enumerate(
        zip(rows, job.futures, of_cells, strict=True), cells.first
    ):
        row |= {"cell": number, "scenario": scenario, "case": case, "place": place}
        row |= {"junction_id": cells.junction_id, "vehicle": cells.vehicle, "worker_id": None}
        if future.scenario_id:  # Jobs travel with their names sorted.
            names = order[future.scenario_id]
            row["values"] = [(name, future.values[name]) for name in names if name in future.values]
        if failure:
            row["failure"] = failure
    metadata = {"attribution": cells.attribution, **played_with()}
    tables = {
        "road_users": as_table("road_users", road_user_rows(job, recorded.sha256), metadata),
        "jobs": as_table("jobs", [job_row(job, recorded)], metadata),
        "futures": as_table("futures", rows, metadata),
    }
    return FinishedPart(
        job_sha256=recorded.sha256,
        tables={name: parquet_bytes(table) for name, table in tables.items()},
        rows_sha256=rows_sha256(tables["futures"]),
        counts=count_cases(rows),
        given_up=sum(row.get("valid") is None and not row["left_out"] for row in rows),
    )


def parquet_bytes(table: pa.Table) -> bytes:
    """Return a table as the bytes of a file."""
    file = pa.BufferOutputStream()
    with parquet_writer(file, table.schema) as writer:
        writer.write_table(table)
    data: bytes = file.getvalue().to_pybytes()
    return data


def rows_sha256(futures: pa.Table) -> str:
    """Return the hash of rows as whoever reads them finds them."""
    digest = hashlib.sha256()
    for row in futures.to_pylist():
        digest.update(msgspec.msgpack.encode(row))
    return digest.hexdigest()


def count_cases(rows: Iterable[Row]) -> tuple[CaseCount, ...]:
    """Return what came of rows, by scenario and planner; a case that cannot be played at its place
    is not placed, and one that fails is not played: it collides with nobody and has no score."""
    groups: dict[tuple[str, str], list[Row]] = collections.defaultdict(list)
    for row in rows:
        groups[row["scenario"], row["planner"]].append(row)
    return tuple(_counted(*names, group) for names, group in sorted(groups.items()))


def _counted(scenario: str, planner: str, rows: list[Row]) -> CaseCount:
    placed = [row for row in rows if not row["left_out"] and row.get("trajectory_sha256")]

    def known(name: str) -> tuple[float, ...]:
        return tuple(row[name] for row in placed if row.get(name) is not None)

    return CaseCount(
        scenario=scenario,
        planner=planner,
        cases=len(rows),
        placed=len(placed),
        played=sum(bool(row["valid"]) for row in placed),
        collided=sum(bool(row["collided"]) for row in placed),
        failed=sum(bool(row["failure"]) for row in rows),
        clearance_m=known("min_clearance_m"),
        scores=known(_SCORE),
        reasons=dict(collections.Counter(row["failure"] for row in rows if row["failure"])),
        not_placed=dict(collections.Counter(row["left_out"] for row in rows if row["left_out"])),
    )
