"""The jobs of a sweep, as a live round makes them, and what their rows say of its cells."""

from __future__ import annotations

from typing import Any

import msgspec

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.futures import RESULT_STEP_S, Future, Job
from foretwin.contracts.job_identity import vehicle_digest
from foretwin.contracts.parts import JobCells
from foretwin.contracts.placement import AS_RECORDED, PlaceRequest
from foretwin.orchestrator.sweep.plan import Cell, SweepJob
from foretwin.orchestrator.sweep.road_users import NO_OTHERS, others_at
from foretwin.orchestrator.sweep.spec import Loaded


def place_request(loaded: Loaded, world_id: str) -> PlaceRequest:
    """Return the question where the scenarios of a sweep take place, for its first vehicle."""
    vehicle = next(iter(loaded.vehicles.values()))
    starts = tuple((n, one) for n, one in enumerate(loaded.starts) if one.world_id == world_id)
    return PlaceRequest(
        world_id=world_id,
        scenarios=loaded.scenarios,
        vehicle=vehicle_digest(vehicle),
        most=loaded.spec.places,
        starts=starts,
    )


class JobMaker:
    """Makes jobs of what the plan names: a function of the spec and of where it takes place."""

    def __init__(self, loaded: Loaded) -> None:
        self._loaded = loaded
        self._scenarios = {scenario.id: scenario for scenario in loaded.scenarios}
        self._vehicles = {n: vehicle_digest(vehicle) for n, vehicle in loaded.vehicles.items()}

    def job(self, planned: SweepJob) -> Job:
        """Return the job whose futures are the cells, in their order."""
        spec, cells = self._loaded.spec, planned.cells
        names = sorted({cell.scenario_id for cell in cells} - {AS_RECORDED})
        return Job(
            round_id=0,
            job_index=planned.number,
            world_id=planned.world.world_id,
            futures=tuple(_future(i, cell, planned.planner) for i, cell in enumerate(cells)),
            horizon_s=planned.horizon_s,
            step_s=RESULT_STEP_S,
            seed=spec.seed,
            scenarios=tuple(self._scenarios[name] for name in names),
            lights_by_plan=spec.lights_by_plan,
            metrics=spec.metrics,
            accidents=spec.accidents,
            vehicle=self._vehicles[planned.vehicle],
            control_hz=spec.control_hz,
            engine=spec.physics,
            planner_timing=(
                spec.remote[planned.planner].timing
                if planned.planner in spec.remote
                else msgspec.UNSET
            ),
            **(self._staged(planned) if cells[0].start is None else self._recorded(planned)),
        )

    def _staged(self, planned: SweepJob) -> dict[str, Any]:
        """Return how staged futures begin: each where its case says, nobody measured a car."""
        world, first = planned.world, planned.cells[0]
        state = VehicleState(
            vehicle_id=planned.vehicle,
            stamp_ns=0,
            position=world.frame.origin,
            yaw_rad=0.0,
            speed_mps=0.0,
            yaw_rate_radps=0.0,
            accel_mps2=0.0,
        )
        cruise_speed_mps = first.values["ego.speed_mps"]
        return {"state": state, "path": world.ways[first.ego], "cruise_speed_mps": cruise_speed_mps}

    def _recorded(self, planned: SweepJob) -> dict[str, Any]:
        """Return how futures begin where a car was; those who meet it are timed to it."""
        loaded, frame = self._loaded, planned.world.frame
        start = loaded.starts[planned.cells[0].start or 0]
        path, others = start.path(frame), NO_OTHERS
        if loaded.road_users is not None and loaded.spec.recorded is not None:
            others = others_at(
                loaded.road_users,
                loaded.spec.recorded.road_users,
                start.state,
                frame,
                horizon_s=planned.horizon_s,
                way_xy_m=path.xy_m,
            )
        return {
            "state": start.state,
            "path": path,
            "cruise_speed_mps": start.cruise_speed_mps,
            "drive_time_s": start.drive_time_s,
            "road_users": others.predicted,
            "replayed": others.replayed,
        }


def _future(index: int, cell: Cell, planner: str) -> Future:
    name = f"{cell.scenario_id} {cell.case}"
    future = Future(index=index, name=name, planner=planner, numbers=cell.parameters)
    if cell.scenario_id == AS_RECORDED:
        return msgspec.structs.replace(future, place_rank=cell.rank)
    return msgspec.structs.replace(
        future,
        scenario_id=cell.scenario_id,
        values=cell.values,
        place_rank=cell.rank,
        place=cell.place if cell.start is None else "",
    )


def cells_of(planned: SweepJob, attribution: str) -> JobCells:
    """Return what the rows of a job's cells say beside what the job says."""
    cells = planned.cells
    return JobCells(
        first=cells[0].number,
        junction_id=cells[0].junction_id,
        vehicle=planned.vehicle,
        scenarios=tuple(cell.scenario_id for cell in cells),
        cases=tuple(cell.case for cell in cells),
        places=tuple(cell.place for cell in cells),
        attribution=attribution,
    )
