"""What a sweep's worker processes do: find places in a World, and play jobs there."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.errors import one_line
from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.futures import Faults, FuturesJob, PathAhead, Variant
from foretwin.contracts.scenario import FAULTS, Scenario
from foretwin.contracts.world import World
from foretwin.orchestrator.sweep.future_rows import told, told_of_case
from foretwin.orchestrator.sweep.places import places_in
from foretwin.orchestrator.sweep.plan import Cell, SweepJob, WorldPlaces
from foretwin.orchestrator.sweep.pool import Lost
from foretwin.orchestrator.sweep.road_users import NOBODY, Others, others_at
from foretwin.orchestrator.sweep.rows import Row, blank_row
from foretwin.orchestrator.sweep.spec import (
    AS_RECORDED,
    FAULT_NAMES,
    FUTURES_PER_JOB,
    STEP_S,
    Loaded,
)
from foretwin.sim_worker.batch.batch_simulation import Stage
from foretwin.sim_worker.futures.ego_dry_run import staged_cases
from foretwin.sim_worker.futures.run_job import run_job
from foretwin.sim_worker.futures.scene import SceneMaker
from foretwin.sim_worker.scenarios.roles import Cast
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


def start_worker(setup: PlaySetup) -> Callable[[PlaceQuestion | SweepJob], Any]:
    """Return what answers a sweep's questions in this process."""
    worker = SweepWorker(setup)
    return worker.answer


class SweepWorker:
    """Answers where scenarios take place, and what becomes of jobs; keeps compiled stages."""

    def __init__(self, setup: PlaySetup) -> None:
        self._loaded = setup.loaded
        self._worlds_dir = Path(setup.worlds_dir)
        self._scenarios = {scenario.id: scenario for scenario in setup.loaded.scenarios}
        self._stages: dict[str, StageCache] = {}

    def answer(self, question: PlaceQuestion | SweepJob) -> WorldPlaces | list[Row] | Lost:
        """Return the places in a World, or the rows of a job; a job that fails says so in them."""
        if isinstance(question, PlaceQuestion):
            try:
                return places_in(load_world(self._worlds_dir, question.world_id), self._loaded)
            except Exception as error:  # one bad World never stops the sweep
                return Lost(one_line(error))
        try:
            return self._play(question)
        except Exception as error:  # one bad job never stops the sweep
            return failed_rows(question, self._loaded, one_line(error))

    def _play(self, job: SweepJob) -> list[Row]:
        loaded, spec = self._loaded, self._loaded.spec
        vehicle = loaded.vehicles[job.vehicle]
        if job.vehicle not in self._stages:
            self._stages[job.vehicle] = StageCache(
                self._worlds_dir, vehicle, control_hz=spec.control_hz, nsim=FUTURES_PER_JOB,
                kept=_KEPT_STAGES,
            )  # fmt: skip
        prepared = self._stages[job.vehicle].get(job.world_id)
        world, staged = prepared.scenes.world, prepared.scenes.staged
        if job.cells[0].start is not None:
            return self._play_recorded(job, prepared.stage, prepared.scenes)
        casts: dict[int, Cast] = {}
        rows = {cell.number: blank_row(job, cell, spec) for cell in job.cells}
        for scenario, place, cells in _together(job, self._scenarios):
            played = staged.cast(scenario, [cell.values for cell in cells], place, vehicle)
            for cell, cast in zip(cells, played, strict=True):
                if isinstance(cast, Cast):
                    casts[cell.number] = cast
                else:
                    rows[cell.number]["left_out"] = cast.reason
        cells = [cell for cell in job.cells if cell.number in casts]
        if cells:
            futures = _staged_job(job, cells, casts, world, loaded, self._scenarios)
            result = run_job(futures, prepared.stage, scenes=prepared.scenes)
            meant = staged_cases(futures, prepared.stage, prepared.scenes)
            for index, cell in enumerate(cells):
                case = meant[index]
                assert isinstance(case, Cast)
                rows[cell.number] |= told_of_case(result, index, case, vehicle)
        return list(rows.values())

    def _play_recorded(self, job: SweepJob, stage: Stage, scenes: SceneMaker) -> list[Row]:
        """Play cases around a car that was recorded; those who meet it are timed to it."""
        loaded, first = self._loaded, job.cells[0].start
        start, frame = loaded.starts[first or 0], scenes.world.frame
        path = start.path(frame)
        others = NOBODY
        if loaded.road_users is not None and loaded.spec.recorded is not None:
            others = others_at(
                loaded.road_users, loaded.spec.recorded.road_users, start.state, frame,
                horizon_s=job.horizon_s, way_xy_m=path.xy_m,
            )  # fmt: skip
        futures = _futures_job(
            job, list(job.cells), loaded, self._scenarios, world_id=start.world_id,
            state=start.state, path=path, cruise_speed_mps=start.cruise_speed_mps,
            drive_time_s=start.drive_time_s, others=others,
        )  # fmt: skip
        result = run_job(futures, stage, scenes=scenes)
        known = {"start_stamp_ns": start.state.stamp_ns, "recorded_road_users": len(others.names)}
        return [
            blank_row(job, cell, loaded.spec)
            | known
            | told(result, index, (*others.names, *self._actors(cell)))
            for index, cell in enumerate(job.cells)
        ]

    def _actors(self, cell: Cell) -> tuple[str, ...]:
        """Return the names of those whom a cell's scenario adds, in its order."""
        return tuple(actor.name for actor in self._scenarios[cell.scenario_id].actors)


def failed_rows(job: SweepJob, loaded: Loaded, reason: str) -> list[Row]:
    """Return the rows of a job that could not be played."""
    return [blank_row(job, cell, loaded.spec) | {"failure": reason} for cell in job.cells]


def _together(
    job: SweepJob, scenarios: dict[str, Scenario]
) -> list[tuple[Scenario, str, list[Cell]]]:
    """Return the cells of each scenario and place: their cases are cast together."""
    groups: dict[tuple[str, str], list[Cell]] = {}
    for cell in job.cells:
        groups.setdefault((cell.scenario_id, cell.place), []).append(cell)
    return [(scenarios[id_], place, cells) for (id_, place), cells in groups.items()]


def _staged_job(
    job: SweepJob,
    cells: list[Cell],
    casts: dict[int, Cast],
    world: World,
    loaded: Loaded,
    scenarios: dict[str, Scenario],
) -> FuturesJob:
    first, here = casts[cells[0].number], world.frame.origin
    return _futures_job(
        job, cells, loaded, scenarios, world_id=world.id,
        # Nobody measured a car: each begins where its case says.
        state=VehicleState(
            vehicle_id=job.vehicle, stamp_ns=0, position=GeoPoint(here.lat_deg, here.lon_deg),
            yaw_rad=0.0, speed_mps=0.0, yaw_rate_radps=0.0, accel_mps2=0.0,
        ),
        path=PathAhead(xy_m=first.ego_xy_m, speed_limit_mps=first.ego_speed_limit_mps),
        cruise_speed_mps=first.ego_speed_mps,
    )  # fmt: skip


def _futures_job(
    job: SweepJob,
    cells: list[Cell],
    loaded: Loaded,
    scenarios: dict[str, Scenario],
    *,
    world_id: str,
    state: VehicleState,
    path: PathAhead,
    cruise_speed_mps: float,
    drive_time_s: float = 0.0,
    others: Others = NOBODY,
) -> FuturesJob:
    spec = loaded.spec
    return FuturesJob(
        round_id=0,
        job_index=job.number,
        world_id=world_id,
        state=state,
        path=path,
        variants=tuple(_variant(index, cell, job.planner) for index, cell in enumerate(cells)),
        horizon_s=job.horizon_s,
        step_s=STEP_S,
        seed=spec.seed,
        cruise_speed_mps=cruise_speed_mps,
        scenarios=tuple(
            scenarios[id_] for id_ in sorted({c.scenario_id for c in cells} - {AS_RECORDED})
        ),
        road_users=others.predicted,
        replayed=others.replayed,
        drive_time_s=drive_time_s,
        lights_by_plan=spec.lights_by_plan,
        metrics=spec.metrics,
        accidents=spec.accidents,
    )  # fmt: skip


def _variant(index: int, cell: Cell, planner: str) -> Variant:
    variant = Variant(
        index=index, name=f"{cell.scenario_id} {cell.case}", planner=planner,
        scenario_id=cell.scenario_id, values=cell.values, place_rank=cell.rank,
        place=cell.place if cell.start is None else "",
        target_speed_factor=cell.parameters.get("target_speed_factor", 1.0),
        target_speed_offset_mps=cell.parameters.get("target_speed_offset_mps", 0.0),
        lateral_shift_m=cell.parameters.get("lateral_shift_m", 0.0),
    )  # fmt: skip
    if cell.scenario_id != AS_RECORDED:
        return variant
    faults = Faults(**{name: cell.values[f"{FAULTS}.{name}"] for name in FAULT_NAMES})
    return msgspec.structs.replace(variant, scenario_id="", values={}, faults=faults)
