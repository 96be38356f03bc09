"""A small sweep over a drawn crossing, for tests."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import pyarrow as pa
import pyarrow.parquet as pq

from foretwin.contracts.job_identity import job_bytes
from foretwin.contracts.placement import WorldPlaces
from foretwin.contracts.runner import Runner, answers, job_task, place_task
from foretwin.orchestrator.sweep.jobs import JobMaker, cells_of, place_request
from foretwin.orchestrator.sweep.plan import SweepPlan
from foretwin.orchestrator.sweep.spec import Loaded, worlds_folder
from foretwin.orchestrator.sweep.workers import worker_setup
from foretwin.sim_worker.futures.future_rows import Row
from foretwin.world_gen.world_store import WorldStore
from tests.sim_worker.scenarios.worlds import cross

if TYPE_CHECKING:
    from tests.sim_worker.in_process_runner import InProcessRunner

SMALL = """
worlds = "{worlds}"
scenarios = ["scp", "cpta", "reversing_parking"]
cases = 2
planners = ["pure_pursuit_idm", "constant_speed"]
horizon_s = 5.0
metrics = ["ttc", "driving_score"]

[parameters]
friction_factor = [1.0, 0.4]
"""


def small_sweep(folder: Path, text: str = SMALL) -> Path:
    """Write a sweep's file, and the World that it is about, into a folder."""
    WorldStore(folder / "drawn").save(cross())
    spec = folder / "small.toml"
    spec.write_text(text.format(worlds=folder / "drawn"))
    return spec


def alone(loaded: Loaded) -> InProcessRunner:
    """A runner of this process alone: what it answers is what any worker would."""
    # What it takes is not to count as a sweep's where that is measured.
    from tests.sim_worker.in_process_runner import InProcessRunner

    setup = worker_setup(loaded, Path("nowhere"))
    there = str(worlds_folder(loaded.spec))
    return InProcessRunner(msgspec.structs.replace(setup, worlds_dir=there))


def places_of(runner: Runner, loaded: Loaded, world_id: str) -> WorldPlaces:
    """Ask where the scenarios of a sweep take place."""
    (answer,) = answers(runner, [place_task(place_request(loaded, world_id))])
    assert isinstance(answer.message, WorldPlaces), answer.failure
    return answer.message


def rows_of(runner: Runner, plan: SweepPlan, loaded: Loaded, *, step: int = 1) -> list[Row]:
    """Play the jobs of a plan one by one, in their order or, with -1, from the last."""
    maker, rows = JobMaker(loaded), []
    for planned in list(plan.planned())[::step]:
        job = maker.job(planned)
        cells = cells_of(planned, plan.attribution)
        (answer,) = answers(runner, [job_task(job, job_bytes(job), cells=cells)])
        part = pa.BufferReader(answer.message.part.tables["futures"])
        rows += pq.read_table(part).to_pylist()
    return rows
