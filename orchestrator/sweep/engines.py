"""Who plays a sweep: worker processes of this machine, or seats on Ray."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from foretwin.contracts.did_you_mean import one_of
from foretwin.contracts.errors import UserError
from foretwin.contracts.log_file import JsonLines, LogFile
from foretwin.contracts.one_heap import share_one_heap
from foretwin.contracts.owned_folder import temporary_folder
from foretwin.contracts.runner import Runner
from foretwin.contracts.setup import WorkerSetup
from foretwin.orchestrator.processors import trouble_with_workers
from foretwin.orchestrator.runner.worker_processes import WorkerProcesses
from foretwin.orchestrator.sweep.folder import built_worlds, planner_origins
from foretwin.orchestrator.sweep.spec import Loaded
from foretwin.orchestrator.sweep.workers import task_timeout_s, worker_setup
from foretwin.orchestrator.sweep.worlds import SUFFIX

ENGINES = "zenoh", "ray"
PROCESSES = 2
"""So many worker processes, unless told otherwise."""


class Engine(NamedTuple):
    """By what a sweep is played; `workers` None is the usual number, with Ray all processors."""

    name: str = "zenoh"
    workers: int | None = None
    address: str | None = None
    """Of a Ray cluster; None starts one on this machine for as long as the sweep takes."""

    def check(self) -> None:
        """Raise UserError, in one line, for what cannot be."""
        if self.name not in ENGINES:
            raise UserError(f"--engine {self.name}: {one_of(self.name, ENGINES)}")
        if self.address is not None:
            if self.name != "ray":
                raise UserError(f"--address {self.address}: goes with --engine ray alone")
            if self.workers is not None and self.workers < 1:
                raise UserError(f"--workers {self.workers}: at least 1")
        elif self.workers is not None and (trouble := trouble_with_workers(self.workers)):
            raise UserError(trouble)


LOCAL = Engine()


@contextlib.contextmanager
def workers_for(loaded: Loaded, out: Path, engine: Engine) -> Iterator[Runner]:
    """Give a runner that plays a sweep into the folder `out`, and end all that it started."""
    setup, timeout_s = worker_setup(loaded, out), task_timeout_s(loaded)
    if engine.name == "ray":
        with _seats_on_ray(
            setup, engine, out=out, planners=planner_origins(loaded), timeout_s=timeout_s
        ) as runner:
            yield runner
        return
    share_one_heap()
    count = PROCESSES if engine.workers is None else engine.workers
    with (
        temporary_folder("foretwin-sweep-") as folder,
        WorkerProcesses(count, setup, task_timeout_s=timeout_s, folder=folder) as processes,
    ):
        yield processes


@contextlib.contextmanager
def _seats_on_ray(
    setup: WorkerSetup, engine: Engine, *, out: Path, planners: Iterable[str], timeout_s: float
) -> Iterator[Runner]:
    from foretwin.orchestrator.runner.ray_cluster import ray_cluster
    from foretwin.orchestrator.runner.ray_runner import RayRunner
    from foretwin.sim_worker.seat import SeatSetup, made_of

    seat = SeatSetup(worker=setup, made_of=made_of(planners), limit_s=timeout_s)
    with (
        _log_of_the_sweep(setup) as log,
        ray_cluster(seat, address=engine.address, processors=engine.workers) as cluster,
    ):
        yield RayRunner(
            cluster,
            world_file=lambda name: (built_worlds(out) / f"{name}{SUFFIX}").read_bytes(),
            task_timeout_s=timeout_s,
            most=engine.workers if engine.address else None,
            log=log,
        )


@contextlib.contextmanager
def _log_of_the_sweep(setup: WorkerSetup) -> Iterator[Callable[[bytes], None]]:
    """Let this process's log go to the sweep's too; give what adds a seat's lines as they are."""
    own, seats = (LogFile(Path(setup.log_file)) for _ in range(2))
    own.setFormatter(JsonLines("orchestrator"))
    logger = logging.getLogger("orchestrator")
    logger.addHandler(own)

    def add(line: bytes) -> None:
        text = line.decode(errors="replace")
        seats.handle(logging.LogRecord("seat", logging.WARNING, "", 0, text, (), None))

    try:
        yield add
    finally:
        logger.removeHandler(own)
        own.close()
        seats.close()
