"""What a round simulates: the mix of futures that fits the way ahead, as jobs for workers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array32
from foretwin.contracts.drive import PlannedTrajectory, SignalState, VehicleState
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import LocalFrame, local_from_geo, local_from_geo_yaw
from foretwin.contracts.futures import (
    PATH_BEHIND_M,
    RESULT_STEP_S,
    CarPlan,
    Future,
    Job,
    PathAhead,
)
from foretwin.contracts.job_identity import vehicle_digest
from foretwin.contracts.scenario import Scenario
from foretwin.contracts.too_old import LIGHT_FOR_S
from foretwin.contracts.trace import traced
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.orchestrator.config import DriveConfig
from foretwin.orchestrator.instructions import LatestReports, RoundIntent
from foretwin.orchestrator.rounds.fewer_futures import some_of
from foretwin.orchestrator.rounds.learnt_speed import partly_learnt
from foretwin.orchestrator.rounds.path_from_car import led_from_car
from foretwin.orchestrator.rounds.progress_forecasts import ProgressForecasts
from foretwin.orchestrator.rounds.seen_users import near_car
from foretwin.sim_worker.futures.future_mix import cases_of, plan_futures
from foretwin.sim_worker.metrics.table import ROW_METRICS
from foretwin.sim_worker.scenarios.live import KnownScenarios
from foretwin.sim_worker.scenarios.reading import catalogue, find_scenario
from foretwin.sim_worker.scenarios.roads import RoadNetwork

HEEDLESS_PLANNER = "constant_speed"
PLAN_FRESH_NS = 1_000_000_000
"""An older plan of the car is not compared with a new future, nor followed in one."""
_KEPT_WORLDS = 8
LEAST_IN_JOB = 16
"""A job costs about as much as 30 of its futures before the first one: smaller ones save little."""


def planners_of(planner: str) -> list[str]:
    """Return who drives the futures in turn: the planner under test, and one that heeds nobody."""
    return [planner] * 7 + ([HEEDLESS_PLANNER] if planner != HEEDLESS_PLANNER else [])


def scenarios_of(config: DriveConfig) -> tuple[Scenario, ...]:
    """Return the scenarios that a drive's futures take turns with.

    Raises UserError for an unknown one, or one that happens at no junction.
    """
    if config.scenarios is None:
        return tuple(s for s in catalogue().values() if s.where.setting == "junction")
    found = tuple(find_scenario(name) for name in config.scenarios)
    for scenario in found:
        if scenario.where.setting != "junction":
            raise UserError(
                f"scenario {scenario.id}: takes place on a {scenario.where.setting}, not at a "
                "junction ahead of a drive"
            )
    return found


class RoundPlanner:
    """Plans rounds: a function of World, intent and what the car says; keeps what is costly."""

    def __init__(self, config: DriveConfig, vehicle: VehicleParameters) -> None:
        self._config = config
        self.use_vehicle(vehicle, 0)
        self._scenarios = scenarios_of(config)
        self._known: dict[str, KnownScenarios] = {}
        self._futures: dict[tuple[str, ...], tuple[Future, ...]] = {}
        self._worst: tuple[Future, ...] = ()

    def use_vehicle(self, vehicle: VehicleParameters, version: int) -> None:
        """Plan for these parameters from now on."""
        self._vehicle, self._vehicle_version = vehicle, version
        self._vehicle_digest = vehicle_digest(vehicle)

    def take_worst(self, futures: Sequence[Future], criticality: Array32) -> None:
        """Keep of a round's futures those in which somebody is hit or nearly so, the worst first:
        where the next round runs fewer, these come first."""
        worst = np.argsort(-criticality, kind="stable")
        self._worst = tuple(futures[i] for i in worst if criticality[i] > 0.0)

    def draw_cases(self) -> None:
        """Draw the cases of all scenarios: before the drive, not in its first round."""
        for scenario in self._scenarios:
            cases_of(scenario, self._config.seed)

    @traced("plan jobs")
    def plan(
        self,
        round_id: int,
        intent: RoundIntent,
        state: VehicleState,
        reports: LatestReports,
        world: World,
        *,
        start_stamp_ns: int,
        count: int,
        progress: ProgressForecasts | None = None,
    ) -> tuple[Job, ...]:
        """Return the jobs of a round of `count` futures, with what `progress` forecasts."""
        config = self._config
        scenarios = self._fitting(world, intent.path, state.speed_mps)
        planned = self._futures_with(scenarios)
        futures = some_of(planned, count, turn=round_id, first=self._worst)
        users = near_car(reports.road_users, state, world.frame)
        signals = _signals(reports.signals, state)
        car_plan = _car_plan(reports.plan, state, world.frame)
        path = _begun_by_car(intent.path, state, world.frame)
        forecast, speed_ahead = None, intent.speed_ahead_mps
        if progress is not None:
            forecast = progress.forecast(round_id, intent, state, users, world.frame)
        if forecast is not None:
            speed_ahead = partly_learnt(speed_ahead, forecast)
        jobs = []
        for index, mine in enumerate(self._cut(futures)):
            named = {future.scenario_id for future in mine}
            jobs.append(
                Job(
                    round_id=round_id,
                    job_index=index,
                    world_id=intent.world_id,
                    state=state,
                    path=path,
                    futures=mine,
                    horizon_s=config.horizon_s,
                    step_s=RESULT_STEP_S,
                    seed=config.seed,
                    cruise_speed_mps=intent.cruise_speed_mps,
                    speed_ahead_mps=speed_ahead,
                    bend_accel_mps2=intent.bend_accel_mps2,
                    scenarios=tuple(s for s in scenarios if s.id in named),
                    road_users=users,
                    signals=signals,
                    learnt_signals=reports.learnt_signals,
                    drive_time_s=(state.stamp_ns - start_stamp_ns) / 1e9,
                    car_plan=car_plan,
                    metrics=ROW_METRICS,
                    accidents=True,
                    accident_motion=False,
                    vehicle=self._vehicle_digest,
                    vehicle_version=self._vehicle_version,
                    progress=msgspec.UNSET if forecast is None else forecast,
                )
            )
        return tuple(jobs)

    def _cut(self, futures: tuple[Future, ...]) -> list[tuple[Future, ...]]:
        """Return the futures of each job: as many jobs as for all, unless that makes them small."""
        size, count = self._config.futures_per_job, len(futures)
        for_all = math.ceil(self._config.futures / size)
        jobs = max(math.ceil(count / size), min(for_all, count // LEAST_IN_JOB))
        cuts = [count * job // jobs for job in range(jobs + 1)]
        return [futures[low:high] for low, high in pairwise(cuts)]

    def _futures_with(self, scenarios: tuple[Scenario, ...]) -> tuple[Future, ...]:
        key = tuple(scenario.id for scenario in scenarios)
        if key not in self._futures:
            config = self._config
            self._futures[key] = plan_futures(
                count=config.futures,
                seed=config.seed,
                planners=planners_of(config.planner),
                scenarios=scenarios,
            )
        return self._futures[key]

    def _fitting(self, world: World, path: PathAhead, speed_mps: float) -> tuple[Scenario, ...]:
        """Return the scenarios that can take place on the way that is left through a junction."""
        if not self._scenarios:
            return ()
        if world.id not in self._known:
            while len(self._known) >= _KEPT_WORLDS:
                del self._known[next(iter(self._known))]
            self._known[world.id] = KnownScenarios(RoadNetwork(world))
        known = self._known[world.id]
        on = known.on(FrenetPath(path.xy_m), PATH_BEHIND_M, self._vehicle)
        return on.ahead(self._scenarios, ego_arc_m=PATH_BEHIND_M, ego_speed_mps=speed_mps)


def _begun_by_car(path: PathAhead, state: VehicleState, frame: LocalFrame) -> PathAhead:
    lat, lon = state.position.lat_deg, state.position.lon_deg
    led = led_from_car(
        path.xy_m,
        car_xy_m=np.asarray(local_from_geo(frame, lat, lon)),
        car_yaw_rad=float(local_from_geo_yaw(frame, state.yaw_rad, lat, lon)),
        speed_mps=state.speed_mps,
    )
    return msgspec.structs.replace(path, xy_m=led)


def _signals(states: tuple[SignalState, ...], state: VehicleState) -> tuple[SignalState, ...]:
    fresh_ns = LIGHT_FOR_S * 1e9
    return tuple(s for s in states if abs(state.stamp_ns - s.stamp_ns) <= fresh_ns)


def _car_plan(
    plan: PlannedTrajectory | None, state: VehicleState, frame: LocalFrame
) -> CarPlan | None:
    if plan is None or abs(state.stamp_ns - plan.stamp_ns) > PLAN_FRESH_NS:
        return None
    return CarPlan(
        time_s=plan.time_from_stamp_s + (plan.stamp_ns - state.stamp_ns) / 1e9,
        xy_m=np.asarray(local_from_geo(frame, plan.lat_deg, plan.lon_deg)),
        yaw_rad=np.asarray(local_from_geo_yaw(frame, plan.yaw_rad, plan.lat_deg, plan.lon_deg)),
        speed_mps=plan.speed_mps,
    )
