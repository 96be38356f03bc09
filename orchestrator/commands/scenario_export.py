"""`foretwin scenarios export` and `draw`: one case of a scenario at one junction, as a file."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import NamedTuple

from foretwin.contracts.arrays import Array
from foretwin.contracts.errors import UserError
from foretwin.contracts.scenario import Scenario
from foretwin.contracts.world import World
from foretwin.geometry.frenet_path import PathPose
from foretwin.orchestrator.commands.scenarios import RADIUS_M, PlacesAsked, asked_junctions
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.futures.ego_dry_run import rehearsal_stage
from foretwin.sim_worker.futures.playable import ego_alone, places
from foretwin.sim_worker.futures.scene import SceneMaker
from foretwin.sim_worker.planners.registry import check_planner
from foretwin.sim_worker.scenarios.drawing import draw_cases
from foretwin.sim_worker.scenarios.openscenario import EXPORT_MARK, write_openscenario
from foretwin.sim_worker.scenarios.openscenario_motion import instants
from foretwin.sim_worker.scenarios.reading import find_scenario
from foretwin.sim_worker.scenarios.roles import StagedCase
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.world_gen.build import build_world
from foretwin.world_gen.junctions.map_index import index_map


class CaseRequest(NamedTuple):
    """Which case of which scenario, and where; the first case is 1."""

    scenario: str
    where: PlacesAsked
    case: int
    vehicle: Path | None = None


class PlacedCase(NamedTuple):
    """A case as it was cast in a World; `scenes` and `stage` are what it was found with."""

    scenario: Scenario
    world: World
    played: StagedCase
    scenes: SceneMaker
    stage: BatchSimulation

    def ego_alone(self, time_s: Array) -> PathPose:
        """Return where its ego really drives."""
        return ego_alone(self.played, self.scenario, self.scenes, self.stage, time_s)


def export_scenario(request: CaseRequest, out: Path) -> CommandResult:
    """Write one case as OpenSCENARIO, and its roads beside it as OpenDRIVE.

    Raises UserError where there is no such case, no place for it at that junction, or where the
    roads would replace others.
    """
    if out.suffix != ".xosc":
        raise UserError(f"{out}: an OpenSCENARIO file is written as .xosc")
    _check_roads(out)
    vehicle = load_vehicle(request.vehicle)
    found = placed_case(request)
    out.parent.mkdir(parents=True, exist_ok=True)
    now, case = datetime.datetime.now(datetime.UTC), (found.played, found.scenario, found.world)
    alone = found.ego_alone(instants(found.scenario.horizon_s))
    roads = write_openscenario(*case, out, vehicle=vehicle, alone=alone, written_at=now)
    return _written(request, found, out, roads=roads)


def _check_roads(out: Path) -> None:
    """Refuse to replace roads that are not those of an earlier export to the same file."""
    roads = out.with_suffix(".xodr")
    exported = out.is_file() and EXPORT_MARK.encode() in out.read_bytes()
    if roads.exists() and not exported:
        raise UserError(
            f"{roads}: would be replaced by the roads of {out.name}, and was not made for it; "
            "move it, or name another --out"
        )


def draw_scenario(request: CaseRequest, out: Path, *, planner: str) -> CommandResult:
    """Write a picture of one case: as planned, and as a planner drives it.

    Raises UserError where there is no such case, place or planner, or where the planner fails.
    """
    from foretwin.sim_worker.futures.case_picture import write_case_picture
    from foretwin.sim_worker.futures.case_picture_runs import heedless_run, planned_run

    if out.suffix != ".png":
        raise UserError(f"{out}: a picture of a case is written as .png")
    check_planner(planner, in_drive=False)
    vehicle = load_vehicle(request.vehicle)
    found = placed_case(request)
    scenario, world, played, *_ = found
    heedless = heedless_run(played, vehicle, found.ego_alone, horizon_s=scenario.horizon_s)
    try:
        planned = planned_run(played, scenario, world, vehicle, planner=planner)
    except ValueError as error:
        raise UserError(str(error)) from error
    write_case_picture(out, played, scenario, world, heedless, planned, planner=planner)
    return _written(request, found, out)


def _written(
    request: CaseRequest, found: PlacedCase, out: Path, *, roads: Path | None = None
) -> CommandResult:
    scenario_id, junction_id = found.scenario.id, found.played.place.junction_id
    body = {"file": out, "scenario": scenario_id, "case": request.case, "junction_id": junction_id}
    words = f"{out}: {scenario_id}, case {request.case}, at {junction_id}"
    if roads is None:
        return CommandResult(body, words)
    return CommandResult(body | {"roads": roads}, f"{words}\n{roads}: its roads")


def placed_case(request: CaseRequest) -> PlacedCase:
    """Return a case at the first place of a junction where it can be played."""
    scenario = find_scenario(request.scenario)
    cases = draw_cases(scenario)
    if not 1 <= request.case <= len(cases):
        raise UserError(f"{scenario.id} has cases 1 to {len(cases)}; there is no {request.case}")
    if request.where.at is None and request.where.junction_id is None:
        raise UserError("name the junction by --at LAT,LON or --id ID")
    vehicle = load_vehicle(request.vehicle)
    opened, junctions = asked_junctions(request.where)
    index = index_map(opened.osm, opened.graph, opened.junctions)
    world = build_world(opened.osm, opened.graph, junctions[0], radius_m=RADIUS_M, index=index)
    asked = cases[request.case - 1]
    scenes, stage = SceneMaker(world), rehearsal_stage(vehicle, nsim=1)
    found = places(scenario, world, scenes=scenes, stage=stage, cases=[asked], most=1)
    if found.unplaced:
        where, reason = junctions[0].summary, found.unplaced[0].reason
        raise UserError(f"{scenario.id} has no place at {where.id} {where.name}: {reason}")
    played = found.cases[0][0]
    assert isinstance(played, StagedCase)
    return PlacedCase(scenario, world, played, scenes, stage)
