"""What stands or is painted beside and on the roads of an OpenDRIVE file.

Every object belongs to the road that is nearest to it. Its corners are written in axes that are
parallel to the file's, so that outlines come out as the World has them, wherever the road bends.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import count
from typing import NamedTuple

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.beside_road import ObstacleKind
from foretwin.contracts.world import StopLine, World
from foretwin.geometry.polyline import left_of, unit
from foretwin.geometry.world_heights import heights_of, standing
from foretwin.world_gen.export.choices import OpenDriveVersion
from foretwin.world_gen.export.lanelets import crosswalk_edges
from foretwin.world_gen.export.opendrive_places import OdrNetwork
from foretwin.world_gen.export.opendrive_roads import OdrRoad
from foretwin.world_gen.export.solids import STOP_LINE_M
from foretwin.world_gen.export.stop_line_lanes import StopLineLanes
from foretwin.world_gen.export.xml_tree import Element, child, number

ISLAND_HEIGHT_M = 0.15
_CROSSWALKS = {"zebra": "zebra", "marked": "zebra", "uncontrolled": "zebra", "unmarked": "virtual"}
"""OpenDRIVE's kinds of crosswalks by OSM's; all others are `pedestrian`."""
_OBSTACLES: Mapping[ObstacleKind, tuple[str, str | None]] = {
    "tree": ("tree", None),
    "lamp": ("pole", "streetLamp"),
    "pole": ("pole", "powerPole"),
    "bollard": ("pole", "bollard"),
    "block": ("obstacle", None),
    "wall": ("barrier", "wall"),
    "fence": ("barrier", "fence"),
    "hedge": ("barrier", "hedge"),
    "guard_rail": ("barrier", "guardRail"),
    "shelter": ("building", "busStop"),
}
"""Type and subtype of objects (ASAM OpenDRIVE 1.8, 13.14)."""


class _Thing(NamedTuple):
    type: str
    subtype: str | None
    name: str
    outlines: tuple[Array, ...]
    """The outer one (N, 2), then holes."""
    bottom_m: float = 0.0
    height_m: float = 0.0
    lane_type: str | None = None
    road: OdrRoad | None = None
    grounded: bool = False
    """Stands on the World's plane, not on the road."""

    @property
    def middle(self) -> Array:
        """The mean (2,) of its corners."""
        corners = self.outlines[0]
        closed = len(corners) > 1 and np.array_equal(corners[0], corners[-1])
        middle: Array = corners[: len(corners) - closed].mean(axis=0)
        return middle


def add_objects(
    world: World, network: OdrNetwork, elements: Mapping[int, Element], version: OpenDriveVersion
) -> None:
    """Add `<objects>` to the roads' `elements`, which are by id."""
    things = list(_things(world, network))
    hosts = _hosts(things, [road for road in network.roads if road.road is not None])
    by_road: dict[int, list[_Thing]] = defaultdict(list)
    for thing, host in zip(things, hosts, strict=True):
        by_road[host.id].append(thing)
    ids = count(1)
    for road in network.roads:
        mine, source = by_road[road.id], road.road
        over = source is not None and (source.bridge or source.tunnel)
        if mine or over:
            group = child(elements[road.id], "objects")
        if mine:
            _add_things(group, road, mine, ids, version)
        if source is not None and over:
            tag, kind = ("tunnel", "standard") if source.tunnel else ("bridge", "concrete")
            reach = {"s": 0, "length": road.curve.length_m}
            child(group, tag, **reach, name=road.name, type=kind, id=next(ids))


def _things(world: World, network: OdrNetwork) -> Iterator[_Thing]:
    hills = heights_of(world)
    for building in world.buildings:
        rings, bottom = (building.outline, *building.holes), building.min_height_m
        top = max(building.height_m.value, bottom)
        low, high = standing(hills, building.outline, bottom, top)
        yield _Thing("building", None, building.id, rings, low, high - low, grounded=True)
    for one in world.obstacles:
        kind, subtype = _OBSTACLES[one.kind]
        low, high = standing(hills, one.outline, 0.0, one.height_m.value)
        rings = (one.outline, *one.holes)
        yield _Thing(kind, subtype, one.id, rings, low, high - low, grounded=True)
    for area in world.islands:
        rings = (area.outline, *area.holes)
        yield _Thing("trafficIsland", None, area.id, rings, 0.0, ISLAND_HEIGHT_M)
    for area in network.areas_on_foot:
        yield _Thing("none", "sidewalk", area.id, (area.outline, *area.holes), lane_type="sidewalk")
    for crossing in world.crossings:
        kind = _CROSSWALKS.get(crossing.kind.value, "pedestrian")
        left, right = crosswalk_edges(crossing)
        # CARLA tells one crosswalk from the next by the first corner, which comes again.
        ring = np.concatenate([right, left[::-1], right[:1]])
        yield _Thing("crosswalk", kind, crossing.id, (ring,))
    places = StopLineLanes(world)
    for line in world.stop_lines:
        road = network.road_across(places.across(line))
        if line.control.value != "none" and road is not None:
            yield _Thing("roadMark", "signalLines", line.id, (_painted(line),), road=road)


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
    middles = shapely.points(np.array([thing.middle for thing in things]))
    which, nearest = shapely.STRtree(lines).query_nearest(middles, all_matches=False)
    road_of = dict(zip(which.tolist(), nearest.tolist(), strict=True))
    return [thing.road or roads[road_of[i]] for i, thing in enumerate(things)]


def _add_things(
    group: Element,
    road: OdrRoad,
    things: Sequence[_Thing],
    ids: Iterator[int],
    version: OpenDriveVersion,
) -> None:
    s, t = road.curve.locate(np.array([thing.middle for thing in things]))
    points, directions = road.curve.at(s)
    origins = points + t[:, None] * left_of(directions)
    headings = np.arctan2(directions[:, 1], directions[:, 0])
    for i, thing in enumerate(things):
        made = child(
            group,
            "object",
            type=thing.type,
            name=thing.name,
            s=s[i],
            t=t[i],
            zOffset=thing.bottom_m - (road.height.at(float(s[i])) if thing.grounded else 0.0),
            orientation="none",
            hdg=-headings[i],
            height=float(thing.height_m),
            subtype=thing.subtype if version == "1.8" else None,
            id=next(ids),
        )
        _add_outlines(made, thing, origins[i], version)


def _add_outlines(made: Element, thing: _Thing, origin: Array, version: OpenDriveVersion) -> None:
    if version == "1.4":
        _add_corners(child(made, "outline"), thing, thing.outlines[0] - origin, None)
        return
    corners = count()
    # CARLA reads crosswalks from an outline of the object itself alone, as 1.8 allows for one.
    group = made if thing.type == "crosswalk" else child(made, "outlines")
    for i, points in enumerate(thing.outlines):
        kind = {"closed": "true", "outer": "false" if i else "true"}
        outline = child(group, "outline", **kind, id=i, laneType=thing.lane_type)
        _add_corners(outline, thing, points - origin, corners)


def _add_corners(outline: Element, thing: _Thing, points: Array, ids: Iterator[int] | None) -> None:
    for u, v in points.tolist():
        at = {"u": f"{u:.4f}", "v": f"{v:.4f}", "z": "0", "height": number(thing.height_m)}
        child(outline, "cornerLocal", **at, id=None if ids is None else next(ids))
