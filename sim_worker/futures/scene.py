"""From a job to the scene it plays in: who drives where, aims at what, and suffers from what."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from foretwin.contracts.arrays import Array, Flags
from foretwin.contracts.errors import UserError
from foretwin.contracts.futures import CAR_WITHIN_M, Future, Job
from foretwin.contracts.numbers import Quantity
from foretwin.contracts.scenario import Scenario
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.futures.aims import Aims, aims_of, bend_accel_of, limit_share
from foretwin.sim_worker.futures.clear_offsets import clear_offsets_m
from foretwin.sim_worker.futures.lights import Lights, lights_of
from foretwin.sim_worker.futures.number_columns import NumberColumns, number_columns
from foretwin.sim_worker.metrics.ground import DrivableGround
from foretwin.sim_worker.metrics.lane_areas import LaneAreas
from foretwin.sim_worker.planner_interface import KnownPlan, SharedGround
from foretwin.sim_worker.planners.registry import drives_backwards
from foretwin.sim_worker.planners.tracking import MIN_LOOKAHEAD_M
from foretwin.sim_worker.road_users.cast import Player, casting
from foretwin.sim_worker.road_users.manners import key_of
from foretwin.sim_worker.road_users.path_table import PathTable
from foretwin.sim_worker.road_users.perception import PerceptionFaults, Sight
from foretwin.sim_worker.road_users.right_of_way import JunctionRules, PathRules
from foretwin.sim_worker.road_users.sight_lines import OpaqueGrid, opaque_grid
from foretwin.sim_worker.road_users.traffic import Traffic
from foretwin.sim_worker.scenarios.impact import ego_box
from foretwin.sim_worker.scenarios.live import KnownScenarios
from foretwin.sim_worker.scenarios.places import Unplaced
from foretwin.sim_worker.scenarios.roads import RoadNetwork
from foretwin.sim_worker.scenarios.roles import StagedCase
from foretwin.sim_worker.scenarios.seen import SeenActors
from foretwin.sim_worker.scenarios.staged import staged_players, staged_start
from foretwin.sim_worker.vehicle.seeding import local_state

_PERCEPTION: tuple[Quantity, ...] = (
    "perception.delay_s", "perception.lost_from_s", "perception.lost_for_s",
)  # fmt: skip
"""In the order of `PerceptionFaults`."""


class JobScene(NamedTuple):
    """All that S futures of a job begin with; `traffic` is None without other road users.

    `limit_share` (M,) at the path's nodes is how far limits lie below that at the start;
    `bend_accel_mps2` is what the nominal future takes across the way in bends.
    """

    path: FrenetPath
    starts: Array
    start_arc_m: Array
    aims: Aims
    bend_accel_mps2: float
    planners: tuple[str, ...]
    numbers: NumberColumns
    limit_share: Array | None
    traffic: Traffic | None
    sight: Sight | None
    rules: PathRules
    ground: SharedGround | None
    car_plan: KnownPlan | None
    lights: Lights
    left_out: tuple[str, ...]
    """(S,) why a future's scenario does not happen in it, in words; empty where it does."""

    @property
    def backwards(self) -> Flags:
        """(S,) whose planner drives in reverse."""
        return np.array([drives_backwards(name) for name in self.planners])

    def red_arcs_m(self, time_s: float) -> Array:
        """Return (P, K) the stop lines of all paths that show no green at a time of the job."""
        if not self.rules.groups:
            return self.rules.stop_arcs_m
        return self.rules.red(self.lights.at(time_s))


class SceneMaker:
    """Makes the scenes of one World; keeps what they have in common."""

    def __init__(self, world: World) -> None:
        self.world = world
        self._rules = JunctionRules(world)
        self.network = RoadNetwork(world)
        self._seen = SeenActors(self.network)
        self.scenarios = KnownScenarios(self.network)
        self.rehearsed: dict[tuple[object, ...], Any] = {}
        """Drives of egos alone that cases were cast on."""

    @functools.cached_property
    def drivable(self) -> DrivableGround:
        """Where this World may be driven on; what one job looked up, the next ones know."""
        return DrivableGround(self.world)

    @functools.cached_property
    def lanes(self) -> LaneAreas:
        """The lanes of this World as areas."""
        return LaneAreas(self.world)

    @functools.cached_property
    def _walls(self) -> OpaqueGrid | None:
        return opaque_grid(self.world)

    def warm_up(self) -> None:
        """Make what the first jobs would make of the World alone, before they come."""
        for junction in self.world.junctions:
            self.network.passages(junction.summary.id)
        _ = self.network.walls, self._walls, self.drivable, self.lanes

    def scene(
        self,
        job: Job,
        vehicle: VehicleParameters,
        *,
        tick_s: float,
        staged: Mapping[int, StagedCase | Unplaced] | None = None,
        start_arc_m: Array | None = None,
    ) -> JobScene:
        """Return the scene of a job on this World.

        `staged` are the cases of the rows that name their place, if they are known already;
        `start_arc_m` (S,) is about where the cars are, if that is known.

        Raises ValueError for a scenario that the job does not define, or a state that is not
        finite.
        """
        count = len(job.futures)
        path = FrenetPath(job.path.xy_m, job.path.speed_limit_mps)
        scenarios = {scenario.id: scenario for scenario in job.scenarios}
        scenario_of = [_scenario_of(future, scenarios) for future in job.futures]
        if staged is None:
            staged = self.staged_cases(job, vehicle)
        cases = {row: case for row, case in staged.items() if isinstance(case, StagedCase)}
        if job.starts is None:
            starts = np.repeat(local_state(job.state, self.world.frame, vehicle)[None], count, 0)
            for row, case in cases.items():
                starts[row] = staged_start(case, vehicle)
        else:
            starts = np.array(job.starts, dtype=np.float64)
        place = path.locate(starts[:, :2], upto_arc_m=CAR_WITHIN_M)
        if staged and start_arc_m is None:
            start_arc_m = place.arc_m
            for row, case in cases.items():
                start_arc_m[row] = case.ego_arc_m
        if start_arc_m is not None:
            # Ways may be long, and cross themselves.
            place = path.locate(starts[:, :2], near_arc_m=start_arc_m)
        numbers = number_columns(job.futures)
        aims = aims_of(job, place.offset_m, numbers)
        if job.starts is None and (here := [row for row in range(count) if row not in staged]):
            from_m, speed_mps = float(place.arc_m[here[0]]), float(starts[here[0], 3])
            aims.offset_m[here] = clear_offsets_m(
                self.network.walls,
                ego_box(vehicle, path, speed_mps),
                aims.offset_m[here],
                from_m=from_m + MIN_LOOKAHEAD_M,
                upto_m=from_m + job.horizon_s * max(speed_mps, job.cruise_speed_mps),
            )
        live = any(v.scenario_id and not v.place for v in job.futures)
        on_path = self.scenarios.on(path, float(place.arc_m[0]), vehicle) if live else None
        seen = self._seen.actors(job.road_users)
        casts: list[tuple[Player, ...]] = []
        left_out = [""] * count
        for row, (future, scenario) in enumerate(zip(job.futures, scenario_of, strict=True)):
            cast = seen
            players: tuple[Player, ...] | Unplaced = ()
            if row in staged:
                played = staged[row]
                players = played if isinstance(played, Unplaced) else staged_players(played, path)
            elif scenario is not None and on_path is not None:
                players = on_path.players(
                    scenario,
                    future.values,
                    place_rank=future.place_rank,
                    ego_arc_m=float(place.arc_m[row]),
                    ego_speed_mps=float(starts[row, 3]),
                )
            if isinstance(players, Unplaced):
                left_out[row] = players.reason
            else:
                cast = (*seen, *players)
            casts.append(cast)
        keys = [key_of(job.seed, v.name, v.place or v.place_rank) for v in job.futures]
        crowd = casting(casts, ego_path=path, replayed=job.replayed, keys=keys)
        # Where recorded road users go, no rule binds.
        taken = [self._rules.taken(one) for one in crowd.paths] + [()] * len(job.replayed)
        rules = self._rules.between(taken)
        traffic = sight = None
        if crowd.crowd.present.any():
            tracks = () if crowd.replay is None else crowd.replay.tracks
            table = PathTable(crowd.paths, tracks)
            traffic = Traffic(crowd.crowd, table, rules, crowd.paces, crowd.replay)
            sight = Sight(
                traffic,
                table.along(path),
                vehicle,
                PerceptionFaults._make(numbers.applied(what, 0.0) for what in _PERCEPTION),
                tick_s=tick_s,
                walls=self._walls,
            )
        told = bool(staged) or aims.speed_ahead_mps is not None
        return JobScene(
            path=path,
            starts=starts,
            start_arc_m=place.arc_m,
            aims=aims,
            bend_accel_mps2=bend_accel_of(job),
            planners=tuple(future.planner for future in job.futures),
            numbers=numbers,
            # Staged, a case says how fast the ego drives; speeds ahead are those of the limits.
            limit_share=None if told else limit_share(path, float(place.arc_m[0])),
            traffic=traffic,
            sight=sight,
            rules=rules,
            ground=self._rules.ground(taken[0], path),
            car_plan=_known_plan(job),
            lights=lights_of(job, self.world),
            left_out=tuple(left_out),
        )

    def staged_cases(
        self, job: Job, vehicle: VehicleParameters
    ) -> dict[int, StagedCase | Unplaced]:
        """Return the cases of the rows that name their place, on its path as it is."""
        known = {scenario.id: scenario for scenario in job.scenarios}
        rows: dict[tuple[str, str], list[int]] = {}
        for row, future in enumerate(job.futures):
            if future.place and future.scenario_id:
                rows.setdefault((future.scenario_id, future.place), []).append(row)
        found: dict[int, StagedCase | Unplaced] = {}
        for (_, place), mine in rows.items():
            scenario = _scenario_of(job.futures[mine[0]], known)
            assert scenario is not None
            cases = [job.futures[row].values for row in mine]
            found.update(
                zip(mine, self.scenarios.cast(scenario, cases, place, vehicle), strict=True)
            )
        return found


def _scenario_of(future: Future, known: Mapping[str, Scenario]) -> Scenario | None:
    if not future.scenario_id:
        return None
    if future.scenario_id not in known:
        raise UserError(
            f"future {future.name!r} names scenario {future.scenario_id!r}; the job defines "
            f"{', '.join(known) or 'none'}"
        )
    return known[future.scenario_id]


def _known_plan(job: Job) -> KnownPlan | None:
    plan = job.car_plan
    return None if plan is None else KnownPlan(plan.time_s, plan.xy_m, plan.yaw_rad, plan.speed_mps)
