"""What a sweep would say of a job's futures."""

from __future__ import annotations

from foretwin.contracts.futures import Job
from foretwin.contracts.parts import JobCells


def cells_for(job: Job, *, first: int = 100) -> JobCells:
    """Return cells from a number on, one for each future."""
    return JobCells(
        first=first,
        junction_id="n1",
        vehicle="named",
        scenarios=tuple(future.scenario_id for future in job.futures),
        cases=tuple(range(len(job.futures))),
        places=tuple(f"place {future.index}" for future in job.futures),
        attribution="© somebody",
    )
