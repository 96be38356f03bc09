"""Short roads between two roads whose lanes go on one by one, but bend, widen or move aside."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence

from foretwin.contracts.world import Connection, DrivingSide, Lane
from foretwin.world_gen.export.opendrive_curve import Curve, curve_between
from foretwin.world_gen.export.opendrive_roads import Cubic, End, OdrLane, OdrRoad, Pose


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
    road = _road(place, number, curve, (first, second), along, side)
    for (lane, _, _), (other, _, _), mine in zip(first, second, road.lanes, strict=True):
        mine.predecessor, mine.successor = a.road.numbers[lane.id], b.road.numbers[other.id]
        _set_next(a, mine.predecessor, mine.number)
        _set_next(b, mine.successor, mine.number)
    road.link(at_end=False, to=("road", a.road.id, a.at_end))
    road.link(at_end=True, to=("road", b.road.id, b.at_end))
    a.road.link(at_end=a.at_end, to=("road", road.id, False))
    b.road.link(at_end=b.at_end, to=("road", road.id, True))
    road.name, road.road_class = a.road.name, a.road.road_class
    road.height = Cubic(a.road.height.at(a.road.curve.length_m if a.at_end else 0.0))
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
        inner = item.number - (1 if item.number > 0 else -1)
        edges = [flip * end.road.edge_m(n, at_end=end.at_end) for n in (item.number, inner)]
        found.append((item.lane, max(edges), min(edges)))
    return sorted(found, key=lambda row: -row[1])


def _road(
    place: str,
    number: int,
    curve: Curve,
    sections: tuple[Section, Section],
    along: Sequence[bool],
    side: DrivingSide,
) -> OdrRoad:
    first, second = sections
    left = sum(flag != (side == "right") for flag in along)
    zero = [section[left - 1][2] if left else section[0][1] for section in (first, second)]
    lanes = []
    for i, ((lane, l0, r0), (_, l1, r1)) in enumerate(zip(first, second, strict=True)):
        lanes.append(
            OdrLane(
                number=left - i if i < left else left - i - 1,
                width=Cubic.between(l0 - r0, l1 - r1, curve.length_m),
                lane=lane,
            )
        )
    return OdrRoad(
        id=number,
        name="",
        source=place,
        curve=curve,
        offset=Cubic.between(zero[0], zero[1], curve.length_m),
        lanes=lanes,
        road_class="",
        height=Cubic(0.0),
    )


def _pose(end: End) -> Pose:
    """Return the end of a road's reference line, looking out of the road."""
    point, direction = end.road.curve.end(at_end=end.at_end)
    return Pose(point, direction if end.at_end else -direction)


def _set_next(end: End, number: int, following: int) -> None:
    lane = end.road.lane_numbered(number)
    if end.at_end:
        lane.successor = following
    else:
        lane.predecessor = following
