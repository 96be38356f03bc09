"""Buildings, obstacles, islands and sidewalks as areas of a Lanelet2 map."""

from __future__ import annotations

from collections.abc import Mapping

import shapely
from shapely.geometry import Polygon

from foretwin.contracts.beside_road import Building, Obstacle, ObstacleKind
from foretwin.contracts.world import Area, World
from foretwin.world_gen.export.lanelet2_primitives import Lanelet2Map, RelationMember, Tags

_EDGES: Mapping[ObstacleKind, str] = {"wall": "wall", "fence": "fence", "guard_rail": "guard_rail"}
"""Linestring types of Lanelet2 that are walls to it."""


def add_surroundings(world: World, drawn: Lanelet2Map) -> None:
    """Add what stands or lies beside the road; rings that cross themselves are left out."""
    for building in world.buildings:
        tags = {
            "subtype": "building",
            "height": f"{building.height_m.value:.2f}",
            "min_height": f"{building.min_height_m:.2f}",
            "foretwin:id": building.id,
            "foretwin:height": building.height_m.source,
        }
        _add_area(building, tags, drawn, edge={"type": "building"})
    for one in world.obstacles:
        tags = {
            "subtype": "obstacle",
            "height": f"{one.height_m.value:.2f}",
            "foretwin:id": one.id,
            "foretwin:kind": one.kind,
            "foretwin:height": one.height_m.source,
        }
        _add_area(one, tags, drawn, edge={"type": _EDGES.get(one.kind, "obstacle")})
    for island in world.islands:
        tags = {"subtype": "traffic_island", "foretwin:id": island.id}
        _add_area(island, tags, drawn, edge={"type": "curbstone", "subtype": "high"})
    walkway = {"subtype": "walkway", "participant:pedestrian": "yes"}
    for sidewalk in world.sidewalks:
        tags = {**walkway, "foretwin:id": sidewalk.id}
        _add_area(sidewalk, tags, drawn, edge={"type": "curbstone", "subtype": "low"})


def add_intersection_areas(world: World, drawn: Lanelet2Map) -> dict[str, int]:
    """Draw the ground of each junction, as Autoware wants it, and return its way by junction."""
    found: dict[str, int] = {}
    for junction in world.junctions:
        area = junction.area
        if area is None or len(area.outline) < 3 or not Polygon(area.outline).is_valid:
            continue
        name = junction.summary.id
        tags = {"type": "intersection_area", "area": "yes", "foretwin:id": name}
        found[name] = drawn.way(drawn.ground_nodes(area.outline), tags)
    return found


def _add_area(
    area: Area | Building | Obstacle, tags: Tags, drawn: Lanelet2Map, *, edge: Tags
) -> None:
    polygon = Polygon(area.outline, area.holes) if len(area.outline) >= 3 else Polygon()
    if polygon.is_empty or not polygon.is_valid:
        return
    members = []
    # Lanelet2 wants outer rings clockwise and inner ones counter-clockwise.
    turned = shapely.orient_polygons(polygon, exterior_cw=True)
    for role, ring in (("outer", turned.exterior), *(("inner", r) for r in turned.interiors)):
        nodes = drawn.ground_nodes(shapely.get_coordinates(ring)[:-1])
        members.append(RelationMember("way", drawn.way((*nodes, nodes[0]), edge), role))
    drawn.relation(members, {"type": "multipolygon", "location": "urban", **tags})
