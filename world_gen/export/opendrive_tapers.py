"""Short roads between two roads whose lanes go on one by one, but bend, widen or move aside."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence

from foretwin.contracts.world import Connection, DrivingSide, Lane
from foretwin.world_gen.export.opendrive_cubics import Cubic, Rise
from foretwin.world_gen.export.opendrive_curve import curve_between
from foretwin.world_gen.export.opendrive_roads import End, OdrLane, OdrRoad, Pose, inward


def taper(
    place: str,
    number: int,
    ends: Sequence[End],
    connections: Sequence[Connection],
    lanes: Mapping[str, Lane],
    side: DrivingSide,
) -> OdrRoad | None:
    """Return a road between two roads whose lanes go on one by one, else None."""
    if len(ends) != 2 or any(c.junction_id for c in connections) or not connections:
        return None
    a, b = ends
    across: dict[str, str] = {}
    for c in connections:
        one, other = lanes[c.from_lane_id], lanes[c.to_lane_id]
        if one.id in b.road.numbers and one.id not in a.road.numbers:
            one, other = other, one
        if one.id in across or one.id not in a.road.numbers or other.id not in b.road.numbers:
            return None
        across[one.id] = other.id
    first, second = _section(a, facing=True), _section(b, facing=False)
    if first is None or second is None or a.road is b.road:
        return None
    first, second = _driven_on(first, across.keys()), _driven_on(second, across.values())
    if [across.get(lane.id) for lane, _, _ in first] != [lane.id for lane, _, _ in second]:
        return None
    along = [lane.reverse != a.at_end for lane, _, _ in first]
    if along != sorted(along, reverse=side == "left"):
        return None
    begin, finish = _pose(a), _pose(b)
    span = finish.point - begin.point
    if math.hypot(*span) < 0.5 or float(begin.heading @ -finish.heading) < -0.2:
        return None
    curve = curve_between(begin.point, begin.heading, finish.point, -finish.heading)
    left = sum(flag != (side == "right") for flag in along)
    road = OdrRoad(
        id=number,
        name=a.road.name,
        source=place,
        curve=curve,
        offset=Cubic.between(_lane_zero(first, left), _lane_zero(second, left), curve.length_m),
        lanes=[
            OdrLane(
                number=left - i if i < left else left - i - 1,
                width=Cubic.between(l0 - r0, l1 - r1, curve.length_m),
                lane=lane,
            )
            for i, ((lane, l0, r0), (_, l1, r1)) in enumerate(zip(first, second, strict=True))
        ],
        road_class=a.road.road_class,
        height=Rise.joining(a.height_m, a.grade_out, b.height_m, -b.grade_out, curve.length_m),
    )
    for (lane, _, _), (other, _, _), mine in zip(first, second, road.lanes, strict=True):
        mine.predecessor, mine.successor = a.road.numbers[lane.id], b.road.numbers[other.id]
        a.link_lane(mine.predecessor, mine.number)
        b.link_lane(mine.successor, mine.number)
    for end, own in ((a, End(road, False)), (b, End(road, True))):
        own.link("road", end.road.id, at_end=end.at_end)
        end.link("road", road.id, at_end=own.at_end)
    return road


Section = list[tuple[Lane, float, float]]
"""Lanes from left to right with their left and right edges, in metres to the left."""


def _driven_on(section: Section, through: Collection[str]) -> Section:
    """Return a section without lanes at its edges that end here, such as those for parking."""
    inner = [i for i, (lane, _, _) in enumerate(section) if lane.id in through]
    return section[inner[0] : inner[-1] + 1] if inner else section


def _section(end: End, *, facing: bool) -> Section | None:
    """Return the lanes of a road's end, seen along (`facing`: away from) the road beyond it.

    None where there is more than lanes side by side.
    """
    flip = -1.0 if end.at_end != facing else 1.0
    found: Section = []
    for item in end.road.lanes:
        if item.sidewalk:
            continue
        if item.lane is None or item.reversed:
            return None
        edges = [flip * end.edge_m(n) for n in (item.number, inward(item.number))]
        found.append((item.lane, max(edges), min(edges)))
    return sorted(found, key=lambda row: -row[1])


def _lane_zero(section: Section, left: int) -> float:
    """Return how far to the left lane 0 lies, to the right of so many lanes."""
    return section[left - 1][2] if left else section[0][1]


def _pose(end: End) -> Pose:
    """Return the end of a road's reference line, looking out of the road."""
    point, direction = end.road.curve.end(at_end=end.at_end)
    return Pose(point, direction if end.at_end else -direction)
