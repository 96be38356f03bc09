"""Futures of a car from a state, played here and now: the part of the face that simulates."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from foretwin.checks import expect, number, path_of, whole_number
from foretwin.contracts.arrays import Array, Array32
from foretwin.contracts.drive import VehicleState
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import (
    GeoPoint,
    geo_from_local,
    geo_from_local_yaw,
    local_from_geo,
)
from foretwin.contracts.future_numbers import check_futures
from foretwin.contracts.futures import (
    PATH_BEHIND_M,
    RESULT_STEP_S,
    Future,
    FuturesResult,
    Job,
    PathAhead,
)
from foretwin.contracts.job_identity import job_bytes, vehicle_digest
from foretwin.contracts.numbers import MAX_HORIZON_S, MAX_SEED, out_of_range
from foretwin.contracts.scenario import Scenario
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.sim_worker.driver_model import UNKNOWN_LIMIT_MPS
from foretwin.sim_worker.futures.future_mix import plan_futures
from foretwin.sim_worker.futures.future_rows import future_rows
from foretwin.sim_worker.futures.job_tables import as_table
from foretwin.sim_worker.futures.run_job import run_alone
from foretwin.sim_worker.metrics.table import ROW_METRICS
from foretwin.sim_worker.planners.registry import check_planner
from foretwin.sim_worker.scenarios.reading import find_scenario
from foretwin.sim_worker.scenarios.reading import numbers as numbers_of_cases
from foretwin.sim_worker.scenarios.roads import RoadNetwork
from foretwin.sim_worker.scenarios.ways import Way
from foretwin.sim_worker.vehicle.parameters import load_vehicle

_NEAR_WAY_M = 10.0
MAX_FUTURES = 10_000
"""Side by side, in one process."""


class Futures(NamedTuple):
    """What S futures came to.

    `time_s` (N,) from the state; `states` (S, N, 8) of base_link in the World's frame, columns as
    `foretwin.contracts.futures.STATE_COLUMNS`. `rows` say of each future what was asked for, its
    outcome and its metrics, by the columns of docs/results.md.
    """

    job: Job
    result: FuturesResult
    rows: list[dict[str, Any]]

    @property
    def time_s(self) -> Array:
        """(N,) seconds from the state that they begin with."""
        return self.result.trajectory.time_s

    @property
    def states(self) -> Array32:
        """(S, N, 8) x_m, y_m, yaw_rad, vx_mps, vy_mps, yaw_rate_radps, tire_angle_rad, accel."""
        return self.result.trajectory.states

    @property
    def table(self) -> pa.Table:
        """The rows as a table, with the columns of the table `futures` of a run or sweep."""
        return as_table("futures", self.rows)


def ways_through(world: World) -> tuple[Way, ...]:
    """Return the ways that a car can take through the World's intersection."""
    expect("world", world, World)
    network = RoadNetwork(world)
    return tuple(network.way(p) for p in network.passages(world.intersection.id))


def state_on(
    world: World, way: Way, *, before_m: float = 40.0, speed_mps: float | None = None
) -> VehicleState:
    """Return a car in its lane, `before_m` metres before the intersection.

    It drives at the speed limit there where no speed is given. Raises UserError where the way does
    not reach back so far, or for a speed that no car has.
    """
    expect("world", world, World)
    arc_m = expect("way", way, Way).entry_m - number("before_m", before_m)
    if not PATH_BEHIND_M <= arc_m < way.path.length_m:
        most = way.entry_m - PATH_BEHIND_M
        raise UserError(f"{before_m:g} m before the intersection: way {way.name} has {most:.0f} m")
    pose = way.path.pose_at(np.array([arc_m]))
    xy = way.path.point_at(np.array([arc_m]))[0]
    limit = float(way.path.at_nodes(way.path.speed_limit_mps, np.array([arc_m]))[0])
    if speed_mps is None:
        speed_mps = limit if np.isfinite(limit) else UNKNOWN_LIMIT_MPS
    speed_mps = number("speed_mps", speed_mps)
    if wrong := out_of_range("speed_mps", speed_mps, speed_mps):
        raise UserError(f"speed_mps {wrong}")
    lat, lon = geo_from_local(world.frame, xy)
    return VehicleState(
        vehicle_id="ego",
        stamp_ns=0,
        position=GeoPoint(float(lat), float(lon)),
        yaw_rad=float(geo_from_local_yaw(world.frame, float(pose.yaw_rad[0]), xy)),
        speed_mps=speed_mps,
        yaw_rate_radps=0.0,
        accel_mps2=0.0,
    )


def run_futures(
    world: World,
    way: Way,
    state: VehicleState,
    *,
    count: int | None = None,
    futures: Sequence[Future] | Future = (),
    scenarios: Sequence[Scenario | Path | str] | Scenario | Path | str = (),
    planner: str | None = None,
    vehicle: VehicleParameters | Path | str | None = None,
    horizon_s: float = 8.0,
    seed: int = 0,
) -> Futures:
    """Play futures of a car that drives along `way` from `state`, side by side.

    `futures` as given, each with a planner of its own, or a mix of `count` (64) by `planner`
    (`pure_pursuit_idm`): the nominal one first, then others that differ in speed, friction,
    steering delay and place in the lane, and in which `scenarios` (one or several ids, files or
    definitions) happen. `vehicle` is a bundled one's name, a file or parameters.
    Raises UserError for what cannot be played: an unknown planner or scenario, one that needs a
    drive, a number out of range, a state that is not on the way.
    """
    expect("world", world, World)
    expect("way", way, Way)
    expect("state", state, VehicleState)
    known = _scenarios(scenarios)
    if not isinstance(vehicle, VehicleParameters):
        vehicle = load_vehicle(None if vehicle is None else path_of("vehicle", vehicle))
    seed = whole_number("seed", seed, 0, MAX_SEED)
    if isinstance(futures, Future):
        futures = (futures,)
    given = tuple(expect("a future", future, Future) for future in futures)
    _check_cases(given, known)
    for name, value in {"count": count, "planner": planner}.items():
        if given and value is not None:
            raise UserError(f"{name} {value}: of a mix, and goes not with futures")
    mix = given or plan_futures(
        count=64 if count is None else whole_number("count", count, 1, MAX_FUTURES),
        seed=seed,
        planners=("pure_pursuit_idm" if planner is None else planner,),
        scenarios=known,
    )
    check_futures(mix)
    for name in dict.fromkeys(future.planner for future in mix):
        check_planner(name, in_drive=False)
    job = Job(
        round_id=0,
        job_index=0,
        world_id=world.id,
        state=state,
        path=_path(world, way, state),
        futures=mix,
        horizon_s=_horizon(horizon_s),
        step_s=RESULT_STEP_S,
        seed=seed,
        cruise_speed_mps=state.speed_mps,
        scenarios=known,
        lights_by_plan=True,
        metrics=ROW_METRICS,
        accidents=True,
        vehicle=vehicle_digest(vehicle),
    )
    result = run_alone(job, world, vehicle)
    rows = future_rows(job, result, job_sha256=job_bytes(job).sha256)
    for row in rows:
        row |= {"junction_id": world.intersection.id, "vehicle": vehicle.name}
    return Futures(job, result, rows)


def _scenarios(
    given: Sequence[Scenario | Path | str] | Scenario | Path | str,
) -> tuple[Scenario, ...]:
    several: Any = (given,) if isinstance(given, Scenario | Path | str) else given
    if not isinstance(several, Iterable):
        kind = type(several).__name__
        raise UserError(f"scenarios must be ids, files or definitions, not {kind}")
    return tuple(
        one if isinstance(one, Scenario) else find_scenario(path_of("a scenario", one))
        for one in several
    )


def _check_cases(futures: Sequence[Future], known: Sequence[Scenario]) -> None:
    """Raise UserError where a future's values are no case of its scenario."""
    names = {one.id: {number.name for number in numbers_of_cases(one)} for one in known}
    for future in futures:
        if future.scenario_id not in names:
            continue
        if wrong := names[future.scenario_id] ^ future.values.keys():
            has = "an unknown" if min(wrong) in future.values else "no"
            raise UserError(f"future {future.name!r} has {has} value {min(wrong)!r}")
        for name, value in future.values.items():
            if trouble := out_of_range(name.split(".")[-1], value, value):
                raise UserError(f"future {future.name!r}: {name} {trouble}")


def _horizon(given: float) -> float:
    horizon_s = number("horizon_s", given)
    steps = horizon_s / RESULT_STEP_S
    if not RESULT_STEP_S <= horizon_s <= MAX_HORIZON_S or abs(steps - round(steps)) > 1e-6:
        span = f"{RESULT_STEP_S:g} to {MAX_HORIZON_S:g} seconds, in steps of {RESULT_STEP_S:g}"
        raise UserError(f"horizon_s {horizon_s:g}: {span}")
    return horizon_s


def _path(world: World, way: Way, state: VehicleState) -> PathAhead:
    """Return the way from a few metres behind the car on, a point each metre."""
    state.position.validate()
    here = local_from_geo(world.frame, state.position.lat_deg, state.position.lon_deg)
    place = way.path.locate(np.asarray(here)[None])
    if not abs(place.offset_m[0]) <= _NEAR_WAY_M:
        raise UserError(f"the state is {abs(place.offset_m[0]):.0f} m away from way {way.name}")
    arcs = np.arange(max(place.arc_m[0] - PATH_BEHIND_M, 0.0), way.path.length_m, 1.0)
    limits = way.path.at_nodes(way.path.speed_limit_mps, arcs)
    return PathAhead(xy_m=way.path.point_at(arcs), speed_limit_mps=np.asarray(limits))
