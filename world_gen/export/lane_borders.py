"""Left and right borders of lanes and connections, with every shared point shared exactly.

The lanes of a road lie between parallels of its reference line, so neighbours have one border in
common, point by point. Where a lane leads straight into another their ends are drawn together;
a connection begins on its first lane's end points and ends on its second's, and takes up every
change of width on the way.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import shapely

from foretwin.contracts.arrays import Array
from foretwin.contracts.world import Connection, Lane, World
from foretwin.geometry.polyline import apart, arc_lengths, length, mitres, unit
from foretwin.world_gen.export.parallels import filled, parallel, untangled

BLEND_M = 10.0
"""Over this length a border bends to the point where another road's border takes over."""
_GAP_M = 0.3
"""Lanes whose edges lie nearer to each other touch; a wider gap is no lane's."""
_COINCIDENT_M = 0.005
_Place = tuple[str, int, int]
"""Road, border counted from the left of its reference line, and end: 0 first, 1 last."""


class Borders(NamedTuple):
    """The borders (N, 2) of one lane in metres, in driving direction, with as many points each."""

    left: Array
    right: Array


class _BorderIndices(NamedTuple):
    """Which of its road's borders, counted from the left, are a lane's left and right ones."""

    left: int
    right: int


class _RoadDraft(NamedTuple):
    line: Array
    offsets_m: list[float]
    sides: dict[str, _BorderIndices]


def lane_borders(world: World) -> dict[str, Borders]:
    """Return the borders of every lane and connection of a World by its id."""
    lanes = {lane.id: lane for lane in world.lanes}
    roads = _roads(world, lanes)
    joints = _joints(lanes, roads)
    beyond = _directions_beyond(joints, roads)
    drawn = {}
    for name, road in roads.items():
        before, after = beyond.get((name, 0)), beyond.get((name, 1))
        drawn[name] = parallel(road.line, np.array(road.offsets_m), before=before, after=after)
    _join_ends(joints, roads, drawn)
    found: dict[str, Borders] = {}
    for name, road in roads.items():
        lines = np.round(drawn[name], 3)
        for lane_id, side in road.sides.items():
            step = -1 if lanes[lane_id].reverse else 1
            found[lane_id] = Borders(lines[side.left][::step], lines[side.right][::step])
    found.update(_connection_borders(world.connections, found))
    return found


def _roads(world: World, lanes: Mapping[str, Lane]) -> dict[str, _RoadDraft]:
    """Return where borders lie on each road; a lane without a road is a road of its own."""
    found: dict[str, _RoadDraft] = {}
    for road in world.roads:
        mine = [lanes[name] for name in road.lane_ids if name in lanes]
        line = _distinct(road.reference_line)
        if mine:
            found[road.id] = _road(line, mine)
    placed = {name for road in found.values() for name in road.sides}
    for lane in world.lanes:
        if lane.id not in placed:
            half = lane.width_m.value / 2
            side = _BorderIndices(1, 0) if lane.reverse else _BorderIndices(0, 1)
            line = _distinct(lane.centerline[::-1] if lane.reverse else lane.centerline)
            found[f"lane {lane.id}"] = _RoadDraft(line, [half, -half], {lane.id: side})
    return found


def _distinct(line: Array) -> Array:
    """Return a line (N, 2) without points that coincide with the one before; its ends stay."""
    kept: Array = line[apart(line, tolerance_m=_COINCIDENT_M)]
    kept[-1] = line[-1]
    return kept if len(kept) > 1 else line[[0, -1]]


def _road(line: Array, lanes: Sequence[Lane]) -> _RoadDraft:
    offsets: list[float] = []
    sides: dict[str, _BorderIndices] = {}
    for lane in sorted(lanes, key=lambda lane: -lane.left_of_reference_m):
        left = lane.left_of_reference_m + lane.width_m.value / 2
        right = lane.left_of_reference_m - lane.width_m.value / 2
        if offsets and abs(offsets[-1] - left) <= _GAP_M:
            offsets[-1] = (offsets[-1] + left) / 2
        else:
            offsets.append(left)
        offsets.append(right)
        outer = len(offsets) - 2
        sides[lane.id] = _BorderIndices(outer, outer + 1)
        if lane.reverse:
            sides[lane.id] = _BorderIndices(outer + 1, outer)
    return _RoadDraft(line, offsets, sides)


class _LaneEnd(NamedTuple):
    """A lane's last point or first one: of which road, and at which of its ends."""

    lane: Lane
    road: str
    end: int

    def outgoing(self, roads: Mapping[str, _RoadDraft]) -> Array:
        """Return the direction (2,) of the road's line here, pointing out of the road."""
        line = roads[self.road].line
        return unit(line[-1] - line[-2] if self.end else line[0] - line[1])


_Joint = tuple[_LaneEnd, _LaneEnd]


def _joints(lanes: Mapping[str, Lane], roads: Mapping[str, _RoadDraft]) -> list[_Joint]:
    """Return where lanes lead straight into others."""
    road_of = {lane_id: name for name, road in roads.items() for lane_id in road.sides}

    def end_of(lane: Lane, *, first: bool) -> _LaneEnd:
        return _LaneEnd(lane, road_of[lane.id], 1 if first == lane.reverse else 0)

    pairs = ((lane, name) for lane in lanes.values() for name in lane.successor_ids)
    known = ((lane, lanes[name]) for lane, name in pairs if name in lanes)
    return [(end_of(lane, first=False), end_of(after, first=True)) for lane, after in known]


def _directions_beyond(
    joints: Sequence[_Joint], roads: Mapping[str, _RoadDraft]
) -> dict[tuple[str, int], Array]:
    """Return, where lanes lead straight into others, the road's direction beyond its end.

    By (road, end), as a unit vector (2,) along that road's own reference line.
    """
    found: dict[tuple[str, int], Array] = {}
    for pair in joints:
        for here, there in (pair, pair[::-1]):
            inward = -there.outgoing(roads)
            found[here.road, here.end] = inward if here.end else -inward
    return found


def _join_ends(
    joints: Sequence[_Joint], roads: Mapping[str, _RoadDraft], drawn: dict[str, Array]
) -> None:
    """Draw the ends of borders together where a lane leads straight into another."""
    groups = _Groups()
    for here, there in joints:
        mine, its = roads[here.road].sides[here.lane.id], roads[there.road].sides[there.lane.id]
        groups.join((here.road, mine.left, here.end), (there.road, its.left, there.end))
        groups.join((here.road, mine.right, here.end), (there.road, its.right, there.end))
    for members in groups.found():
        ends = np.array([drawn[road][border, -end] for road, border, end in members])
        meeting = ends.mean(axis=0)
        for (road, border, end), at in zip(members, ends, strict=True):
            line = drawn[road][border]
            s = arc_lengths(line)
            gone = s if end == 0 else s[-1] - s
            reach = max(min(BLEND_M, s[-1] / 2), 1e-6)
            line += np.clip(1.0 - gone / reach, 0.0, 1.0)[:, None] * (meeting - at)
            line[-end] = meeting


class _Groups:
    """Ends of borders that become one point; never two of the same end of a road."""

    def __init__(self) -> None:
        self._group_of: dict[_Place, int] = {}
        self._members: dict[int, list[_Place]] = {}

    def join(self, a: _Place, b: _Place) -> None:
        mine, other = self._group(a), self._group(b)
        if mine == other:
            return
        ends = {(road, end): border for road, border, end in self._members[mine]}
        if any(
            ends.get((road, end), border) != border for road, border, end in self._members[other]
        ):
            return
        for place in self._members.pop(other):
            self._members[mine].append(place)
            self._group_of[place] = mine

    def found(self) -> list[list[_Place]]:
        return [members for members in self._members.values() if len(members) > 1]

    def _group(self, place: _Place) -> int:
        if place not in self._group_of:
            self._group_of[place] = number = len(self._group_of)
            self._members[number] = [place]
        return self._group_of[place]


def _connection_borders(
    connections: Sequence[Connection], lanes: Mapping[str, Borders]
) -> dict[str, Borders]:
    found: dict[str, Borders] = {}
    for connection in connections:
        start, end = lanes.get(connection.from_lane_id), lanes.get(connection.to_lane_id)
        if start is not None and end is not None:
            middle = connection.centerline
            found[connection.id] = Borders(
                _beside(middle, start.left[-1], end.left[0], 1.0),
                _beside(middle, start.right[-1], end.right[0], -1.0),
            )
    return _uncrossed(found)


def _beside(middle: Array, first: Array, last: Array, side: float) -> Array:
    """Return the line from `first` to `last` beside a path, its distance changing evenly."""
    ray = mitres(middle)
    s = arc_lengths(middle)
    share = (s / s[-1] if s[-1] > 1e-6 else np.linspace(0.0, 1.0, len(s)))[:, None]
    from_m, to_m = np.hypot(*(first - middle[0])), np.hypot(*(last - middle[-1]))
    line = middle + ray.normal * (side * ((1.0 - share) * from_m + share * to_m))
    line += (1.0 - share) * (first - line[0]) + share * (last - line[-1])
    line = np.round(untangled(line, ray.directions), 3)
    line[0], line[-1] = first, last
    return line


def _uncrossed(drawn: dict[str, Borders]) -> dict[str, Borders]:
    """Return the borders with the inner one drawn straight where it crosses the outer or itself."""
    if not drawn:
        return drawn
    crossed = crossing(drawn.values())
    for name in [name for name, bad in zip(drawn, crossed, strict=True) if bad]:
        left, right = drawn[name]
        straight = Borders(*(filled(line[[0, -1]], len(line)).round(3) for line in (left, right)))
        tries = [Borders(straight.left, right), Borders(left, straight.right)]
        if length(left) > length(right):
            tries.reverse()
        tries.append(straight)
        clean = (pair for pair, bad in zip(tries, crossing(tries), strict=True) if not bad)
        drawn[name] = next(clean, straight)
    return drawn


def crossing(drawn: Iterable[Borders]) -> list[bool]:
    """Return for each pair of borders whether they meet, or the ground between crosses itself.

    Borders that begin and end in one point, as those of U-turns, may touch there.
    """
    pairs = list(drawn)
    left = np.array([shapely.LineString(p.left) for p in pairs])
    right = np.array([shapely.LineString(p.right) for p in pairs])
    ground = np.array([shapely.Polygon(np.concatenate([p.right, p.left[::-1]])) for p in pairs])
    closed = np.array(
        [any(np.array_equal(line[0], line[-1]) for line in pair) for pair in pairs], dtype=bool
    )
    bad = shapely.intersects(left, right) | ~shapely.is_simple(left) | ~shapely.is_simple(right)
    return [bool(b) for b in bad | (~closed & ~shapely.is_valid(ground))]
