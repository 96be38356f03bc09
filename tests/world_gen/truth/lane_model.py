"""Lanes and ways through junctions as any generator made them, in one form for the scores."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from scipy.spatial import cKDTree

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import LocalFrame, geo_from_local, local_from_geo
from foretwin.contracts.world import World
from foretwin.geometry.polyline import densified, length, tangents
from tests.world_gen.truth.hd_map import HdMap
from tests.world_gen.truth.junction_ways import movements

STEP_M = 0.25
_REACH_M = 8.0
_SAME_WAY_COS = np.cos(np.radians(40.0))


@dataclass(frozen=True, kw_only=True)
class ModelLane:
    """One lane; `road` names the direction of the road that it belongs to."""

    line: Array
    width_m: float
    road: str


@dataclass(frozen=True, kw_only=True)
class ModelConnection:
    """A way from lane to lane, by their keys; `line` (N, 2) from the one's end to the other's."""

    from_lane: str
    to_lane: str
    line: Array


@dataclass(frozen=True, kw_only=True)
class LaneModel:
    """What cars may drive on, in the frame of the truth."""

    name: str
    lanes: dict[str, ModelLane]
    connections: list[ModelConnection]
    joins: tuple[tuple[str, str], ...] = ()
    """Lanes that go on as another where it begins."""

    def lines(self, *, connections: bool = True) -> list[Array]:
        """Return all centre lines."""
        made = [lane.line for lane in self.lanes.values()]
        return made + [c.line for c in self.connections] if connections else made


class Nearby:
    """Finds the line that runs past a point in its direction."""

    def __init__(self, lines: Sequence[Array]) -> None:
        dense = [densified(line, spacing_m=STEP_M) for line in lines]
        self._which = np.repeat(np.arange(len(dense)), [len(line) for line in dense])
        self._xy = np.concatenate(dense)
        self._along = np.concatenate([tangents(line) for line in dense])
        self._tree = cKDTree(self._xy)

    def lateral(self, xy_m: Array, along: Array) -> tuple[Array, np.ndarray]:
        """Return for points (N, 2) with unit directions (N, 2) how far left of the nearest line
        that heads their way they lie, NaN where there is none within 8 m, and which line it is."""
        offset = np.full(len(xy_m), np.nan)
        which = np.full(len(xy_m), -1)
        for i, near in enumerate(self._tree.query_ball_point(xy_m, _REACH_M)):
            rows = np.array(near, dtype=np.int64)
            rows = rows[self._along[rows] @ along[i] > _SAME_WAY_COS]
            gap = xy_m[i] - self._xy[rows]
            d = self._along[rows]
            beside = np.abs((gap * d).sum(axis=1)) <= STEP_M
            if beside.any():
                across = (d[:, 0] * gap[:, 1] - d[:, 1] * gap[:, 0])[beside]
                best = int(np.argmin(np.abs(across)))
                offset[i], which[i] = across[best], self._which[rows[beside][best]]
        return offset, which


def of_world(world: World, frame: LocalFrame) -> LaneModel:
    """Return the lanes of a World that cars drive, in metres of `frame`."""

    def moved(line: Array) -> Array:
        geo = geo_from_local(world.frame, line)
        return local_from_geo(frame, geo[:, 0], geo[:, 1])

    lanes = {
        lane.id: ModelLane(
            line=moved(lane.centerline),
            width_m=lane.width_m.value,
            road=f"{lane.road_id} {lane.reverse}",
        )
        for lane in world.lanes
        if lane.kind in ("driving", "bus")
    }
    found = [
        ModelConnection(from_lane=c.from_lane_id, to_lane=c.to_lane_id, line=moved(c.centerline))
        for c in world.connections
        if c.from_lane_id in lanes and c.to_lane_id in lanes
    ]
    joins = tuple(
        (lane.id, after)
        for lane in world.lanes
        for after in lane.successor_ids
        if lane.id in lanes and after in lanes
    )
    return LaneModel(name="foretwin", lanes=lanes, connections=found, joins=joins)


def of_hd_map(hd: HdMap) -> LaneModel:
    """Return the HD map's own lanes: what a perfect generator would make."""
    lanes = {
        key: ModelLane(line=lane.centerline, width_m=lane.width_m, road=key)
        for key, lane in hd.lanes.items()
        if not lane.inside and lane.kind != "bicycle"
    }
    found = [
        ModelConnection(
            from_lane=m.from_lane,
            to_lane=m.to_lane,
            line=np.concatenate([hd.lanes[key].centerline for key in m.inside]),
        )
        for m in movements(hd)
    ]
    joins = tuple(
        (key, after) for key in lanes for after in hd.lanes[key].successors if after in lanes
    )
    return LaneModel(name="HD map", lanes=lanes, connections=found, joins=joins)


def of_sumo(net: Path) -> LaneModel:
    """Return the lanes of a SUMO net whose metres are those of the truth's frame."""
    root = ElementTree.parse(net).getroot()
    shapes, lanes, inner = {}, {}, {}
    for edge in root.iter("edge"):
        for lane in edge.iter("lane"):
            key = str(lane.get("id"))
            shape = _shape(lane.get("shape", ""))
            shapes[key] = shape
            if edge.get("function") == "internal":
                inner[key] = shape
            elif _for_cars(lane):
                width = float(lane.get("width", "3.2"))
                lanes[key] = ModelLane(line=shape, width_m=width, road=str(edge.get("id")))
    after: dict[str, str] = {}
    starts = []
    for c in root.iter("connection"):
        begin, end = (f"{c.get(w)}_{c.get(w + 'Lane')}" for w in ("from", "to"))
        if begin in inner:
            after[begin] = str(c.get("via", ""))
        elif begin in lanes and end in lanes:
            starts.append((begin, end, c.get("via")))
    found = []
    for begin, end, via in starts:
        parts = [shapes[begin][-1:]]
        while via in inner:
            parts.append(inner[via])
            via = after.get(via)
        parts.append(shapes[end][:1])
        line = np.concatenate(parts)
        if length(line) > 0.1:
            found.append(ModelConnection(from_lane=begin, to_lane=end, line=_apart(line)))
    return LaneModel(name="netconvert", lanes=lanes, connections=found)


def _for_cars(lane: ElementTree.Element) -> bool:
    allow, disallow = lane.get("allow"), lane.get("disallow", "")
    if allow is not None:
        return "passenger" in allow.split() or "bus" in allow.split() or allow == "all"
    return "passenger" not in disallow.split() and disallow != "all"


def _shape(text: str) -> Array:
    return np.array([[float(v) for v in point.split(",")[:2]] for point in text.split()])


def _apart(line: Array) -> Array:
    step = np.hypot(*np.diff(line, axis=0).T)
    return np.asarray(line[np.concatenate([[True], step > 1e-3])])
