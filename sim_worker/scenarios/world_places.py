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
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.contracts.world import World
from foretwin.geometry.frenet_path import FrenetPath
from foretwin.sim_worker.scenarios.live import LiveScenarios
from foretwin.sim_worker.scenarios.placement import places
from foretwin.sim_worker.scenarios.roads import RoadNetwork


def places_in(world: World, asked: PlaceRequest, vehicle: VehicleParameters) -> WorldPlaces:
    """Return where the scenarios asked for take place in a World, for a vehicle."""
    network = RoadNetwork(world)
    if asked.starts:
        return _places_recorded(network, asked, vehicle)
    placed, unplaced = [], []
    ways: dict[str, PathAhead] = {}
    for scenario in asked.scenarios:
        found = places(scenario, world, network=network, vehicle=vehicle, most=asked.most)
        for place in found.places:
            placed.append(
                PlacedHere(
                    scenario_id=scenario.id, junction_id=place.junction_id, place=place.name,
                    ego=place.ego.name,
                )
            )  # fmt: skip
            ways[place.ego.name] = PathAhead(
                xy_m=place.ego.xy_m, speed_limit_mps=place.ego.speed_limit_mps
            )
        unplaced += [
            NotPlaced(
                scenario_id=scenario.id, junction_id=one.junction_id, reason=one.reason,
                applies=one.applies,
            )
            for one in found.unplaced
        ]  # fmt: skip
    return WorldPlaces(
        world_id=world.id, frame=world.frame, placed=tuple(placed), unplaced=tuple(unplaced),
        ways=ways,
    )  # fmt: skip


def _places_recorded(
    network: RoadNetwork, asked: PlaceRequest, vehicle: VehicleParameters
) -> WorldPlaces:
    """Return which scenarios can happen on the ways that a recorded car took from its starts."""
    world, known = network.world, LiveScenarios(network)
    placed, unplaced = [], []
    for number, start in asked.starts:
        path = FrenetPath(start.path(world.frame).xy_m)
        here = local_from_geo(
            world.frame, start.state.position.lat_deg, start.state.position.lon_deg
        )
        arc = path.locate(np.asarray(here)[None])
        passage = known.on(path, float(arc.arc_m[0]), vehicle).passage
        for scenario in asked.scenarios:
            name = f"round {start.round_id}"
            if scenario.id == AS_RECORDED:
                placed.append(
                    PlacedHere(
                        scenario_id=scenario.id, junction_id=start.junction_id, place=name,
                        ego=name, start=number,
                    )
                )  # fmt: skip
                continue
            found = () if passage is None else known.places(scenario, passage)
            placed += [
                PlacedHere(
                    scenario_id=scenario.id, junction_id=start.junction_id,
                    place=f"{name}: {place.name}", ego=name, start=number, rank=rank,
                )
                for rank, place in enumerate(found[: asked.most])
            ]  # fmt: skip
            if not found:
                reason = "does not apply on the recorded way"
                unplaced.append(
                    NotPlaced(
                        scenario_id=scenario.id, junction_id=start.junction_id,
                        reason=f"{name}: {reason}", applies=False,
                    )
                )  # fmt: skip
    return WorldPlaces(
        world_id=world.id, frame=world.frame, placed=tuple(placed), unplaced=tuple(unplaced)
    )
