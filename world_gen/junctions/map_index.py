"""What many Worlds of one map share: spatial trees over roads and buildings, turn restrictions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import msgspec
import shapely

from foretwin.contracts.tracks import TrackSet
from foretwin.geometry.polyline_batch import Polylines
from foretwin.world_gen.buildings.footprints import BuildingIndex
from foretwin.world_gen.elevation.dem import DemSet
from foretwin.world_gen.elevation.profiles import RoadProfiles
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.osm.osm_map import OsmMap
from foretwin.world_gen.roads.beside_roads import BesideIndex
from foretwin.world_gen.roads.road_classes import OTHER_CLASSES
from foretwin.world_gen.roads.road_graph import RoadGraph
from foretwin.world_gen.roads.road_tags import is_tidal
from foretwin.world_gen.roads.turn_restrictions import TurnRestrictions, read_turn_restrictions
from foretwin.world_gen.roadside.obstacles import ObstacleIndex


class MapIndex(msgspec.Struct, frozen=True, kw_only=True):
    """A map prepared for building Worlds; make it once per map with `index_map`."""

    osm: OsmMap
    graph: RoadGraph
    car_edges: tuple[int, ...]
    car_edge_tree: shapely.STRtree
    buildings: BuildingIndex
    beside: BesideIndex
    obstacles: ObstacleIndex
    restrictions: TurnRestrictions
    junction_of_node: Mapping[int, Junction]
    junction_lights: frozenset[int]
    """Nodes of the lights that govern junctions."""
    profiles: RoadProfiles | None = None
    """Heights along car roads, where an elevation model was given."""
    tracks: TrackSet | None = None
    """Earlier drives that correct where lanes lie, where some were given."""

    @property
    def map_key(self) -> str:
        """The map's SHA-256, which roads count as car roads beyond its tags, which way round tidal
        ones are driven, and the heights'."""
        edges = [self.graph.edges[i] for i in self.car_edges]
        others = (edge for edge in edges if edge.road_class in OTHER_CLASSES)
        tidal = (edge for edge in edges if edge.one_way and is_tidal(edge.tags))
        added = [f"w{edge.way_id}.{edge.start_node}.{edge.end_node}" for edge in others]
        added += [f"{'+' if e.forward else '-'}w{e.way_id}.{e.start_node}" for e in tidal]
        key = self.osm.sha256 if not added else f"{self.osm.sha256} with {' '.join(added)}"
        key = key if self.profiles is None else f"{key} over {self.profiles.dem.key}"
        return key if self.tracks is None else f"{key} driven {self.tracks.key}"

    def car_edges_in(self, area: shapely.Polygon) -> tuple[int, ...]:
        """Return indices of car roads that touch an area in the map's frame."""
        found = self.car_edge_tree.query(area, predicate="intersects")
        return tuple(sorted(self.car_edges[i] for i in found))


def index_map(
    osm: OsmMap,
    graph: RoadGraph,
    junctions: Iterable[Junction] = (),
    *,
    dem: DemSet | None = None,
    tracks: TrackSet | None = None,
) -> MapIndex:
    """Prepare a map; `junctions` are all known ones, so that neighbours are built as such.

    With an elevation model its Worlds have heights; raises UserError where that lies elsewhere.
    With tracks their lanes and turns lie where these were driven.
    """
    car = tuple(edge.index for edge in graph.edges if edge.drivable)
    known = tuple(junctions)
    lines = Polylines.of([graph.edges[i].xy_m for i in car])
    return MapIndex(
        osm=osm,
        graph=graph,
        car_edges=car,
        car_edge_tree=shapely.STRtree(shapely.linestrings(lines.xy_m, indices=lines.line)),
        buildings=BuildingIndex(osm),
        beside=BesideIndex(osm),
        obstacles=ObstacleIndex(osm),
        restrictions=read_turn_restrictions(osm, graph),
        junction_of_node={node: j for j in known for node in sorted(j.nodes)},
        junction_lights=frozenset().union(*(junction.lights for junction in known)),
        profiles=None if dem is None else _profiles(osm, graph, car, dem),
        tracks=tracks,
    )


def _profiles(osm: OsmMap, graph: RoadGraph, car: tuple[int, ...], dem: DemSet) -> RoadProfiles:
    # Imported here: most Worlds are flat, and need no solver of sparse equations.
    from foretwin.world_gen.elevation.road_profiles import road_profiles

    return road_profiles(graph, car, dem, osm.node_tags)
