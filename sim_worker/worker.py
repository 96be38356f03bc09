"""The worker process: keeps compiled stages of the last Worlds and answers jobs on them."""

from __future__ import annotations

import logging
import time
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import msgspec
import numpy as np
import scipy.spatial  # noqa: F401  A search for many points needs it: not within the first job.

from foretwin.contracts.bus import Bus, Mailbox, Request
from foretwin.contracts.cpu_use import cpu_taken_s
from foretwin.contracts.frames import local_from_geo
from foretwin.contracts.futures import EngineName, FuturesResult, Job
from foretwin.contracts.job_identity import JobBytes, vehicle_digest
from foretwin.contracts.placement import PlaceRequest, WorldPlaces
from foretwin.contracts.process import ProcessLife
from foretwin.contracts.refusals import Refusals
from foretwin.contracts.runner import JobAnswer, JobRequest
from foretwin.contracts.setup import STACK_LOGS, WorkerSetup
from foretwin.contracts.simulation import PrepareReply, PrepareRequest
from foretwin.contracts.trace import came, since, span
from foretwin.contracts.tuning import UseVehicle
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world_building import BuiltWorld, WantedWorld
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation, Controls
from foretwin.sim_worker.futures.run_job import run_job, stage_for
from foretwin.sim_worker.futures.scene import SceneMaker
from foretwin.sim_worker.futures.world_places import places_in
from foretwin.sim_worker.message_loop import passed_over_where_unfit
from foretwin.sim_worker.planner_interface import PlayAgain
from foretwin.sim_worker.planners.hosted import HostedPlanner
from foretwin.sim_worker.planners.registry import load_planner
from foretwin.sim_worker.planners.remote import RemotePlanner
from foretwin.sim_worker.planners.stack import StackPlanner
from foretwin.sim_worker.vehicle.parameters import check_vehicle
from foretwin.sim_worker.world_file import WorldFolder, WorldSource

if TYPE_CHECKING:
    from foretwin.sim_worker.world_building import WorldBuilder

_IDLE_S = 0.2

log = logging.getLogger("sim_worker")


class _Prepared(NamedTuple):
    stage: BatchSimulation
    scenes: SceneMaker


class SimulationCache:
    """Compiled stages of the Worlds used last; fetches a World on first use."""

    def __init__(
        self, setup: WorkerSetup, vehicle: VehicleParameters, *, worlds: WorldSource
    ) -> None:
        self._setup, self._vehicle, self._worlds = setup, vehicle, worlds
        self._stages: OrderedDict[tuple[str, EngineName], _Prepared] = OrderedDict()

    def get(self, world_id: str, engine: EngineName = "mujoco") -> _Prepared:
        """Return the stage of a World; raises as its source does where that has it not, and
        ValueError for an engine that is not here."""
        key = world_id, engine
        if key in self._stages:
            self._stages.move_to_end(key)
            return self._stages[key]
        with span("compile a World", world=world_id):
            prepared = self._compiled(world_id, engine)
        self._stages[key] = prepared
        while len(self._stages) > self._setup.kept_worlds:
            _, (stage, _) = self._stages.popitem(last=False)
            stage.close()
        return prepared

    def _compiled(self, world_id: str, engine: EngineName) -> _Prepared:
        setup, world = self._setup, self._worlds.world(world_id)
        stage = stage_for(
            engine,
            world,
            self._vehicle,
            nsim=setup.simulations,
            control_hz=setup.control_hz,
            threads=setup.threads,
        )
        return _Prepared(stage, SceneMaker(world))

    def use_vehicle(self, vehicle: VehicleParameters) -> None:
        """Change the parameters of the vehicle on every stage; Worlds stay compiled.

        Raises ValueError, and changes nothing, for what is no road vehicle any more.
        """
        self._vehicle = check_vehicle(vehicle, before=self._vehicle)
        for prepared in self._stages.values():
            prepared.stage.use_vehicle(vehicle)

    @property
    def world_ids(self) -> tuple[str, ...]:
        """Return the Worlds that are compiled, the one used last at the end."""
        return tuple(dict.fromkeys(world_id for world_id, _ in self._stages))

    def close(self) -> None:
        """End what engines have started."""
        for stage, _ in self._stages.values():
            stage.close()


class FuturesWorker:
    """Answers `prepare`, `use_vehicle`, `job`, `place`: in a process of its own, or in any.

    Its Worlds come from `worlds`; without, from the folder that the setup names. Once `leaves` says
    that the process should end, jobs that wait for a driving stack are refused.
    """

    def __init__(
        self,
        setup: WorkerSetup,
        *,
        worlds: WorldSource | None = None,
        refusals: Refusals | None = None,
        leaves: Callable[[], bool] = lambda: False,
    ) -> None:
        self._id = setup.process_id
        self._refusals = Refusals() if refusals is None else refusals
        self._worlds = WorldFolder(Path(setup.worlds_dir)) if worlds is None else worlds
        self._stages = self._cache(setup, setup.vehicle)
        self._vehicles = {vehicle_digest(v): v for v in setup.swept_vehicles}
        self._swept = {name: self._cache(setup, v) for name, v in self._vehicles.items()}
        self._version = 0
        self._began_s = cpu_taken_s()
        self._builder: WorldBuilder | None = None
        self.stacks = {
            name: StackPlanner(
                name,
                stack,
                folder=Path(setup.log_file).parent / STACK_LOGS,
                owner=setup.process_id,
                leaves=leaves,
            )
            for name, stack in setup.stacks
        }
        self._answers: dict[str, Callable[[msgspec.Struct], msgspec.Struct]] = {
            "prepare": self._prepare,
            "use_vehicle": self._use_vehicle,
            "job": self._job,
            "place": self._place,
            "build_world": self._build_world,
        }

    def _cache(self, setup: WorkerSetup, vehicle: VehicleParameters) -> SimulationCache:
        return SimulationCache(setup, vehicle, worlds=self._worlds)

    def handle(self, request: Request) -> None:
        """Answer one question; never raises: what cannot be answered is refused in one line."""
        since("in the queue", request.received_mono_ns, channel=request.channel)
        with span(request.channel):
            self._handle(request)

    def _handle(self, request: Request) -> None:
        with passed_over_where_unfit(request, refusals=self._refusals, log=log):
            request.reply(self.answer(request.channel, request.message()))

    def answer(self, channel: str, question: msgspec.Struct) -> msgspec.Struct:
        """Return the answer to a question; raises whatever keeps it from being answered."""
        if channel != "build_world":
            self._builder = None  # A map takes much memory, and no more of it is wanted.
        return self._answers[channel](question)

    def _prepare(self, question: msgspec.Struct) -> PrepareReply:
        assert isinstance(question, PrepareRequest)
        start = time.perf_counter()
        prepared = self._stages.get(question.world_id)
        warm_up(prepared.stage)
        prepared.scenes.warm_up()
        return PrepareReply(
            world_id=question.world_id,
            worker_id=self._id,
            seconds=time.perf_counter() - start,
        )

    def _use_vehicle(self, question: msgspec.Struct) -> UseVehicle:
        assert isinstance(question, UseVehicle)
        self._stages.use_vehicle(question.vehicle)
        self._version = question.version
        return question

    def _job(self, question: msgspec.Struct) -> JobAnswer:
        assert isinstance(question, JobRequest)
        came("job", question.sha256)
        with span("decode a job"):
            job = question.decoded()
        if job.vehicle_version != self._version:
            raise ValueError(
                f"job for version {job.vehicle_version} of the vehicle's parameters at a "
                f"worker with version {self._version}"
            )
        prepared = self._swept.get(job.vehicle, self._stages).get(job.world_id, job.engine)
        result = self._played(job, prepared)
        if question.cells is None:
            return JobAnswer(result=result, cpu_s=cpu_taken_s() - self._began_s)
        # Parquet takes 40 MB and 0.2 s to import, and a drive's workers write none.
        from foretwin.sim_worker.futures.finished_part import finished_part

        recorded = JobBytes(bytes(question.job), question.sha256)
        with span("rows"):
            return JobAnswer(part=finished_part(job, recorded, result, question.cells))

    def _played(self, job: Job, prepared: _Prepared) -> FuturesResult:
        """Play a job, from its start again where a driving stack was lost and says so."""
        while True:
            try:
                return run_job(
                    job,
                    prepared.stage,
                    worker_id=self._id,
                    scenes=prepared.scenes,
                    stacks=self.stacks,
                )
            except PlayAgain as lost:
                log.warning("job %s is played again: %s", job.job_index, lost)

    def close(self) -> None:
        """End the driving stacks and engines that it has started."""
        for stack in self.stacks.values():
            stack.close()
        for cache in (self._stages, *self._swept.values()):
            cache.close()

    def _place(self, question: msgspec.Struct) -> WorldPlaces:
        assert isinstance(question, PlaceRequest)
        world = self._worlds.world(question.world_id)
        return places_in(world, question, self._vehicles[question.vehicle])

    def _build_world(self, question: msgspec.Struct) -> BuiltWorld:
        assert isinstance(question, WantedWorld)
        if self._builder is None:
            # A drive's workers read no map.
            from foretwin.sim_worker.world_building import WorldBuilder

            self._builder = WorldBuilder()
        return self._builder.build(question)


def warm_up(stage: BatchSimulation) -> None:
    """Do once, before it counts, what a first job does first: project and step."""
    assert stage.world is not None
    origin = stage.world.frame.origin
    local_from_geo(stage.world.frame, origin.lat_deg, origin.lon_deg)
    stage.seed(np.zeros((1, 8)), steering_delay_s=np.zeros(1), friction_factor=np.ones(1))
    stage.step(Controls(np.zeros(1), np.zeros(1)))


def connect_planners(setup: WorkerSetup, bus: Bus) -> None:
    """Load the planners of a worker before its first job; one that cannot be refuses that job.

    In a live drive they have rounds to keep; in lock step, and in sweeps, no clock runs.
    """
    if "remote" in setup.planners:
        remote = load_planner("remote")
        assert isinstance(remote, RemotePlanner)
        lock_step = setup.bus.lossless
        remote.connect(bus, run=setup.run_id, process=setup.process_id, lock_step=lock_step)
    for name in setup.planners:
        try:
            planner = load_planner(name)
            if isinstance(planner, HostedPlanner) and not setup.bus.lossless:
                planner.keep_pace()
        except ValueError as error:
            log.warning("%s", error)


def serve_futures(setup: WorkerSetup, bus: Bus, life: ProcessLife) -> None:
    """Answer until the run is over; alive only once it can take work."""
    worker = FuturesWorker(setup, refusals=life.refusals, leaves=lambda: life.over)
    mailbox = Mailbox(64)
    ids = {"run": setup.run_id, "process": setup.process_id}
    for channel in ("prepare", "use_vehicle", "job", "place", "build_world"):
        bus.serve(channel, mailbox, **ids)
    connect_planners(setup, bus)
    life.ready()
    while not life.over:
        request = mailbox.take(_IDLE_S)
        if isinstance(request, Request):
            worker.handle(request)
    worker.close()
