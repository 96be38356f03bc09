"""Buildings, islands and sidewalks as areas of a Lanelet2 map."""

from __future__ import annotations

from collections.abc import Sequence

import shapely
from shapely.geometry import Polygon

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import World
from foretwin.world_gen.export.lanelet2_primitives import Lanelet2Map, RelationMember, Tags


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
        _add_area(building.outline, building.holes, tags, drawn, edge={"type": "building"})
    for island in world.islands:
        tags = {"subtype": "traffic_island", "foretwin:id": island.id}
        edge = {"type": "curbstone", "subtype": "high"}
        _add_area(island.outline, island.holes, tags, drawn, edge=edge)
    for sidewalk in world.sidewalks:
        tags = {
            "subtype": "walkway",
            "participant:pedestrian": "yes",
            "foretwin:id": sidewalk.id,
        }
        edge = {"type": "curbstone", "subtype": "low"}
        _add_area(sidewalk.outline, sidewalk.holes, tags, drawn, edge=edge)


def add_intersection_areas(world: World, drawn: Lanelet2Map) -> dict[str, int]:
    """Draw the ground of each junction, as Autoware wants it, and return its way by junction."""
    found: dict[str, int] = {}
    for junction in world.junctions:
        area = junction.area
        if area is None or len(area.outline) < 3 or not Polygon(area.outline).is_valid:
            continue
        nodes = tuple(drawn.node(x, y, 0.0) for x, y in area.outline.tolist())
        name = junction.summary.id
        tags = {"type": "intersection_area", "area": "yes", "foretwin:id": name}
        found[name] = drawn.way(nodes, tags)
    return found


def _add_area(
    outline: Array, holes: Sequence[Array], tags: Tags, drawn: Lanelet2Map, *, edge: Tags
) -> None:
    polygon = Polygon(outline, holes) if len(outline) >= 3 else Polygon()
    if polygon.is_empty or not polygon.is_valid:
        return
    members = []
    # Lanelet2 wants outer rings clockwise and inner ones counter-clockwise.
    turned = shapely.orient_polygons(polygon, exterior_cw=True)
    for role, ring in (("outer", turned.exterior), *(("inner", r) for r in turned.interiors)):
        nodes = tuple(drawn.node(x, y, 0.0) for x, y in list(ring.coords)[:-1])
        members.append(RelationMember("way", drawn.way((*nodes, nodes[0]), edge), role))
    drawn.relation(members, {"type": "multipolygon", "location": "urban", **tags})
