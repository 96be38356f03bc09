"""A World as a Lanelet2 map in OSM XML, as the Lanelet2 library and Autoware read it.

Nodes carry latitude and longitude and, for readers that want metres, `local_x` and `local_y` in
the World's frame; `ele` is the height above the World's plane, or, where an elevation model was
given, above the sea. A file beside the map gives
Autoware the projection: transverse Mercator of scale 1 about the World's origin, as the World's
own frame.
"""

from __future__ import annotations

from pathlib import Path

from foretwin.contracts.world import Connection, Crossing, Lane, LaneKind, World
from foretwin.geometry.world_heights import heights_of
from foretwin.world_gen.export import lanelets
from foretwin.world_gen.export.choices import Lanelet2Dialect
from foretwin.world_gen.export.lane_borders import Borders, lane_borders
from foretwin.world_gen.export.lanelet2_orientation import oriented
from foretwin.world_gen.export.lanelet2_primitives import Lanelet2Map, RelationMember, Tags
from foretwin.world_gen.export.lanelet2_rules import add_rules
from foretwin.world_gen.export.lanelet2_surroundings import add_intersection_areas, add_surroundings
from foretwin.world_gen.export.lanelets import SIDES, URBAN_MPS, Marking
from foretwin.world_gen.export.road_heights import layered

AUTOWARE_MAP_NAME = "lanelet2_map.osm"
"""A map of this name gets the projector file under the name that Autoware looks for beside it."""
_KINDS: dict[LaneKind, tuple[str, tuple[str, ...]]] = {
    "driving": ("road", ("vehicle",)),
    "bus": ("bus_lane", ("vehicle:bus", "vehicle:emergency", "vehicle:taxi")),
    "bicycle": ("bicycle_lane", ("bicycle",)),
    "parking": ("parking", ()),
    "tram": ("rail", ("train",)),
    "closed": ("emergency_lane", ("vehicle:emergency",)),
}
"""Subtype and participants of lanes by kind."""
VIRTUAL: Tags = {"type": "virtual"}
_BORDER_TYPES = {
    "thin": "line_thin",
    "thick": "line_thick",
    "kerb": "curbstone",
    "edge": "road_border",
    "none": "virtual",
}


def write_lanelet2(world: World, path: Path, *, dialect: Lanelet2Dialect | None = None) -> Path:
    """Write the World as a Lanelet2 map; return the path of Autoware's projector file beside it.

    That is `map_projector_info.yaml` beside a `lanelet2_map.osm`, else it is named as the map is.
    The dialect `autoware`, that of a `lanelet2_map.osm` unless another is asked for, has the
    regulatory elements of subtype `crosswalk` that Autoware's validator asks for (vm-05-01) and
    that the Lanelet2 library alone refuses. Raises OSError where a file cannot be written.
    """
    dialect = dialect or ("autoware" if path.name == AUTOWARE_MAP_NAME else "lanelet2")
    drawn = lanelet2_map(world, crosswalk_rules=dialect == "autoware")
    drawn.write(world, path)
    projector = _projector_path(path)
    projector.write_text(_projector_info(world), encoding="utf-8")
    return projector


def lanelet2_map(world: World, *, crosswalk_rules: bool = False) -> Lanelet2Map:
    """Return the World's lanes, connections, rules and surroundings as a map not yet written."""
    drawn = Lanelet2Map(heights_of(world) or layered(world))
    borders = lane_borders(world)
    members = _lane_members(world, borders, drawn)
    members |= _connection_members(world, borders, drawn)
    crosswalks = {c.id: _crosswalk(c, drawn) for c in world.crossings}
    ids = {name: drawn.new_id() for name in members}
    rules = add_rules(world, ids, crosswalks if crosswalk_rules else {}, drawn)
    areas = add_intersection_areas(world, drawn)
    lanes = {lane.id: lane for lane in world.lanes}
    tags = {lane.id: _lane_tags(lane) for lane in world.lanes}
    for connection in world.connections:
        if connection.id in members:
            tags[connection.id] = _connection_tags(connection, lanes, world)
            if connection.junction_id in areas:
                tags[connection.id]["intersection_area"] = str(areas[connection.junction_id])
    for name, about in tags.items():
        mine = rules.get(name, ())
        named = [RelationMember("relation", rule, "regulatory_element") for rule in mine]
        drawn.relation([*members[name], *named], about, number=ids[name])
    add_surroundings(world, drawn)
    return drawn


def _lane_members(
    world: World, borders: dict[str, Borders], drawn: Lanelet2Map
) -> dict[str, list[RelationMember]]:
    """Draw the borders of lanes, each once, and return them as left and right of every lane."""
    nodes = {
        lane.id: tuple(drawn.road_nodes(lane, line) for line in borders[lane.id])
        for lane in world.lanes
    }
    markings = lanelets.lane_markings(world, borders)
    return {
        name: [
            RelationMember("way", drawn.road_way(line, border_tags(markings[name, side])), side)
            for side, line in zip(SIDES, lines, strict=True)
        ]
        for name, lines in nodes.items()
    }


def border_tags(marking: Marking) -> dict[str, str]:
    """Return the tags of a border drawn in driving direction: Lanelet2 infers lane changes."""
    tags = {"type": _BORDER_TYPES[marking.paint]}
    if marking.paint == "kerb":
        tags["subtype"] = "high"
    if marking.pattern:
        tags["subtype"] = marking.pattern
    if marking.oncoming or marking.pattern == "solid":
        # One may overtake over a dashed middle line, but no one changes lanes over it.
        tags["lane_change"] = "no"
    elif marking.pattern == "dashed":
        tags["lane_change"] = "yes"
    return tags


def _connection_members(
    world: World, borders: dict[str, Borders], drawn: Lanelet2Map
) -> dict[str, list[RelationMember]]:
    found: dict[str, list[RelationMember]] = {}
    for connection in world.connections:
        if connection.id in borders:
            members = found[connection.id] = []
            for side, line in zip(SIDES, oriented(borders[connection.id]), strict=True):
                nodes = drawn.road_nodes(connection, line)
                members.append(RelationMember("way", drawn.road_way(nodes, VIRTUAL), side))
    return found


def _lane_tags(lane: Lane) -> dict[str, str]:
    urban = lane.speed_limit_mps.value <= URBAN_MPS
    subtype, participants = _KINDS[lane.kind]
    tags = {
        "type": "lanelet",
        "subtype": subtype,
        "location": "urban" if urban else "nonurban",
        "one_way": "yes",
        "foretwin:id": lane.id,
        "foretwin:width": f"{lane.width_m.value:.2f} {lane.width_m.source}",
    }
    tags |= {f"participant:{kind}": "yes" for kind in participants}
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
    tags = _lane_tags(lanelets.narrower_lane(connection, lanes))
    tags["foretwin:id"] = connection.id
    tags["foretwin:width"] = f"{connection.width_m.value:.2f} {connection.width_m.source}"
    if "speed_limit" in tags:
        slower = lanelets.slower_lane(start, end).speed_limit_mps
        tags["speed_limit"] = f"{slower.value * 3.6:.0f}"
        tags["foretwin:speed_limit"] = slower.source
    tags.pop("road_name", None)
    if connection.junction_id:
        tags["turn_direction"] = lanelets.indicated(
            connection.turn, world.intersection.driving_side
        )
    return tags


def _crosswalk(crossing: Crossing, drawn: Lanelet2Map) -> int:
    """Draw the lanelet over which pedestrians cross and return its id."""
    paint = {"type": "zebra_marking" if crossing.kind.value == "zebra" else "pedestrian_marking"}
    sides = []
    for name, edge in zip(SIDES, lanelets.crosswalk_edges(crossing), strict=True):
        way = drawn.way(
            drawn.ground_nodes(edge), paint if lanelets.is_marked(crossing) else VIRTUAL
        )
        sides.append(RelationMember("way", way, name))
    tags = {
        "type": "lanelet",
        "subtype": "crosswalk",
        "location": "urban",
        "one_way": "no",
        "participant:pedestrian": "yes",
        "speed_limit": "10",
        "foretwin:id": crossing.id,
        "foretwin:kind": f"{crossing.kind.value} {crossing.kind.source}",
    }
    return drawn.relation(sides, tags)


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
