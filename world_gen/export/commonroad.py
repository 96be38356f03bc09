"""A World as a CommonRoad scenario of the 2020a format: a map without traffic or task.

Lanes, connections and crossings become lanelets whose neighbours and successors share their end
points; `commonroad-io` reads the file. What the World guessed of speed limits stands on signs
marked as virtual.
"""

from __future__ import annotations

import datetime
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree
from shapely.geometry import Polygon

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import Building, Connection, Crossing, Lane, LaneKind, Road, World
from foretwin.world_gen.export.commonroad_elements import IdCounter, child, points, put, ref
from foretwin.world_gen.export.commonroad_intersections import intersections
from foretwin.world_gen.export.commonroad_lights import traffic_lights
from foretwin.world_gen.export.commonroad_signs import DEFAULT_COUNTRY, traffic_signs
from foretwin.world_gen.export.lane_borders import Borders, lane_borders
from foretwin.world_gen.export.lane_markings import Marking, lane_markings
from foretwin.world_gen.export.lanelets import URBAN_MPS, crosswalk_edges, is_marked, narrower_lane
from foretwin.world_gen.export.xml_tree import in_comment

VERSION = "2020a"
TIME_STEP_S = 0.1
UNKNOWN_GEONAME = -999
PASSABLE_UNDER_M = 2.5
"""Buildings that begin higher over the road stand in nobody's way and are left out."""
_TYPES: dict[LaneKind, str] = {
    "bus": "busLane",
    "bicycle": "bicycleLane",
    "parking": "parking",
    "tram": "restricted",
}
_USERS: dict[LaneKind, tuple[str, ...]] = {
    "driving": ("vehicle", "bicycle"),
    "bus": ("bus", "taxi", "priorityVehicle"),
    "bicycle": ("bicycle",),
    "parking": ("vehicle",),
    "tram": ("train",),
}
_CLASS_TYPES = {"motorway": "interstate", "trunk": "highway"}


def write_commonroad(
    world: World,
    path: Path,
    *,
    country: str = DEFAULT_COUNTRY,
    date: datetime.date | None = None,
) -> None:
    """Write the World as CommonRoad XML, dated today where no `date` is given.

    `country` is the ISO code of three letters whose traffic signs are meant; the World does not
    know it, and CommonRoad's own Zamunda has German signs. Raises ValueError where CommonRoad
    has no signs of that country, OSError where the file cannot be written.
    """
    root = {
        "commonRoadVersion": VERSION,
        "benchmarkID": f"{country}_Foretwin{world.id}-1",
        "author": "foretwin",
        "affiliation": "",
        "source": f"{world.attribution}; world {world.id}",
        "date": (date or datetime.date.today()).isoformat(),
        "timeStepSize": str(TIME_STEP_S),
    }
    elements = commonroad_elements(world, country=country)
    # lxml would not say which file cannot be written: it is opened here.
    with path.open("wb") as file, etree.xmlfile(file, encoding="utf-8") as xml:
        xml.write_declaration()
        with xml.element("commonRoad", root):
            xml.write("\n")
            put(xml, etree.Comment(in_comment(f"{world.attribution}; world {world.id}")))
            for element in elements:
                put(xml, element)


def commonroad_elements(world: World, *, country: str = DEFAULT_COUNTRY) -> Iterable[Any]:
    """Yield the children of the root element in the format's order."""
    ids = IdCounter()
    borders = lane_borders(world)
    lanes = {lane.id: ids.new() for lane in world.lanes}
    lanes |= {c.id: ids.new() for c in world.connections if c.id in borders}
    signs = traffic_signs(world, lanes, borders, country, ids)
    lights = traffic_lights(world, lanes, TIME_STEP_S, ids)
    yield _location(world)
    yield _tags(world)
    draft = _Lanelets(world, lanes, borders)
    for lane in world.lanes:
        yield draft.lane(lane, signs.of(lane.id), lights.of(lane.id))
    for connection in world.connections:
        if connection.id in lanes:
            yield draft.connection(connection, signs.of(connection.id))
    for crossing in world.crossings:
        yield _crosswalk(crossing, ids.new())
    yield from signs.elements
    yield from lights.elements
    yield from intersections(world, lanes, ids)
    for building in world.buildings:
        if building.min_height_m < PASSABLE_UNDER_M and _is_sound(building):
            yield _obstacle(building, ids.new())


class _Lanelets:
    """Writes lanes and connections as lanelets."""

    def __init__(
        self, world: World, ids: Mapping[str, int], borders: Mapping[str, Borders]
    ) -> None:
        self._ids = ids
        self._borders = borders
        self._roads: dict[str, Road] = {road.id: road for road in world.roads}
        self._lanes = {lane.id: lane for lane in world.lanes}
        self._markings = lane_markings(world, borders)
        self._stop_lines = {
            line.across_id: line for line in world.stop_lines if line.control.value != "none"
        }
        self._before: dict[str, list[int]] = {}
        self._after: dict[str, list[int]] = {}
        for lane in world.lanes:
            for name in lane.successor_ids:
                if name in self._lanes:
                    self._join(lane.id, name)
        for c in world.connections:
            if c.id in ids:
                self._join(c.from_lane_id, c.id)
                self._join(c.id, c.to_lane_id)

    def _join(self, before: str, after: str) -> None:
        self._after.setdefault(before, []).append(self._ids[after])
        self._before.setdefault(after, []).append(self._ids[before])

    def lane(self, lane: Lane, signs: Sequence[int], lights: Sequence[int]) -> Any:
        """Return the lanelet of a lane."""
        left, right = self._markings[lane.id, "left"], self._markings[lane.id, "right"]
        lanelet = self._begun(lane.id, _line_marking(left), _line_marking(right))
        for name, marking in (("adjacentLeft", left), ("adjacentRight", right)):
            if marking.beyond_id is not None:
                ref(lanelet, name, self._ids[marking.beyond_id]).set(
                    "drivingDir", "opposite" if marking.oncoming else "same"
                )
        self._stop_line(lanelet, lane.id, lights)
        self._end(lanelet, self._types(lane), lane.kind, signs, lights)
        return lanelet

    def connection(self, connection: Connection, signs: Sequence[int]) -> Any:
        """Return the lanelet of a connection; users are those of its narrower lane."""
        kind_of = narrower_lane(connection, self._lanes)
        lanelet = self._begun(connection.id, "no_marking", "no_marking")
        self._stop_line(lanelet, connection.id, ())
        types = self._types(kind_of)
        if connection.junction_id:
            types.append("intersection")
        self._end(lanelet, types, kind_of.kind, signs, ())
        return lanelet

    def _begun(self, name: str, left: str, right: str) -> Any:
        lanelet = etree.Element("lanelet", id=str(self._ids[name]))
        borders = self._borders[name]
        for tag, line, marking in (
            ("leftBound", borders.left, left),
            ("rightBound", borders.right, right),
        ):
            bound = child(lanelet, tag)
            points(bound, line)
            child(bound, "lineMarking", marking)
        for other in self._before.get(name, ()):
            ref(lanelet, "predecessor", other)
        for other in self._after.get(name, ()):
            ref(lanelet, "successor", other)
        return lanelet

    def _stop_line(self, lanelet: Any, name: str, lights: Sequence[int]) -> None:
        line = self._stop_lines.get(name)
        if line is None:
            return
        element = child(lanelet, "stopLine")
        points(element, line.ends)
        gives_way = line.control.value == "give_way"
        child(element, "lineMarking", "broad_dashed" if gives_way else "broad_solid")
        for light in lights if line.control.value == "signal" else ():
            ref(element, "trafficLightRef", light)

    def _types(self, lane: Lane) -> list[str]:
        road = self._roads.get(lane.road_id)
        road_class = road.road_class.removesuffix("_link") if road is not None else ""
        country = lane.speed_limit_mps.value > URBAN_MPS
        types = [_CLASS_TYPES.get(road_class, "country" if country else "urban")]
        if lane.kind in _TYPES:
            types.append(_TYPES[lane.kind])
        return types

    def _end(
        self,
        lanelet: Any,
        types: Iterable[str],
        kind: LaneKind,
        signs: Sequence[int],
        lights: Sequence[int],
    ) -> None:
        for name in types:
            child(lanelet, "laneletType", name)
        for user in _USERS[kind]:
            child(lanelet, "userOneWay", user)
        for sign in signs:
            ref(lanelet, "trafficSignRef", sign)
        for light in lights:
            ref(lanelet, "trafficLightRef", light)


def _line_marking(marking: Marking) -> str:
    if marking.paint == "kerb":
        return "curb"
    if marking.paint in ("edge", "none"):
        return "no_marking"
    broad = marking.paint == "thick" and marking.pattern in ("dashed", "solid")
    return f"broad_{marking.pattern}" if broad else marking.pattern


def _location(world: World) -> Any:
    origin = world.frame.origin
    location = etree.Element("location")
    child(location, "geoNameId", UNKNOWN_GEONAME)
    child(location, "gpsLatitude", f"{origin.lat_deg:.9f}")
    child(location, "gpsLongitude", f"{origin.lon_deg:.9f}")
    transformation = child(location, "geoTransformation")
    child(
        transformation,
        "geoReference",
        f"+proj=tmerc +lat_0={origin.lat_deg:.11f} +lon_0={origin.lon_deg:.11f} +k=1 +x_0=0 "
        "+y_0=0 +ellps=WGS84 +units=m +no_defs",
    )
    moved = child(transformation, "additionalTransformation")
    for name, value in (("xTranslation", 0), ("yTranslation", 0), ("zRotation", 0), ("scaling", 1)):
        child(moved, name, value)
    return location


def _tags(world: World) -> Any:
    tags = etree.Element("scenarioTags")
    kinds = {world.intersection.kind, *(j.summary.kind for j in world.junctions)}
    urban = (
        not world.lanes
        or np.median([lane.speed_limit_mps.value for lane in world.lanes]) <= URBAN_MPS
    )
    child(tags, "urban" if urban else "rural")
    child(tags, "intersection")
    if kinds & {"roundabout", "circular", "mini_roundabout"}:
        child(tags, "roundabout")
    return tags


def _crosswalk(crossing: Crossing, number: int) -> Any:
    lanelet = etree.Element("lanelet", id=str(number))
    marked = "dashed" if is_marked(crossing) else "no_marking"
    for tag, edge in zip(("leftBound", "rightBound"), crosswalk_edges(crossing), strict=True):
        bound = child(lanelet, tag)
        points(bound, edge)
        child(bound, "lineMarking", marked)
    child(lanelet, "laneletType", "crosswalk")
    child(lanelet, "userBidirectional", "pedestrian")
    return lanelet


def _is_sound(building: Building) -> bool:
    outline: Array = building.outline
    return len(outline) >= 3 and bool(Polygon(outline).is_valid)


def _obstacle(building: Building, number: int) -> Any:
    """Return a building as the outline of its ground: the format knows no courtyards."""
    obstacle = etree.Element("environmentObstacle", id=str(number))
    child(obstacle, "type", "building")
    points(child(child(obstacle, "shape"), "polygon"), building.outline)
    return obstacle
