"""A small sweep over a drawn crossing, for tests."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from foretwin.contracts.futures import FuturesResult
from foretwin.contracts.job_identity import job_bytes
from foretwin.orchestrator.sweep.jobs import JobMaker, cell_rows
from foretwin.orchestrator.sweep.plan import SweepPlan
from foretwin.orchestrator.sweep.play import PlaySetup, SweepWorker
from foretwin.orchestrator.sweep.pool import Task
from foretwin.orchestrator.sweep.spec import Loaded, worlds_folder
from foretwin.sim_worker.futures.future_rows import Row
from foretwin.world_gen.world_store import WorldStore
from tests.sim_worker.scenarios.worlds import cross

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


class Alone:
    """A crew of this process alone: what it answers is what any worker would."""

    def __init__(self, loaded: Loaded) -> None:
        worlds = worlds_folder(loaded.spec)
        self._worker = SweepWorker(PlaySetup(loaded=loaded, worlds_dir=str(worlds)))

    def run(self, tasks: Sequence[Task], done: Callable[[Task, object], None]) -> None:
        for task in tasks:
            done(task, self._worker.answer(task.question))


def rows_of(worker: SweepWorker, plan: SweepPlan, loaded: Loaded, *, step: int = 1) -> list[Row]:
    """Play the jobs of a plan one by one, in their order or, with -1, from the last."""
    maker, rows = JobMaker(loaded, plan.worlds), []
    for planned in plan.jobs[::step]:
        job = maker.job(planned)
        result = worker.answer(job)
        assert isinstance(result, FuturesResult)
        rows += cell_rows(planned, job, job_bytes(job).sha256, result)
    return rows
