"""A recorded drive in lock step, in this process: mission, Worlds and the nominal future alone.

Its comparisons are those of the table that `foretwin drive --speed max` writes.
"""

from __future__ import annotations

from typing import NamedTuple

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.forecast import ForecastOutcome
from foretwin.contracts.futures import FuturesResult, Job
from foretwin.contracts.simulation import Comparison
from foretwin.contracts.world import World
from foretwin.orchestrator.config import DriveConfig
from foretwin.orchestrator.drive.mission import Mission, MissionSettings
from foretwin.orchestrator.drive.plan import read_inputs
from foretwin.orchestrator.drive.start_worlds import WITHIN_M, junctions_at_start
from foretwin.orchestrator.instructions import BuildWorld, Instruction, LatestReports, RoundIntent
from foretwin.orchestrator.plan import DriveInputs
from foretwin.orchestrator.rounds.comparisons import OpenComparisons
from foretwin.orchestrator.rounds.jobs import RoundPlanner
from foretwin.orchestrator.rounds.progress_forecasts import ProgressForecasts
from foretwin.orchestrator.runner.open_rounds import RoundDone, RoundOrder
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.futures.scene import SceneMaker
from foretwin.telemetry.estimator.estimator import estimator_of
from foretwin.telemetry.logs.opening import open_log
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.map_index import index_map


class Round(NamedTuple):
    """A round of a drive: its World, what was meant to be driven, and the state it began in.

    `acceleration_mps2` is the trend of the speed over the last second.
    """

    number: int
    world: World
    intent: RoundIntent
    state: VehicleState
    acceleration_mps2: float
    job: Job
    """Of its nominal future."""


class _Builder:
    """Worlds and stages of one map, each made once."""

    def __init__(self, inputs: DriveInputs) -> None:
        self._inputs = inputs
        self._index = index_map(inputs.osm, inputs.graph, inputs.junctions)
        self._junctions = {junction.summary.id: junction for junction in inputs.junctions}
        self._worlds: dict[str, World] = {}
        self.by_id: dict[str, World] = {}
        self._stages: dict[str, tuple[BatchSimulation, SceneMaker]] = {}

    def world(self, junction_id: str) -> World:
        if junction_id not in self._worlds:
            self._worlds[junction_id] = build_world(
                self._inputs.osm, self._inputs.graph, self._junctions[junction_id],
                radius_m=self._inputs.config.radius_m, index=self._index,
            )  # fmt: skip
            self.by_id[self._worlds[junction_id].id] = self._worlds[junction_id]
        return self._worlds[junction_id]

    def stage(self, world: World) -> tuple[BatchSimulation, SceneMaker]:
        if world.id not in self._stages:
            stage = BatchSimulation(world, self._inputs.vehicle, nsim=1)
            self._stages[world.id] = stage, SceneMaker(world)
        return self._stages[world.id]


class LockStep:
    """A recorded drive from sample to sample, with the nominal `futures` of its rounds or not."""

    def __init__(self, config: DriveConfig, *, futures: bool = True) -> None:
        self._futures = futures
        inputs = read_inputs(config.validate())
        assert inputs.log_file is not None
        self._inputs, self._log = inputs, open_log(inputs.log_file)
        self._start_ns = self._log.info.start_stamp_ns
        vehicle = inputs.vehicle
        self._estimator = estimator_of(self._log.info, vehicle)
        self.mission = Mission(
            inputs.way_ahead(),
            MissionSettings(
                radius_m=config.radius_m,
                look_ahead_s=config.look_ahead_s,
                horizon_s=config.horizon_s,
            ),
            start_stamp_ns=self._start_ns,
        )
        self._builder, self._planner = _Builder(inputs), RoundPlanner(config, vehicle)
        self._forecasts = None
        if inputs.progress is not None:
            self._forecasts = ProgressForecasts(inputs.progress, horizon_s=config.horizon_s)
        self._desk = OpenComparisons(inputs.drive_frame, config.horizon_s)
        self._asked: set[str] = set()
        self._wanted: list[Instruction] = []
        self._latest: VehicleState | None = None
        self.rounds: list[Round] = []
        self.comparisons: list[Comparison] = []
        self.outcomes: list[ForecastOutcome] = []

    def run(self) -> LockStep:
        if self._inputs.routes:
            first = junctions_at_start(self._inputs.routes[0], self._inputs.junctions, WITHIN_M)
            self._wanted += self.mission.before_start(first, mono_s=0.0)
            self._build()
        until_ns, period_ns = self._start_ns, round(1e9 / self._inputs.config.rate_hz)
        for channel, message in self._log.samples():
            while message.stamp_ns > until_ns:  # type: ignore[attr-defined]
                self._build()
                self._round()
                until_ns += period_ns
            self._take(self._estimator.handle(channel, message))
        self.comparisons += self._desk.flush()
        return self

    def _take(self, state: VehicleState | None) -> None:
        if state is None:
            return
        self._latest = state
        if self._forecasts is not None:
            self.outcomes += self._forecasts.take_state(state, self._start_ns)
        self.comparisons += self._desk.take_state(state)
        self._wanted += self.mission.on_state(state, mono_s=0.0)
        if self.mission.road_line is not None:
            self._estimator.take_line(self.mission.road_line)

    def _build(self) -> None:
        """Answer what the mission asked for, as the world desk does; its answers ask for more."""
        while self._wanted:
            one = self._wanted.pop(0)
            if isinstance(one, BuildWorld) and one.junction_id not in self._asked:
                self._asked.add(one.junction_id)
                world = self._builder.world(one.junction_id)
                self._wanted += self.mission.on_world(one.junction_id, world, mono_s=0.0)

    def _round(self) -> None:
        intent, state = self.mission.plan_round(), self._latest
        if not isinstance(intent, RoundIntent) or state is None:
            return
        world = self._builder.world(intent.junction_id)
        number = len(self.rounds)
        trend = self.mission.way.acceleration_mps2
        (job,) = self._planner.plan(
            number, intent, state, LatestReports(None, None, ()), world,
            start_stamp_ns=self._start_ns, count=1, progress=self._forecasts,
        )  # fmt: skip
        self.rounds.append(Round(number, world, intent, state, trend, job))
        order = RoundOrder(
            round_id=number, stamp_ns=state.stamp_ns, junction_id=intent.junction_id,
            world_id=world.id, receipt_mono_ns=0, started_mono_ns=0, jobs=(job,),
        )  # fmt: skip
        results = (self.played(job),) if self._futures else ()
        done = RoundDone(order=order, results=results, latency_ms=0.0, seconds=0.0)
        if self._forecasts is not None:
            self._forecasts.take_round(done)
        if results and results[0].outcome.valid[0]:
            self._desk.take_round(done, world.frame, state)

    def played(self, job: Job) -> FuturesResult:
        """What a worker would answer."""
        stage, scenes = self._builder.stage(self._builder.by_id[job.world_id])
        return run_job(job, stage, scenes=scenes)
