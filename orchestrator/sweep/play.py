"""What a sweep's worker processes do: find places in a World, and play jobs there."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec

from foretwin.contracts.errors import one_line
from foretwin.contracts.futures import FuturesResult, Job
from foretwin.contracts.job_identity import vehicle_digest
from foretwin.orchestrator.sweep.places import places_in
from foretwin.orchestrator.sweep.plan import WorldPlaces
from foretwin.orchestrator.sweep.pool import Lost
from foretwin.orchestrator.sweep.spec import FUTURES_PER_JOB, Loaded
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.worker import StageCache
from foretwin.sim_worker.world_file import load_world

_KEPT_STAGES = 2


class PlaySetup(msgspec.Struct, frozen=True, kw_only=True):
    """What a worker of a sweep is started with."""

    loaded: Loaded
    worlds_dir: str


class PlaceQuestion(msgspec.Struct, frozen=True, kw_only=True):
    """Where do the scenarios take place in this World?"""

    world_id: str


def start_worker(setup: PlaySetup) -> Callable[[PlaceQuestion | Job], Any]:
    """Return what answers a sweep's questions in this process."""
    return SweepWorker(setup).answer


class SweepWorker:
    """Answers where scenarios take place, and what becomes of jobs; keeps compiled stages."""

    def __init__(self, setup: PlaySetup) -> None:
        self._loaded = setup.loaded
        self._worlds_dir = Path(setup.worlds_dir)
        self._stages = {
            vehicle_digest(vehicle): StageCache(
                self._worlds_dir, vehicle, control_hz=setup.loaded.spec.control_hz,
                nsim=FUTURES_PER_JOB, kept=_KEPT_STAGES,
            )
            for vehicle in setup.loaded.vehicles.values()
        }  # fmt: skip

    def answer(self, question: PlaceQuestion | Job) -> WorldPlaces | FuturesResult | Lost:
        """Return the places in a World, or what became of a job; says why where it cannot."""
        try:
            if isinstance(question, PlaceQuestion):
                return places_in(load_world(self._worlds_dir, question.world_id), self._loaded)
            prepared = self._stages[question.vehicle].get(question.world_id)
            return run_job(question, prepared.stage, scenes=prepared.scenes)
        except Exception as error:  # one bad World or job never stops the sweep
            return Lost(one_line(error))
