"""A World as a Lanelet2 map in OSM XML, as the Lanelet2 library and Autoware read it.

Nodes carry latitude and longitude and, for readers that want metres, `local_x` and `local_y` in
the World's frame; `ele` is the height above the World's plane. A file beside the map tells
Autoware the projection: transverse Mercator of scale 1 about the World's origin, as the World's
own frame.
"""

from __future__ import annotations

from pathlib import Path

from foretwin.contracts.world import Connection, Crossing, Lane, LaneKind, World
from foretwin.world_gen.export.lane_borders import Borders, lane_borders
from foretwin.world_gen.export.lane_markings import SIDES, lane_markings
from foretwin.world_gen.export.lanelet2_markings import VIRTUAL, border_tags
from foretwin.world_gen.export.lanelet2_orientation import oriented
from foretwin.world_gen.export.lanelet2_primitives import Lanelet2Map, RelationMember, Tags
from foretwin.world_gen.export.lanelet2_rules import LaneletRules, add_rules
from foretwin.world_gen.export.lanelet2_surroundings import add_intersection_areas, add_surroundings
from foretwin.world_gen.export.lanelets import (
    URBAN_MPS,
    crosswalk_edges,
    indicated,
    is_marked,
    narrower_lane,
)
from foretwin.world_gen.export.road_heights import RoadHeights

AUTOWARE_MAP_NAME = "lanelet2_map.osm"
"""A map of this name gets the projector file under the name that Autoware looks for beside it."""
_SUBTYPES: dict[LaneKind, str] = {
    "driving": "road",
    "bus": "bus_lane",
    "bicycle": "bicycle_lane",
    "parking": "parking",
    "tram": "rail",
}
_PARTICIPANTS: dict[LaneKind, tuple[str, ...]] = {
    "driving": ("vehicle",),
    "bus": ("vehicle:bus", "vehicle:emergency", "vehicle:taxi"),
    "bicycle": ("bicycle",),
    "parking": (),
    "tram": ("train",),
}


def write_lanelet2(world: World, path: Path, *, crosswalk_rules: bool = False) -> Path:
    """Write the World as a Lanelet2 map; return the path of Autoware's projector file beside it.

    That is `map_projector_info.yaml` beside a `lanelet2_map.osm`, else it is named as the map is.
    `crosswalk_rules` adds the regulatory elements of subtype `crosswalk` that Autoware knows and
    the Lanelet2 library alone refuses. Raises OSError where a file cannot be written.
    """
    drawn = lanelet2_map(world, crosswalk_rules=crosswalk_rules)
    drawn.write(world, path)
    projector = _projector_path(path)
    projector.write_text(_projector_info(world), encoding="utf-8")
    return projector


def lanelet2_map(world: World, *, crosswalk_rules: bool = False) -> Lanelet2Map:
    """Return the World's lanes, connections, rules and surroundings as a map not yet written."""
    drawn = Lanelet2Map()
    borders = lane_borders(world)
    heights = RoadHeights(world, borders)
    members = _lane_members(world, borders, heights, drawn)
    members |= _connection_members(world, borders, heights, drawn)
    crosswalks = {c.id: _crosswalk(c, drawn) for c in world.crossings}
    ids = {name: drawn.new_id() for name in members}
    rules = add_rules(world, ids, crosswalks if crosswalk_rules else {}, drawn)
    areas = add_intersection_areas(world, drawn)
    lanes = {lane.id: lane for lane in world.lanes}
    for lane in world.lanes:
        _add_lanelet(lane.id, _lane_tags(lane), members, ids, rules, drawn)
    for connection in world.connections:
        if connection.id in members:
            tags = _connection_tags(connection, lanes, world)
            if connection.junction_id in areas:
                tags["intersection_area"] = str(areas[connection.junction_id])
            _add_lanelet(connection.id, tags, members, ids, rules, drawn)
    add_surroundings(world, drawn)
    return drawn


def _add_lanelet(
    name: str,
    tags: Tags,
    members: dict[str, list[RelationMember]],
    ids: dict[str, int],
    rules: LaneletRules,
    drawn: Lanelet2Map,
) -> None:
    mine = [RelationMember("relation", rule, "regulatory_element") for rule in rules.of(name)]
    drawn.relation([*members[name], *mine], tags, number=ids[name])


def _lane_members(
    world: World, borders: dict[str, Borders], heights: RoadHeights, drawn: Lanelet2Map
) -> dict[str, list[RelationMember]]:
    """Draw the borders of lanes, each once, and return them as left and right of every lane."""
    nodes = {
        lane.id: tuple(
            drawn.road_nodes(line, heights.along(line, lane.layer)) for line in borders[lane.id]
        )
        for lane in world.lanes
    }
    markings = lane_markings(world, borders)
    found: dict[str, list[RelationMember]] = {}
    for lane in world.lanes:
        found[lane.id] = [
            RelationMember("way", drawn.road_way(line, border_tags(markings[lane.id, side])), side)
            for side, line in zip(SIDES, nodes[lane.id], strict=True)
        ]
    return found


def _connection_members(
    world: World, borders: dict[str, Borders], heights: RoadHeights, drawn: Lanelet2Map
) -> dict[str, list[RelationMember]]:
    found: dict[str, list[RelationMember]] = {}
    for connection in world.connections:
        if connection.id not in borders:
            continue
        lines = zip(SIDES, oriented(borders[connection.id]), strict=True)
        found[connection.id] = [
            RelationMember(
                "way",
                drawn.road_way(
                    drawn.road_nodes(line, heights.along(line, connection.layer)), VIRTUAL
                ),
                side,
            )
            for side, line in lines
        ]
    return found


def _lane_tags(lane: Lane) -> dict[str, str]:
    urban = lane.speed_limit_mps.value <= URBAN_MPS
    tags = {
        "type": "lanelet",
        "subtype": _SUBTYPES[lane.kind],
        "location": "urban" if urban else "nonurban",
        "one_way": "yes",
        "foretwin:id": lane.id,
        "foretwin:width": f"{lane.width_m.value:.2f} {lane.width_m.source}",
    }
    tags |= {f"participant:{who}": "yes" for who in _PARTICIPANTS[lane.kind]}
    if lane.kind == "driving" and urban:
        tags["participant:bicycle"] = "yes"
    if lane.kind in ("driving", "bus"):
        tags["speed_limit"] = f"{lane.speed_limit_mps.value * 3.6:.0f}"
        tags["foretwin:speed_limit"] = lane.speed_limit_mps.source
    if lane.name:
        tags["road_name"] = lane.name
    return tags


def _connection_tags(
    connection: Connection, lanes: dict[str, Lane], world: World
) -> dict[str, str]:
    """Return the tags of the narrower of both lanes, with the turn where it is a junction's."""
    start, end = lanes[connection.from_lane_id], lanes[connection.to_lane_id]
    tags = _lane_tags(narrower_lane(connection, lanes))
    tags["foretwin:id"] = connection.id
    tags["foretwin:width"] = f"{connection.width_m.value:.2f} {connection.width_m.source}"
    if "speed_limit" in tags:
        slower = min(start.speed_limit_mps, end.speed_limit_mps, key=lambda limit: limit.value)
        tags["speed_limit"] = f"{slower.value * 3.6:.0f}"
        tags["foretwin:speed_limit"] = slower.source
    tags.pop("road_name", None)
    if connection.junction_id:
        tags["turn_direction"] = indicated(connection.turn, world.intersection.driving_side)
    return tags


def _crosswalk(crossing: Crossing, drawn: Lanelet2Map) -> int:
    """Draw the lanelet over which pedestrians cross and return its id."""
    paint = {"type": "zebra_marking" if crossing.kind.value == "zebra" else "pedestrian_marking"}
    sides = []
    for name, edge in zip(SIDES, crosswalk_edges(crossing), strict=True):
        nodes = tuple(drawn.node(x, y, 0.0) for x, y in edge.tolist())
        way = drawn.way(nodes, paint if is_marked(crossing) else VIRTUAL)
        sides.append(RelationMember("way", way, name))
    return drawn.relation(
        sides,
        {
            "type": "lanelet",
            "subtype": "crosswalk",
            "location": "urban",
            "one_way": "no",
            "participant:pedestrian": "yes",
            "speed_limit": "10",
            "foretwin:id": crossing.id,
            "foretwin:kind": f"{crossing.kind.value} {crossing.kind.source}",
        },
    )


def _projector_path(path: Path) -> Path:
    if path.name == AUTOWARE_MAP_NAME:
        return path.with_name("map_projector_info.yaml")
    return path.with_name(f"{path.stem}.map_projector_info.yaml")


def _projector_info(world: World) -> str:
    origin = world.frame.origin
    return (
        f"# {world.attribution}; world {world.id}\n"
        "projector_type: TransverseMercator\n"
        "vertical_datum: WGS84\n"
        "map_origin:\n"
        f"  latitude: {origin.lat_deg:.11f}\n"
        f"  longitude: {origin.lon_deg:.11f}\n"
        "scale_factor: 1.0\n"
    )
