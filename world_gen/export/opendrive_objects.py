"""What stands or is painted beside and on the roads of an OpenDRIVE file.

Every object belongs to the road that is nearest to it. Its corners are written in axes that are
parallel to the file's, so that outlines come out as the World has them, wherever the road bends.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import shapely
from lxml import etree

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import Crossing, StopLine, World
from foretwin.geometry.polyline import left_of, unit
from foretwin.world_gen.export.opendrive_elements import Version, number, text
from foretwin.world_gen.export.opendrive_places import OdrNetwork
from foretwin.world_gen.export.opendrive_roads import OdrRoad

STOP_LINE_M = 0.5
"""Breadth of a stop line (RMS-1, 1993)."""
ISLAND_HEIGHT_M = 0.15
_CROSSWALKS = {"zebra": "zebra", "marked": "zebra", "uncontrolled": "zebra", "unmarked": "virtual"}
"""OpenDRIVE's kinds of crosswalks by OSM's; all others are `pedestrian`."""


class _Thing(NamedTuple):
    type: str
    subtype: str
    name: str
    outlines: tuple[Array, ...]
    """The outer one (N, 2), then holes."""
    bottom_m: float = 0.0
    height_m: float = 0.0
    lane_type: str = ""
    road: OdrRoad | None = None
    grounded: bool = False
    """Stands on the World's plane, not on the road."""


def add_objects(
    world: World, network: OdrNetwork, elements: Mapping[int, etree._Element], version: Version
) -> None:
    """Add `<objects>` to the roads' `elements`, which are by id."""
    things = list(_things(world, network))
    hosts = _hosts(things, [road for road in network.roads if road.road is not None])
    by_road: dict[int, list[_Thing]] = {}
    for thing, host in zip(things, hosts, strict=True):
        by_road.setdefault(host.id, []).append(thing)
    own = 0
    for road in network.roads:
        mine = by_road.get(road.id, [])
        source = road.road
        over = source is not None and (source.bridge or source.tunnel)
        if not mine and not over:
            continue
        group = etree.SubElement(elements[road.id], "objects")
        for thing, (element, origin) in zip(mine, _placed(group, road, mine, version), strict=True):
            own += 1
            element.set("id", str(own))
            _add_outlines(element, thing, origin, version)
        if over:
            own += 1
            _add_structure(group, road, own)


def _things(world: World, network: OdrNetwork) -> Iterator[_Thing]:
    for building in world.buildings:
        bottom = building.min_height_m
        yield _Thing(
            "building",
            "",
            building.id,
            (building.outline, *building.holes),
            bottom,
            max(building.height_m.value - bottom, 0.0),
            grounded=True,
        )
    for area in world.islands:
        yield _Thing(
            "trafficIsland", "", area.id, (area.outline, *area.holes), 0.0, ISLAND_HEIGHT_M
        )
    for area in network.areas_on_foot:
        yield _Thing("none", "sidewalk", area.id, (area.outline, *area.holes), lane_type="sidewalk")
    for crossing in world.crossings:
        kind = _CROSSWALKS.get(crossing.kind.value, "pedestrian")
        yield _Thing("crosswalk", kind, crossing.id, (_stripe(crossing),))
    for line in world.stop_lines:
        road = network.road_across(line.across_id)
        if line.control.value != "none" and road is not None:
            yield _Thing("roadMark", "signalLines", line.id, (_painted(line),), road=road)


def _stripe(crossing: Crossing) -> Array:
    a, b = crossing.line
    aside = left_of(unit(b - a)) * (crossing.width_m.value / 2.0)
    return np.array([a - aside, b - aside, b + aside, a + aside])


def _painted(line: StopLine) -> Array:
    """Return the outline of a stop line, just beyond the place where cars stop."""
    left, right = line.ends
    ahead = left_of(unit(right - left)) * STOP_LINE_M
    return np.array([right, right + ahead, left + ahead, left])


def _hosts(things: Sequence[_Thing], roads: Sequence[OdrRoad]) -> list[OdrRoad]:
    """Return the road that each thing belongs to: its own, else the nearest."""
    if not things:
        return []
    lines = [shapely.LineString(r.road.reference_line) for r in roads if r.road is not None]
    tree = shapely.STRtree(lines)
    middles = shapely.points(np.array([thing.outlines[0].mean(axis=0) for thing in things]))
    pairs = tree.query_nearest(middles, all_matches=False)
    nearest = dict(zip(pairs[0].tolist(), pairs[1].tolist(), strict=True))
    return [thing.road or roads[nearest[i]] for i, thing in enumerate(things)]


def _placed(
    group: etree._Element, road: OdrRoad, things: Sequence[_Thing], version: Version
) -> Iterator[tuple[etree._Element, Array]]:
    """Yield an `<object>` for each thing, and its origin (2,)."""
    if not things:
        return
    middles = np.array([thing.outlines[0].mean(axis=0) for thing in things])
    s, t = road.curve.locate(middles)
    points, directions = road.curve.at(s)
    origins = points + t[:, None] * left_of(directions)
    headings = np.arctan2(directions[:, 1], directions[:, 0])
    for i, thing in enumerate(things):
        element = etree.SubElement(
            group,
            "object",
            type=thing.type,
            name=thing.name,
            s=number(s[i]),
            t=number(t[i]),
            zOffset=number(thing.bottom_m - (road.height.at(float(s[i])) if thing.grounded else 0)),
            orientation="none",
            hdg=number(-headings[i]),
            height=number(thing.height_m),
        )
        if thing.subtype and version == "1.8":
            element.set("subtype", thing.subtype)
        yield element, origins[i]


def _add_outlines(element: etree._Element, thing: _Thing, origin: Array, version: Version) -> None:
    height = number(thing.height_m)
    if version == "1.4":
        outline = etree.SubElement(element, "outline")
        for u, v in (thing.outlines[0] - origin).tolist():
            etree.SubElement(
                outline, "cornerLocal", u=f"{u:.4f}", v=f"{v:.4f}", z="0", height=height
            )
        return
    group = etree.SubElement(element, "outlines")
    corner = 0
    for i, points in enumerate(thing.outlines):
        outline = etree.SubElement(group, "outline", closed="true", outer="false" if i else "true")
        outline.set("id", str(i))
        if thing.lane_type:
            outline.set("laneType", thing.lane_type)
        for u, v in (points - origin).tolist():
            item = etree.SubElement(
                outline, "cornerLocal", u=f"{u:.4f}", v=f"{v:.4f}", z="0", height=height
            )
            item.set("id", str(corner))
            corner += 1


def _add_structure(group: etree._Element, road: OdrRoad, own: int) -> None:
    source = road.road
    assert source is not None
    item = etree.SubElement(
        group,
        "tunnel" if source.tunnel else "bridge",
        s="0",
        length=number(road.curve.length_m),
        name=text(road.name),
        type="standard" if source.tunnel else "concrete",
    )
    item.set("id", str(own))
