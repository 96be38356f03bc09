"""A World as a CommonRoad scenario of the 2020a format: a map without traffic or task.

Lanes, connections and crossings become lanelets whose neighbours and successors share their end
points; `commonroad-io` reads the file. What the World guessed of speed limits stands on signs
marked as virtual.
"""

from __future__ import annotations

import datetime
from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import count
from pathlib import Path

import numpy as np
from lxml import etree
from shapely.geometry import Polygon

from foretwin.contracts.arrays import Array
from foretwin.contracts.beside_road import Building, ObstacleKind
from foretwin.contracts.world import ROUNDABOUT_KINDS, Connection, Crossing, Lane, LaneKind, World
from foretwin.world_gen.buildings.tags import HEADROOM_M
from foretwin.world_gen.export import commonroad_controls as controls
from foretwin.world_gen.export import lanelets
from foretwin.world_gen.export.commonroad_controls import DEFAULT_COUNTRY, points
from foretwin.world_gen.export.commonroad_intersections import intersections
from foretwin.world_gen.export.lane_borders import Borders, lane_borders
from foretwin.world_gen.export.lanelets import URBAN_MPS, Marking
from foretwin.world_gen.export.sdformat_shapes import extrusions
from foretwin.world_gen.export.stop_line_lanes import StopLineLanes
from foretwin.world_gen.export.xml_tree import Element, child, document, element, in_comment, leaves

VERSION = "2020a"
_PILLARS: frozenset[ObstacleKind] = frozenset(("tree", "lamp", "pole", "bollard"))
TIME_STEP_S = 0.1
UNKNOWN_GEONAME = -999
_KINDS: dict[LaneKind, tuple[str, tuple[str, ...]]] = {
    "driving": ("", ("vehicle", "bicycle")),
    "bus": ("busLane", ("bus", "taxi", "priorityVehicle")),
    "bicycle": ("bicycleLane", ("bicycle",)),
    "parking": ("parking", ("vehicle",)),
    "tram": ("restricted", ("train",)),
    "closed": ("restricted", ("priorityVehicle",)),
}
"""Type and users of lanes by kind; those for driving have the type of their road alone."""
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
    hold it, and CommonRoad's own Zamunda has German signs. Raises ValueError where CommonRoad
    has no signs of that country, OSError where the file cannot be written.
    """
    about = f"{world.attribution}; world {world.id}"
    root = element(
        "commonRoad",
        commonRoadVersion=VERSION,
        benchmarkID=f"{country}_Foretwin{world.id}-1",
        author="foretwin",
        affiliation="",
        source=about,
        date=(date or datetime.date.today()).isoformat(),
        timeStepSize=TIME_STEP_S,
    )
    root.append(etree.Comment(in_comment(about)))
    root.extend(commonroad_elements(world, country=country))
    root.text = "\n"
    for part in root:
        part.tail = "\n"
    path.write_bytes(document(root, encoding="utf-8"))


def commonroad_elements(world: World, *, country: str = DEFAULT_COUNTRY) -> Iterator[Element]:
    """Yield the children of the root element in the format's order."""
    ids = count(1)  # all kinds share one range
    draft = _Lanelets(world, country, ids)
    yield _location(world)
    yield _tags(world)
    for lane in world.lanes:
        yield draft.lane(lane)
    for connection in world.connections:
        if connection.id in draft.ids:
            yield draft.connection(connection)
    for crossing in world.crossings:
        yield _crosswalk(crossing, next(ids))
    yield from draft.signs.elements
    yield from draft.lights.elements
    yield from intersections(world, draft.ids, ids)
    for building in world.buildings:
        if building.min_height_m < HEADROOM_M and _is_sound(building):
            # The outline of its ground: the format has no courtyards.
            yield _environment("building", building.outline, next(ids))
    for one in world.obstacles:
        kind = "pillar" if one.kind in _PILLARS else "unknown"
        for ring in extrusions(one.outline, one.holes):  # the format has no holes
            yield _environment(kind, ring, next(ids))


def _environment(kind: str, outline: Array, number: int) -> Element:
    obstacle = element("environmentObstacle", id=number)
    child(obstacle, "type", kind)
    points(child(child(obstacle, "shape"), "polygon"), outline)
    return obstacle


class _Lanelets:
    """Writes lanes and connections as lanelets, whose `ids` are by those of the World."""

    def __init__(self, world: World, country: str, ids: Iterator[int]) -> None:
        borders = self._borders = lane_borders(world)
        self.ids = {lane.id: next(ids) for lane in world.lanes}
        self.ids |= {c.id: next(ids) for c in world.connections if c.id in borders}
        self.signs = controls.traffic_signs(world, self.ids, borders, country, ids)
        self.lights = controls.traffic_lights(world, self.ids, TIME_STEP_S, ids)
        self._class_of = {road.id: road.road_class for road in world.roads}
        self._lanes = {lane.id: lane for lane in world.lanes}
        self._markings = lanelets.lane_markings(world, borders)
        places = StopLineLanes(world)
        self._stop_lines = {
            places.across(line): line for line in world.stop_lines if line.control.value != "none"
        }
        self._before: dict[str, list[int]] = defaultdict(list)
        self._after: dict[str, list[int]] = defaultdict(list)
        for lane in world.lanes:
            for name in lane.successor_ids:
                if name in self._lanes:
                    self._join(lane.id, name)
        for c in world.connections:
            if c.id in self.ids:
                self._join(c.from_lane_id, c.id)
                self._join(c.id, c.to_lane_id)

    def _join(self, before: str, after: str) -> None:
        self._after[before].append(self.ids[after])
        self._before[after].append(self.ids[before])

    def lane(self, lane: Lane) -> Element:
        """Return the lanelet of a lane."""
        left, right = self._markings[lane.id, "left"], self._markings[lane.id, "right"]
        lanelet = self._begun(lane.id, _line_marking(left), _line_marking(right))
        for tag, marking in (("adjacentLeft", left), ("adjacentRight", right)):
            if marking.beyond_id is not None:
                way = "opposite" if marking.oncoming else "same"
                child(lanelet, tag, ref=self.ids[marking.beyond_id], drivingDir=way)
        return self._ended(lanelet, lane.id, self._types(lane), lane.kind)

    def connection(self, connection: Connection) -> Element:
        """Return the lanelet of a connection; users are those of its narrower lane."""
        lane = lanelets.narrower_lane(connection, self._lanes)
        types = self._types(lane)
        if connection.junction_id:
            types.append("intersection")
        lanelet = self._begun(connection.id, "no_marking", "no_marking")
        return self._ended(lanelet, connection.id, types, lane.kind)

    def _begun(self, name: str, left: str, right: str) -> Element:
        lanelet = _bounded(self.ids[name], self._borders[name], left, right)
        for tag, others in (("predecessor", self._before), ("successor", self._after)):
            for other in others[name]:
                child(lanelet, tag, ref=other)
        return lanelet

    def _types(self, lane: Lane) -> list[str]:
        road_class = self._class_of.get(lane.road_id, "").removesuffix("_link")
        country = lane.speed_limit_mps.value > URBAN_MPS
        types = [_CLASS_TYPES.get(road_class, "country" if country else "urban")]
        own, _ = _KINDS[lane.kind]
        return [*types, own] if own else types

    def _ended(self, lanelet: Element, name: str, types: Sequence[str], kind: LaneKind) -> Element:
        line, lights = self._stop_lines.get(name), self.lights.of(name)
        _, users = _KINDS[kind]
        if line is not None:
            made = child(lanelet, "stopLine")
            points(made, line.ends)
            gives_way = line.control.value == "give_way"
            child(made, "lineMarking", "broad_dashed" if gives_way else "broad_solid")
            for light in lights if line.control.value == "signal" else ():
                child(made, "trafficLightRef", ref=light)
        leaves(lanelet, (("laneletType", word) for word in types))
        leaves(lanelet, (("userOneWay", user) for user in users))
        for sign in self.signs.of(name):
            child(lanelet, "trafficSignRef", ref=sign)
        for light in lights:
            child(lanelet, "trafficLightRef", ref=light)
        return lanelet


def _bounded(number: int, borders: Borders, left: str, right: str) -> Element:
    """Return a lanelet with both bounds, marked as said."""
    lanelet = element("lanelet", id=number)
    for tag, line, marking in zip(("leftBound", "rightBound"), borders, (left, right), strict=True):
        bound = child(lanelet, tag)
        points(bound, line)
        child(bound, "lineMarking", marking)
    return lanelet


def _line_marking(marking: Marking) -> str:
    if marking.paint == "kerb":
        return "curb"
    if marking.paint in ("edge", "none"):
        return "no_marking"
    broad = marking.paint == "thick" and marking.pattern in ("dashed", "solid")
    return f"broad_{marking.pattern}" if broad else marking.pattern


def _location(world: World) -> Element:
    origin = world.frame.origin
    location = element("location")
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
    moved = {"xTranslation": "0", "yTranslation": "0", "zRotation": "0", "scaling": "1"}
    leaves(child(transformation, "additionalTransformation"), moved)
    return location


def _tags(world: World) -> Element:
    tags = element("scenarioTags")
    kinds = {world.intersection.kind, *(j.summary.kind for j in world.junctions)}
    limits_mps = [lane.speed_limit_mps.value for lane in world.lanes]
    child(tags, "urban" if not limits_mps or np.median(limits_mps) <= URBAN_MPS else "rural")
    child(tags, "intersection")
    if kinds & ROUNDABOUT_KINDS:
        child(tags, "roundabout")
    return tags


def _crosswalk(crossing: Crossing, number: int) -> Element:
    marked = "dashed" if lanelets.is_marked(crossing) else "no_marking"
    lanelet = _bounded(number, lanelets.crosswalk_edges(crossing), marked, marked)
    leaves(lanelet, {"laneletType": "crosswalk", "userBidirectional": "pedestrian"})
    return lanelet


def _is_sound(building: Building) -> bool:
    return len(building.outline) >= 3 and bool(Polygon(building.outline).is_valid)
