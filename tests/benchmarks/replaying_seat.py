"""A seat that computes nothing: it plays one job, and gives the rows of that for every other."""

from __future__ import annotations

import msgspec
import pyarrow as pa
import pyarrow.parquet as pq

from foretwin.contracts.bus import Bus, Mailbox, Request
from foretwin.contracts.parts import CaseCount, FinishedPart, JobCells
from foretwin.contracts.process import ProcessLife, run_process
from foretwin.contracts.runner import JobAnswer, JobRequest
from foretwin.contracts.setup import WorkerSetup
from foretwin.sim_worker.worker import FuturesWorker

CHECKED = ["job_sha256", "cell"]
"""Columns of which the ends of files tell the least and the greatest value."""


class ReplayingSeat:
    """Answers as a worker does, jobs with the rows of the first one under their own names."""

    def __init__(self, setup: WorkerSetup) -> None:
        self._worker = FuturesWorker(setup)
        self._first: FinishedPart | None = None

    def answer(self, channel: str, question: msgspec.Struct) -> msgspec.Struct:
        """Return the answer to a question; raises what a worker raises."""
        if not isinstance(question, JobRequest) or question.cells is None:
            return self._worker.answer(channel, question)
        if self._first is None:
            answer = self._worker.answer(channel, question)
            assert isinstance(answer, JobAnswer)
            self._first = answer.part
            assert self._first is not None
            self._futures = pq.read_table(pa.BufferReader(self._first.tables["futures"]))
            self._job = pq.read_table(pa.BufferReader(self._first.tables["jobs"]))
        return JobAnswer(part=self._renamed(question, question.cells))

    def _renamed(self, question: JobRequest, cells: JobCells) -> FinishedPart:
        assert self._first is not None
        count = len(cells.cases)
        names = {
            "job_sha256": count * [question.sha256],
            "cell": range(cells.first, cells.first + count),
        }
        futures = _with(self._futures.slice(0, count), names)
        job = _with(self._job, {"job_sha256": [question.sha256], "job": [bytes(question.job)]})
        (like, *_) = self._first.counts
        return FinishedPart(
            job_sha256=question.sha256,
            tables={
                "road_users": self._first.tables["road_users"],
                "jobs": _parquet(job),
                "futures": _parquet(futures),
            },
            rows_sha256=question.sha256,
            counts=_counts(like, cells, question),
        )


def _counts(like: CaseCount, cells: JobCells, question: JobRequest) -> tuple[CaseCount, ...]:
    planner = question.decoded().futures[0].planner
    return tuple(
        msgspec.structs.replace(
            like,
            scenario=scenario,
            planner=planner,
            cases=cells.scenarios.count(scenario),
            clearance_m=like.clearance_m[:1] * cells.scenarios.count(scenario),
        )
        for scenario in sorted(set(cells.scenarios))
    )


def _with(table: pa.Table, columns: dict[str, object]) -> pa.Table:
    for name, values in columns.items():
        place = table.schema.get_field_index(name)
        table = table.set_column(
            place, table.schema.field(place), pa.array(values, table.schema.field(place).type)
        )
    return table


def _parquet(table: pa.Table) -> bytes:
    file = pa.BufferOutputStream()
    told = [name for name in CHECKED if name in table.schema.names]
    pq.write_table(table, file, compression="zstd", use_dictionary=False, write_statistics=told)
    data: bytes = file.getvalue().to_pybytes()
    return data


def serve(setup: WorkerSetup, bus: Bus, life: ProcessLife) -> None:
    """Answer until the run is over."""
    seat, mailbox = ReplayingSeat(setup), Mailbox(64)
    for channel in ("job", "place"):
        bus.serve(channel, mailbox, run=setup.run_id, process=setup.process_id)
    life.ready()
    while not life.over:
        request = mailbox.take(0.1)
        if isinstance(request, Request):
            request.reply(seat.answer(request.channel, request.message()))


if __name__ == "__main__":
    run_process(WorkerSetup, serve)
