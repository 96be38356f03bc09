"""From a junction, or a stretch, of a map to its World: the one entry to world generation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from foretwin.contracts.elevation import Elevation
from foretwin.contracts.errors import UserError
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local, local_from_geo
from foretwin.contracts.world import (
    Arm,
    Connection,
    IntersectionSummary,
    Lane,
    World,
    WorldJunction,
)
from foretwin.contracts.world_identity import with_id
from foretwin.world_gen.connections.connection_paths import draw_paths
from foretwin.world_gen.connections.lane_connections import ConnectionDraft, connect
from foretwin.world_gen.connections.movements import movements
from foretwin.world_gen.extent import Disc, Rectangle
from foretwin.world_gen.garbage import rarely_collected
from foretwin.world_gen.ground.crossings import crossings
from foretwin.world_gen.ground.surroundings import Ground, ground_around
from foretwin.world_gen.junctions.find_intersections import find_intersections
from foretwin.world_gen.junctions.intersections import Junction
from foretwin.world_gen.junctions.map_index import MapIndex, index_map
from foretwin.world_gen.lanes.clusters import Surroundings, in_map, surroundings, world_frame
from foretwin.world_gen.lanes.lane_curves import LaneSet, build_lanes, join_straight_on
from foretwin.world_gen.lanes.tram_tracks import tram_tracks
from foretwin.world_gen.osm.osm_map import LatLonBounds, MapError, OsmMap
from foretwin.world_gen.roads.road_graph import RoadGraph
from foretwin.world_gen.rules.junction_rules import junction_rules

if TYPE_CHECKING:
    from foretwin.world_gen.driven.correction import Driven

GENERATOR_VERSION = 33
"""Counts changes of what is built from the same map; part of every cache key."""
DEFAULT_RADIUS_M = 150.0


@rarely_collected()
def build_world(
    osm: OsmMap,
    graph: RoadGraph,
    junction: Junction,
    *,
    radius_m: float = DEFAULT_RADIUS_M,
    index: MapIndex | None = None,
    ground: bool = True,
) -> World:
    """Build the World within `radius_m` of a junction, in the junction's own frame.

    What cannot be built is left out and named in the World's notes. Pass an `index` (see
    `index_map`) where many Worlds come from one map: making it takes longer than one World.
    Without `ground` it is a road network alone: no paved areas, kerbs, islands, sidewalks
    and buildings.
    Raises UserError where the radius is not between 10 and 2000 m.
    """
    if not 10.0 <= radius_m <= 2000.0:
        raise UserError(f"radius {radius_m} m is not between 10 and 2000 m")
    index = index or index_map(osm, graph, (junction,))
    around = surroundings(index, world_frame(junction), Disc(radius_m), (junction,))
    corrected = _corrected(index, around, (junction,))
    return _world(index, *corrected, junction.summary, ground=ground)


@rarely_collected()
def build_region(
    osm: OsmMap,
    graph: RoadGraph,
    bounds: LatLonBounds,
    *,
    index: MapIndex | None = None,
    ground: bool = True,
) -> World:
    """Build one World of all that lies within `bounds`, in a frame about their middle.

    Every junction whose roads all reach into the bounds gets the same treatment as the one
    that `build_world` is made for. Pass an `index` made with all junctions of the map; for
    `ground` see there. Raises `MapError` where the bounds hold no road for cars.
    """
    index = index or index_map(osm, graph, find_intersections(osm, graph))
    middle = GeoPoint((bounds.south + bounds.north) / 2, (bounds.west + bounds.east) / 2)
    frame = LocalFrame(middle)
    around = surroundings(index, frame, _rectangle(bounds, frame), ())
    if not around.edges:
        raise MapError(f"{osm.file}: no road for cars between {_words(bounds)}")
    corrected = _corrected(index, around, ())
    return _world(index, *corrected, _region_summary(bounds, middle, graph), ground=ground)


def _corrected(
    index: MapIndex, around: Surroundings, made_for: tuple[Junction, ...]
) -> tuple[Surroundings, Driven | None]:
    """Return the roads where tracks say that they lie, and what these say of connections."""
    if index.tracks is None:
        return around, None
    # Loaded where passes are asked for: its solver takes as long as a small World.
    from foretwin.world_gen.driven.correction import driven
    from foretwin.world_gen.driven.passes import passes_within

    passes = passes_within(index.tracks.tracks, around.frame, around.extent)
    if not passes:
        return around, None
    lanes = build_lanes(around)
    connections = _connections(index, around, lanes, [])
    found = driven(around.edges, lanes, connections, passes, around.trims_m)
    if not (found.roads or found.passes or found.widths):
        return around, None
    again = surroundings(
        index, around.frame, around.extent, made_for,
        moved=found.roads, least_trims_m=found.trims_m, widths=found.widths,
    )  # fmt: skip
    return again, found


def _rectangle(bounds: LatLonBounds, frame: LocalFrame) -> Rectangle:
    """Return the largest rectangle of the frame within bounds in degrees."""
    south, north, west, east = bounds.south, bounds.north, bounds.west, bounds.east
    lat, lon = np.array([south, south, north, north]), np.array([west, east, west, east])
    sw, se, nw, ne = np.round(local_from_geo(frame, lat, lon), 3).tolist()
    return Rectangle(max(sw[0], nw[0]), max(sw[1], se[1]), min(se[0], ne[0]), min(nw[1], ne[1]))


def _region_summary(
    bounds: LatLonBounds, middle: GeoPoint, graph: RoadGraph
) -> IntersectionSummary:
    return IntersectionSummary(
        id=f"region {_words(bounds)}",
        kind="region",
        lat=round(middle.lat_deg, 7),
        lon=round(middle.lon_deg, 7),
        arms=0,
        control="uncontrolled",
        driving_side=graph.driving_side,
        osm_nodes=(),
    )


def _words(bounds: LatLonBounds) -> str:
    """Return west, south, east, north in degrees, as `--bbox` takes them."""
    return f"{bounds.west:g},{bounds.south:g},{bounds.east:g},{bounds.north:g}"


def _world(
    index: MapIndex,
    around: Surroundings,
    driven: Driven | None,
    summary: IntersectionSummary,
    *,
    ground: bool,
) -> World:
    osm, extent = index.osm, around.extent
    notes: list[str] = []
    lanes = build_lanes(around)
    connections = _connections(index, around, lanes, notes)
    if driven is not None:
        notes.extend(driven.hold(lanes, connections))
    on_map = in_map(extent, around.frame, index.graph.frame)
    beside = index.beside.within(on_map)
    crossed = crossings(around, osm.node_tags, beside)
    rules = junction_rules(
        around,
        osm.node_tags,
        lanes,
        connections,
        crossed,
        index.junction_lights,
        index.restrictions.on_red,
    )
    tracks = tram_tracks(around, osm, beside)
    made = ground_around(index, around, lanes, connections, beside) if ground else Ground()
    finished = tuple(lane.finished() for lane in lanes.lanes.values())
    joined = tuple(c.finished() for c in connections)
    elevation = _elevation(index, around, lanes, finished, joined, notes)
    world = World(
        id="",
        intersection=summary,
        frame=around.frame,
        radius_m=extent.radius_m,
        bounds_m=extent.bounds_m,
        map_sha256=osm.sha256,
        junctions=tuple(
            WorldJunction(
                summary=junction.summary,
                arms=_arms(junction, around),
                area=made.junction_areas.get(junction.summary.id),
                plan=rules.plans.get(junction.summary.id),
            )
            for junction in around.junctions
        ),
        roads=(*lanes.roads, *tracks.roads),
        lanes=(*finished, *tracks.lanes),
        connections=joined,
        conflicts=rules.conflicts,
        stop_lines=rules.stop_lines,
        crossings=crossed,
        crossing_plans=rules.crossing_plans,
        signals=rules.signals,
        islands=made.islands,
        kerbs=made.kerbs,
        road_surface=made.road_surface,
        sidewalks=made.sidewalks,
        buildings=made.buildings,
        obstacles=made.obstacles,
        cut_away=made.cut_away or msgspec.UNSET,
        notes=tuple(
            dict.fromkeys(
                (*lanes.notes, *notes, *tracks.notes, *made.notes, *_reading_notes(osm, around))
            )
        ),
        attribution=osm.attribution,
        elevation=elevation,
    )
    return with_id(world)


def _elevation(
    index: MapIndex,
    around: Surroundings,
    lanes: LaneSet,
    finished: tuple[Lane, ...],
    joined: tuple[Connection, ...],
    notes: list[str],
) -> Elevation | msgspec.UnsetType:
    if index.profiles is None:
        return msgspec.UNSET
    from foretwin.world_gen.ground.heights import world_elevation

    edge_of = {lane.road_id: lane.key.edge for lane in lanes.lanes.values()}
    found = world_elevation(around, index.profiles, edge_of, lanes.roads, finished, joined)
    notes.extend(found.notes)
    return found.elevation


def _connections(
    index: MapIndex, around: Surroundings, lanes: LaneSet, notes: list[str]
) -> list[ConnectionDraft]:
    found: list[ConnectionDraft] = []
    for cluster in around.clusters:
        if join_straight_on(cluster, around, lanes):
            continue
        ways = movements(cluster, around, index.restrictions)
        found.extend(connect(cluster, ways, around, lanes, notes))
    draw_paths(found, around, notes)
    return found


def _reading_notes(osm: OsmMap, around: Surroundings) -> tuple[str, ...]:
    """Return what the reader of the map left out or mended within the World."""
    west, south, east, north = around.extent.polygon.bounds
    corners = np.array([[west, south], [west, north], [east, south], [east, north]])
    lat, lon = geo_from_local(around.frame, corners).T
    return osm.notes_within(
        LatLonBounds(float(lat.min()), float(lon.min()), float(lat.max()), float(lon.max()))
    )


def _arms(junction: Junction, around: Surroundings) -> tuple[Arm, ...]:
    arms = []
    for i, arm in enumerate(junction.arms):
        lanes_in = lanes_out = 0
        for leg in arm.outward:
            section = around.sections.get(leg.edge.index)
            if section is not None:
                lanes_out += len(section.along(reverse=leg.reverse).driven)
                lanes_in += len(section.along(reverse=not leg.reverse).driven)
        arms.append(
            Arm(
                id=f"a{i}",
                name=arm.name,
                osm_ways=tuple(dict.fromkeys(leg.ways[0] for leg in arm.outward)),
                bearing_rad=float(arm.bearing_rad),
                lanes_in=lanes_in,
                lanes_out=lanes_out,
            )
        )
    return tuple(arms)
