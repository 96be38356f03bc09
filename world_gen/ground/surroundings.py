"""What lies on the ground of a World and stands on it: pavement, kerbs, sidewalks, buildings."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.beside_road import Building, Obstacle
from foretwin.contracts.world import Area
from foretwin.world_gen.buildings.footprints import buildings_in_frame
from foretwin.world_gen.connections.lane_connections import ConnectionDraft
from foretwin.world_gen.ground.islands import mapped_islands
from foretwin.world_gen.ground.road_surface import areas
from foretwin.world_gen.ground.sidewalks import sidewalk_areas
from foretwin.world_gen.junctions.map_index import MapIndex
from foretwin.world_gen.lanes.clusters import Surroundings, in_map
from foretwin.world_gen.lanes.lane_curves import LaneSet
from foretwin.world_gen.roads.beside_roads import BesideRoads
from foretwin.world_gen.roads.road_tags import below_buildings
from foretwin.world_gen.roadside.obstacles import obstacles_in_frame

_BESIDE_PASSAGE_M = 0.5
"""Walls of passages stand beside the road in them. Chosen: RASt 06, 4.2, room of safety."""


class Ground(NamedTuple):
    """The parts of a World that a road network does without; `junction_areas` by junction id.

    `notes` name what had to give way to lanes.
    """

    road_surface: tuple[Area, ...] = ()
    junction_areas: Mapping[str, Area] = MappingProxyType({})
    islands: tuple[Area, ...] = ()
    kerbs: tuple[Array, ...] = ()
    sidewalks: tuple[Area, ...] = ()
    buildings: tuple[Building, ...] = ()
    cut_away: tuple[Area, ...] = ()
    """Of buildings."""
    obstacles: tuple[Obstacle, ...] = ()
    notes: tuple[str, ...] = ()


def ground_around(
    index: MapIndex,
    around: Surroundings,
    lanes: LaneSet,
    connections: list[ConnectionDraft],
    beside: BesideRoads,
) -> Ground:
    """Return the ground of a World, given its lanes and connections."""
    surface = areas(around, lanes, connections)
    map_frame = index.graph.frame
    on_map = in_map(around.extent, around.frame, map_frame)
    near = index.buildings.within(on_map)
    standing = buildings_in_frame(near, around.frame, map_frame, surface.driven, _passages(around))
    obstacles, cut_too = obstacles_in_frame(
        index.obstacles.within(on_map),
        around.frame,
        around.extent,
        surface.driven,
        [road.reference_line for road in lanes.roads],
    )
    mapped = mapped_islands(around, index.osm, beside, surface.driven)
    return Ground(
        road_surface=surface.road_surface,
        junction_areas=surface.junction_areas,
        islands=(*surface.islands, *mapped),
        kerbs=surface.kerbs,
        sidewalks=sidewalk_areas(around, lanes, surface.road_surface, index.osm, beside),
        buildings=standing.buildings,
        cut_away=standing.cut_away,
        obstacles=obstacles,
        notes=(*standing.notes, *cut_too),
    )


def _passages(around: Surroundings) -> shapely.Geometry:
    """Return the ground of roads that lead below or through buildings, as broad as these are."""
    grounds = []
    for index, edge in around.edges.items():
        if below_buildings(edge.tags):
            section = around.sections[index]
            half_m = max(abs(section.left_m), abs(section.right_m)) + _BESIDE_PASSAGE_M
            grounds.append(shapely.LineString(edge.xy_m).buffer(half_m, cap_style="square"))
    return shapely.union_all(grounds)
