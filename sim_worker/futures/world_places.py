"""Where scenarios take place: in a World, or around a car that was recorded there."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.frames import local_from_geo
from foretwin.contracts.futures import PathAhead
from foretwin.contracts.placement import (
    AS_RECORDED,
    NotPlaced,
    PlacedHere,
    PlaceRequest,
    WorldPlaces,
)
from foretwin.contracts.scenario import Scenario
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.futures.ego_dry_run import rehearsal_stage
from foretwin.sim_worker.futures.playable import places
from foretwin.sim_worker.futures.scene import SceneMaker
from foretwin.sim_worker.scenarios.places import Unplaced


def places_in(world: World, request: PlaceRequest, vehicle: VehicleParameters) -> WorldPlaces:
    """Return where the requested scenarios take place in a World, for a vehicle."""
    scenes = SceneMaker(world)
    if request.starts:
        return _places_recorded(scenes, request, vehicle)
    stage = rehearsal_stage(vehicle)
    placed, unplaced = [], []
    ways: dict[str, PathAhead] = {}
    for scenario in request.scenarios:
        if scenario.id == AS_RECORDED:
            continue  # Nobody was recorded to begin in this World.
        found = places(scenario, world, scenes=scenes, stage=stage, most=request.most)
        for here in found.places:
            ego = here.ego
            placed.append(_placed(scenario, here.junction_id, here.name, ego.name))
            ways[ego.name] = PathAhead(xy_m=ego.xy_m, speed_limit_mps=ego.speed_limit_mps)
        unplaced += [NotPlaced(scenario_id=scenario.id, **u._asdict()) for u in found.unplaced]
    return _world_places(world, placed, unplaced, ways)


def _places_recorded(
    scenes: SceneMaker, request: PlaceRequest, vehicle: VehicleParameters
) -> WorldPlaces:
    """Return which scenarios can happen on the ways that a recorded car took from its starts."""
    world, known = scenes.world, scenes.scenarios
    placed, unplaced = [], []
    for number, start in request.starts:
        path = FrenetPath(start.path(world.frame).xy_m)
        position = start.state.position
        here = local_from_geo(world.frame, position.lat_deg, position.lon_deg)
        arc = path.locate(np.asarray(here)[None])
        passage = known.on(path, float(arc.arc_m[0]), vehicle).passage
        for scenario in request.scenarios:
            name = f"round {start.round_id}"
            found = () if passage is None else known.places(scenario, passage)
            names = [f"{name}: {place.name}" for place in found[: request.most]]
            if scenario.id == AS_RECORDED:
                names = [name]
            elif not found:
                why = Unplaced(start.junction_id, f"{name}: {_NOT_FOR_WAY}", False)
                unplaced.append(NotPlaced(scenario_id=scenario.id, **why._asdict()))
            placed += [
                _placed(scenario, start.junction_id, place, name, start=number, rank=rank)
                for rank, place in enumerate(names)
            ]
    return _world_places(world, placed, unplaced, {})


_NOT_FOR_WAY = "does not apply on the recorded way"


def _placed(
    scenario: Scenario, junction_id: str, place: str, ego: str, **recorded: int
) -> PlacedHere:
    return PlacedHere(
        scenario_id=scenario.id, junction_id=junction_id, place=place, ego=ego, **recorded
    )


def _world_places(
    world: World, placed: list[PlacedHere], unplaced: list[NotPlaced], ways: dict[str, PathAhead]
) -> WorldPlaces:
    return WorldPlaces(
        world_id=world.id,
        frame=world.frame,
        placed=tuple(placed),
        unplaced=tuple(unplaced),
        ways=ways,
        attribution=world.attribution,
    )
